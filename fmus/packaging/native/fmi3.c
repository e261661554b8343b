/* FMI 3.0, co-simulation and model exchange, of the model in model.h: calls.h and instance.h say what a call does. */
#define _POSIX_C_SOURCE 200809L /* beside C99: signal masks */

#include "fmi3Functions.h"

typedef struct {
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback look; /* called in every step, if it is there */
    bool handles;                        /* events of a communication step */
    bool returns;                        /* early */
} Host;
typedef fmi3Status Status;
typedef fmi3Instance Handle;
typedef fmi3Boolean Boolean;
typedef fmi3Byte Byte;
typedef fmi3String Word;
typedef fmi3FMUState Saved;

#define FMI(name) fmi3##name
#define OF_STATE(before, after) fmi3##before##FMUState##after
#define DESERIALIZE fmi3DeserializeFMUState

#include "calls.h"

static const Type FLOAT64 = {"Float64", true}, INT64 = {"Int64", false};

static void log_to(const Host *host, const char *name, const char *sentence)
{
    (void)name;
    if (host->log) host->log(host->environment, fmi3Error, "logStatusError", sentence);
}

/* ---- from instantiation to the end */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage)
{
    Host host = {.environment = instanceEnvironment, .log = logMessage, .handles = true};
    (void)resourcePath, (void)visible;
    return instantiate(instanceName, instantiationToken, &host, EXCHANGING, loggingOn, __func__);
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
    (void)requiredIntermediateVariables, (void)nRequiredIntermediateVariables; /* all can be read then */
    int running = STEPPING | (intermediateUpdate ? 1 << INTERMEDIATE : 0) | (eventModeUsed ? 1 << EVENT : 0);
    return instantiate(instanceName, instantiationToken, &host, running, loggingOn, __func__);
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
    Instance *it = instantiate(instanceName, instantiationToken, &host, STEPPING, loggingOn, __func__);
    return it ? dismissed(it, NOT_SUPPORTED, __func__, "") : NULL;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    ENTER(instance, NEW);
    bool fault = false;
    call_sequence_set_experiment(&it->state.run, startTime, stopTimeDefined ? stopTime : INFINITY, toleranceDefined ? tolerance : 0.0,
                &fault);
    it->state.run.phase = INITIALISING;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    ENTER(instance, 1 << INITIALISING);
    return begin(it, it->host.handles);
}

/* ---- values */

/* Every variable is one number. */
#define ONE_EACH \
    if (nValues != nValueReferences) return refuse(it, WRONG_LENGTH, __func__, "the number of values")

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Float64 values[], size_t nValues)
{
    ENTER(instance, READABLE);
    ONE_EACH;
    READ(it, &FLOAT64, valueReferences, nValueReferences, values, real_at, NAN);
}

