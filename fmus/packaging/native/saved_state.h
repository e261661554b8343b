/* A saved FMU state: the State of an instance with the GUID of the FMU and a checksum.
 *
 * Serialized states come back from files and networks and may be damaged. A state is accepted only if it has the GUID
 * of this FMU and its checksum is right. The checksum is no secret: a state with forged numbers is accepted too, unless
 * its use is undefined in C.
 */
#ifndef SAVED_STATE_H
#define SAVED_STATE_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

typedef struct {
    uint64_t checksum; /* of all following bytes */
    char guid[sizeof MODEL_GUID];
    State state;
} SavedState;

#define MAX_INTEGER 9007199254740992 /* 2^53: doubles represent it exactly, and the sum of two does not overflow */

/* ---- values */

static void *variable_address(State *state, const Variable *variable) { return (char *)state + variable->offset; }

static double variable_value(const State *state, const Variable *variable)
{
    const void *address = (const char *)state + variable->offset;
    if (!variable->is_integer) return *(const double *)address;
    int64_t value = *(const int64_t *)address;
    return value == NO_VALUE && variable->is_real ? NAN : (double)value;
}

static bool is_allowed_value(const Variable *variable, double value)
{
    if (variable->items) {
        for (const int64_t *item = variable->items; item < variable->items_end; item++) {
            if ((double)*item == value) return true;
        }
        return false;
    }
    bool fault = false;
    return variable_declarations_is_in_range(value, variable->low, variable->high, variable->above, variable->below, &fault);
}

/* ---- checksum */

/* Checksum over words of eight bytes. Every mixing step is invertible, so a change within one word is always detected;
 * other changes are missed with a probability of 2^-64. */
static uint64_t checksum_of(const void *bytes, size_t size)
{
    uint64_t sum = size;
    for (size_t i = 0; i < size; i += sizeof sum) {
        uint64_t word = 0;
        memcpy(&word, (const char *)bytes + i, size - i < sizeof word ? size - i : sizeof word);
        sum = (sum ^ word) * UINT64_C(0x9E3779B97F4A7C15);
        sum ^= sum >> 32;
    }
    return sum;
}

static uint64_t payload_checksum(const SavedState *saved)
{
    return checksum_of((const char *)saved + sizeof saved->checksum, sizeof *saved - sizeof saved->checksum);
}

static void write_saved_state(SavedState *saved, const State *state)
{
    memset(saved, 0, sizeof *saved);
    memcpy(saved->guid, MODEL_GUID, sizeof MODEL_GUID);
    memcpy(&saved->state, state, sizeof *state);
    saved->checksum = payload_checksum(saved);
}

/* Check whether the pointer refers to a state of this FMU. Reads no byte after the first difference. */
static bool has_model_guid(const SavedState *saved)
{
    return saved && !strncmp(saved->guid, MODEL_GUID, sizeof MODEL_GUID);
}

/* ---- validation */
static bool is_bool(const void *byte) { return *(const unsigned char *)byte <= 1; }

/* Another byte in a bool is undefined, and so is the overflow of a counter. */
static bool are_members_valid(const State *state)
{
    for (const Member *member = members; member < members + MEMBERS; member++) {
        const void *value = (const char *)state + member->offset;
        if (member->is_bool ? !is_bool(value) : *(const int64_t *)value < NO_VALUE || *(const int64_t *)value > MAX_INTEGER) {
            return false;
        }
    }
    return true;
}

/* Reading a discrete integer converts its stored value, which must be in the range of int64_t. */
static bool are_discrete_values_valid(const State *state)
{
    for (int i = 0; i < DISCRETE; i++) {
        if (!variables[discrete_variables[i]].is_real && !(fabs(state->discrete_values[i]) <= MAX_INTEGER)) return false;
    }
    return true;
}

/* No call is valid in any other phase, not even a reset. */
static bool is_phase_valid(const State *state)
{
    return INSTANTIATED <= state->run.phase && state->run.phase <= CONTINUOUS;
}

/* Return the state, or NULL if it is invalid in any way. */
static const State *valid_state(SavedState *saved)
{
    if (!has_model_guid(saved) || saved->checksum != payload_checksum(saved)) return NULL;
    const State *state = &saved->state;
    return are_members_valid(state) && are_discrete_values_valid(state) && is_phase_valid(state) ? state : NULL;
}

#endif
