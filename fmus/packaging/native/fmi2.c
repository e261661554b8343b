/* FMI 2.0 co-simulation of the model in model.h.
 *
 * Every call does what it does in the Python FMU of the same model (fmus/runtime/hosted.py there), with the same
 * sentences: a value that cannot be used is remembered and told by the next step; a run that cannot begin or go on
 * answers fmi2Error, and every calculated Real reads NaN from then on.  On top, calls out of order, wrong references
 * and missing addresses are refused: such a call changes nothing.
 *
 * All that an instance changes is in one struct, and nothing is shared: instances may run side by side in threads.
 */
#define _POSIX_C_SOURCE 200809L /* beside C99: signal masks */

#include "fmi2Functions.h"
#include "model.h"
#include "say.h"
#include "state.h"

typedef struct {
    State state;
    bool observed; /* the outputs are those of the present point */
    bool logging;
    fmi2CallbackFunctions functions;
    char name[];
} Instance;

/* ---- saying what is wrong */

static void say(const Instance *instance, const Text *text)
{
    announce(&instance->functions, instance->name, instance->logging, text);
}

/* A mistake of the importer, which leaves the motion as it is. */
static fmi2Status refuse(const Instance *instance, const char *function, const char *why)
{
    Text text = {0};
    add(&text, function);
    add(&text, why);
    say(instance, &text);
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

static fmi2Status refuse_reference(const Instance *instance, fmi2ValueReference reference, const char *type)
{
    Text text = {0};
    add(&text, "value reference ");
    add_integer(&text, reference);
    add(&text, " is refused: it is not that of a variable of type ");
    add(&text, type);
    add(&text, "; the model description of this very FMU has those that are");
    say(instance, &text);
    return fmi2Error;
}

/* The instance, if the call is allowed in its phase. */
#define ENTER(phases)         \
    Instance *it = component; \
    if (!it || !(it->state.phase & (phases))) return refuse_order(it, (phases), __func__)

/* An address that the call cannot do without. */
#define NEED(address) \
    if (!(address)) return refuse(it, __func__, " is refused: an address is missing, " #address " is NULL")

/* ---- values */

static void add_value(Text *text, const Variable *variable, double value)
{
    if (variable->is_real) add_real(text, value);
    else add_integer(text, (int64_t)value);
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
    say(it, text);
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
    it->observed = observe(&state->model, &fault) && !fault;
    if (!it->observed) fail_by_fault(it);
    return it->observed;
}

/* ---- reading and writing */

static bool is_one(fmi2ValueReference reference, bool is_real)
{
    return reference < VARIABLES && variables[reference].is_real == is_real;
}

/* Refuse a call unless every reference is that of a variable of the type, and there is room for the values. */
static fmi2Status check(const Instance *it, bool is_real, const fmi2ValueReference vr[], size_t nvr, const void *value,
                        const char *function)
{
    if (nvr && (!vr || !value)) return refuse(it, function, " is refused: an address is missing, vr or value is NULL");
    for (size_t i = 0; i < nvr; i++) {
        if (!is_one(vr[i], is_real)) return refuse_reference(it, vr[i], is_real ? "Real" : "Integer");
    }
    return fmi2OK;
}

/* Make the values ready to be read; fmi2Discard after a fault. */
static fmi2Status ready(Instance *it, bool is_real, const fmi2ValueReference vr[], size_t nvr, const void *value,
                        const char *function)
{
    bool reported = false, ahead = false, fault = false;
    if (!vr || !value) return check(it, is_real, vr, nvr, value, function);
    for (size_t i = 0; i < nvr; i++) {
        if (!is_one(vr[i], is_real)) return check(it, is_real, vr, nvr, value, function);
        reported |= variables[vr[i]].is_reported;
        ahead |= vr[i] == T_NEXT;
    }
    if (!it->observed && !it->state.failed && !bring_up(it)) return fmi2Discard;
    if (reported && it->observed) report(&it->state.model, &fault);
    if (ahead && it->observed && !fault) look_ahead(&it->state.model, &fault);
    if (fault) fail_by_fault(it);
    return fault ? fmi2Discard : fmi2OK;
}

/* As much of a count as an fmi2Integer can hold. */
static fmi2Integer integer_of(double value) { return value < 2147483647.0 ? (fmi2Integer)value : 2147483647; }

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
    fmi2Status status = ready(it, true, vr, nvr, value, __func__);
    if (status == fmi2Error) return fmi2Error;
    for (size_t i = 0; i < nvr; i++) {
        value[i] = status ? NAN : *(const double *)place(&it->state.model, &variables[vr[i]]);
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    ENTER(ANY);
    fmi2Status status = ready(it, false, vr, nvr, value, __func__);
    if (status == fmi2Error) return fmi2Error;
    for (size_t i = 0; i < nvr; i++) {
        value[i] = status ? 0 : integer_of(value_of(&it->state.model, &variables[vr[i]]));
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    ENTER(SETTING_UP | RUNNING);
    if (check(it, true, vr, nvr, value, __func__)) return fmi2Error;
    for (size_t i = 0; i < nvr && write_one(it, vr[i], value[i]); i++) continue;
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    ENTER(SETTING_UP | RUNNING);
    if (check(it, false, vr, nvr, value, __func__)) return fmi2Error;
    for (size_t i = 0; i < nvr && write_one(it, vr[i], value[i]); i++) continue;
    return fmi2OK;
}

/* No variable is a Boolean or a String. */
static fmi2Status refuse_all(const Instance *it, const fmi2ValueReference vr[], size_t nvr, const char *type)
{
    if (!nvr) return fmi2OK;
    NEED(vr);
    return refuse_reference(it, vr[0], type);
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    ENTER(ANY);
    (void)value;
    return refuse_all(it, vr, nvr, "Boolean");
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    ENTER(ANY);
    (void)value;
    return refuse_all(it, vr, nvr, "String");
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    ENTER(SETTING_UP | RUNNING);
    (void)value;
    return refuse_all(it, vr, nvr, "Boolean");
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    ENTER(SETTING_UP | RUNNING);
    (void)value;
    return refuse_all(it, vr, nvr, "String");
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
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    static const fmi2CallbackFunctions silent = {0};
    const char *name = instanceName ? instanceName : "";
    Instance *it = calloc(1, sizeof *it + 4 * strlen(name) + 1);
    Text why = {0};
    (void)fmuResourceLocation, (void)visible;
    if (!functions) functions = &silent;
    if (!it) {
        add(&why, "fmi2Instantiate failed: no memory is left");
        announce(functions, "", loggingOn, &why);
        return NULL;
    }
    copy_name(it->name, name);
    it->functions = *functions;
    it->logging = loggingOn;
    begin(it);
    if (fmuType != fmi2CoSimulation) {
        add(&why, "fmi2Instantiate is refused: this FMU is for co-simulation only");
    } else if (!fmuGUID || strcmp(fmuGUID, MODEL_GUID)) {
        add(&why, "fmi2Instantiate is refused: the GUID must be " MODEL_GUID ", that of modelDescription.xml");
    }
    if (!why.length) return it;
    say(it, &why);
    free(it);
    return NULL;
}

void fmi2FreeInstance(fmi2Component component) { free(component); }

/* Every message is of the category logStatusError. */
fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    ENTER(ANY);
    if (nCategories) NEED(categories);
    it->logging = loggingOn && nCategories == 0;
    for (size_t i = 0; i < nCategories; i++) {
        const char *category = categories[i] ? categories[i] : "";
        it->logging |= loggingOn && (!strcmp(category, "logStatusError") || !strcmp(category, "logAll"));
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

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    ENTER(INITIALISING);
    bool good = settle(it) && !it->state.failed;
    it->state.phase = RUNNING;
    return good ? fmi2OK : fmi2Error;
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

/* One communication step, which must begin at the present point and end by the stop time.  An importer's times are sums
 * at the size of the start, so that near zero they may be off by more than the last place of the time itself. */
static bool advance_by(Instance *it, double t, double h)
{
    Model *model = &it->state.model;
    double now = model->solver.t, stop = model->solver.step.t_end, end = t + h;
    double size = greater(greater(fabs(it->state.start_time), fabs(now)), fabs(end));
    bool fault = false, begins_here = fabs(t - now) <= 1e-6 * h + 4e-15 * size;
    int64_t status;
    if (fabs(end - model->solver.step.t1) <= 1e-15 * size && fabs(end) < INFINITY) {
        end = model->solver.step.t1; /* the end of an internal step, but for the rounding of the sum */
    } else if (stop < end && end < INFINITY && end <= stop + 1e-6 * h + 1e-11 * size) {
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
    if (state->failed) return fmi2Error;
    if ((state->changed || state->refusals) && !settle(it)) return fmi2Error;
    return advance_by(it, currentCommunicationPoint, communicationStepSize) ? fmi2OK : fmi2Error;
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind s, fmi2Real *value)
{
    ENTER(ANY);
    NEED(value);
    if (s != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = it->state.phase & SETTING_UP ? NAN : it->state.model.solver.t;
    return fmi2OK;
}

/* The motion never ends by itself. */
fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind s, fmi2Boolean *value)
{
    ENTER(ANY);
    NEED(value);
    if (s != fmi2Terminated) return fmi2Discard;
    *value = fmi2False;
    return fmi2OK;
}

/* ---- state */

static fmi2Status refuse_state(const Instance *it)
{
    return refuse(it, "a saved state", " is refused: it is not, to the last bit, one that this very FMU wrote; save a "
                                       "state anew and pass it on unchanged");
}

/* Keep a state in memory, in place of an older one if there is one. */
static fmi2Status keep(const Instance *it, const State *state, fmi2FMUstate *FMUstate, const char *function)
{
    if (*FMUstate && !is_ours(*FMUstate)) return refuse_state(it);
    if (!*FMUstate && !(*FMUstate = malloc(sizeof(Sealed)))) return refuse(it, function, " failed: no memory is left");
    seal(*FMUstate, state);
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *FMUstate)
{
    ENTER(ANY);
    NEED(FMUstate);
    return keep(it, &it->state, FMUstate, __func__);
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate FMUstate)
{
    ENTER(ANY);
    const State *state = unsealed(FMUstate);
    if (!state) return refuse_state(it);
    memcpy(&it->state, state, sizeof *state);
    it->observed = false;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *FMUstate)
{
    ENTER(ANY);
    if (!FMUstate || !*FMUstate) return fmi2OK;
    if (!is_ours(*FMUstate)) return refuse_state(it);
    free(*FMUstate);
    *FMUstate = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate FMUstate, size_t *size)
{
    ENTER(ANY);
    NEED(size);
    if (!is_ours(FMUstate)) return refuse_state(it);
    *size = sizeof(Sealed);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size)
{
    ENTER(ANY);
    NEED(serializedState);
    if (!unsealed(FMUstate)) return refuse_state(it);
    if (size < sizeof(Sealed)) return refuse(it, __func__, " is refused: a state does not fit into so few bytes");
    memset(serializedState, 0, size);
    memcpy(serializedState, FMUstate, sizeof(Sealed));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate)
{
    ENTER(ANY);
    NEED(serializedState);
    NEED(FMUstate);
    if (size != sizeof(Sealed)) return refuse_state(it);
    Sealed *sealed = malloc(sizeof *sealed); /* for bytes may lie where a state cannot */
    if (!sealed) return refuse(it, __func__, " failed: no memory is left");
    memcpy(sealed, serializedState, size);
    const State *state = unsealed(sealed);
    fmi2Status status = state ? keep(it, state, FMUstate, __func__) : refuse_state(it);
    free(sealed);
    return status;
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