fmi3Status fmi3GetInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Int64 values[], size_t nValues)
{
    ENTER(instance, READABLE);
    ONE_EACH;
    READ(it, &INT64, valueReferences, nValueReferences, values, integer_at, 0);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Float64 values[], size_t nValues)
{
    ENTER(instance, LIVING | 1 << INTERMEDIATE);
    ONE_EACH;
    for (size_t i = 0; it->state.run.phase == INTERMEDIATE && valueReferences && i < nValueReferences; i++) {
        uint32_t reference = valueReferences[i];
        bool is_input = reference < VARIABLES && variables[reference].moves && !variables[reference].is_calculated;
        if (!is_input) return refuse_order(it, LIVING, __func__);
    }
    WRITE(it, &FLOAT64, valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Int64 values[], size_t nValues)
{
    ENTER(instance, LIVING);
    ONE_EACH;
    WRITE(it, &INT64, valueReferences, nValueReferences, values);
}

#define NO_VARIABLES_OF(TYPE)                                                                                     \
    fmi3Status fmi3Get##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[],                   \
                             size_t nValueReferences, fmi3##TYPE values[], size_t nValues)                        \
    {                                                                                                             \
        ENTER(instance, READABLE);                                                                                \
        (void)values, (void)nValues;                                                                              \
        REFUSE_ALL(it, valueReferences, nValueReferences, #TYPE);                                                 \
    }                                                                                                             \
    fmi3Status fmi3Set##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[],                   \
                             size_t nValueReferences, const fmi3##TYPE values[], size_t nValues)                  \
    {                                                                                                             \
        ENTER(instance, LIVING);                                                                                  \
        (void)values, (void)nValues;                                                                              \
        REFUSE_ALL(it, valueReferences, nValueReferences, #TYPE);                                                 \
    }

NO_VARIABLES_OF(Float32)
NO_VARIABLES_OF(Int8)
NO_VARIABLES_OF(UInt8)
NO_VARIABLES_OF(Int16)
NO_VARIABLES_OF(UInt16)
NO_VARIABLES_OF(Int32)
NO_VARIABLES_OF(UInt32)
NO_VARIABLES_OF(UInt64)
NO_VARIABLES_OF(Boolean)
NO_VARIABLES_OF(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    ENTER(instance, READABLE);
    (void)valueSizes, (void)values, (void)nValues;
    REFUSE_ALL(it, valueReferences, nValueReferences, "Binary");
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    ENTER(instance, LIVING);
    (void)valueSizes, (void)values, (void)nValues;
    REFUSE_ALL(it, valueReferences, nValueReferences, "Binary");
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Clock values[])
{
    ENTER(instance, READABLE);
    (void)values;
    REFUSE_ALL(it, valueReferences, nValueReferences, "Clock");
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Clock values[])
{
    ENTER(instance, LIVING);
    (void)values;
    REFUSE_ALL(it, valueReferences, nValueReferences, "Clock");
}

/* ---- events */

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    ENTER(instance, BEGUN);
    bool fault = false;
    if (!it->host.handles) return refuse(it, NOT_SUPPORTED, __func__, "");
    if (!exchanges(&it->state)) early_return_complete_event(&it->state.run, &it->state.model, &fault);
    it->state.run.phase = EVENT;
    return fmi3OK;
}

/* They are evaluated when they are updated, and when an output is read. */
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    ENTER(instance, 1 << INITIALISING | 1 << EVENT);
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime)
{
    ENTER(instance, 1 << EVENT);
    NEED(discreteStatesNeedUpdate);
    NEED(terminateSimulation);
    NEED(nominalsOfContinuousStatesChanged);
    NEED(valuesOfContinuousStatesChanged);
    NEED(nextEventTimeDefined);
    NEED(nextEventTime);
    fmi3Status status = handle(it);
    const struct ModelExchange *exchange = &it->state.model.model_exchange;
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
    ENTER(instance, 1 << EVENT);
    if (exchanges(&it->state)) return refuse(it, NOT_SUPPORTED, __func__, "");
    it->state.run.phase = RUNNING;
    return fmi3OK;
}

/* Let the importer look at the present point, where a leap ends or the first begins, set inputs from there on, and say
 * where it wants to stop. */
static void show(Instance *it, bool finished)
{
    struct ModelExchange *exchange = &it->state.model.model_exchange;
    double now = it->state.model.solver.t, wanted = now;
    bool wants = false;
    if (!it->host.look) return;
    it->state.run.phase = INTERMEDIATE;
    it->host.look(it->host.environment, now, true, true, finished, it->host.returns, &wants, &wanted);
    it->state.run.phase = RUNNING;
    if (!it->host.returns || !wants || !(wanted < exchange->step_end)) return;
    if (wanted > now) exchange->step_end = wanted;
    else if (finished) exchange->step_end = now;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded,
                      fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    ENTER(instance, STEPPING);
    NEED(eventHandlingNeeded);
    NEED(terminateSimulation);
    NEED(earlyReturn);
    NEED(lastSuccessfulTime);
    State *state = &it->state;
    const double *now = &state->model.solver.t;
    double t = currentCommunicationPoint, h = communicationStepSize;
    bool fault = false;
    (void)noSetFMUStatePriorToCurrentPoint;
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = false;
    if (!it->host.handles && !it->host.returns && !it->host.look) {
        fmi3Status status = step_by(it, t, h);
        *lastSuccessfulTime = *now;
        return status;
    }
    struct ModelExchange *exchange = &state->model.model_exchange;
    int64_t status = early_return_begin_step(&state->run, &state->model, t, h, &fault);
    double end = exchange->step_end;
    if (status == OK && !fault) show(it, false);
    while (status == OK && !fault && *now < exchange->step_end) {
        status = early_return_next_internal_step(&state->run, &state->model, it->host.handles, &fault);
        if (status != OK || fault) break;
        show(it, true);
        if (exchange->event_reached && it->host.returns) break;
    }
    *lastSuccessfulTime = *now;
    if (status == OK && !fault) {
        *eventHandlingNeeded = it->host.handles && exchange->event_reached;
        *earlyReturn = *now < end;
    }
    return judged_by(it, status, fault, t, h);
}

/* ---- model exchange */

TELLING(ContinuousStateDerivatives, rates, STATES)

#define COUNTING(NAME, COUNT)                                                    \
    fmi3Status fmi3GetNumberOf##NAME(fmi3Instance instance, size_t *number)      \
    {                                                                            \
        ENTER(instance, ANY);                                                    \
        NEED(number);                                                            \
        *number = COUNT;                                                         \
        return fmi3OK;                                                           \
    }

COUNTING(ContinuousStates, STATES)
COUNTING(EventIndicators, INDICATORS)

/* ---- derivatives */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                        size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    ENTER(instance, ANY);
    if (nSeed != nKnowns) return refuse(it, WRONG_LENGTH, __func__, "the length of seed");
    if (nSensitivity != nUnknowns) return refuse(it, WRONG_LENGTH, __func__, "the length of sensitivity");
    return directional(it, unknowns, nUnknowns, knowns, nKnowns, seed, sensitivity, __func__);
}

