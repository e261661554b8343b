/* FMI 2.0, co-simulation and model exchange, of the model in model.h: instance.h says what a call does. */
#define _POSIX_C_SOURCE 200809L /* beside C99: signal masks */

#include "fmi2Functions.h"

typedef fmi2CallbackFunctions Host;
typedef fmi2Status Status;

#include "instance.h"

static const Type REAL = {"Real", true}, INTEGER = {"Integer", false};

/* The message is taken for a printf format. */
static void log_to(const Host *host, const char *name, const char *sentence)
{
    Text format = {0};
    if (!host->logger) return;
    for (const char *c = sentence; *c; c++) {
        char piece[3] = {*c, *c == '%' ? '%' : '\0', '\0'};
        add(&format, piece);
    }
    host->logger(host->componentEnvironment, name, fmi2Error, "logStatusError", format.line);
}

/* ---- from instantiation to the end */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    static const fmi2CallbackFunctions silent = {0};
    (void)fmuResourceLocation, (void)visible;
    if (!functions) functions = &silent;
    const char *name = instanceName ? instanceName : "";
    int running = fmuType == fmi2ModelExchange ? EXCHANGING : STEPPING;
    Instance *it = instantiate(name, functions, running, loggingOn, __func__);
    if (it && (!fmuGUID || strcmp(fmuGUID, MODEL_GUID))) return dismissed(it, WRONG_TOKEN, __func__, MODEL_GUID);
    return it;
}

void fmi2FreeInstance(fmi2Component component) { free(component); }

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    ENTER(component, ANY);
    if (nCategories) NEED(categories);
    return choose_log(it, loggingOn, nCategories, categories);
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    ENTER(component, NEW);
    bool fault = false;
    rules_setup(&it->state.run, startTime, stopTimeDefined ? stopTime : INFINITY, toleranceDefined ? tolerance : 0.0,
                &fault);
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    ENTER(component, NEW);
    it->state.run.phase = INITIALISING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    ENTER(component, 1 << INITIALISING);
    return begin(it, exchanges(&it->state));
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    ENTER(component, BEGUN);
    it->state.run.phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    ENTER(component, ANY);
    fresh(it);
    return fmi2OK;
}

/* ---- values */

/* As much of a count as an fmi2Integer can hold. */
static fmi2Integer held(const Instance *it, fmi2ValueReference reference)
{
    int64_t value = integer_at(it, reference);
    return value < 2147483647 ? (fmi2Integer)value : 2147483647;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    ENTER(component, ANY);
    READ(it, &REAL, vr, nvr, value, real_at, NAN);
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    ENTER(component, ANY);
    READ(it, &INTEGER, vr, nvr, value, held, 0);
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    ENTER(component, LIVING);
    WRITE(it, &REAL, vr, nvr, value);
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    ENTER(component, LIVING);
    WRITE(it, &INTEGER, vr, nvr, value);
}

/* No variable is a Boolean or a String. */
#define NO_VARIABLES_OF(TYPE)                                                                                         \
    fmi2Status fmi2Get##TYPE(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2##TYPE value[])  \
    {                                                                                                                 \
        ENTER(component, ANY);                                                                                        \
        (void)value;                                                                                                  \
        REFUSE_ALL(it, vr, nvr, #TYPE);                                                                               \
    }                                                                                                                 \
    fmi2Status fmi2Set##TYPE(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,                      \
                             const fmi2##TYPE value[])                                                                \
    {                                                                                                                 \
        ENTER(component, LIVING);                                                                                     \
        (void)value;                                                                                                  \
        REFUSE_ALL(it, vr, nvr, #TYPE);                                                                               \
    }

NO_VARIABLES_OF(Boolean)
NO_VARIABLES_OF(String)

/* ---- steps */

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    ENTER(component, STEPPING);
    (void)noSetFMUStatePriorToCurrentPoint;
    return step_by(it, currentCommunicationPoint, communicationStepSize);
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind s, fmi2Real *value)
{
    ENTER(component, ANY);
    NEED(value);
    if (s != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = it->state.run.phase < RUNNING ? NAN : it->state.model.solver.t;
    return fmi2OK;
}

/* The motion never ends by itself. */
fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind s, fmi2Boolean *value)
{
    ENTER(component, ANY);
    NEED(value);
    if (s != fmi2Terminated) return fmi2Discard;
    *value = fmi2False;
    return fmi2OK;
}

/* What the inputs are to be from the present point on; each derivative goes its way until it is set anew. */
fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    ENTER(component, NEW | 1 << INITIALISING | STEPPING);
    State *state = &it->state;
    bool fault = false;
    if (nvr && (!vr || !order || !value)) return refuse(it, NO_ADDRESS, __func__, "vr, order or value");
    for (size_t i = 0; i < nvr; i++) {
        bool has_any = vr[i] < VARIABLES && variables[vr[i]].order != NO_SLOPE;
        if (has_any && 1 <= order[i] && order[i] <= HIGHEST && isfinite(value[i])) continue;
        return refuse_call(it, NO_COURSE, &(Call){.function = __func__, .reference = vr[i]});
    }
    for (size_t i = 0; i < nvr && !fault; i++) {
        const Variable *variable = &variables[vr[i]];
        int64_t *highest = order_of(state, variable);
        double *derivative = (double *)((char *)&state->model + variable->derivatives) + order[i];
        if (*derivative == value[i] && *highest <= order[i]) continue; /* it stays what it is */
        rules_change(&state->run, &state->model, &fault);
        *derivative = value[i];
        if (*highest < order[i]) *highest = order[i];
        state->run.observed = false;
    }
    return judged_by(it, OK, fault, NAN, NAN);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    ENTER(component, STEPPING | 1 << TERMINATED);
    return read_rates(it, vr, nvr, order, value, __func__);
}

