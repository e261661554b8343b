/* Every function of FMI 3.0 in every state of every kind of instance. This program includes the sources of the FMU.
 *
 *     fmi3_stress states THREADS | random_calls SEED TURNS | valid_calls SEED RUNS | forge_states
 *
 * prints the number of instances, of the completed steps, or nothing.
 *
 * It aborts on an unexpected result; a sanitizer stops it on a memory error.
 */
#include "fmi3.c"

#include <pthread.h>

#include "stress.h"

enum { MAX_VALUES = 12, BYTES = sizeof(SavedState), N_INSTANCES = 20, INVALID_REFERENCE = VARIABLES + 7 };
enum { KIND_CS, KIND_CS_EVENTS, KIND_ME, KINDS }; /* plain; with event mode; model exchange */

/* An instance, and all arguments that its importer passes. */
typedef struct Context {
    Instance *it;
    int kind, n_messages;
    void (*intermediate)(struct Context *context); /* in an intermediate update */
    const struct Row *row;           /* the call made there */
    bool valid;
    fmi3ValueReference one, unknown, known;
    size_t count, states, limits, size;
    double t, h, real, reals[MAX_VALUES], others[MAX_VALUES];
    int64_t integers[MAX_VALUES];
    int32_t orders[MAX_VALUES];
    bool flags[6], requests_return;
    fmi3FMUState state;
    fmi3ValueReference references[MAX_VALUES];
    fmi3Byte bytes[BYTES];
    void *buffer[MAX_VALUES]; /* for values of any type */
} Context;

#define AT ((Context *)it->host.environment)
#define R AT->references, AT->count
#define BUFFER (void *)AT->buffer

/* ---- the functions: the states in which the standard allows them, the state they lead to, a valid call and one that
 * must be refused.  SOME: may be allowed or not; AFTER_INIT: the state after initialisation. */

enum { STAYS = -1, AFTER_INIT = -2 };
enum { SOME = 1 << PHASES, EXCHANGED = 2 << PHASES, STEPPED = 4 << PHASES, HANDLED = 8 << PHASES };
enum { NEVER = 0, AT_EVENT = 1 << EVENT, GOING = 1 << CONTINUOUS, BEGINNING = 1 << INITIALISING };

#define TRANSITIONS(f)                                                                                                 \
    f(EnterInitializationMode, IN_INSTANTIATED, INITIALISING, (it, true, 1e-5, 0.0, true, 9.0), (NULL, false, 0.0, 0.0, false, 0.0)) \
    f(ExitInitializationMode, BEGINNING, AFTER_INIT, (it), (NULL))                                                           \
    f(EnterEventMode, (IN_SIMULATION | HANDLED), EVENT, (it), (NULL))                                                          \
    f(UpdateDiscreteStates, AT_EVENT, STAYS,                                                                           \
      (it, AT->flags, AT->flags + 1, AT->flags + 2, AT->flags + 3, AT->flags + 4, &AT->real),                          \
      (it, AT->flags, AT->flags + 1, AT->flags + 2, NULL, AT->flags + 4, &AT->real))                                   \
    f(EvaluateDiscreteStates, (BEGINNING | AT_EVENT), STAYS, (it), (NULL))                                             \
    f(EnterStepMode, (AT_EVENT | STEPPED), RUNNING, (it), (NULL))                                                      \
    f(EnterContinuousTimeMode, (AT_EVENT | EXCHANGED), CONTINUOUS, (it), (NULL))                                       \
    f(DoStep, IN_STEP_MODE, STAYS, (it, AT->t, AT->h, true, AT->flags, AT->flags + 1, AT->flags + 2, &AT->real),           \
      (it, AT->t, AT->h, true, AT->flags, AT->flags + 1, AT->flags + 2, NULL))                                         \
    f(SetTime, (GOING | EXCHANGED | SOME), STAYS, (it, AT->t), (NULL, 0.0))                                            \
    f(SetContinuousStates, GOING, STAYS, (it, AT->reals, AT->states), (it, AT->reals, STATES + 1))                     \
    f(CompletedIntegratorStep, GOING, STAYS, (it, true, AT->flags, AT->flags + 1), (it, true, NULL, AT->flags))        \
    f(Reset, IN_ANY_PHASE, INSTANTIATED, (it), (NULL))                                                                          \
    f(Terminate, IN_SIMULATION, TERMINATED, (it), (NULL))

