/* A saved state: what of an instance makes its run, under a seal.
 *
 * Bytes come back from files and networks, and so do pointers from importers.  A saved state is believed if it carries
 * the GUID of this very FMU, if its checksum holds, and if nothing in it could lead the code astray: no truth value but
 * 0 and 1, no refused value that is not there, no value out of its range, no present point outside the step.
 */
#ifndef SAVED_STATE_H
#define SAVED_STATE_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

typedef struct {
    uint64_t checksum; /* of all bytes that follow */
    char guid[sizeof MODEL_GUID];
    State state;
} SavedState;

#define MAX_INTEGER 9007199254740992 /* an int of the numerics: no sum of two such overflows, and a double holds it */

/* ---- values */

static void *variable_address(Model *model, const Variable *variable) { return (char *)model + variable->offset; }

static double variable_value(const Model *model, const Variable *variable)
{
    const void *value = (const char *)model + variable->offset;
    return variable->is_real ? *(const double *)value : (double)*(const int64_t *)value;
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
    return call_sequence_is_in_range(value, variable->low, variable->high, variable->above, variable->below, &fault);
}

/* ---- the seal */

/* A sum of bytes in eights.  Each eight is mixed in by steps that can be undone: so a change within one is seen for
 * certain, and any other but for one in 2^64. */
static uint64_t checksum_of(const void *bytes, size_t size)
{
    uint64_t sum = size;
    for (size_t i = 0; i < size; i += sizeof sum) {
        uint64_t eight = 0;
        memcpy(&eight, (const char *)bytes + i, size - i < sizeof eight ? size - i : sizeof eight);
        sum = (sum ^ eight) * UINT64_C(0x9E3779B97F4A7C15);
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

/* Whether a block of memory was made here; nothing is read beyond the first difference. */
static bool has_model_guid(const SavedState *saved) { return saved && !strncmp(saved->guid, MODEL_GUID, sizeof MODEL_GUID); }

/* ---- the structure */

/* Whether a byte can be read as a bool. */
static bool is_bool(const void *byte) { return *(const unsigned char *)byte <= 1; }

static bool are_members_valid(const State *state)
{
    for (const Member *member = members; member < members + MEMBERS; member++) {
        const void *value = (const char *)state + member->offset;
        if (member->is_bool ? !is_bool(value) : *(const int64_t *)value < -1 || *(const int64_t *)value > MAX_INTEGER) {
            return false;
        }
    }
    return true;
}

/* Values out of range are never in the model, but among the refused. */
static bool are_values_valid(const Model *model)
{
    for (const Variable *variable = variables; variable < variables + VARIABLES; variable++) {
        bool is_free = variable->is_real && variable->is_calculated;
        if (!is_free && !is_allowed_value(variable, variable_value(model, variable))) return false;
    }
    return true;
}

static bool are_rejections_valid(const State *state)
{
    int64_t refusals = 0;
    if (state->rejection_count < 0 || state->rejection_count > MAX_INTEGER) return false;
    for (int i = 0; i < VARIABLES; i++) {
        const RejectedValue *refusal = &state->rejected[i];
        if (refusal->reason == OK) continue;
        if (refusal->reason < CALCULATED || refusal->reason > OUT_OF_RANGE) return false;
        if (refusal->sequence < 1 || refusal->sequence > state->rejection_count) return false;
        if (!variables[i].is_real && !(fabs(refusal->value) <= 2147483648.0)) return false; /* an fmi2Integer */
        refusals++;
    }
    return refusals == state->run.n_invalid_values;
}

static bool is_state_valid(State *state)
{
    bool fault = false;
    return are_members_valid(state) && !state->run.outputs_current && are_values_valid(&state->model) && are_rejections_valid(state) &&
           call_sequence_is_valid_state(&state->run, &state->model, state->run.interface == MODEL_EXCHANGE, &fault) && !fault;
}

/* The state under the seal; NULL if it is broken in any way. */
static const State *valid_state(SavedState *saved)
{
    return has_model_guid(saved) && saved->checksum == payload_checksum(saved) && is_state_valid(&saved->state) ? &saved->state : NULL;
}

#endif