/* One direction for each known. */
fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                    size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    ENTER(instance, ANY);
    if (nSeed != nUnknowns) return refuse(it, WRONG_LENGTH, __func__, "the length of seed");
    if (nSensitivity != nKnowns) return refuse(it, WRONG_LENGTH, __func__, "the length of sensitivity");
    if (check_slopes(it, unknowns, nUnknowns, knowns, nKnowns, seed, sensitivity, __func__)) return fmi3Error;
    for (size_t j = 0; j < nKnowns; j++) {
        struct Tangent to = {0};
        *slope_of(&to, knowns[j]) = 1.0;
        fmi3Status status = follow(it, &to);
        sensitivity[j] = status ? NAN : 0.0;
        for (size_t i = 0; i < nUnknowns; i++) sensitivity[j] += seed[i] * *slope_of(&to, unknowns[i]);
        if (status) return status;
    }
    return fmi3OK;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[],
                                    size_t nValues)
{
    ENTER(instance, STEPPING | 1 << EVENT | 1 << INTERMEDIATE | 1 << TERMINATED);
    ONE_EACH;
    return read_rates(it, valueReferences, nValueReferences, orders, values, __func__);
}

/* ---- what this FMU does not offer, as its description says */

typedef const fmi3ValueReference References[];

NOT_OFFERED_HERE(EnterConfigurationMode, Handle instance)
NOT_OFFERED_HERE(ExitConfigurationMode, Handle instance)
NOT_OFFERED_HERE(GetNumberOfVariableDependencies, Handle instance, fmi3ValueReference valueReference,
                 size_t *nDependencies)
NOT_OFFERED_HERE(GetVariableDependencies, Handle instance, fmi3ValueReference dependent,
                 size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
                 size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[], size_t nDependencies)
NOT_OFFERED_HERE(GetIntervalDecimal, Handle instance, References valueReferences, size_t nValueReferences,
                 fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
NOT_OFFERED_HERE(GetIntervalFraction, Handle instance, References valueReferences, size_t nValueReferences,
                 fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NOT_OFFERED_HERE(GetShiftDecimal, Handle instance, References valueReferences, size_t nValueReferences,
                 fmi3Float64 shifts[])
NOT_OFFERED_HERE(GetShiftFraction, Handle instance, References valueReferences, size_t nValueReferences,
                 fmi3UInt64 counters[], fmi3UInt64 resolutions[])
NOT_OFFERED_HERE(SetIntervalDecimal, Handle instance, References valueReferences, size_t nValueReferences,
                 const fmi3Float64 intervals[])
NOT_OFFERED_HERE(SetIntervalFraction, Handle instance, References valueReferences, size_t nValueReferences,
                 const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NOT_OFFERED_HERE(SetShiftDecimal, Handle instance, References valueReferences, size_t nValueReferences,
                 const fmi3Float64 shifts[])
NOT_OFFERED_HERE(SetShiftFraction, Handle instance, References valueReferences, size_t nValueReferences,
                 const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NOT_OFFERED_HERE(ActivateModelPartition, Handle instance, fmi3ValueReference clockReference, fmi3Float64 activationTime)
