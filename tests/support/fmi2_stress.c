/* What no importer should do, to the sources of a native FMU: this program includes them.
 *
 *     abuse flips | forged | calls SEED TURNS | names | failures
 *
 * It ends by abort() where an answer is not the right one, and a sanitizer ends it where memory is.
 */
#include "fmi2.c"

#include "stress.h"

enum { FEW = 12, BYTES = sizeof(SavedState) };

static int heard;

static void hear(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                 fmi2String message, ...)
{
    (void)environment, (void)status, (void)category;
    heard++;
    if (getenv("ALOUD")) printf("%s|%s\n", instance, message);
}

static const fmi2CallbackFunctions callbacks = {hear, calloc, free, NULL, NULL};

/* ---- lives */

static Instance *instance(const char *name)
{
    Instance *it = fmi2Instantiate(name, fmi2CoSimulation, MODEL_GUID, "", &callbacks, fmi2False, fmi2True);
    HOLDS(it);
    return it;
}

static void initialise(Instance *it, fmi2Status expected)
{
    HOLDS(fmi2SetupExperiment(it, fmi2False, 0.0, 0.0, fmi2True, 4.0) == fmi2OK);
    HOLDS(fmi2EnterInitializationMode(it) == fmi2OK);
    HOLDS(fmi2ExitInitializationMode(it) == expected);
}

static void set(Instance *it, const char *name, double value)
{
    fmi2ValueReference reference = reference_of(name);
    HOLDS(fmi2SetReal(it, &reference, 1, &value) == fmi2OK);
}

static double get(Instance *it, fmi2ValueReference reference)
{
    fmi2Integer integer = 0;
    double real = 0.0;
    if (variables[reference].is_real) HOLDS(fmi2GetReal(it, &reference, 1, &real) == fmi2OK);
    if (!variables[reference].is_real) HOLDS(fmi2GetInteger(it, &reference, 1, &integer) == fmi2OK);
    return variables[reference].is_real ? real : integer;
}

/* Lives in every phase: fresh, set up, initialising, running, ahead of itself, with a value pending, with a refused
 * one, failed, terminated. */
static Instance *life(int number_of_life)
{
    Instance *it = instance("life");
    fmi2ValueReference ahead = T_NEXT;
    double t_next;
    if (number_of_life == 0) return it;
    set(it, "m", number_of_life == 7 ? -1.0 : 1.5);
    if (number_of_life == 1) return it;
    if (number_of_life == 2) {
        HOLDS(fmi2EnterInitializationMode(it) == fmi2OK);
        return it;
    }
    initialise(it, number_of_life == 7 ? fmi2Error : fmi2OK);
    if (number_of_life == 7) return it;
    for (int i = 0; i < 3; i++) HOLDS(fmi2DoStep(it, 0.3 * i, 0.3, fmi2True) == fmi2OK);
    if (number_of_life == 4) HOLDS(fmi2GetReal(it, &ahead, 1, &t_next) == fmi2OK);
    if (number_of_life == 5) set(it, "m", 2.0);
    if (number_of_life == 6) set(it, "m", -1.0);
    if (number_of_life == 8) HOLDS(fmi2Terminate(it) == fmi2OK);
    return it;
}

enum { LIVES = 9 };

/* For model exchange: fresh, initialised, in continuous time, elsewhere, at an event. */
static Instance *exchanging(int far)
{
    Instance *it = fmi2Instantiate("exchange", fmi2ModelExchange, MODEL_GUID, "", &callbacks, fmi2False, fmi2True);
    fmi2EventInfo event;
    double states[STATES];
    HOLDS(it);
    if (far > 0) initialise(it, fmi2OK);
    if (far > 1) HOLDS(fmi2NewDiscreteStates(it, &event) == fmi2OK && fmi2EnterContinuousTimeMode(it) == fmi2OK);
    for (int i = 0; i < STATES; i++) states[i] = number();
    if (far > 2) HOLDS(fmi2SetTime(it, number()) == fmi2OK && fmi2SetContinuousStates(it, states, STATES) == fmi2OK);
    if (far > 3) HOLDS(fmi2EnterEventMode(it) == fmi2OK);
    return it;
}

