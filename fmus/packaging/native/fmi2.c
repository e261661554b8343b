/* FMI 2.0 co-simulation of the model in model.h.
 *
 * Every call does what it does in the Python FMU of the same model (fmus/runtime/hosted.py there), with the same
 * sentences: a value that cannot be used is remembered and told by the next step; a step that fails is discarded, and
 * every calculated Real reads NaN from then on.  On top, calls out of order are refused.
 *
 * All that an instance changes is in one struct, and nothing is shared: instances may run side by side in threads.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "model.h"

/* The phases of an instance, as bits. */
enum { INSTANTIATED = 1, INITIALISING = 2, RUNNING = 4, TERMINATED = 8 };
enum { SETTING_UP = INSTANTIATED | INITIALISING, ANY = SETTING_UP | RUNNING | TERMINATED };

typedef enum { NONE, CALCULATED, FIXED, OUT_OF_RANGE } Reason;

/* A value that was set and cannot be used; the earliest is told first. */
typedef struct {
    Reason reason;
    double value;
    int64_t turn;
} Refusal;

/* What a saved state holds. */
typedef struct {
    int phase;
    double start_time, stop_time, tolerance;
    bool changed; /* values were set since the motion was last settled */
    bool failed;
    int refusals; /* how many values are refused */
    int64_t turns;
    Refusal refused[VARIABLES];
    Model model;
} State;

typedef struct {
    State state;
    bool observed; /* the outputs are those of the present point */
    double last_time;
    bool logging;
    fmi2CallbackFunctions functions;
    char name[];
} Instance;

/* A state as bytes: whose it is, and what it is. */
typedef struct {
    char guid[sizeof MODEL_GUID];
    State state;
} Sealed;

/* ---- saying what is wrong */

static void announce(const fmi2CallbackFunctions *functions, const char *instance, bool logging, const Text *text)
{
    if (logging && functions->logger) {
        Text format = {0}; /* the message is taken for a printf format */
        for (const char *c = text->line; *c; c++) {
            char piece[3] = {*c, *c == '%' ? '%' : '\0', '\0'};
            add(&format, piece);
        }
        functions->logger(functions->componentEnvironment, instance, fmi2Error, "logStatusError", format.line);
    }
    fprintf(stderr, "%s (%s): %s\n", MODEL_NAME, instance, text->line);
    fflush(stderr);
}

/* A mistake of the importer, which leaves the motion as it is. */
static fmi2Status refuse(const Instance *instance, const char *function, const char *why)
{
    Text text = {0};
    add(&text, function);
    add(&text, why);
    announce(&instance->functions, instance->name, instance->logging, &text);
    return fmi2Error;
}

static fmi2Status refuse_order(const Instance *instance, int phases, const char *function)
{
    static const char *const names[] = {"instantiated", "in initialisation mode", "running", "terminated"};
    const char *separator = ", the call is allowed when it is ";
    Text why = {0};
    if (!instance) return fmi2Error;
    add(&why, " is refused: the FMU is ");
    for (int i = 0; i < 4; i++) {
        if (instance->state.phase == 1 << i) add(&why, names[i]);
    }
    for (int i = 0; i < 4; i++) {
        if (!(phases & 1 << i)) continue;
        add(&why, separator);
        add(&why, names[i]);
        separator = " or ";
    }
    return refuse(instance, function, why.line);
}

/* The instance, if the call is allowed in its phase. */
#define ENTER(phases)         \
    Instance *it = component; \
    if (!it || !(it->state.phase & (phases))) return refuse_order(it, (phases), __func__)

/* ---- values */

static void *place(Model *model, const Variable *variable) { return (char *)model + variable->offset; }

static double value_of(const Model *model, const Variable *variable)
{
    const void *value = (const char *)model + variable->offset;
    return variable->is_real ? *(const double *)value : (double)*(const int64_t *)value;
}

static void add_value(Text *text, const Variable *variable, double value)
{
    if (variable->is_real) add_real(text, value);
    else add_integer(text, (int64_t)value);
}

