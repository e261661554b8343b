/* The FMI 2.0 interface of the model in model.h, for co-simulation and model exchange. The functions that both versions
 * of FMI share are in common_functions.h, their implementation is in instance.h. */
#define _POSIX_C_SOURCE 200809L /* for signal masks, which C99 does not have */

#include "fmi2Functions.h"

typedef fmi2CallbackFunctions Host;
typedef fmi2Status Status;
typedef fmi2Component Handle;
typedef fmi2Boolean Boolean;
typedef fmi2Byte Byte;
typedef fmi2String String;
typedef fmi2FMUstate StateHandle;

#define FMI(name) fmi2##name
#define STATE_FUNCTION(before, after) fmi2##before##FMUstate##after
#define DESERIALIZE_FUNCTION fmi2DeSerializeFMUstate

#include "common_functions.h"

static const FmiType REAL = {"Real", true}, INTEGER = {"Integer", false};

/* The logger interprets the message as a printf format, so escape percent signs. */
static void log_to_host(const Host *host, const char *name, Status status, const char *category, const char *message)
{
    TextBuffer format = {0};
    if (!host->logger) return;
    for (const char *c = message; *c; c++) {
        char escaped[3] = {*c, *c == '%' ? '%' : '\0', '\0'};
        append(&format, escaped);
    }
    host->logger(host->componentEnvironment, name, status, category, format.buffer);
}

/* ---- life cycle */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    static const fmi2CallbackFunctions no_callbacks = {0};
    (void)fmuResourceLocation, (void)visible;
    int simulation_phases = fmuType == fmi2ModelExchange ? IN_MODEL_EXCHANGE : IN_STEP_MODE;
    const Host *host = functions ? functions : &no_callbacks;
    return instantiate(instanceName, fmuGUID, host, simulation_phases, loggingOn, __func__);
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    REQUIRE_PHASE(component, IN_INSTANTIATED);
    return set_experiment(self, startTime, stopTimeDefined ? stopTime : INFINITY, toleranceDefined ? tolerance : 0.0);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    REQUIRE_PHASE(component, IN_INSTANTIATED);
    self->state.run.phase = INITIALISING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    REQUIRE_PHASE(component, 1 << INITIALISING);
    return begin_run(self, is_model_exchange(&self->state));
}

/* ---- values */

/* An integer variable, limited to the range of fmi2Integer. */
static fmi2Integer saturated_integer(const Instance *self, fmi2ValueReference reference)
{
    int64_t value = read_integer(self, reference);
    return value < 2147483647 ? (fmi2Integer)value : 2147483647;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    REQUIRE_PHASE(component, IN_ANY_PHASE);
    READ_VALUES(self, &REAL, vr, nvr, value, read_real);
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    REQUIRE_PHASE(component, IN_ANY_PHASE);
    READ_VALUES(self, &INTEGER, vr, nvr, value, saturated_integer);
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    REQUIRE_PHASE(component, BEFORE_TERMINATION);
    WRITE_VALUES(self, &REAL, vr, nvr, value);
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    REQUIRE_PHASE(component, BEFORE_TERMINATION);
    WRITE_VALUES(self, &INTEGER, vr, nvr, value);
}

