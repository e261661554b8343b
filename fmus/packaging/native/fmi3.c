/* The FMI 3.0 interface of the model in model.h, for co-simulation and model exchange. The functions that both versions
 * of FMI share are in common_functions.h, their implementation is in instance.h. */
#define _POSIX_C_SOURCE 200809L /* for signal masks, which C99 does not have */

#include "fmi3Functions.h"

typedef struct {
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback intermediate_update; /* called after every internal step, unless NULL */
    bool event_mode_used;
    bool early_return_allowed;
} Host;
typedef fmi3Status Status;
typedef fmi3Instance Handle;
typedef fmi3Boolean Boolean;
typedef fmi3Byte Byte;
typedef fmi3String String;
typedef fmi3FMUState StateHandle;

#define FMI(name) fmi3##name
#define STATE_FUNCTION(before, after) fmi3##before##FMUState##after
#define DESERIALIZE_FUNCTION fmi3DeserializeFMUState

#include "common_functions.h"

static const FmiType FLOAT64 = {"Float64", true}, INT64 = {"Int64", false};

static void log_to_host(const Host *host, const char *name, Status status, const char *category, const char *message)
{
    (void)name;
    if (host->log) host->log(host->environment, status, category, message);
}

/* ---- life cycle */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage)
{
    Host host = {.environment = instanceEnvironment, .log = logMessage, .event_mode_used = true};
    (void)resourcePath, (void)visible;
    return instantiate(instanceName, instantiationToken, &host, IN_MODEL_EXCHANGE, loggingOn, __func__);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken,
                                         fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                         fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                         const fmi3ValueReference requiredIntermediateVariables[],
                                         size_t nRequiredIntermediateVariables,
                                         fmi3InstanceEnvironment instanceEnvironment,
                                         fmi3LogMessageCallback logMessage,
                                         fmi3IntermediateUpdateCallback intermediateUpdate)
{
    Host host = {instanceEnvironment, logMessage, intermediateUpdate, eventModeUsed, earlyReturnAllowed};
    (void)resourcePath, (void)visible;
    /* All variables are available in intermediate updates. */
    (void)requiredIntermediateVariables, (void)nRequiredIntermediateVariables;
    int simulation_phases =
        IN_STEP_MODE | (intermediateUpdate ? 1 << INTERMEDIATE : 0) | (eventModeUsed ? 1 << EVENT : 0);
    return instantiate(instanceName, instantiationToken, &host, simulation_phases, loggingOn, __func__);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                               fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption)
{
    Host host = {.environment = instanceEnvironment, .log = logMessage};
    (void)resourcePath, (void)visible, (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
    Instance *self = instantiate(instanceName, instantiationToken, &host, IN_STEP_MODE, loggingOn, __func__);
    return self ? refuse_instance(self, NOT_SUPPORTED, __func__, "") : NULL;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    REQUIRE_PHASE(instance, IN_INSTANTIATED);
    double stop = stopTimeDefined ? stopTime : INFINITY;
    if (set_experiment(self, startTime, stop, toleranceDefined ? tolerance : 0.0)) return fmi3Error;
    self->state.run.phase = INITIALISING;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    REQUIRE_PHASE(instance, 1 << INITIALISING);
    return begin_run(self, self->host.event_mode_used);
}

/* ---- discrete variables
 *
 * They may change in event mode only, or at communication points if the importer does not use event mode. In between,
 * they read their last values. */

/* Store the values of the discrete variables. */
static void store_discrete_values(Instance *self)
{
    State *state = &self->state;
    bool fault = false;
    int64_t status = OK;
    if (!state->run.outputs_current && !state->run.has_failed) {
        status = call_sequence_update_outputs(&state->run, &state->model, &fault);
    }
    if (status != OK || fault || state->run.has_failed) return; /* the next step reports it */
    call_sequence_update_statistics(&state->run, &state->model, false, &fault);
    for (int i = 0; i < DISCRETE; i++) {
        state->discrete_values[i] = variable_value(state, &variables[discrete_variables[i]]);
    }
}

/* Return the stored value of a discrete variable that may not change now, otherwise NULL. */
static const double *stored_value(const Instance *self, uint32_t reference)
{
    const State *state = &self->state;
    int64_t phase = state->run.phase;
    bool between_events = self->host.event_mode_used && (phase == RUNNING || phase == TERMINATED);
    if (state->run.has_failed || is_model_exchange(state) || !(between_events || phase == INTERMEDIATE)) return NULL;
    for (int i = 0; i < DISCRETE; i++) {
        if (discrete_variables[i] == reference) return &state->discrete_values[i];
    }
    return NULL;
}

static double read_float64(const Instance *self, uint32_t reference)
{
    const double *stored = stored_value(self, reference);
    return stored ? *stored : read_real(self, reference);
}

static int64_t read_int64(const Instance *self, uint32_t reference)
{
    const double *stored = stored_value(self, reference);
    return stored ? (int64_t)*stored : read_integer(self, reference);
}

/* ---- values */

#define REQUIRE_LENGTH \
    if (nValues != nValueReferences) return refuse(self, WRONG_LENGTH, __func__, "the number of values")

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Float64 values[], size_t nValues)
{
    REQUIRE_PHASE(instance, IN_READABLE_PHASE);
    REQUIRE_LENGTH;
    READ_VALUES(self, &FLOAT64, valueReferences, nValueReferences, values, read_float64);
}