static bool accepts(const Variable *variable, double value)
{
    if (variable->items) {
        for (const int64_t *item = variable->items; item < variable->end_of_items; item++) {
            if ((double)*item == value) return true;
        }
        return false;
    }
    return isfinite(value) && variable->low <= value && value <= variable->high && variable->above < value &&
           value < variable->below;
}

static void tell_refusal(const Variable *variable, const Refusal *refusal, Text *text)
{
    add(text, variable->name);
    add(text, " = ");
    add_value(text, variable, refusal->value);
    if (refusal->reason == OUT_OF_RANGE) {
        add(text, variable->refusal);
        return;
    }
    add(text, " is refused: ");
    add(text, variable->text);
    add(text, refusal->reason == CALCULATED ? " is calculated, not set"
                                            : " is fixed, it must be set before initialisation ends; reset the FMU "
                                              "to change it");
}

/* The refused value that came first. */
static const Refusal *refused(const State *state)
{
    const Refusal *first = NULL, *end = state->refused + VARIABLES;
    for (const Refusal *refusal = state->refused; refusal < end; refusal++) {
        if (refusal->reason != NONE && (!first || refusal->turn < first->turn)) first = refusal;
    }
    return first;
}

/* ---- failure */

static void silence(Model *model)
{
    for (const Variable *variable = variables; variable < variables + VARIABLES; variable++) {
        if (variable->is_real && variable->is_calculated) *(double *)place(model, variable) = NAN;
    }
}

static void fail(Instance *it, const Text *text)
{
    it->state.failed = true;
    it->observed = false;
    silence(&it->state.model);
    announce(&it->functions, it->name, it->logging, text);
}

static void fail_by_status(Instance *it, int64_t status, double start)
{
    Text text = {0};
    tell_failure(status, it->state.model.solver.step.t0, start, &text);
    fail(it, &text);
}

/* Where Python would raise. */
static void fail_by_fault(Instance *it) { fail_by_status(it, DIVERGED, it->state.model.solver.t); }

/* ---- the run */

typedef enum { GOOD, BAD, FAULTY } Verdict;

/* Whether the values can be used as they stand; if they are bad, why. */
static Verdict judge(State *state, Text *why)
{
    bool fault = false;
    int64_t rule;
    if (state->refusals) {
        const Refusal *first = refused(state);
        tell_refusal(&variables[first - state->refused], first, why);
        return BAD;
    }
    if (!isfinite(state->start_time)) {
        add(why, "start time = ");
        add_real(why, state->start_time);
        add(why, " s is refused: it must be a finite number");
        return BAD;
    }
    if (!(state->stop_time > state->start_time)) {
        add(why, "stop time = ");
        add_real(why, state->stop_time);
        add(why, " s is refused: it must be above the start time, ");
        add_real(why, state->start_time);
        add(why, " s");
        return BAD;
    }
    rule = prepare(&state->model, &fault);
    if (fault) return FAULTY;
    if (rule) tell_rule(&state->model, rule, why);
    return rule ? BAD : GOOD;
}

/* Let the motion begin, or go on from the present point, with values that have been found good. */
static bool apply(Instance *it)
{
    State *state = &it->state;
    bool fault = false;
    if (!(state->phase & SETTING_UP)) restart(&state->model, &fault);
    else start(&state->model, state->start_time, state->stop_time, state->tolerance, &fault);
    if (fault) {
        fail_by_fault(it);
        return false;
    }
    state->changed = it->observed = false;
    return true;
}

/* Take over what was set, or fail. */
static bool settle(Instance *it)
{
    Text why = {0};
    switch (judge(&it->state, &why)) {
    case GOOD: return apply(it);
    case BAD: fail(it, &why); return false;
    default: fail_by_fault(it); return false;
    }
}

/* Bring the outputs to the present point; NaN while the values cannot be used.  False after a fault. */
static bool bring_up(Instance *it)
{
    State *state = &it->state;
    bool fault = false;
    if (state->changed || state->phase & SETTING_UP || state->refusals) {
        Text why = {0};
        switch (judge(state, &why)) {
        case GOOD: break;
        case BAD: silence(&state->model); return true;
        default: fail_by_fault(it); return false;
        }
        if (!apply(it)) return false;
    }
    observe(&state->model, &fault);
    if (fault) fail_by_fault(it);
    it->observed = !fault;
    return !fault;
}