/* There are no Boolean or String variables. */
#define DEFINE_EMPTY_ACCESSORS(TYPE)                                                                                 \
    fmi2Status fmi2Get##TYPE(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2##TYPE value[]) \
    {                                                                                                                \
        REQUIRE_PHASE(component, IN_ANY_PHASE);                                                                      \
        (void)value;                                                                                                 \
        REFUSE_REFERENCES(self, vr, nvr, #TYPE);                                                                     \
    }                                                                                                                \
    fmi2Status fmi2Set##TYPE(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,                     \
                             const fmi2##TYPE value[])                                                               \
    {                                                                                                                \
        REQUIRE_PHASE(component, BEFORE_TERMINATION);                                                                \
        (void)value;                                                                                                 \
        REFUSE_REFERENCES(self, vr, nvr, #TYPE);                                                                     \
    }

DEFINE_EMPTY_ACCESSORS(Boolean)
DEFINE_EMPTY_ACCESSORS(String)

/* ---- steps */

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    REQUIRE_PHASE(component, IN_STEP_MODE);
    (void)noSetFMUStatePriorToCurrentPoint;
    return do_step(self, currentCommunicationPoint, communicationStepSize);
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind s, fmi2Real *value)
{
    REQUIRE_PHASE(component, IN_ANY_PHASE);
    REQUIRE_ADDRESS(value);
    if (s != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = self->state.run.phase < RUNNING ? NAN : current_time(&self->state.run);
    return fmi2OK;
}

/* The model never terminates the simulation. */
fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind s, fmi2Boolean *value)
{
    REQUIRE_PHASE(component, IN_ANY_PHASE);
    REQUIRE_ADDRESS(value);
    if (s != fmi2Terminated) return fmi2Discard;
    *value = fmi2False;
    return fmi2OK;
}

/* Set first derivatives of inputs at the current point. Each input is linear in time until it is set again. */
fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    REQUIRE_PHASE(component, IN_INSTANTIATED | 1 << INITIALISING | IN_STEP_MODE);
    State *state = &self->state;
    if (is_model_exchange(state)) return refuse(self, NOT_SUPPORTED, __func__, "");
    bool fault = false;
    if (nvr && (!vr || !order || !value)) return refuse(self, NULL_POINTER, __func__, "vr, order or value");
    for (size_t i = 0; i < nvr; i++) {
        bool has_derivative = vr[i] < VARIABLES && variables[vr[i]].derivatives_offset != NO_OFFSET;
        if (has_derivative && order[i] == 1 && isfinite(value[i])) continue;
        return refuse_call(self, NO_INPUT_DERIVATIVE, &(Call){.function = __func__, .reference = vr[i]});
    }
    for (size_t i = 0; i < nvr && !fault; i++) {
        const Variable *variable = &variables[vr[i]];
        double *derivative = (double *)((char *)state + variable->derivatives_offset) + 1;
        if (*derivative == value[i]) continue; /* unchanged */
        call_sequence_note_change(&state->run, &state->model, &fault);
        *derivative = value[i];
        *input_order(state, variable) = 1;
        state->run.outputs_current = false;
    }
    return finish_call(self, OK, fault, NAN, NAN);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    REQUIRE_PHASE(component, IN_STEP_MODE | 1 << TERMINATED);
    return read_output_derivatives(self, vr, nvr, order, value, __func__);
}

/* ---- model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component component)
{
    REQUIRE_PHASE(component, IN_MODEL_EXCHANGE);
    self->state.run.phase = EVENT;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *eventInfo)
{
    REQUIRE_PHASE(component, 1 << EVENT);
    REQUIRE_ADDRESS(eventInfo);
    fmi2Status status = handle_event(self);
    const struct ExchangeBuffers *exchange = &self->state.run.model_exchange;
    *eventInfo = (fmi2EventInfo){.terminateSimulation = status != fmi2OK,
                                 .nominalsOfContinuousStatesChanged = exchange->nominals_changed,
                                 .valuesOfContinuousStatesChanged = exchange->states_changed,
                                 .nextEventTimeDefined = exchange->t_next_event < INFINITY,
                                 .nextEventTime = exchange->t_next_event};
    return status;
}

DEFINE_VALUES_GETTER(Derivatives, rates, STATES)

/* ---- directional derivatives */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    REQUIRE_PHASE(component, IN_ANY_PHASE);
    return get_directional_derivative(self, vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown, dvUnknown, __func__);
}

/* ---- functions that this FMU does not support, according to its model description */

DEFINE_NOT_OFFERED(CancelStep, (void)0, Handle instance)

/* fmi2DoStep never returns fmi2Pending, so there is no status to report. */
#define DEFINE_NO_STATUS(NAME, TYPE)                                                       \
    fmi2Status fmi2Get##NAME(fmi2Component component, const fmi2StatusKind s, TYPE *value) \
    {                                                                                      \
        REQUIRE_PHASE(component, IN_ANY_PHASE);                                            \
        (void)s, (void)value;                                                              \
        return fmi2Discard;                                                                \
    }

DEFINE_NO_STATUS(Status, fmi2Status)
DEFINE_NO_STATUS(IntegerStatus, fmi2Integer)
DEFINE_NO_STATUS(StringStatus, fmi2String)