fmi3Status fmi3GetInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Int64 values[], size_t nValues)
{
    REQUIRE_PHASE(instance, IN_READABLE_PHASE);
    REQUIRE_LENGTH;
    READ_VALUES(self, &INT64, valueReferences, nValueReferences, values, read_int64);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Float64 values[], size_t nValues)
{
    REQUIRE_PHASE(instance, BEFORE_TERMINATION | 1 << INTERMEDIATE);
    REQUIRE_LENGTH;
    for (size_t i = 0; self->state.run.phase == INTERMEDIATE && valueReferences && i < nValueReferences; i++) {
        uint32_t reference = valueReferences[i];
        bool is_input = reference < VARIABLES && variables[reference].is_state_or_input &&
                        !variables[reference].is_calculated;
        if (!is_input) return refuse_phase(self, BEFORE_TERMINATION, __func__);
    }
    WRITE_VALUES(self, &FLOAT64, valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Int64 values[], size_t nValues)
{
    REQUIRE_PHASE(instance, BEFORE_TERMINATION);
    REQUIRE_LENGTH;
    WRITE_VALUES(self, &INT64, valueReferences, nValueReferences, values);
}

#define DEFINE_EMPTY_ACCESSORS(TYPE)                                                             \
    fmi3Status fmi3Get##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[],  \
                             size_t nValueReferences, fmi3##TYPE values[], size_t nValues)       \
    {                                                                                            \
        REQUIRE_PHASE(instance, IN_READABLE_PHASE);                                              \
        (void)values, (void)nValues;                                                             \
        REFUSE_REFERENCES(self, valueReferences, nValueReferences, #TYPE);                       \
    }                                                                                            \
    fmi3Status fmi3Set##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[],  \
                             size_t nValueReferences, const fmi3##TYPE values[], size_t nValues) \
    {                                                                                            \
        REQUIRE_PHASE(instance, BEFORE_TERMINATION);                                             \
        (void)values, (void)nValues;                                                             \
        REFUSE_REFERENCES(self, valueReferences, nValueReferences, #TYPE);                       \
    }

DEFINE_EMPTY_ACCESSORS(Float32)
DEFINE_EMPTY_ACCESSORS(Int8)
DEFINE_EMPTY_ACCESSORS(UInt8)
DEFINE_EMPTY_ACCESSORS(Int16)
DEFINE_EMPTY_ACCESSORS(UInt16)
DEFINE_EMPTY_ACCESSORS(Int32)
DEFINE_EMPTY_ACCESSORS(UInt32)
DEFINE_EMPTY_ACCESSORS(UInt64)
DEFINE_EMPTY_ACCESSORS(Boolean)
DEFINE_EMPTY_ACCESSORS(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    REQUIRE_PHASE(instance, IN_READABLE_PHASE);
    (void)valueSizes, (void)values, (void)nValues;
    REFUSE_REFERENCES(self, valueReferences, nValueReferences, "Binary");
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    REQUIRE_PHASE(instance, BEFORE_TERMINATION);
    (void)valueSizes, (void)values, (void)nValues;
    REFUSE_REFERENCES(self, valueReferences, nValueReferences, "Binary");
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Clock values[])
{
    REQUIRE_PHASE(instance, IN_READABLE_PHASE);
    (void)values;
    REFUSE_REFERENCES(self, valueReferences, nValueReferences, "Clock");
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Clock values[])
{
    REQUIRE_PHASE(instance, BEFORE_TERMINATION);
    (void)values;
    REFUSE_REFERENCES(self, valueReferences, nValueReferences, "Clock");
}

/* ---- events */

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    REQUIRE_PHASE(instance, IN_SIMULATION);
    bool fault = false;
    if (!self->host.event_mode_used) return refuse(self, NOT_SUPPORTED, __func__, "");
    if (!is_model_exchange(&self->state)) early_return_complete_event(&self->state.run, &self->state.model, &fault);
    self->state.run.phase = EVENT;
    return fmi3OK;
}

/* Nothing to do: discrete states are evaluated when they are updated or an output is read. */
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    REQUIRE_PHASE(instance, 1 << INITIALISING | 1 << EVENT);
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime)
{
    REQUIRE_PHASE(instance, 1 << EVENT);
    REQUIRE_ADDRESS(discreteStatesNeedUpdate);
    REQUIRE_ADDRESS(terminateSimulation);
    REQUIRE_ADDRESS(nominalsOfContinuousStatesChanged);
    REQUIRE_ADDRESS(valuesOfContinuousStatesChanged);
    REQUIRE_ADDRESS(nextEventTimeDefined);
    REQUIRE_ADDRESS(nextEventTime);
    fmi3Status status = handle_event(self);
    const struct ExchangeBuffers *exchange = &self->state.run.model_exchange;
    *discreteStatesNeedUpdate = false;
    *terminateSimulation = status != fmi3OK;
    *nominalsOfContinuousStatesChanged = exchange->nominals_changed;
    *valuesOfContinuousStatesChanged = exchange->states_changed;
    *nextEventTimeDefined = exchange->t_next_event < INFINITY;
    *nextEventTime = exchange->t_next_event;
    return status;
}

/* ---- co-simulation */

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    REQUIRE_PHASE(instance, 1 << EVENT);
    if (is_model_exchange(&self->state)) return refuse(self, NOT_SUPPORTED, __func__, "");
    store_discrete_values(self);
    self->state.run.phase = RUNNING;
    return fmi3OK;
}

