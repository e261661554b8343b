/* Invalid arguments and data for a native FMU. This program includes the sources of the FMU.
 *
 *     fmi2_stress flip_bits | forge_states | random_calls SEED TURNS | check_names | check_failures
 *
 * It aborts on an unexpected result; a sanitizer stops it on a memory error.
 */
#include "fmi2.c"

#include "stress.h"

enum { MAX_VALUES = 12, BYTES = sizeof(SavedState) };

static int n_messages;

static void on_log(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                 fmi2String message, ...)
{
    (void)environment, (void)status, (void)category;
    n_messages++;
    if (getenv("ALOUD")) printf("%s|%s\n", instance, message);
}

static const fmi2CallbackFunctions callbacks = {on_log, calloc, free, NULL, NULL};

/* ---- instances in all states */

static Instance *instance(const char *name)
{
    Instance *it = fmi2Instantiate(name, fmi2CoSimulation, MODEL_GUID, "", &callbacks, fmi2False, fmi2True);
    CHECK(it);
    return it;
}

static fmi2Status begin(Instance *it)
{
    CHECK(fmi2SetupExperiment(it, fmi2False, 0.0, 0.0, fmi2True, 4.0) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(it) == fmi2OK);
    return fmi2ExitInitializationMode(it);
}

static void initialise(Instance *it)
{
    CHECK(begin(it) == fmi2OK);
}

static fmi2ValueReference input_reference(void)
{
    fmi2ValueReference reference = 0;
    while (variables[reference].rate_offset == NO_OFFSET) reference++;
    return reference;
}

static fmi2Status set(Instance *it, const char *name, double value)
{
    fmi2ValueReference reference = reference_of(name);
    return fmi2SetReal(it, &reference, 1, &value);
}

static double get(Instance *it, fmi2ValueReference reference)
{
    fmi2Integer integer = 0;
    double real = 0.0;
    if (variables[reference].is_real) CHECK(fmi2GetReal(it, &reference, 1, &real) == fmi2OK);
    if (!variables[reference].is_real) CHECK(fmi2GetInteger(it, &reference, 1, &integer) == fmi2OK);
    return variables[reference].is_real ? real : integer;
}

/* States: new, set up, initialising, running, with a computed next step, with a pending value, after a refused one,
 * failed, terminated. */
static Instance *instance_in_state(int number)
{
    Instance *it = instance("instance_in_state");
    fmi2ValueReference ahead = T_NEXT;
    double t_next;
    if (number == 0) return it;
    CHECK(set(it, "m", number == 7 ? 1e-300 : 1.5) == fmi2OK);
    if (number == 1) return it;
    if (number == 2) {
        CHECK(fmi2EnterInitializationMode(it) == fmi2OK);
        return it;
    }
    if (number == 7) CHECK(set(it, variables[input_reference()].name, 1e308) == fmi2OK);
    if (number == 7 && begin(it) == fmi2OK) CHECK(fmi2DoStep(it, 0.0, 0.3, fmi2True) == fmi2Error);
    if (number == 7) return it;
    initialise(it);
    for (int i = 0; i < 3; i++) CHECK(fmi2DoStep(it, 0.3 * i, 0.3, fmi2True) == fmi2OK);
    if (number == 4) CHECK(fmi2GetReal(it, &ahead, 1, &t_next) == fmi2OK);
    if (number == 5) CHECK(set(it, "m", 2.0) == fmi2OK);
    if (number == 6) CHECK(set(it, "m", -1.0) == fmi2Error);
    if (number == 8) CHECK(fmi2Terminate(it) == fmi2OK);
    return it;
}

enum { N_STATES = 9 };

/* For model exchange: new, initialised, in continuous time, at another point, at an event. */
static Instance *exchange_instance(int progress)
{
    Instance *it = fmi2Instantiate("exchange", fmi2ModelExchange, MODEL_GUID, "", &callbacks, fmi2False, fmi2True);
    fmi2EventInfo event;
    double states[STATES];
    CHECK(it);
    if (progress > 0) initialise(it);
    if (progress > 1) CHECK(fmi2NewDiscreteStates(it, &event) == fmi2OK && fmi2EnterContinuousTimeMode(it) == fmi2OK);
    for (int i = 0; i < STATES; i++) states[i] = number();
    if (progress > 2) CHECK(fmi2SetTime(it, number()) == fmi2OK && fmi2SetContinuousStates(it, states, STATES) == fmi2OK);
    if (progress > 3) CHECK(fmi2EnterEventMode(it) == fmi2OK);
    return it;
}