static void bytes_of(Instance *it, char bytes[BYTES])
{
    fmi2FMUstate state = NULL;
    size_t size = 0;
    HOLDS(fmi2GetFMUstate(it, &state) == fmi2OK);
    HOLDS(fmi2SerializedFMUstateSize(it, state, &size) == fmi2OK && size == BYTES);
    HOLDS(fmi2SerializeFMUstate(it, state, bytes, BYTES) == fmi2OK);
    HOLDS(fmi2FreeFMUstate(it, &state) == fmi2OK && !state);
}

/* ---- flips: every bit, and cuts, additions and exchanges; none is taken, and nobody changes */

static void refuses(Instance *it, const char *bytes, size_t size)
{
    fmi2FMUstate state = NULL;
    char *copy = malloc(size + 1); /* of its own, so that reading beyond it is seen */
    copy = realloc(copy, size ? size : 1);
    memcpy(copy, bytes, size);
    HOLDS(fmi2DeSerializeFMUstate(it, copy, size, &state) == fmi2Error && !state);
    free(copy);
}

static void flips(void)
{
    static char bytes[BYTES], again[BYTES], longer[BYTES + 64];
    size_t tried = 0;
    for (size_t bit = 0; bit < 8 * BYTES; bit++) { /* each in one of the lives */
        static Instance *it;
        if (bit % (8 * BYTES / LIVES + 1) == 0) {
            if (it) fmi2FreeInstance(it);
            it = life((int)(bit / (8 * BYTES / LIVES + 1)));
            bytes_of(it, bytes);
        }
        bytes[bit / 8] ^= (char)(1 << bit % 8);
        refuses(it, bytes, BYTES);
        bytes[bit / 8] ^= (char)(1 << bit % 8);
        tried++;
        if (bit + 1 == 8 * BYTES) fmi2FreeInstance(it);
    }
    for (int i = 0; i < LIVES; i++) {
        Instance *it = life(i), *other = life(3);
        fmi2FMUstate state = NULL;
        bytes_of(it, bytes);
        State before = it->state;
        memcpy(longer, bytes, BYTES);
        for (size_t size = 0; size < BYTES + 64; size += 1 + draw(60)) {
            if (size != BYTES) refuses(it, longer, size), tried++;
        }
        for (int turn = 0; turn < 600; turn++) {
            size_t a = draw(BYTES), b = draw(BYTES), size = draw(64);
            memcpy(again, bytes, BYTES);
            if (turn % 3 == 0) again[a] = bytes[b], again[b] = bytes[a];
            if (turn % 3 == 1) again[a] = (char)draw(256), again[b] = (char)draw(256);
            if (turn % 3 == 2) memset(again + a, (int)draw(2) * 255, a + size < BYTES ? size : BYTES - a);
            if (memcmp(again, bytes, BYTES)) refuses(it, again, BYTES), tried++;
        }
        HOLDS(!memcmp(&before, &it->state, sizeof before)); /* as it was */
        HOLDS(fmi2DeSerializeFMUstate(other, bytes, BYTES, &state) == fmi2OK); /* and the good one is taken */
        HOLDS(fmi2SetFMUstate(other, state) == fmi2OK);
        bytes_of(other, again);
        HOLDS(!memcmp(bytes, again, BYTES));
        ((char *)state)[draw(BYTES)] ^= 4; /* in memory too */
        HOLDS(fmi2SetFMUstate(other, state) == fmi2Error);
        bytes_of(other, again);
        HOLDS(!memcmp(bytes, again, BYTES));
        free(state);
        fmi2FreeInstance(it), fmi2FreeInstance(other);
    }
    printf("%zu\n", tried);
}

/* ---- forged: a checksum that is right over what cannot be */

static void refuses_forged(Instance *it, const State *forged, bool good)
{
    SavedState sealed;
    State before = it->state;
    write_saved_state(&sealed, forged);
    HOLDS(fmi2SetFMUstate(it, &sealed) == (good ? fmi2OK : fmi2Error));
    if (!good) HOLDS(!memcmp(&before, &it->state, sizeof before));
    strcpy(sealed.guid, "{of another}");
    sealed.checksum = payload_checksum(&sealed);
    HOLDS(fmi2SetFMUstate(it, &sealed) == fmi2Error);
}

/* One more refused value. */
static void refuse_in(State *state, fmi2ValueReference reference, int64_t reason, double value)
{
    state->rejected[reference] = (RejectedValue){reason, value, ++state->rejection_count};
    state->run.n_invalid_values++;
}