/* ---- reading and writing */

static bool is_one(fmi2ValueReference reference, bool is_real)
{
    return reference < VARIABLES && variables[reference].is_real == is_real;
}

static fmi2Status fail_by_reference(Instance *it, fmi2ValueReference reference, const char *type)
{
    Text text = {0};
    add(&text, "value reference ");
    add_integer(&text, reference);
    add(&text, " is refused: it is not that of a variable of type ");
    add(&text, type);
    add(&text, "; the model description of this very FMU has those that are");
    fail(it, &text);
    return fmi2Error;
}

/* Make the values ready to be read; fmi2Discard after a fault. */
static fmi2Status ready(Instance *it, bool is_real, const fmi2ValueReference references[], size_t count)
{
    bool reported = false, ahead = false, fault = false;
    for (size_t i = 0; i < count; i++) {
        if (!is_one(references[i], is_real)) return fail_by_reference(it, references[i], is_real ? "Real" : "Integer");
        reported |= variables[references[i]].is_reported;
        ahead |= references[i] == T_NEXT;
    }
    if (!it->observed && !it->state.failed && !bring_up(it)) return fmi2Discard;
    if (reported && it->observed) report(&it->state.model, &fault);
    if (ahead && it->observed && !fault) look_ahead(&it->state.model, &fault);
    if (fault) fail_by_fault(it);
    return fault ? fmi2Discard : fmi2OK;
}

static Reason objection(const State *state, const Variable *variable, double value)
{
    return variable->is_calculated                         ? CALCULATED
           : state->phase == RUNNING && variable->is_fixed ? FIXED
           : accepts(variable, value)                      ? NONE
                                                           : OUT_OF_RANGE;
}

/* Take over a value, or remember that it cannot be used.  False after a fault. */
static bool write_one(Instance *it, fmi2ValueReference reference, double value)
{
    State *state = &it->state;
    const Variable *variable = &variables[reference];
    Refusal *refusal = &state->refused[reference];
    bool fault = false;
    if (value == value_of(&state->model, variable) && refusal->reason == NONE) return true;
    it->observed = false;
    state->refusals -= refusal->reason != NONE;
    refusal->reason = objection(state, variable, value);
    if (refusal->reason != NONE) {
        state->refusals++;
        refusal->value = value;
        refusal->turn = ++state->turns;
        return true;
    }
    if (!state->changed && state->phase == RUNNING) rebase(&state->model, &fault);
    if (fault) {
        fail_by_fault(it);
        return false;
    }
    state->changed = true;
    if (variable->is_real) *(double *)place(&state->model, variable) = value;
    else *(int64_t *)place(&state->model, variable) = (int64_t)value;
    return true;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    ENTER(ANY);
    fmi2Status status = ready(it, true, vr, nvr);
    for (size_t i = 0; i < nvr; i++) {
        value[i] = status ? NAN : *(const double *)place(&it->state.model, &variables[vr[i]]);
    }
    return status == fmi2Error ? fmi2Error : fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    ENTER(ANY);
    fmi2Status status = ready(it, false, vr, nvr);
    for (size_t i = 0; i < nvr; i++) {
        value[i] = status ? 0 : (fmi2Integer)value_of(&it->state.model, &variables[vr[i]]);
    }
    return status == fmi2Error ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    ENTER(SETTING_UP | RUNNING);
    for (size_t i = 0; i < nvr; i++) {
        if (!is_one(vr[i], true)) return fail_by_reference(it, vr[i], "Real");
        if (!write_one(it, vr[i], value[i])) break;
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    ENTER(SETTING_UP | RUNNING);
    for (size_t i = 0; i < nvr; i++) {
        if (!is_one(vr[i], false)) return fail_by_reference(it, vr[i], "Integer");
        if (!write_one(it, vr[i], value[i])) break;
    }
    return fmi2OK;
}

/* No variable is a Boolean or a String. */

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    ENTER(ANY);
    for (size_t i = 0; i < nvr; i++) value[i] = fmi2False;
    return nvr ? fail_by_reference(it, vr[0], "Boolean") : fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    ENTER(ANY);
    for (size_t i = 0; i < nvr; i++) value[i] = "";
    return nvr ? fail_by_reference(it, vr[0], "String") : fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    ENTER(SETTING_UP | RUNNING);
    (void)value;
    return nvr ? fail_by_reference(it, vr[0], "Boolean") : fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    ENTER(SETTING_UP | RUNNING);
    (void)value;
    return nvr ? fail_by_reference(it, vr[0], "String") : fmi2OK;
}

