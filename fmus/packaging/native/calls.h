/* The calls that both versions of FMI have, in the hands of an instance: what each does, said once.
 *
 * Who includes this says what FMI(name) and OF_STATE(before, after) are called, and what a Handle, a Boolean, a Byte, a
 * Word and a Saved are there.
 */
#ifndef CALLS_H
#define CALLS_H

#include "instance.h"

/* ---- from instantiation to the end */

void FMI(FreeInstance)(Handle instance) { free(instance); }

Status FMI(SetDebugLogging)(Handle instance, Boolean loggingOn, size_t n, const Word categories[])
{
    ENTER(instance, ANY);
    if (n) NEED(categories);
    return choose_log(it, loggingOn, n, categories);
}

Status FMI(Terminate)(Handle instance)
{
    ENTER(instance, BEGUN);
    it->state.run.phase = TERMINATED;
    return DONE;
}

Status FMI(Reset)(Handle instance)
{
    ENTER(instance, ANY);
    fresh(it);
    return DONE;
}

/* ---- model exchange */

Status FMI(EnterContinuousTimeMode)(Handle instance)
{
    ENTER(instance, 1 << EVENT);
    EXCHANGE_ONLY;
    it->state.run.phase = CONTINUOUS;
    return DONE;
}

Status FMI(CompletedIntegratorStep)(Handle instance, Boolean noSetFMUStatePriorToCurrentPoint, Boolean *enterEventMode,
                                    Boolean *terminateSimulation)
{
    ENTER(instance, 1 << CONTINUOUS);
    NEED(enterEventMode);
    NEED(terminateSimulation);
    (void)noSetFMUStatePriorToCurrentPoint;
    *enterEventMode = *terminateSimulation = false;
    return DONE;
}

Status FMI(SetTime)(Handle instance, double time)
{
    ENTER(instance, EXCHANGING);
    EXCHANGE_ONLY;
    bool fault = false;
    model_exchange_set_time(&it->state.run, &it->state.model, time, &fault);
    return DONE;
}

Status FMI(SetContinuousStates)(Handle instance, const double states[], size_t n)
{
    ENTER(instance, 1 << CONTINUOUS);
    bool fault = false;
    if (n != STATES) return refuse(it, WRONG_LENGTH, __func__, "the number of states");
    NEED(states);
    memcpy(it->state.model.model_exchange.states, states, STATES * sizeof *states);
    model_exchange_set_continuous_states(&it->state.run, &it->state.model, &fault);
    return DONE;
}

/* What is found of the present point, in a row of the model; NaN where there is nothing to calculate with, for a state
 * that the importer's solver only tries may be anything.  No function but of FMI: a call takes half as long. */
#define TELLING(NAME, found, COUNT)                                                                              \
    Status FMI(Get##NAME)(Handle instance, double values[], size_t n)                                              \
    {                                                                                                            \
        ENTER(instance, ANY);                                                                                      \
        EXCHANGE_ONLY;                                                                                           \
        State *state = &it->state;                                                                               \
        bool fault = false;                                                                                      \
        if (n != (COUNT)) return refuse(it, WRONG_LENGTH, __func__, "the number of values");                     \
        if (n && !values) return refuse(it, NULL_POINTER, __func__, "the address of the values");                  \
        int64_t status = model_exchange_prepare(&state->run, &state->model, &fault);                                     \
        if (status == OK && !fault) model_exchange_update_##found(&state->model, &fault);                                     \
        bool is_there = status == OK && !fault;                                                                  \
        for (size_t i = 0; i < n; i++) values[i] = is_there ? state->model.model_exchange.found[i] : NAN;              \
        return status == OK || state->run.phase < RUNNING ? DONE : give_up(it, status, NAN, NAN);                \
    }

TELLING(ContinuousStates, states, STATES)
TELLING(NominalsOfContinuousStates, nominals, STATES)
TELLING(EventIndicators, indicators, INDICATORS)

/* ---- state */

Status OF_STATE(Get, )(Handle instance, Saved *state)
{
    ENTER(instance, ANY);
    NEED(state);
    it->state.run.outputs_current = false; /* here and there, outputs are calculated anew */
    return keep(it, &it->state, state, __func__);
}

Status OF_STATE(Set, )(Handle instance, Saved state)
{
    ENTER(instance, ANY);
    const State *own = own_state(it, state);
    if (!own) return refuse_state(it);
    memcpy(&it->state, own, sizeof *own);
    return DONE;
}

Status OF_STATE(Free, )(Handle instance, Saved *state)
{
    ENTER(instance, ANY);
    if (!state || !*state) return DONE;
    if (!is_ours(*state)) return refuse_state(it);
    free(*state);
    *state = NULL;
    return DONE;
}

Status OF_STATE(Serialized, Size)(Handle instance, Saved state, size_t *size)
{
    ENTER(instance, ANY);
    NEED(size);
    if (!is_ours(state)) return refuse_state(it);
    *size = sizeof(Sealed);
    return DONE;
}

Status OF_STATE(Serialize, )(Handle instance, Saved state, Byte serializedState[], size_t size)
{
    ENTER(instance, ANY);
    NEED(serializedState);
    if (!own_state(it, state)) return refuse_state(it);
    if (size < sizeof(Sealed)) return refuse(it, BUFFER_TOO_SMALL, __func__, "");
    memset(serializedState, 0, size);
    memcpy(serializedState, state, sizeof(Sealed));
    return DONE;
}

Status DESERIALIZE(Handle instance, const Byte serializedState[], size_t size, Saved *state)
{
    ENTER(instance, ANY);
    NEED(serializedState);
    NEED(state);
    if (size != sizeof(Sealed)) return refuse_state(it);
    Sealed *sealed = malloc(sizeof *sealed); /* for bytes may lie where a state cannot */
    if (!sealed) return refuse(it, NO_MEMORY, __func__, "");
    memcpy(sealed, serializedState, size);
    const State *own = own_state(it, sealed);
    Status status = own ? keep(it, own, state, __func__) : refuse_state(it);
    free(sealed);
    return status;
}

/* ---- what no FMU of ours offers, as its description says */

#define NOT_OFFERED_HERE(NAME, ...)                   \
    Status FMI(NAME)(__VA_ARGS__)                     \
    {                                                 \
        ENTER(instance, ANY);                           \
        return refuse(it, NOT_SUPPORTED, __func__, ""); \
    }

#endif
