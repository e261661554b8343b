/* The functions that FMI 2.0 and 3.0 have in common.
 *
 * The including file defines the names FMI(name), STATE_FUNCTION(before, after) and DESERIALIZE_FUNCTION and the types
 * Handle, Boolean, Byte, String and StateHandle.
 */
#ifndef COMMON_FUNCTIONS_H
#define COMMON_FUNCTIONS_H

#include "instance.h"

/* ---- life cycle */

void FMI(FreeInstance)(Handle instance) { free(instance); }

Status FMI(SetDebugLogging)(Handle instance, Boolean loggingOn, size_t n, const String categories[])
{
    REQUIRE_PHASE(instance, IN_ANY_PHASE);
    if (n) REQUIRE_ADDRESS(categories);
    return set_logging(self, loggingOn, n, categories);
}

Status FMI(Terminate)(Handle instance)
{
    REQUIRE_PHASE(instance, IN_SIMULATION);
    const Run *run = &self->state.run;
    /* An importer that completes no steps learns only here that its solution diverged. */
    bool is_open = is_model_exchange(&self->state) && !run->has_failed && !run->has_pending_changes;
    Status status = is_open ? complete_step(self) : STATUS_OK;
    self->state.run.phase = TERMINATED;
    return status;
}

Status FMI(Reset)(Handle instance)
{
    REQUIRE_PHASE(instance, IN_ANY_PHASE);
    reset_state(self);
    return STATUS_OK;
}

/* ---- model exchange */

Status FMI(EnterContinuousTimeMode)(Handle instance)
{
    REQUIRE_PHASE(instance, 1 << EVENT);
    REQUIRE_MODEL_EXCHANGE;
    self->state.run.phase = CONTINUOUS;
    return STATUS_OK;
}

Status FMI(CompletedIntegratorStep)(Handle instance, Boolean noSetFMUStatePriorToCurrentPoint, Boolean *enterEventMode,
                                    Boolean *terminateSimulation)
{
    REQUIRE_PHASE(instance, 1 << CONTINUOUS);
    REQUIRE_ADDRESS(enterEventMode);
    REQUIRE_ADDRESS(terminateSimulation);
    (void)noSetFMUStatePriorToCurrentPoint;
    bool fault = false;
    *enterEventMode = *terminateSimulation = false;
    Status status = complete_step(self);
    if (status == STATUS_OK) *enterEventMode = model_exchange_has_step_event(&self->state.run, &self->state.model, &fault);
    return status;
}

Status FMI(SetTime)(Handle instance, double time)
{
    REQUIRE_PHASE(instance, IN_MODEL_EXCHANGE);
    REQUIRE_MODEL_EXCHANGE;
    bool fault = false;
    model_exchange_set_time(&self->state.run, &self->state.model, time, &fault);
    return STATUS_OK;
}

Status FMI(SetContinuousStates)(Handle instance, const double states[], size_t n)
{
    REQUIRE_PHASE(instance, 1 << CONTINUOUS);
    bool fault = false;
    if (n != STATES) return refuse(self, WRONG_LENGTH, __func__, "the number of states");
    REQUIRE_ADDRESS(states);
    memcpy(self->state.run.model_exchange.states, states, STATES * sizeof *states);
    model_exchange_set_continuous_states(&self->state.run, &self->state.model, &fault);
    return STATUS_OK;
}

/* Define a function that reads an array of the model at the current point, NaN if it cannot be calculated: the
 * importer's solver may try states without finite results. A macro because a helper function doubles the time of a
 * call. */