#define VALUES(f, TYPE)                                                                               \
    f(Get##TYPE, SOME, STAYS, (it, R, BUFFER, AT->count), (it, &AT->one, 1, BUFFER, 1))           \
    f(Set##TYPE, SOME, STAYS, (it, R, BUFFER, AT->count), (it, &AT->one, 1, BUFFER, 1))

#define OTHERS(f)                                                                                                      \
    VALUES(f, Float32) VALUES(f, Int8) VALUES(f, UInt8) VALUES(f, Int16) VALUES(f, UInt16) VALUES(f, Int32)            \
    VALUES(f, UInt32) VALUES(f, UInt64) VALUES(f, Boolean) VALUES(f, String)                                           \
    f(GetBinary, SOME, STAYS, (it, R, &AT->size, BUFFER, AT->count), (it, &AT->one, 1, &AT->size, BUFFER, 1))      \
    f(SetBinary, SOME, STAYS, (it, R, &AT->size, BUFFER, AT->count), (it, &AT->one, 1, &AT->size, BUFFER, 1))      \
    f(GetClock, SOME, STAYS, (it, R, AT->flags), (it, &AT->one, 1, AT->flags))                                         \
    f(SetClock, SOME, STAYS, (it, R, AT->flags), (it, &AT->one, 1, AT->flags))                                         \
    f(GetFloat64, SOME, STAYS, (it, &AT->known, 1, &AT->real, 1), (it, &AT->known, 1, AT->reals, 2))                   \
    f(GetInt64, SOME, STAYS, (it, R, AT->integers, AT->count), (it, &AT->known, 1, AT->integers, 1))                   \
    f(SetFloat64, SOME, STAYS, (it, &AT->known, 1, &AT->real, 1), (it, &AT->known, 1, NULL, 1))                        \
    f(SetInt64, SOME, STAYS, (it, R, AT->integers, AT->count), (it, NULL, 1, AT->integers, 1))                         \
    f(SetDebugLogging, SOME, STAYS, (it, true, 0, NULL), (it, true, 1, NULL))                                          \
    f(GetContinuousStates, (EXCHANGED | SOME), STAYS, (it, AT->others, AT->states), (it, AT->others, STATES - 1))      \
    f(GetContinuousStateDerivatives, (EXCHANGED | SOME), STAYS, (it, AT->others, AT->states), (it, NULL, STATES))      \
    f(GetNominalsOfContinuousStates, (EXCHANGED | SOME), STAYS,                                                        \
      (it, AT->others, AT->states), (it, AT->others, STATES + 1))                                                      \
    f(GetEventIndicators, (EXCHANGED | SOME), STAYS, (it, AT->others, AT->limits), (it, AT->others, INDICATORS + 1))   \
    f(GetNumberOfContinuousStates, SOME, STAYS, (it, &AT->size), (it, NULL))                                           \
    f(GetNumberOfEventIndicators, SOME, STAYS, (it, &AT->size), (it, NULL))                                            \
    f(GetDirectionalDerivative, SOME, STAYS, (it, &AT->unknown, 1, &AT->known, 1, AT->reals, 1, AT->others, 1),        \
      (it, &AT->unknown, 1, &AT->known, 1, AT->reals, 1, AT->others, 2))                                               \
    f(GetAdjointDerivative, SOME, STAYS, (it, &AT->unknown, 1, &AT->known, 1, AT->reals, 1, AT->others, 1),            \
      (it, &AT->unknown, 1, &AT->known, 1, NULL, 1, AT->others, 1))                                                    \
    f(GetFMUState, IN_ANY_PHASE, STAYS, (it, &AT->state), (it, NULL))                                                           \
    f(SetFMUState, IN_ANY_PHASE, STAYS, (it, AT->state), (it, NULL))                                                            \
    f(SerializedFMUStateSize, IN_ANY_PHASE, STAYS, (it, AT->state, &AT->size), (it, AT->state, NULL))                           \
    f(SerializeFMUState, IN_ANY_PHASE, STAYS, (it, AT->state, AT->bytes, BYTES), (it, AT->state, AT->bytes, BYTES - 1))         \
    f(DeserializeFMUState, IN_ANY_PHASE, STAYS, (it, AT->bytes, BYTES, &AT->state), (it, AT->bytes, BYTES - 1, &AT->state))     \
    f(GetOutputDerivatives, SOME, STAYS, (it, R, AT->orders, AT->reals, AT->count),                                    \
      (it, &AT->one, 1, AT->orders, AT->reals, 1))                                                                     \
    f(FreeFMUState, IN_ANY_PHASE, STAYS, (it, &AT->state), (NULL, NULL))                                                        \
    f(EnterConfigurationMode, NEVER, STAYS, (it), (NULL))                                                              \
    f(ExitConfigurationMode, NEVER, STAYS, (it), (NULL))                                                               \
    f(GetNumberOfVariableDependencies, NEVER, STAYS, (it, AT->known, &AT->size), (it, AT->known, NULL))                \
    f(GetVariableDependencies, NEVER, STAYS, (it, AT->known, NULL, NULL, NULL, NULL, 0),                               \
      (it, AT->one, NULL, NULL, NULL, NULL, 1))                                                                        \
    f(GetIntervalDecimal, NEVER, STAYS, (it, R, AT->reals, BUFFER), (it, R, NULL, NULL))                             \
    f(GetIntervalFraction, NEVER, STAYS, (it, R, BUFFER, BUFFER, BUFFER), (it, R, NULL, NULL, NULL))             \
    f(GetShiftDecimal, NEVER, STAYS, (it, R, AT->reals), (it, R, NULL))                                                \
    f(GetShiftFraction, NEVER, STAYS, (it, R, BUFFER, BUFFER), (it, R, NULL, NULL))                                \
    f(SetIntervalDecimal, NEVER, STAYS, (it, R, AT->reals), (it, R, NULL))                                             \
    f(SetIntervalFraction, NEVER, STAYS, (it, R, BUFFER, BUFFER), (it, R, NULL, NULL))                             \
    f(SetShiftDecimal, NEVER, STAYS, (it, R, AT->reals), (it, R, NULL))                                                \
    f(SetShiftFraction, NEVER, STAYS, (it, R, BUFFER, BUFFER), (it, R, NULL, NULL))                                \
    f(ActivateModelPartition, NEVER, STAYS, (it, AT->known, 0.0), (it, AT->one, NAN))

#define DEFINE(name, allowed, to, fine, bad)                             \
    static fmi3Status valid_##name(Instance *it) { return fmi3##name fine; } \
    static fmi3Status invalid_##name(Instance *it) { (void)it; return fmi3##name bad; }

TRANSITIONS(DEFINE)
OTHERS(DEFINE)

static const struct Row {
    const char *name;
    int allowed, to;
    fmi3Status (*valid)(Instance *it), (*invalid)(Instance *it);
} rows[] = {
#define ENTRY(name, allowed, to, fine, bad) {#name, allowed, to, valid_##name, invalid_##name},
    TRANSITIONS(ENTRY) OTHERS(ENTRY)
};

#define COUNT(name, allowed, to, fine, bad) +1
enum { LEADING = 0 TRANSITIONS(COUNT), ROWS = sizeof rows / sizeof *rows };

/* ---- instances in all states */

static void on_log(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    Context *context = environment;
    CHECK(status == fmi3Error && !strcmp(category, "logStatusError") && *message);
    context->n_messages++;
}

static void intermediate(fmi3InstanceEnvironment environment, fmi3Float64 t, fmi3Boolean set, fmi3Boolean get,
                 fmi3Boolean finished, fmi3Boolean early, fmi3Boolean *requests_return, fmi3Float64 *return_time)
{
    Context *context = environment;
    (void)finished;
    CHECK(set && get && early && isfinite(t));
    if (context->intermediate) context->intermediate(context);
    *requests_return = context->requests_return, *return_time = context->h;
}

static Instance *new_instance(Context *context, int kind)
{
    bool handles = kind == KIND_CS_EVENTS;
    *context = (Context){.kind = kind, .one = INVALID_REFERENCE, .states = STATES, .limits = INDICATORS, .h = 0.1};
    for (fmi3ValueReference i = 0; i < VARIABLES; i++) {
        if (variables[i].is_state_or_input) context->known = i;
        else if (variables[i].tangent_offset != NO_OFFSET && variables[i].is_calculated) context->unknown = i;
    }
    context->it = kind == KIND_ME ? fmi3InstantiateModelExchange("it", MODEL_GUID, NULL, false, true, context, on_log)
                              : fmi3InstantiateCoSimulation("it", MODEL_GUID, NULL, false, true, handles, handles, NULL,
                                                            0, context, on_log, handles ? intermediate : NULL);
    CHECK(context->it);
    return context->it;
}

/* Create an instance in a state, with its saved state in memory and as bytes; false if its kind has no such state. */
static bool prepare(Context *context, int kind, int phase)
{
    Instance *it = new_instance(context, kind);
    bool initialised = phase > INITIALISING, events = phase == EVENT || phase == CONTINUOUS;
    if (phase >= INITIALISING) CHECK(valid_EnterInitializationMode(it) == fmi3OK);
    if (initialised) CHECK(valid_ExitInitializationMode(it) == fmi3OK);
    if (initialised && kind == KIND_CS_EVENTS && phase != EVENT) CHECK(valid_EnterStepMode(it) == fmi3OK);
    if (phase == CONTINUOUS && kind == KIND_ME) CHECK(valid_EnterContinuousTimeMode(it) == fmi3OK);
    if (phase == TERMINATED) CHECK(valid_Terminate(it) == fmi3OK);
    CHECK(fmi3GetFMUState(it, &context->state) == fmi3OK && valid_SerializeFMUState(it) == fmi3OK);
    if (kind == KIND_ME) return phase != RUNNING && phase != INTERMEDIATE;
    return kind == KIND_CS_EVENTS ? phase != CONTINUOUS : !events && phase != INTERMEDIATE;
}

static void release(Context *context)
{
    if (context->state) CHECK(fmi3FreeFMUState(context->it, &context->state) == fmi3OK);
    fmi3FreeInstance(context->it);
}

/* ---- the walk */

/* 1 if a call is allowed, 0 if not, -1 if it may be either. */
static int is_allowed(const struct Row *row, int kind, int phase)
{
    int only = row->allowed;
    if ((only & EXCHANGED && kind != KIND_ME) || (only & STEPPED && kind == KIND_ME)) return 0;
    if (only & HANDLED && kind == KIND_CS) return 0;
    return only >> phase & 1 ? 1 : only & SOME ? -1 : 0;
}

/* Make the call of the row and check its result: a refused call changes nothing and logs one message. */
static void call(Context *context)
{
    Instance *it = context->it;
    const struct Row *row = context->row;
    State before = it->state;
    int phase = before.run.phase, allowed = context->valid ? is_allowed(row, context->kind, phase) : 0;
    context->intermediate = NULL;
    context->n_messages = 0;
    fmi3Status status = (context->valid ? row->valid : row->invalid)(it);
    int to = row->to == AFTER_INIT ? (it->host.event_mode_used ? EVENT : RUNNING) : row->to == STAYS ? phase : row->to;
    bool good = status == fmi3OK ? allowed && !context->n_messages && it->state.run.phase == to
                                 : status == fmi3Error && allowed < 1 && context->n_messages <= 1 &&
                                       (context->n_messages || !context->valid) && !memcmp(&before, &it->state, sizeof before);
    if (!good) printf("fmi3%s, kind %d, state %d, valid %d: status %d\n", row->name, context->kind, phase, context->valid, status);
    CHECK(good);
}

static void *walk(void *argument)
{
    int *count = argument;
    for (int kind = 0; kind < KINDS; kind++) {
        for (int phase = 0; phase < PHASES; phase++) {
            for (int i = 0; i < 2 * ROWS; i++) {
                Context context;
                ++*count;
                if (prepare(&context, kind, phase)) {
                    context.row = &rows[i / 2], context.valid = i % 2;
                    context.intermediate = call; /* once, in that state */
                    if (phase != INTERMEDIATE) call(&context);
                    else CHECK(valid_DoStep(context.it) == fmi3OK && !context.intermediate);
                }
                release(&context);
            }
        }
    }
    return NULL;
}

/* In every thread; returns the number of instances. */
static int walk_in_threads(int threads)
{
    enum { MOST = 16 };
    pthread_t each[MOST];
    int counts[MOST] = {0}, all = 0;
    CHECK(threads <= MOST);
    for (int i = 0; i < threads; i++) CHECK(!pthread_create(&each[i], NULL, walk, &counts[i]));
    for (int i = 0; i < threads; all += counts[i++]) CHECK(!pthread_join(each[i], NULL));
    return all;
}

/* ---- random sequences of functions, with random arguments */

static void random_call(Context *context)
{
    const struct Row *row = &rows[draw(2) ? draw(LEADING) : draw(ROWS)];
    context->t = draw(4) ? context->it->state.run.solver.t : number();
    context->h = draw(4) ? (double)draw(100) * 1e-4 : number();
    context->real = number();
    context->requests_return = draw(3) == 0;
    context->count = draw(20) ? 0 : draw(MAX_VALUES);
    context->states = draw(9) ? STATES : draw(MAX_VALUES), context->limits = draw(9) ? INDICATORS : draw(MAX_VALUES);
    context->known = (fmi3ValueReference)(draw(40) ? draw(VARIABLES) : draw(UINT64_C(1) << 32));
    context->unknown = (fmi3ValueReference)draw(VARIABLES);
    for (int i = 0; i < MAX_VALUES; i++) {
        context->references[i] = (fmi3ValueReference)(draw(40) ? draw(VARIABLES) : draw(UINT64_C(1) << 32));
        context->reals[i] = draw(3) ? (double)draw(1000) / 100.0 : number();
        context->integers[i] = (int64_t)draw(draw(9) ? 6 : UINT64_C(1) << 40);
    }
    if (draw(20) == 0) context->bytes[draw(BYTES)] ^= 1;
    fmi3Status status = (draw(9) ? row->valid : row->invalid)(context->it);
    CHECK(status == fmi3OK || status == fmi3Discard || status == fmi3Error);
}

static void random_calls(uint64_t seed, int turns)
{
    static Context contexts[N_INSTANCES], bystander;
    prepare(&bystander, KIND_CS_EVENTS, RUNNING);
    State before = bystander.it->state;
    random_state = seed;
    for (int i = 0; i < N_INSTANCES; i++) prepare(&contexts[i], i % KINDS, INSTANTIATED);
    for (int turn = 0; turn < turns; turn++) {
        Context *context = &contexts[draw(N_INSTANCES)], *other = &contexts[draw(N_INSTANCES)];
        if (draw(20) == 0) release(context), prepare(context, (int)draw(KINDS), (int)draw(PHASES));
        fmi3FMUState state = context->state;
        context->state = other->state, other->state = state; /* possibly of another instance */
        context->intermediate = random_call;
        random_call(context);
    }
    for (int i = 0; i < N_INSTANCES; i++) {
        Context *context = &contexts[i];
        fmi3ValueReference energy = reference_of("energy");
        context->intermediate = NULL, context->t = 0.0, context->h = 0.1, context->requests_return = false;
        CHECK(valid_Reset(context->it) == fmi3OK && valid_EnterInitializationMode(context->it) == fmi3OK);
        CHECK(valid_ExitInitializationMode(context->it) == fmi3OK);
        if (context->kind == KIND_CS_EVENTS) CHECK(valid_EnterStepMode(context->it) == fmi3OK);
        if (context->kind != KIND_ME) CHECK(valid_DoStep(context->it) == fmi3OK);
        CHECK(fmi3GetFloat64(context->it, &energy, 1, &context->real, 1) == fmi3OK && isfinite(context->real));
        release(context);
    }
    CHECK(!memcmp(&before, &bystander.it->state, sizeof before));
    release(&bystander);
}

/* ---- random runs of co-simulation in the order of the standard, with any values */

typedef struct {
    Context context; /* first: the environment of the callbacks */
    double t, h, end, last_update; /* of the step; of the last update after an internal step */
} CoSimulation;

static bool is_input(uint32_t reference)
{
    return variables[reference].is_state_or_input && !variables[reference].is_calculated;
}

/* Read all values. Parameters and inputs have the values of the last call, and outputs are finite in a healthy run. */
static void read_all(Instance *it)
{
    for (fmi3ValueReference i = 0; i < VARIABLES; i++) {
        if (!variables[i].is_real) continue;
        double value, stored = variable_value(&it->state, &variables[i]);
        CHECK(fmi3GetFloat64(it, &i, 1, &value, 1) == fmi3OK);
        CHECK(variables[i].is_calculated || value == stored);
        bool may_lack_value = i == T_NEXT || !it->state.run.outputs_current; /* doomed, failed or refused */
        CHECK(!variables[i].is_calculated || may_lack_value || isfinite(value));
    }
}

/* Set a variable to any value, which reads back, whatever else is wrong. */
static void set_any(CoSimulation *run)
{
    Instance *it = run->context.it;
    fmi3ValueReference i = (fmi3ValueReference)draw(VARIABLES);
    bool intermediate = it->state.run.phase == INTERMEDIATE;
    if (!variables[i].is_real) return;
    double extreme = draw(2) ? number() : draw(2) ? -1e308 : 1e-9, value = draw(3) ? (double)draw(1000) / 100.0 : extreme, read;
    fmi3Status status = fmi3SetFloat64(it, &i, 1, &value, 1);
    CHECK(!intermediate || is_input(i) || status == fmi3Error);
    if (status != fmi3OK || variables[i].is_calculated) return; /* a calculated value may be set to what it is */
    CHECK(fmi3GetFloat64(it, &i, 1, &read, 1) == fmi3OK);
    CHECK(read == value);
}

static void on_update(fmi3InstanceEnvironment environment, fmi3Float64 t, fmi3Boolean set, fmi3Boolean get,
                      fmi3Boolean finished, fmi3Boolean early, fmi3Boolean *requests_return, fmi3Float64 *return_time)
{
    CoSimulation *run = environment;
    Instance *it = run->context.it;
    (void)set, (void)get, (void)early;
    CHECK(run->t <= t && t <= run->end && t >= run->last_update);
    if (finished) run->last_update = t;
    if (draw(3) == 0) set_any(run);
    if (draw(3) == 0) rows[draw(ROWS)].valid(it);
    if (draw(3) == 0) read_all(it);
    CHECK(it->state.run.phase == INTERMEDIATE);
    *requests_return = draw(4) == 0, *return_time = draw(2) ? t + run->h * (double)draw(100) / 99.0 : number();
}

/* Make one step, and handle the event after it. Returns false if the run cannot continue. */
static bool step_once(CoSimulation *run, bool handles_events)
{
    static const double sizes[] = {1e-9, 1e-3, 0.1, 0.5, 1.0, 3.0, 1e4};
    Instance *it = run->context.it;
    bool event, ends, early;
    double last, now = current_time(&it->state.run);
    run->h = sizes[draw(sizeof sizes / sizeof *sizes)];
    run->t = draw(4) ? now : now + 1e-7 * run->h; /* as a sum of many steps */
    run->end = run->t + run->h * (1.0 + 1e-6) + 1e-14 * run->t; /* may be rounded to that of the run */
    run->last_update = run->t;
    if (fmi3DoStep(it, run->t, run->h, true, &event, &ends, &early, &last) != fmi3OK) return false;
    CHECK(!it->state.run.has_failed && last >= run->t && last <= run->end);
    CHECK(early || last >= (run->t + run->h) * (1.0 - 1e-14) - 1e-6 * run->h);
    read_all(it);
    CHECK(it->state.run.outputs_current);
    if (handles_events && (event || draw(4) == 0)) {
        CHECK(fmi3EnterEventMode(it) == fmi3OK);
        if (draw(3) == 0) set_any(run);
        if (valid_UpdateDiscreteStates(it) != fmi3OK) return false;
        CHECK(fmi3EnterStepMode(it) == fmi3OK);
    }
    if (draw(4) == 0) set_any(run);
    return true;
}

static int valid_calls(uint64_t seed, int runs)
{
    int steps = 0;
    random_state = seed;
    for (int i = 0; i < runs; i++) {
        CoSimulation run = {.context = {.states = STATES, .limits = INDICATORS}};
        bool handles_events = draw(2), early = draw(2);
        Instance *it = fmi3InstantiateCoSimulation("it", MODEL_GUID, NULL, false, true, handles_events, early, NULL, 0,
                                                   &run, on_log, draw(4) ? on_update : NULL);
        CHECK(it);
        run.context.it = it;
        for (uint64_t n = draw(3); n; n--) set_any(&run);
        CHECK(fmi3EnterInitializationMode(it, true, 1e-5, (double)draw(3) * 100.0, draw(2), 1000.0) == fmi3OK);
        for (uint64_t n = draw(4); n; n--) set_any(&run);
        if (draw(2)) read_all(it);
        bool healthy = fmi3ExitInitializationMode(it) == fmi3OK;
        if (healthy && handles_events) healthy = valid_UpdateDiscreteStates(it) == fmi3OK && valid_EnterStepMode(it) == fmi3OK;
        for (int n = 0; healthy && n < 12; n++, steps += healthy) healthy = step_once(&run, handles_events);
        read_all(it);
        if (run.context.state) CHECK(fmi3FreeFMUState(it, &run.context.state) == fmi3OK);
        fmi3FreeInstance(it);
    }
    return steps;
}

/* A stored value of a discrete integer that no int64_t can have is refused, though the checksum is right. */
static void forge_states(void)
{
    static const double forged[] = {NAN, INFINITY, -1e300};
    for (int i = 0; i < 3 * DISCRETE; i++) {
        Context context;
        SavedState sealed;
        prepare(&context, KIND_CS_EVENTS, RUNNING);
        State state = context.it->state;
        if (!variables[discrete_variables[i / 3]].is_real) {
            state.discrete_values[i / 3] = forged[i % 3];
            write_saved_state(&sealed, &state);
            CHECK(fmi3SetFMUState(context.it, &sealed) == fmi3Error);
        }
        release(&context);
    }
}

int main(int argc, char **argv)
{
    const char *what = argc > 1 ? argv[1] : "";
    if (!strcmp(what, "forge_states")) forge_states();
    else if (!strcmp(what, "states") && argc == 3) printf("%d\n", walk_in_threads(atoi(argv[2])));
    else if (!strcmp(what, "random_calls") && argc == 4) random_calls(strtoull(argv[2], NULL, 10), atoi(argv[3]));
    else if (!strcmp(what, "valid_calls") && argc == 4) printf("%d\n", valid_calls(strtoull(argv[2], NULL, 10), atoi(argv[3])));
    else die("usage", __LINE__);
    return 0;
}
