/* FMI 2.0 co-simulation of the model in model.h.
 *
 * Every call does what it does in the Python FMU of the same model, by the same rules (rules_... in model.h) and with
 * the same sentences: a value that cannot be used is remembered and told by the next step; a run that cannot begin or
 * go on answers fmi2Error, and every calculated Real reads NaN from then on.  On top, calls out of order, wrong
 * references and missing addresses are refused: such a call changes nothing.
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
        if (instance->state.run.phase == i) add(&why, names[i]);
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
    tell_call(&text, NO_VARIABLE, reference, type);
    say(instance, &text);
    return fmi2Error;
}

/* Phases as bits. */
enum { NEW = 1 << INSTANTIATED, SETTING_UP = NEW | 1 << INITIALISING, ALIVE = SETTING_UP | 1 << RUNNING };
enum { ANY = ALIVE | 1 << TERMINATED };

/* The instance, if the call is allowed in its phase. */
#define ENTER(phases)         \
    Instance *it = component; \
    if (!it || !(1 << it->state.run.phase & (phases))) return refuse_order(it, (phases), __func__)

/* An address that the call cannot do without. */
#define NEED(address) \
    if (!(address)) return refuse(it, __func__, " is refused: an address is missing, " #address " is NULL")

/* ---- values */

/* The refused value that came first. */
static const Refusal *refused(const State *state)
{
    const Refusal *first = NULL, *end = state->refused + VARIABLES;
    for (const Refusal *refusal = state->refused; refusal < end; refusal++) {
        if (refusal->reason != OK && (!first || refusal->turn < first->turn)) first = refusal;
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
    it->state.run.failed = true;
    it->state.run.observed = false;
    silence(&it->state.model);
    say(it, text);
}

/* Fail for the reason that the rules give, in a communication step of h from t. */
static fmi2Status give_up(Instance *it, int64_t status, double t, double h)
{
    const State *state = &it->state;
    Text text = {0};
    if (status == FAILED) return fmi2Error; /* which has been told */
    if (status == BAD_VALUE) {
        const Refusal *first = refused(state);
        tell_value(&text, first->reason, &variables[first - state->refused], first->value);
    } else {
        tell_status(&text, status, &state->run, &state->model, t, h);
    }
    fail(it, &text);
    return fmi2Error;
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

/* Make the values ready to be read; fmi2Discard after a fault, which is where Python would raise. */
static fmi2Status ready(Instance *it, bool is_real, const fmi2ValueReference vr[], size_t nvr, const void *value,
                        const char *function)
{
    State *state = &it->state;
    bool reported = false, ahead = false, fault = false;
    if (!vr || !value) return check(it, is_real, vr, nvr, value, function);
    for (size_t i = 0; i < nvr; i++) {
        if (!is_one(vr[i], is_real)) return check(it, is_real, vr, nvr, value, function);
        reported |= variables[vr[i]].is_reported;
        ahead |= vr[i] == T_NEXT;
    }
    if (!state->run.observed && !state->run.failed) {
        int64_t status = rules_observe(&state->run, &state->model, &fault);
        if (status == DIVERGED) fault = true;
        else if (status != OK) silence(&state->model);
    }
    if (reported && state->run.observed && !fault) rules_report(&state->model, ahead, &fault);
    if (!fault) return fmi2OK;
    give_up(it, DIVERGED, NAN, NAN);
    return fmi2Discard;
}

/* As much of a count as an fmi2Integer can hold. */
static fmi2Integer integer_of(double value) { return value < 2147483647.0 ? (fmi2Integer)value : 2147483647; }

/* Take over a value, or remember that it cannot be used.  False after a fault. */
static bool write_one(Instance *it, fmi2ValueReference reference, double value)
{
    State *state = &it->state;
    const Variable *variable = &variables[reference];
    Refusal *refusal = &state->refused[reference];
    bool allowed = accepts(variable, value), fault = false;
    if (value == value_of(&state->model, variable) && refusal->reason == OK) return true;
    state->run.observed = false;
    state->run.refused -= refusal->reason != OK;
    refusal->reason = rules_reason(&state->run, variable->is_calculated, variable->is_fixed, allowed, &fault);
    if (refusal->reason != OK) {
        state->run.refused++;
        refusal->value = value;
        refusal->turn = ++state->turns;
        return true;
    }
    rules_change(&state->run, &state->model, &fault);
    if (fault) {
        give_up(it, DIVERGED, NAN, NAN);
        return false;
    }
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
    ENTER(ALIVE);
    if (check(it, true, vr, nvr, value, __func__)) return fmi2Error;
    for (size_t i = 0; i < nvr && write_one(it, vr[i], value[i]); i++) continue;
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    ENTER(ALIVE);
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
    ENTER(ALIVE);
    (void)value;
    return refuse_all(it, vr, nvr, "Boolean");
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    ENTER(ALIVE);
    (void)value;
    return refuse_all(it, vr, nvr, "String");
}

/* ---- from instantiation to the end */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

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
    memcpy(&it->state, &initial, sizeof initial);
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
    ENTER(NEW);
    bool fault = false;
    rules_setup(&it->state.run, startTime, stopTimeDefined ? stopTime : INFINITY, toleranceDefined ? tolerance : 0.0,
                &fault);
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    ENTER(NEW);
    it->state.run.phase = INITIALISING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    ENTER(1 << INITIALISING);
    bool fault = false;
    int64_t status = rules_begin(&it->state.run, &it->state.model, &fault);
    return status == OK && !fault ? fmi2OK : give_up(it, fault ? DIVERGED : status, NAN, NAN);
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    ENTER(1 << RUNNING);
    it->state.run.phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    ENTER(ANY);
    memcpy(&it->state, &initial, sizeof initial);
    return fmi2OK;
}

/* ---- steps */

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    ENTER(1 << RUNNING);
    State *state = &it->state;
    double t = currentCommunicationPoint, h = communicationStepSize;
    bool fault = false;
    int64_t status = rules_step(&state->run, &state->model, t, h, &fault);
    (void)noSetFMUStatePriorToCurrentPoint;
    return status == OK && !fault ? fmi2OK : give_up(it, fault ? DIVERGED : status, t, h);
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind s, fmi2Real *value)
{
    ENTER(ANY);
    NEED(value);
    if (s != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = it->state.run.phase < RUNNING ? NAN : it->state.model.solver.t;
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
    Text text = {0};
    tell_call(&text, FOREIGN_STATE, 0, "");
    say(it, &text);
    return fmi2Error;
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
    it->state.run.observed = false; /* here and there, outputs are calculated anew */
    return keep(it, &it->state, FMUstate, __func__);
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate FMUstate)
{
    ENTER(ANY);
    const State *state = unsealed(FMUstate);
    if (!state) return refuse_state(it);
    memcpy(&it->state, state, sizeof *state);
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