static void bytes_of(Instance *it, char bytes[BYTES])
{
    fmi2FMUstate state = NULL;
    size_t size = 0;
    CHECK(fmi2GetFMUstate(it, &state) == fmi2OK);
    CHECK(fmi2SerializedFMUstateSize(it, state, &size) == fmi2OK && size == BYTES);
    CHECK(fmi2SerializeFMUstate(it, state, bytes, BYTES) == fmi2OK);
    CHECK(fmi2FreeFMUstate(it, &state) == fmi2OK && !state);
}

/* ---- flip_bits: every bit flipped, truncated, extended, exchanged; each is refused, and no instance changes */

static void assert_refused(Instance *it, const char *bytes, size_t size)
{
    fmi2FMUstate state = NULL;
    char *copy = malloc(size + 1); /* separate, so that an access beyond it is detected */
    copy = realloc(copy, size ? size : 1);
    memcpy(copy, bytes, size);
    CHECK(fmi2DeSerializeFMUstate(it, copy, size, &state) == fmi2Error && !state);
    free(copy);
}

static void flip_bits(void)
{
    static char bytes[BYTES], again[BYTES], longer[BYTES + 64];
    size_t n_tried = 0;
    for (size_t bit = 0; bit < 8 * BYTES; bit++) { /* each in one of the states */
        static Instance *it;
        if (bit % (8 * BYTES / N_STATES + 1) == 0) {
            if (it) fmi2FreeInstance(it);
            it = instance_in_state((int)(bit / (8 * BYTES / N_STATES + 1)));
            bytes_of(it, bytes);
        }
        bytes[bit / 8] ^= (char)(1 << bit % 8);
        assert_refused(it, bytes, BYTES);
        bytes[bit / 8] ^= (char)(1 << bit % 8);
        n_tried++;
        if (bit + 1 == 8 * BYTES) fmi2FreeInstance(it);
    }
    for (int i = 0; i < N_STATES; i++) {
        Instance *it = instance_in_state(i), *other = instance_in_state(3);
        fmi2FMUstate state = NULL;
        bytes_of(it, bytes);
        State before = it->state;
        memcpy(longer, bytes, BYTES);
        for (size_t size = 0; size < BYTES + 64; size += 1 + draw(60)) {
            if (size != BYTES) assert_refused(it, longer, size), n_tried++;
        }
        for (int i_turn = 0; i_turn < 600; i_turn++) {
            size_t a = draw(BYTES), b = draw(BYTES), size = draw(64);
            memcpy(again, bytes, BYTES);
            if (i_turn % 3 == 0) again[a] = bytes[b], again[b] = bytes[a];
            if (i_turn % 3 == 1) again[a] = (char)draw(256), again[b] = (char)draw(256);
            if (i_turn % 3 == 2) memset(again + a, (int)draw(2) * 255, a + size < BYTES ? size : BYTES - a);
            if (memcmp(again, bytes, BYTES)) assert_refused(it, again, BYTES), n_tried++;
        }
        CHECK(!memcmp(&before, &it->state, sizeof before)); /* unchanged */
        CHECK(fmi2DeSerializeFMUstate(other, bytes, BYTES, &state) == fmi2OK); /* and the valid one is accepted */
        CHECK(fmi2SetFMUstate(other, state) == fmi2OK);
        bytes_of(other, again);
        CHECK(!memcmp(bytes, again, BYTES));
        ((char *)state)[draw(BYTES)] ^= 4; /* in memory too */
        CHECK(fmi2SetFMUstate(other, state) == fmi2Error);
        bytes_of(other, again);
        CHECK(!memcmp(bytes, again, BYTES));
        free(state);
        fmi2FreeInstance(it), fmi2FreeInstance(other);
    }
    printf("%zu\n", n_tried);
}