/* Call the importer's intermediate update at the start t of a communication step and after each internal step. It may
 * read values, set inputs from here on and request an early return.
 *
 * The current time may be before t, by what call_sequence_do_step takes for rounding errors of the importer's sums. */
static void call_intermediate_update(Instance *self, double t, bool finished)
{
    const Run *run = &self->state.run; /* its solver counts time from the start of the run */
    struct ExchangeBuffers *exchange = &self->state.run.model_exchange;
    bool is_before_t = current_time(run) < t, return_requested = false;
    double now = is_before_t ? t : current_time(run), return_time = now;
    if (!self->host.intermediate_update) return;
    self->state.run.phase = INTERMEDIATE;
    self->host.intermediate_update(self->host.environment, now, true, true, finished, self->host.early_return_allowed,
                                   &return_requested, &return_time);
    self->state.run.phase = RUNNING;
    if (!self->host.early_return_allowed || !return_requested) return;
    double elapsed = return_time > now || is_before_t ? fmax(return_time, now) - run->solver.start_time : run->solver.t;
    if (elapsed < exchange->step_end && (elapsed > run->solver.t || finished)) exchange->step_end = elapsed;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded,
                      fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    REQUIRE_PHASE(instance, IN_STEP_MODE);
    REQUIRE_ADDRESS(eventHandlingNeeded);
    REQUIRE_ADDRESS(terminateSimulation);
    REQUIRE_ADDRESS(earlyReturn);
    REQUIRE_ADDRESS(lastSuccessfulTime);
    State *state = &self->state;
    const double *now = &state->run.solver.t;
    double t = currentCommunicationPoint, h = communicationStepSize;
    bool fault = false;
    (void)noSetFMUStatePriorToCurrentPoint;
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = false;
    if (!self->host.event_mode_used && !self->host.early_return_allowed && !self->host.intermediate_update) {
        fmi3Status status = do_step(self, t, h);
        *lastSuccessfulTime = current_time(&state->run);
        return status;
    }
    struct ExchangeBuffers *exchange = &state->run.model_exchange;
    bool event_passed = false;
    if (!self->host.event_mode_used) store_discrete_values(self);
    int64_t status = early_return_begin_step(&state->run, &state->model, t, h, &fault);
    double end = exchange->step_end;
    if (status == OK && !fault) call_intermediate_update(self, t, false);
    while (status == OK && !fault && *now < exchange->step_end) {
        status = early_return_next_internal_step(&state->run, &state->model, self->host.event_mode_used, &fault);
        if (status != OK || fault) break;
        event_passed = event_passed || exchange->event_reached;
        call_intermediate_update(self, t, true);
        if (exchange->event_reached && self->host.early_return_allowed && current_time(&state->run) >= t) break;
    }
    if (status == OK && !fault) status = early_return_end_step(&state->run, &state->model, &fault);
    *lastSuccessfulTime = current_time(&state->run);
    if (status == OK && !fault) {
        *lastSuccessfulTime = fmax(*lastSuccessfulTime, t);
        warn_of_inconsistent_rate(self);
        *eventHandlingNeeded = self->host.event_mode_used && event_passed;
        *earlyReturn = *now < end;
    }
    return finish_call(self, status, fault, t, h);
}