#define FORGED(change)                     \
    do {                                   \
        State state = good;                \
        change;                            \
        refuses_forged(it, &state, false); \
    } while (0)

static void forged(void)
{
    static const double beyond[] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < LIVES; i++) {
        Instance *it = life(i);
        State good = it->state;
        good.run.outputs_current = false; /* as it is saved */
        refuses_forged(it, &good, true);
        FORGED(state.run.phase = CONTINUOUS);
        FORGED(state.run.phase = INTERMEDIATE);
        FORGED(state.run.phase = -1);
        FORGED(state.run.interface = 0);
        FORGED(state.run.interface = MODEL_EXCHANGE);
        FORGED(state.run.n_invalid_values++);
        FORGED(state.run.n_invalid_values = -1);
        FORGED(state.run.outputs_current = true);
        FORGED(state.run.tolerance = NAN);
        FORGED(state.rejection_count = -1);
        FORGED(refuse_in(&state, 1, 99, 1.0));
        FORGED(refuse_in(&state, 1, FIXED, 1.0); state.rejection_count--);
        FORGED(refuse_in(&state, reference_of("solver.method"), OUT_OF_RANGE, 1e300));
        for (const Member *member = members; member < members + MEMBERS; member++) {
            FORGED(memset((char *)&state + member->offset, 0x7f, member->is_bool ? 1 : 8));
            FORGED(memset((char *)&state + member->offset, 0x80, member->is_bool ? 1 : 8));
        }
        for (const Variable *variable = variables; variable < variables + VARIABLES; variable++) {
            if (!variable->is_real) FORGED(*(int64_t *)variable_address(&state.model, variable) = -7);
            if (!variable->is_real || variable->is_calculated) continue;
            for (int k = 0; k < 3; k++) FORGED(*(double *)variable_address(&state.model, variable) = beyond[k]);
        }
        if (i >= 3 && i != 7) {
            FORGED(state.model.solver.t = 1e9);
#ifdef DRY
            FORGED(state.model.solver.step.mode0 = 5);
#endif
            FORGED(state.model.solver.step.active_method.method_number++);
        }
        fmi2FreeInstance(it);
    }
}

/* Numbers of any size where numbers are, and a seal that is right: taken or not, everything ends and nothing breaks. */
static void fuzzed(int turns)
{
    for (int turn = 0; turn < turns; turn++) {
        Instance *it = life((int)draw(LIVES));
        State state = it->state;
        SavedState sealed;
        double *at = (double *)&state.model;
        for (uint64_t k = draw(4) + 1; k; k--) at[draw(sizeof state.model / sizeof *at)] = number();
        write_saved_state(&sealed, &state);
        if (fmi2SetFMUstate(it, &sealed) == fmi2OK) {
            for (fmi2ValueReference i = 0; i < VARIABLES; i++) get(it, i);
            fmi2DoStep(it, 0.9, 0.01, fmi2True);
            for (fmi2ValueReference i = 0; i < VARIABLES; i++) get(it, i);
        }
        fmi2FreeInstance(it);
    }
}

/* ---- calls in any order, with anything in them */

static void settings(fmi2ValueReference references[FEW], double reals[FEW], fmi2Integer integers[FEW], size_t count)
{
    for (size_t i = 0; i < count; i++) {
        references[i] = (fmi2ValueReference)(draw(40) ? draw(VARIABLES) : draw(UINT64_C(1) << 32));
        reals[i] = draw(3) ? number() : (double)draw(1000) / 100.0;
        integers[i] = (fmi2Integer)(draw(9) ? draw(6) : draw(UINT64_C(1) << 32));
    }
}

/* Values that were asked for and refused are as they were. */
static void reading(Instance *it, const fmi2ValueReference *references, size_t count, uint64_t kind)
{
    double reals[FEW];
    fmi2Integer integers[FEW];
    fmi2String strings[FEW];
    fmi2Status status;
    for (int i = 0; i < FEW; i++) reals[i] = 77.0, integers[i] = 77, strings[i] = "untouched";
    status = kind == 0   ? fmi2GetReal(it, references, count, draw(50) ? reals : NULL)
             : kind == 1 ? fmi2GetInteger(it, references, count, draw(50) ? integers : NULL)
             : kind == 2 ? fmi2GetBoolean(it, references, count, integers)
                         : fmi2GetString(it, references, count, strings);
    HOLDS(status == fmi2OK || status == fmi2Error);
    for (int i = 0; i < FEW && status; i++) {
        HOLDS(reals[i] == 77.0 && integers[i] == 77 && !strcmp(strings[i], "untouched"));
    }
}