/* ---- forge_states: a valid checksum over an impossible state */

static void check_forged(Instance *it, const State *forged, bool good)
{
    SavedState sealed;
    State before = it->state;
    write_saved_state(&sealed, forged);
    CHECK(fmi2SetFMUstate(it, &sealed) == (good ? fmi2OK : fmi2Error));
    if (!good) CHECK(!memcmp(&before, &it->state, sizeof before));
    strcpy(sealed.guid, "{of another}");
    sealed.checksum = payload_checksum(&sealed);
    CHECK(fmi2SetFMUstate(it, &sealed) == fmi2Error);
}

#define FORGED(change)                     \
    do {                                   \
        State state = good;                \
        change;                            \
        check_forged(it, &state, false); \
    } while (0)

static void forge_states(void)
{
    for (int i = 0; i < N_STATES; i++) {
        Instance *it = instance_in_state(i);
        State good = it->state;
        good.run.outputs_current = false; /* as it is saved */
        check_forged(it, &good, true);
        FORGED(state.run.phase = INTERMEDIATE);
        FORGED(state.run.phase = -1);
        FORGED(state.run.interface = MODEL_EXCHANGE);
        for (const Member *member = members; member < members + MEMBERS; member++) {
            FORGED(memset((char *)&state + member->offset, 0x7f, member->is_bool ? 1 : 8));
            FORGED(memset((char *)&state + member->offset, 0x80, member->is_bool ? 1 : 8));
        }
        fmi2FreeInstance(it);
    }
}

/* Random numbers in place of numbers, with a valid checksum: accepted or not, every call returns. */
static void fuzz_states(int turns)
{
    for (int i_turn = 0; i_turn < turns; i_turn++) {
        Instance *it = instance_in_state((int)draw(N_STATES));
        State state = it->state;
        SavedState sealed;
        bool in_solver = draw(2);
        double *at = in_solver ? (double *)&state.run.solver : (double *)&state.model;
        size_t size = in_solver ? sizeof state.run.solver : sizeof state.model;
        for (uint64_t k = draw(4) + 1; k; k--) at[draw(size / sizeof *at)] = number();
        write_saved_state(&sealed, &state);
        if (fmi2SetFMUstate(it, &sealed) == fmi2OK) {
            for (fmi2ValueReference i = 0; i < VARIABLES; i++) get(it, i);
            fmi2DoStep(it, 0.9, 0.01, fmi2True);
            for (fmi2ValueReference i = 0; i < VARIABLES; i++) get(it, i);
        }
        fmi2FreeInstance(it);
    }
}

/* ---- random sequences of functions, with random arguments */

static void random_values(fmi2ValueReference references[MAX_VALUES], double reals[MAX_VALUES], fmi2Integer integers[MAX_VALUES], size_t count)
{
    for (size_t i = 0; i < count; i++) {
        references[i] = (fmi2ValueReference)(draw(40) ? draw(VARIABLES) : draw(UINT64_C(1) << 32));
        reals[i] = draw(3) ? number() : (double)draw(1000) / 100.0;
        integers[i] = (fmi2Integer)(draw(9) ? draw(6) : draw(UINT64_C(1) << 32));
    }
}

/* A refused read leaves its output arguments unchanged. */
static void check_read(Instance *it, const fmi2ValueReference *references, size_t count, uint64_t kind)
{
    double reals[MAX_VALUES];
    fmi2Integer integers[MAX_VALUES];
    fmi2String strings[MAX_VALUES];
    fmi2Status status;
    for (int i = 0; i < MAX_VALUES; i++) reals[i] = 77.0, integers[i] = 77, strings[i] = "untouched";
    status = kind == 0   ? fmi2GetReal(it, references, count, draw(50) ? reals : NULL)
             : kind == 1 ? fmi2GetInteger(it, references, count, draw(50) ? integers : NULL)
             : kind == 2 ? fmi2GetBoolean(it, references, count, integers)
                         : fmi2GetString(it, references, count, strings);
    CHECK(status == fmi2OK || status == fmi2Error);
    for (int i = 0; i < MAX_VALUES && status; i++) {
        CHECK(reals[i] == 77.0 && integers[i] == 77 && !strcmp(strings[i], "untouched"));
    }
}