/* ---- model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component component)
{
    ENTER(component, EXCHANGING);
    it->state.run.phase = EVENT;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *eventInfo)
{
    ENTER(component, 1 << EVENT);
    NEED(eventInfo);
    fmi2Status status = handle(it);
    const struct Exchange *exchange = &it->state.model.exchange;
    *eventInfo = (fmi2EventInfo){.terminateSimulation = status != fmi2OK,
                                 .nominalsOfContinuousStatesChanged = exchange->rescaled,
                                 .valuesOfContinuousStatesChanged = exchange->jumped,
                                 .nextEventTimeDefined = exchange->due < INFINITY,
                                 .nextEventTime = exchange->due};
    return status;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component)
{
    ENTER(component, 1 << EVENT);
    it->state.run.phase = CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
{
    ENTER(component, 1 << CONTINUOUS);
    NEED(enterEventMode);
    NEED(terminateSimulation);
    (void)noSetFMUStatePriorToCurrentPoint;
    *enterEventMode = *terminateSimulation = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real time)
{
    ENTER(component, EXCHANGING);
    return move_to(it, time);
}

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real x[], size_t nx)
{
    ENTER(component, 1 << CONTINUOUS);
    return put(it, x, nx, __func__);
}

#define TELLING(NAME, found, COUNT)                                                 \
    fmi2Status fmi2Get##NAME(fmi2Component component, fmi2Real value[], size_t n)   \
    {                                                                               \
        ENTER(component, ANY);                                                      \
        TELL(it, found, COUNT, value, n);                                           \
    }

TELLING(Derivatives, rates, STATES)
TELLING(EventIndicators, indicators, INDICATORS)
TELLING(ContinuousStates, states, STATES)
TELLING(NominalsOfContinuousStates, nominals, STATES)

/* ---- directional derivatives */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    ENTER(component, ANY);
    return directional(it, vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown, dvUnknown, __func__);
}

/* ---- state */

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *FMUstate)
{
    ENTER(component, ANY);
    NEED(FMUstate);
    return save(it, FMUstate, __func__);
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate FMUstate)
{
    ENTER(component, ANY);
    return restore(it, FMUstate);
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *FMUstate)
{
    ENTER(component, ANY);
    return forget(it, FMUstate);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate FMUstate, size_t *size)
{
    ENTER(component, ANY);
    NEED(size);
    return measure(it, FMUstate, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size)
{
    ENTER(component, ANY);
    NEED(serializedState);
    return serialize(it, FMUstate, serializedState, size, __func__);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate)
{
    ENTER(component, ANY);
    NEED(serializedState);
    NEED(FMUstate);
    return deserialize(it, serializedState, size, FMUstate, __func__);
}

/* ---- what this FMU does not offer, as its description says */

fmi2Status fmi2CancelStep(fmi2Component component)
{
    ENTER(component, ANY);
    return refuse(it, NOT_OFFERED, __func__, "");
}

/* Every step is done when fmi2DoStep returns, so there is nothing more to tell. */
#define NOTHING_TO_TELL(NAME, TYPE)                                                           \
    fmi2Status fmi2Get##NAME(fmi2Component component, const fmi2StatusKind s, TYPE *value)    \
    {                                                                                         \
        ENTER(component, ANY);                                                                \
        (void)s, (void)value;                                                                 \
        return fmi2Discard;                                                                   \
    }

NOTHING_TO_TELL(Status, fmi2Status)
NOTHING_TO_TELL(IntegerStatus, fmi2Integer)
NOTHING_TO_TELL(StringStatus, fmi2String)
