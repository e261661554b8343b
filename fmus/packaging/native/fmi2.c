/* FMI 2.0, co-simulation and model exchange, of the model in model.h: calls.h and instance.h say what a call does. */
#define _POSIX_C_SOURCE 200809L /* beside C99: signal masks */

#include "fmi2Functions.h"

typedef fmi2CallbackFunctions Host;
typedef fmi2Status Status;
typedef fmi2Component Handle;
typedef fmi2Boolean Boolean;
typedef fmi2Byte Byte;
typedef fmi2String Word;
typedef fmi2FMUstate Saved;

#define FMI(name) fmi2##name
#define OF_STATE(before, after) fmi2##before##FMUstate##after
#define DESERIALIZE fmi2DeSerializeFMUstate

#include "calls.h"

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
    int running = fmuType == fmi2ModelExchange ? EXCHANGING : STEPPING;
    return instantiate(instanceName, fmuGUID, functions ? functions : &silent, running, loggingOn, __func__);
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    ENTER(component, NEW);
    bool fault = false;
    call_sequence_set_experiment(&it->state.run, startTime, stopTimeDefined ? stopTime : INFINITY, toleranceDefined ? tolerance : 0.0,
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
    if (exchanges(state)) return refuse(it, NOT_SUPPORTED, __func__, "");
    bool fault = false;
    if (nvr && (!vr || !order || !value)) return refuse(it, NULL_POINTER, __func__, "vr, order or value");
    for (size_t i = 0; i < nvr; i++) {
        bool has_any = vr[i] < VARIABLES && variables[vr[i]].order != NO_SLOPE;
        if (has_any && 1 <= order[i] && order[i] <= MAX_INPUT_ORDER && isfinite(value[i])) continue;
        return refuse_call(it, NO_INPUT_DERIVATIVE, &(Call){.function = __func__, .reference = vr[i]});
    }
    for (size_t i = 0; i < nvr && !fault; i++) {
        const Variable *variable = &variables[vr[i]];
        int64_t *highest = order_of(state, variable);
        double *derivative = (double *)((char *)&state->model + variable->derivatives) + order[i];
        if (*derivative == value[i] && *highest <= order[i]) continue; /* it stays what it is */
        call_sequence_note_change(&state->run, &state->model, &fault);
        *derivative = value[i];
        if (*highest < order[i]) *highest = order[i];
        state->run.outputs_current = false;
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
    const struct ModelExchange *exchange = &it->state.model.model_exchange;
    *eventInfo = (fmi2EventInfo){.terminateSimulation = status != fmi2OK,
                                 .nominalsOfContinuousStatesChanged = exchange->nominals_changed,
                                 .valuesOfContinuousStatesChanged = exchange->states_changed,
                                 .nextEventTimeDefined = exchange->t_next_event < INFINITY,
                                 .nextEventTime = exchange->t_next_event};
    return status;
}

TELLING(Derivatives, rates, STATES)

/* ---- directional derivatives */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    ENTER(component, ANY);
    return directional(it, vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown, dvUnknown, __func__);
}

/* ---- what this FMU does not offer, as its description says */

NOT_OFFERED_HERE(CancelStep, Handle instance)

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