/* Into a block of exact size, so that writing beyond it is detected. */
static fmi2Status serialize_exactly(Instance *it, fmi2FMUstate state, char bytes[BYTES], size_t size)
{
    char *block = malloc(size ? size : 1);
    fmi2Status status = fmi2SerializeFMUstate(it, state, block, size);
    if (status == fmi2OK) memcpy(bytes, block, BYTES);
    free(block);
    return status;
}

static void random_calls(uint64_t seed, int turns)
{
    enum { N_INSTANCES = 20 };
    static Instance *instances[N_INSTANCES];
    static fmi2FMUstate states[N_INSTANCES];
    static char bytes[N_INSTANCES][BYTES];
    Instance *bystander = instance_in_state(3);
    static char before[BYTES], after[BYTES];
    fmi2ValueReference push = input_reference();
    bytes_of(bystander, before);
    random_state = seed;
    for (int i_turn = 0; i_turn < turns; i_turn++) {
        int i = (int)draw(N_INSTANCES), k = (int)draw(N_INSTANCES);
        Instance *it = instances[i]; /* may be NULL */
        fmi2ValueReference references[MAX_VALUES];
        double reals[MAX_VALUES], t = it ? it->state.run.solver.t : 0.0;
        fmi2Integer integers[MAX_VALUES];
        fmi2String categories[] = {"logAll", NULL, "%s%n"};
        size_t count = draw(MAX_VALUES), size;
        fmi2Status status = fmi2OK;
        random_values(references, reals, integers, count);
        double *values = draw(20) ? reals : NULL, slopes[MAX_VALUES];
        size_t rows = draw(9) ? STATES : draw(MAX_VALUES), limits = draw(9) ? INDICATORS : draw(MAX_VALUES);
        const fmi2Integer orders[2 * MAX_VALUES] = {1, 1, 1, 1, 1, 1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0, 8, 2};
        int call = (int)draw(41), phase = it ? (int)it->state.run.phase : 0;
        bool had_failed = it && it->state.run.has_failed;
        fmi2EventInfo event;
        fmi2Boolean flag;
        switch (call) {
        case 0:
            fmi2FreeInstance(it);
            instances[i] = NULL;
            break;
        case 1:
        case 2:
        case 3:
            if (!it) instances[i] = draw(2) ? instance_in_state((int)draw(N_STATES)) : exchange_instance((int)draw(5));
            break;
        case 4: status = fmi2SetDebugLogging(it, draw(2) > 0, draw(4), draw(5) ? categories : NULL); break;
        case 5: status = fmi2SetupExperiment(it, draw(2) > 0, number(), number(), draw(2) > 0, number()); break;
        case 6: status = fmi2EnterInitializationMode(it); break;
        case 7: status = fmi2ExitInitializationMode(it); break;
        case 8: status = draw(4) ? fmi2OK : fmi2Terminate(it); break;
        case 9: status = fmi2Reset(it); break;
        case 10:
        case 11: check_read(it, draw(50) ? references : NULL, count, draw(4)); break;
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
        case 24: status = serialize_exactly(it, states[k], bytes[i], draw(9) ? BYTES : draw(BYTES)); break;
        case 25: status = fmi2EnterEventMode(it); break;
        case 26: status = fmi2NewDiscreteStates(it, draw(9) ? &event : NULL); break;
        case 27: status = fmi2EnterContinuousTimeMode(it); break;
        case 28: status = fmi2SetTime(it, number()); break;
        case 29:
        case 30: status = fmi2SetContinuousStates(it, values, rows); break;
        case 31: status = fmi2GetContinuousStates(it, values, rows); break;
        case 32: status = fmi2GetDerivatives(it, values, rows); break;
        case 33: status = fmi2GetEventIndicators(it, values, limits); break;
        case 34: status = fmi2GetNominalsOfContinuousStates(it, values, rows); break;
        case 35: status = fmi2CompletedIntegratorStep(it, fmi2True, draw(9) ? &flag : NULL, &flag); break;
        case 36:
            status = fmi2GetDirectionalDerivative(it, draw(9) ? references : NULL, count, references, draw(MAX_VALUES), reals,
                                                  slopes);
            if (status == fmi2Discard) status = fmi2OK;
            break;
        case 37:
        case 38:
            references[0] = push;
            status = fmi2SetRealInputDerivatives(it, references, draw(9) ? 1 : count,
                                                 draw(50) ? orders + draw(MAX_VALUES) : NULL, reals);
            break;
        case 39: status = fmi2GetRealOutputDerivatives(it, draw(9) ? references : NULL, count, orders, slopes); break;
        default: status = fmi2DeSerializeFMUstate(it, bytes[i], draw(9) ? BYTES : draw(BYTES), &states[k]); break;
        }
        CHECK(status == fmi2OK || status == fmi2Error);
        if (it && status && it->state.run.has_failed == had_failed) { /* refused */
            CHECK(phase == it->state.run.phase && (t == it->state.run.solver.t || isnan(t)));
        }
        if (it && 31 <= call && call <= 34 && !is_model_exchange(&it->state)) CHECK(status == fmi2Error);
        if (it && 37 <= call && call <= 38 && is_model_exchange(&it->state)) CHECK(status == fmi2Error);
    }
    for (int i = 0; i < N_INSTANCES; i++) {
        Instance *it = instances[i] ? instances[i] : instance("successor");
        CHECK(fmi2Reset(it) == fmi2OK);
        initialise(it);
        if (!is_model_exchange(&it->state)) CHECK(fmi2DoStep(it, 0.0, 0.3, fmi2True) == fmi2OK);
        CHECK(isfinite(get(it, reference_of("energy"))));
        if (states[i]) CHECK(fmi2FreeFMUstate(it, &states[i]) == fmi2OK);
        fmi2FreeInstance(it);
    }
    bytes_of(bystander, after);
    CHECK(!memcmp(before, after, BYTES));
    fmi2FreeInstance(bystander);
}