#define DEFINE_VALUES_GETTER(NAME, found, COUNT)                                                          \
    Status FMI(Get##NAME)(Handle instance, double values[], size_t n)                                     \
    {                                                                                                     \
        REQUIRE_PHASE(instance, IN_ANY_PHASE);                                                            \
        REQUIRE_MODEL_EXCHANGE;                                                                           \
        State *state = &self->state;                                                                      \
        bool fault = false;                                                                               \
        if (n != (COUNT)) return refuse(self, WRONG_LENGTH, __func__, "the number of values");            \
        if (n && !values) return refuse(self, NULL_POINTER, __func__, "the address of the values");         \
        int64_t status = model_exchange_prepare(&state->run, &state->model, &fault);                      \
        if (status == OK && !fault) model_exchange_update_##found(&state->run, &state->model, &fault);    \
        bool is_valid = status == OK && !fault;                                                           \
        for (size_t i = 0; i < n; i++) values[i] = is_valid ? state->run.model_exchange.found[i] : NAN;   \
        return status == OK || state->run.phase < RUNNING ? STATUS_OK : fail_run(self, status, NAN, NAN); \
    }

DEFINE_VALUES_GETTER(ContinuousStates, states, STATES)
DEFINE_VALUES_GETTER(NominalsOfContinuousStates, nominals, STATES)
DEFINE_VALUES_GETTER(EventIndicators, indicators, INDICATORS)

/* ---- saved states */

Status STATE_FUNCTION(Get, )(Handle instance, StateHandle *state)
{
    REQUIRE_PHASE(instance, IN_ANY_PHASE);
    REQUIRE_ADDRESS(state);
    self->state.run.outputs_current = false; /* outputs are calculated again, here and after restoring */
    return store_state(self, &self->state, state, __func__);
}

Status STATE_FUNCTION(Set, )(Handle instance, StateHandle state)
{
    REQUIRE_PHASE(instance, IN_ANY_PHASE);
    const State *own = matching_state(self, state);
    if (!own) return refuse_state(self);
    replace_state(self, own);
    return STATUS_OK;
}

Status STATE_FUNCTION(Free, )(Handle instance, StateHandle *state)
{
    REQUIRE_PHASE(instance, IN_ANY_PHASE);
    if (!state || !*state) return STATUS_OK;
    if (!has_model_guid(*state)) return refuse_state(self);
    free(*state);
    *state = NULL;
    return STATUS_OK;
}

Status STATE_FUNCTION(Serialized, Size)(Handle instance, StateHandle state, size_t *size)
{
    REQUIRE_PHASE(instance, IN_ANY_PHASE);
    REQUIRE_ADDRESS(size);
    if (!has_model_guid(state)) return refuse_state(self);
    *size = sizeof(SavedState);
    return STATUS_OK;
}

Status STATE_FUNCTION(Serialize, )(Handle instance, StateHandle state, Byte serializedState[], size_t size)
{
    REQUIRE_PHASE(instance, IN_ANY_PHASE);
    REQUIRE_ADDRESS(serializedState);
    if (!matching_state(self, state)) return refuse_state(self);
    if (size < sizeof(SavedState)) return refuse(self, BUFFER_TOO_SMALL, __func__, "");
    memset(serializedState, 0, size);
    memcpy(serializedState, state, sizeof(SavedState));
    return STATUS_OK;
}

Status DESERIALIZE_FUNCTION(Handle instance, const Byte serializedState[], size_t size, StateHandle *state)
{
    REQUIRE_PHASE(instance, IN_ANY_PHASE);
    REQUIRE_ADDRESS(serializedState);
    REQUIRE_ADDRESS(state);
    if (size != sizeof(SavedState)) return refuse_state(self);
    SavedState *saved = malloc(sizeof *saved); /* a copy, because the bytes may be misaligned */
    if (!saved) return refuse(self, NO_MEMORY, __func__, "");
    memcpy(saved, serializedState, size);
    const State *own = matching_state(self, saved);
    Status status = own ? store_state(self, own, state, __func__) : refuse_state(self);
    free(saved);
    return status;
}

/* ---- functions that the FMU does not support, according to its model description */

/* `unused` names the parameters after the instance, as ((void)a, (void)b). */
#define DEFINE_NOT_OFFERED(NAME, unused, ...)             \
    Status FMI(NAME)(__VA_ARGS__)                         \
    {                                                     \
        REQUIRE_PHASE(instance, IN_ANY_PHASE);            \
        unused;                                           \
        return refuse(self, NOT_SUPPORTED, __func__, ""); \
    }

#endif