/* ---- from instantiation to the end */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

static void begin(Instance *it)
{
    memset(&it->state, 0, sizeof it->state);
    it->state.phase = INSTANTIATED;
    it->state.stop_time = INFINITY;
    it->state.tolerance = TOLERANCE;
    it->state.model = initial;
    it->observed = false;
    it->last_time = NAN;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    static const fmi2CallbackFunctions silent = {0};
    const char *name = instanceName ? instanceName : "";
    Instance *it = NULL;
    Text why = {0};
    (void)fmuResourceLocation, (void)visible;
    if (fmuType != fmi2CoSimulation) {
        add(&why, "fmi2Instantiate is refused: this FMU is for co-simulation only");
    } else if (!fmuGUID || strcmp(fmuGUID, MODEL_GUID)) {
        add(&why, "fmi2Instantiate is refused: the GUID must be ");
        add(&why, MODEL_GUID);
        add(&why, ", that of modelDescription.xml");
    } else if (!(it = calloc(1, sizeof *it + strlen(name) + 1))) {
        add(&why, "fmi2Instantiate failed: there is no memory left");
    }
    if (!it) {
        announce(functions ? functions : &silent, name, loggingOn, &why);
        return NULL;
    }
    memcpy(it->name, name, strlen(name));
    it->functions = functions ? *functions : silent;
    it->logging = loggingOn;
    begin(it);
    return it;
}

void fmi2FreeInstance(fmi2Component component) { free(component); }

/* Every message is of the category logStatusError. */
fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    ENTER(ANY);
    it->logging = loggingOn && nCategories == 0;
    for (size_t i = 0; i < nCategories; i++) {
        bool wanted = !strcmp(categories[i], "logStatusError") || !strcmp(categories[i], "logAll");
        it->logging |= loggingOn && wanted;
    }
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    ENTER(INSTANTIATED);
    it->state.start_time = startTime;
    it->state.stop_time = stopTimeDefined ? stopTime : INFINITY;
    if (toleranceDefined && 0.0 < tolerance && tolerance < 1.0) it->state.tolerance = tolerance;
    it->state.changed = true;
    it->observed = false;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    ENTER(INSTANTIATED);
    it->state.phase = INITIALISING;
    return fmi2OK;
}

/* What is wrong is told here, and the first step is discarded. */
fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    ENTER(INITIALISING);
    settle(it);
    it->state.phase = RUNNING;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    ENTER(RUNNING);
    it->state.phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    ENTER(ANY);
    begin(it);
    return fmi2OK;
}

/* ---- steps */

static void fail_by_step(Instance *it, double t, double h)
{
    Text text = {0};
    add(&text, "a communication step of ");
    add_real(&text, h);
    add(&text, " s from t = ");
    add_real(&text, t);
    add(&text, " s is refused: it must be above zero, begin at the present point, t = ");
    add_real(&text, it->state.model.solver.t);
    add(&text, " s, and end by the stop time, t = ");
    add_real(&text, it->state.model.solver.step.t_end);
    add(&text, " s");
    fail(it, &text);
}