/* ---- check_names, and standard error */

static void check_names(void)
{
    static char longest[10001];
    memset(longest, '%', 10000);
    const char *all[] = {"", "100 %s %n", "na\xc3\xafve", "\xff\xfe", "cut \xe2\x82", "\xed\xa0\x80", "\xc0\xaf",
                         "\xf0\x9f\x8c\x8d", "\xf5\x80\x80\x80", longest, NULL};
    for (int i = 0; i < 11; i++) {
        Instance *it = instance(all[i]);
        fmi2DoStep(it, 0.0, 1.0, fmi2True);
        fmi2FreeInstance(it);
        CHECK(!fmi2Instantiate(all[i], fmi2CoSimulation, "{of another}", "", &callbacks, fmi2False, fmi2True));
    }
}

static void check_failures(bool closes)
{
    Instance *it = instance_in_state(3);
    if (closes) fclose(stderr);
    n_messages = 0;
    CHECK(set(it, "m", 1e-300) == fmi2OK && set(it, variables[input_reference()].name, 1e308) == fmi2OK);
    CHECK(fmi2DoStep(it, 0.9, 0.1, fmi2True) == fmi2Error);
    CHECK(isnan(get(it, reference_of("energy"))));
    CHECK(fmi2Reset(it) == fmi2OK);
    initialise(it);
    CHECK(fmi2DoStep(it, 0.0, 0.0, fmi2True) == fmi2Error);
    CHECK(n_messages == 2);
    fmi2FreeInstance(it);
}

int main(int argc, char **argv)
{
    const char *what = argc > 1 ? argv[1] : "";
    if (!strcmp(what, "flip_bits")) flip_bits();
    else if (!strcmp(what, "forge_states")) forge_states(), fuzz_states(300);
    else if (!strcmp(what, "random_calls") && argc == 4) random_calls(strtoull(argv[2], NULL, 10), atoi(argv[3]));
    else if (!strcmp(what, "check_names")) check_names();
    else if (!strcmp(what, "check_failures")) check_failures(argc > 2);
    else die("usage", __LINE__);
    return 0;
}