/* Into a block of just the size, so that writing beyond it is seen. */
static fmi2Status serialised(Instance *it, fmi2FMUstate state, char bytes[BYTES], size_t size)
{
    char *block = malloc(size ? size : 1);
    fmi2Status status = fmi2SerializeFMUstate(it, state, block, size);
    if (status == fmi2OK) memcpy(bytes, block, BYTES);
    free(block);
    return status;
}

static void calls(uint64_t seed, int turns)
{
    enum { CROWD = 20 };
    static Instance *crowd[CROWD];
    static fmi2FMUstate states[CROWD];
    static char bytes[CROWD][BYTES];
    Instance *quiet = life(3);
    static char before[BYTES], after[BYTES];
    fmi2ValueReference push = 0; /* the input */
    while (variables[push].rate_offset == NO_OFFSET) push++;
    bytes_of(quiet, before);
    chance = seed;
    for (int turn = 0; turn < turns; turn++) {
        int i = (int)draw(CROWD), k = (int)draw(CROWD);
        Instance *it = crowd[i]; /* which may not be there */
        fmi2ValueReference references[FEW];
        double reals[FEW], t = it ? it->state.model.solver.t : 0.0;
        fmi2Integer integers[FEW];
        fmi2String categories[] = {"logAll", NULL, "%s%n"};
        size_t count = draw(FEW), size;
        fmi2Status status = fmi2OK;
        settings(references, reals, integers, count);
        double *places = draw(20) ? reals : NULL, slopes[FEW];
        size_t rows = draw(9) ? STATES : draw(FEW), limits = draw(9) ? INDICATORS : draw(FEW);
        const fmi2Integer orders[2 * FEW] = {1, 1, 1, 1, 1, 1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0, 8, 2};
        int call = (int)draw(41);
        fmi2EventInfo event;
        fmi2Boolean flag;
        switch (call) {
        case 0:
            fmi2FreeInstance(it);
            crowd[i] = NULL;
            break;
        case 1:
        case 2:
        case 3:
            if (!it) crowd[i] = draw(2) ? life((int)draw(LIVES)) : exchanging((int)draw(5));
            break;
        case 4: status = fmi2SetDebugLogging(it, draw(2) > 0, draw(4), draw(5) ? categories : NULL); break;
        case 5: status = fmi2SetupExperiment(it, draw(2) > 0, number(), number(), draw(2) > 0, number()); break;
        case 6: status = fmi2EnterInitializationMode(it); break;
        case 7: status = fmi2ExitInitializationMode(it); break;
        case 8: status = draw(4) ? fmi2OK : fmi2Terminate(it); break;
        case 9: status = fmi2Reset(it); break;
        case 10:
        case 11: reading(it, draw(50) ? references : NULL, count, draw(4)); break;
        case 12:
            for (fmi2ValueReference r = 0; it && r < VARIABLES; r++) get(it, r);
            break;
        case 13: status = fmi2SetReal(it, draw(50) ? references : NULL, count, draw(50) ? reals : NULL); break;
        case 14: status = fmi2SetInteger(it, draw(50) ? references : NULL, count, draw(50) ? integers : NULL); break;
        case 15: status = fmi2SetBoolean(it, references, count, integers); break;
        case 16: status = fmi2SetString(it, references, count, NULL); break;
        case 17: status = fmi2DoStep(it, number(), number() * 1e-3, fmi2True); break;
        case 18:
        case 19: status = fmi2DoStep(it, t, (double)draw(100) * 1e-4, fmi2True); break;
        case 20: status = fmi2GetFMUstate(it, draw(50) ? &states[k] : NULL); break;
        case 21: status = fmi2SetFMUstate(it, states[k]); break;
        case 22: status = fmi2FreeFMUstate(it, draw(50) ? &states[k] : NULL); break;
        case 23: status = fmi2SerializedFMUstateSize(it, states[k], draw(50) ? &size : NULL); break;
        case 24: status = serialised(it, states[k], bytes[i], draw(9) ? BYTES : draw(BYTES)); break;
        case 25: status = fmi2EnterEventMode(it); break;
        case 26: status = fmi2NewDiscreteStates(it, draw(9) ? &event : NULL); break;
        case 27: status = fmi2EnterContinuousTimeMode(it); break;
        case 28: status = fmi2SetTime(it, number()); break;
        case 29:
        case 30: status = fmi2SetContinuousStates(it, places, rows); break;
        case 31: status = fmi2GetContinuousStates(it, places, rows); break;
        case 32: status = fmi2GetDerivatives(it, places, rows); break;
        case 33: status = fmi2GetEventIndicators(it, places, limits); break;
        case 34: status = fmi2GetNominalsOfContinuousStates(it, places, rows); break;
        case 35: status = fmi2CompletedIntegratorStep(it, fmi2True, draw(9) ? &flag : NULL, &flag); break;
        case 36:
            status = fmi2GetDirectionalDerivative(it, draw(9) ? references : NULL, count, references, draw(FEW), reals,
                                                  slopes);
            if (status == fmi2Discard) status = fmi2OK;
            break;
        case 37:
        case 38:
            references[0] = push;
            status = fmi2SetRealInputDerivatives(it, references, draw(9) ? 1 : count,
                                                 draw(50) ? orders + draw(FEW) : NULL, reals);
            break;
        case 39: status = fmi2GetRealOutputDerivatives(it, draw(9) ? references : NULL, count, orders, slopes); break;
        default: status = fmi2DeSerializeFMUstate(it, bytes[i], draw(9) ? BYTES : draw(BYTES), &states[k]); break;
        }
        HOLDS(status == fmi2OK || status == fmi2Error);
        if (it && 31 <= call && call <= 34 && !is_model_exchange(&it->state)) HOLDS(status == fmi2Error);
        if (it && 37 <= call && call <= 38 && is_model_exchange(&it->state)) HOLDS(status == fmi2Error);
    }
    for (int i = 0; i < CROWD; i++) {
        Instance *it = crowd[i] ? crowd[i] : instance("heir");
        HOLDS(fmi2Reset(it) == fmi2OK);
        initialise(it, fmi2OK);
        if (!is_model_exchange(&it->state)) HOLDS(fmi2DoStep(it, 0.0, 0.3, fmi2True) == fmi2OK);
        HOLDS(isfinite(get(it, reference_of("energy"))));
        if (states[i]) HOLDS(fmi2FreeFMUstate(it, &states[i]) == fmi2OK);
        fmi2FreeInstance(it);
    }
    bytes_of(quiet, after);
    HOLDS(!memcmp(before, after, BYTES));
    fmi2FreeInstance(quiet);
}