/* One communication step, which must begin at the present point and end by the stop time. */
static bool advance_by(Instance *it, double t, double h)
{
    Model *model = &it->state.model;
    double now = model->solver.t, stop = model->solver.step.t_end, end = t + h;
    bool fault = false, begins_here = fabs(t - now) <= 1e-6 * h + 1e-12 * fabs(now);
    int64_t status;
    if (fabs(end - model->solver.step.t1) <= 1e-15 * fabs(end) && fabs(end) < INFINITY) {
        end = model->solver.step.t1; /* the end of an internal step, but for the rounding of the sum */
    } else if (stop < end && end < INFINITY && end <= stop + 1e-9 * h + 1e-12 * fabs(stop)) {
        end = stop;
    }
    if (!(h > 0.0 && begins_here && now <= end && end <= stop && end < INFINITY)) {
        fail_by_step(it, t, h);
        return false;
    }
    if (!(end > now)) return true;
    it->observed = false;
    status = advance(model, end, &fault);
    if (fault) fail_by_fault(it);
    else if (status != OK) fail_by_status(it, status, now);
    return !fault && status == OK;
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    ENTER(RUNNING);
    State *state = &it->state;
    (void)noSetFMUStatePriorToCurrentPoint;
    it->last_time = currentCommunicationPoint;
    if (state->failed) return fmi2Discard;
    if ((state->changed || state->refusals) && !settle(it)) return fmi2Discard;
    if (!advance_by(it, currentCommunicationPoint, communicationStepSize)) return fmi2Discard;
    it->last_time = currentCommunicationPoint + communicationStepSize;
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind s, fmi2Real *value)
{
    ENTER(ANY);
    if (s != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = it->last_time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind s, fmi2Boolean *value)
{
    ENTER(ANY);
    if (s != fmi2Terminated) return fmi2Discard;
    *value = it->state.failed;
    return fmi2OK;
}

/* ---- state */

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *FMUstate)
{
    ENTER(ANY);
    if (!*FMUstate && !(*FMUstate = malloc(sizeof(State)))) return refuse(it, __func__, " failed: no memory is left");
    memcpy(*FMUstate, &it->state, sizeof(State));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate FMUstate)
{
    ENTER(ANY);
    if (!FMUstate) return refuse(it, __func__, " is refused: there is no state");
    memcpy(&it->state, FMUstate, sizeof(State));
    it->observed = false;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *FMUstate)
{
    ENTER(ANY);
    if (FMUstate) {
        free(*FMUstate);
        *FMUstate = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate FMUstate, size_t *size)
{
    ENTER(ANY);
    (void)FMUstate;
    *size = sizeof(Sealed);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size)
{
    ENTER(ANY);
    if (!FMUstate || size < sizeof(Sealed)) return refuse(it, __func__, " is refused: no state, or too few bytes");
    memset(serializedState, 0, size);
    memcpy(serializedState + offsetof(Sealed, guid), MODEL_GUID, sizeof MODEL_GUID);
    memcpy(serializedState + offsetof(Sealed, state), FMUstate, sizeof(State));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate)
{
    ENTER(ANY);
    if (size != sizeof(Sealed) || memcmp(serializedState, MODEL_GUID, sizeof MODEL_GUID)) {
        return refuse(it, __func__, " is refused: the bytes are not a state of this FMU");
    }
    if (!*FMUstate && !(*FMUstate = malloc(sizeof(State)))) return refuse(it, __func__, " failed: no memory is left");
    memcpy(*FMUstate, serializedState + offsetof(Sealed, state), sizeof(State));
    return fmi2OK;
}

/* ---- what this FMU does not offer, as its description says */

#define NOT_OFFERED " is refused: this FMU does not offer it, see its description"

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    ENTER(ANY);
    (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown, (void)dvUnknown;
    return refuse(it, __func__, NOT_OFFERED);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    ENTER(ANY);
    (void)vr, (void)nvr, (void)order, (void)value;
    return refuse(it, __func__, NOT_OFFERED);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    ENTER(ANY);
    (void)vr, (void)nvr, (void)order, (void)value;
    return refuse(it, __func__, NOT_OFFERED);
}

fmi2Status fmi2CancelStep(fmi2Component component)
{
    ENTER(ANY);
    return refuse(it, __func__, NOT_OFFERED);
}

/* Every step is done when fmi2DoStep returns, so there is nothing more to tell. */

fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind s, fmi2Status *value)
{
    ENTER(ANY);
    (void)s, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind s, fmi2Integer *value)
{
    ENTER(ANY);
    (void)s, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind s, fmi2String *value)
{
    ENTER(ANY);
    (void)s, (void)value;
    return fmi2Discard;
}