/* ---- model exchange */

DEFINE_VALUES_GETTER(ContinuousStateDerivatives, rates, STATES)

#define DEFINE_COUNT_GETTER(NAME, COUNT)                                    \
    fmi3Status fmi3GetNumberOf##NAME(fmi3Instance instance, size_t *number) \
    {                                                                       \
        REQUIRE_PHASE(instance, IN_ANY_PHASE);                              \
        REQUIRE_ADDRESS(number);                                            \
        *number = COUNT;                                                    \
        return fmi3OK;                                                      \
    }

DEFINE_COUNT_GETTER(ContinuousStates, STATES)
DEFINE_COUNT_GETTER(EventIndicators, INDICATORS)

/* ---- derivatives */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                        size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    REQUIRE_PHASE(instance, IN_ANY_PHASE);
    if (nSeed != nKnowns) return refuse(self, WRONG_LENGTH, __func__, "the length of seed");
    if (nSensitivity != nUnknowns) return refuse(self, WRONG_LENGTH, __func__, "the length of sensitivity");
    return get_directional_derivative(self, unknowns, nUnknowns, knowns, nKnowns, seed, sensitivity, __func__);
}

/* Combine one directional derivative per known. */
fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                    size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    REQUIRE_PHASE(instance, IN_ANY_PHASE);
    if (nSeed != nUnknowns) return refuse(self, WRONG_LENGTH, __func__, "the length of seed");
    if (nSensitivity != nKnowns) return refuse(self, WRONG_LENGTH, __func__, "the length of sensitivity");
    if (check_derivative_references(self, unknowns, nUnknowns, knowns, nKnowns, seed, sensitivity, __func__)) {
        return fmi3Error;
    }
    for (size_t k = 0; k < nKnowns; k++) {
        struct Tangent tangent = {0};
        fmi3Status status = evaluate_tangent(self, &knowns[k], 1, &(double){1.0}, &tangent);
        sensitivity[k] = status ? NAN : 0.0;
        for (size_t i = 0; i < nUnknowns; i++) sensitivity[k] += seed[i] * *tangent_value(&tangent, unknowns[i]);
        if (status) return status;
    }
    return fmi3OK;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[],
                                    size_t nValues)
{
    REQUIRE_PHASE(instance, IN_STEP_MODE | 1 << EVENT | 1 << INTERMEDIATE | 1 << TERMINATED);
    REQUIRE_LENGTH;
    return read_output_derivatives(self, valueReferences, nValueReferences, orders, values, __func__);
}