/* ---- names, and standard error */

static void names(void)
{
    static char longest[10001];
    memset(longest, '%', 10000);
    const char *all[] = {"", "100 %s %n", "na\xc3\xafve", "\xff\xfe", "cut \xe2\x82", "\xed\xa0\x80", "\xc0\xaf",
                         "\xf0\x9f\x8c\x8d", "\xf5\x80\x80\x80", longest, NULL};
    for (int i = 0; i < 11; i++) {
        Instance *it = instance(all[i]);
        fmi2DoStep(it, 0.0, 1.0, fmi2True);
        fmi2FreeInstance(it);
        HOLDS(!fmi2Instantiate(all[i], fmi2CoSimulation, "{of another}", "", &callbacks, fmi2False, fmi2True));
    }
}

static void failures(bool closes)
{
    Instance *it = life(6);
    if (closes) fclose(stderr);
    heard = 0;
    HOLDS(fmi2DoStep(it, 0.9, 0.1, fmi2True) == fmi2Error);
    HOLDS(isnan(get(it, reference_of("energy"))));
    HOLDS(fmi2Reset(it) == fmi2OK);
    initialise(it, fmi2OK);
    HOLDS(fmi2DoStep(it, 0.0, 0.0, fmi2True) == fmi2Error);
    HOLDS(heard == 2);
    fmi2FreeInstance(it);
}

int main(int argc, char **argv)
{
    const char *what = argc > 1 ? argv[1] : "";
    if (!strcmp(what, "flips")) flips();
    else if (!strcmp(what, "forged")) forged(), fuzzed(300);
    else if (!strcmp(what, "calls") && argc == 4) calls(strtoull(argv[2], NULL, 10), atoi(argv[3]));
    else if (!strcmp(what, "names")) names();
    else if (!strcmp(what, "failures")) failures(argc > 2);
    else die("usage", __LINE__);
    return 0;
}