/* ---- functions that this FMU does not support, according to its model description */

typedef const fmi3ValueReference References[];

DEFINE_NOT_OFFERED(EnterConfigurationMode, (void)0, Handle instance)
DEFINE_NOT_OFFERED(ExitConfigurationMode, (void)0, Handle instance)
DEFINE_NOT_OFFERED(GetNumberOfVariableDependencies,
                   ((void)valueReference, (void)nDependencies),
                   Handle instance, fmi3ValueReference valueReference, size_t *nDependencies)
DEFINE_NOT_OFFERED(GetVariableDependencies,
                   ((void)dependent, (void)elementIndicesOfDependent, (void)independents,
                    (void)elementIndicesOfIndependents, (void)dependencyKinds, (void)nDependencies),
                   Handle instance, fmi3ValueReference dependent, size_t elementIndicesOfDependent[],
                   fmi3ValueReference independents[], size_t elementIndicesOfIndependents[],
                   fmi3DependencyKind dependencyKinds[], size_t nDependencies)
DEFINE_NOT_OFFERED(GetIntervalDecimal,
                   ((void)valueReferences, (void)nValueReferences, (void)intervals, (void)qualifiers),
                   Handle instance, References valueReferences, size_t nValueReferences, fmi3Float64 intervals[],
                   fmi3IntervalQualifier qualifiers[])
DEFINE_NOT_OFFERED(GetIntervalFraction,
                   ((void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions, (void)qualifiers),
                   Handle instance, References valueReferences, size_t nValueReferences, fmi3UInt64 counters[],
                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
DEFINE_NOT_OFFERED(GetShiftDecimal,
                   ((void)valueReferences, (void)nValueReferences, (void)shifts),
                   Handle instance, References valueReferences, size_t nValueReferences, fmi3Float64 shifts[])
DEFINE_NOT_OFFERED(GetShiftFraction,
                   ((void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions),
                   Handle instance, References valueReferences, size_t nValueReferences, fmi3UInt64 counters[],
                   fmi3UInt64 resolutions[])
DEFINE_NOT_OFFERED(SetIntervalDecimal,
                   ((void)valueReferences, (void)nValueReferences, (void)intervals),
                   Handle instance, References valueReferences, size_t nValueReferences, const fmi3Float64 intervals[])
DEFINE_NOT_OFFERED(SetIntervalFraction,
                   ((void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions),
                   Handle instance, References valueReferences, size_t nValueReferences, const fmi3UInt64 counters[],
                   const fmi3UInt64 resolutions[])
DEFINE_NOT_OFFERED(SetShiftDecimal,
                   ((void)valueReferences, (void)nValueReferences, (void)shifts),
                   Handle instance, References valueReferences, size_t nValueReferences, const fmi3Float64 shifts[])
DEFINE_NOT_OFFERED(SetShiftFraction,
                   ((void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions),
                   Handle instance, References valueReferences, size_t nValueReferences, const fmi3UInt64 counters[],
                   const fmi3UInt64 resolutions[])
DEFINE_NOT_OFFERED(ActivateModelPartition,
                   ((void)clockReference, (void)activationTime),
                   Handle instance, fmi3ValueReference clockReference, fmi3Float64 activationTime)
