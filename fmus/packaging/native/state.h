/* A saved state: what of an instance makes its run, under a seal.
 *
 * Bytes come back from files and networks, and so do pointers from importers.  A saved state is believed if it carries
 * the GUID of this very FMU, if its checksum holds, and if nothing in it could lead the code astray: no truth value but
 * 0 and 1, no refused value that is not there, no value out of its range, no present point outside the step.
 */
#ifndef STATE_H
#define STATE_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

typedef struct {
    uint64_t sum; /* of all bytes that follow */
    char guid[sizeof MODEL_GUID];
    State state;
} Sealed;

#define LARGEST 9007199254740992 /* an int of the numerics: no sum of two such overflows, and a double holds it */

/* ---- values */

static void *place(Model *model, const Variable *variable) { return (char *)model + variable->offset; }

static double value_of(const Model *model, const Variable *variable)
{
    const void *value = (const char *)model + variable->offset;
    return variable->is_real ? *(const double *)value : (double)*(const int64_t *)value;
}

static bool accepts(const Variable *variable, double value)
{
    if (variable->items) {
        for (const int64_t *item = variable->items; item < variable->end_of_items; item++) {
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
static uint64_t sum_of(const void *bytes, size_t size)
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

static uint64_t sum_under(const Sealed *sealed)
{
    return sum_of((const char *)sealed + sizeof sealed->sum, sizeof *sealed - sizeof sealed->sum);
}

static void seal(Sealed *sealed, const State *state)
{
    memset(sealed, 0, sizeof *sealed);
    memcpy(sealed->guid, MODEL_GUID, sizeof MODEL_GUID);
    memcpy(&sealed->state, state, sizeof *state);
    sealed->sum = sum_under(sealed);
}

/* Whether a block of memory was made here; nothing is read beyond the first difference. */
static bool is_ours(const Sealed *sealed) { return sealed && !strncmp(sealed->guid, MODEL_GUID, sizeof MODEL_GUID); }

/* ---- the structure */

/* Whether a byte can be read as a bool. */
static bool is_bool(const void *byte) { return *(const unsigned char *)byte <= 1; }

static bool are_members_sound(const State *state)
{
    for (const Member *member = members; member < members + MEMBERS; member++) {
        const void *value = (const char *)state + member->offset;
        if (member->is_bool ? !is_bool(value) : *(const int64_t *)value < -1 || *(const int64_t *)value > LARGEST) {
            return false;
        }
    }
    return true;
}

/* Values out of range are never in the model, but among the refused. */
static bool are_values_sound(const Model *model)
{
    for (const Variable *variable = variables; variable < variables + VARIABLES; variable++) {
        bool is_free = variable->is_real && variable->is_calculated;
        if (!is_free && !accepts(variable, value_of(model, variable))) return false;
    }
    return true;
}

static bool are_refusals_sound(const State *state)
{
    int64_t refusals = 0;
    if (state->turns < 0 || state->turns > LARGEST) return false;
    for (int i = 0; i < VARIABLES; i++) {
        const Refusal *refusal = &state->refused[i];
        if (refusal->reason == OK) continue;
        if (refusal->reason < CALCULATED || refusal->reason > OUT_OF_RANGE) return false;
        if (refusal->turn < 1 || refusal->turn > state->turns) return false;
        if (!variables[i].is_real && !(fabs(refusal->value) <= 2147483648.0)) return false; /* an fmi2Integer */
        refusals++;
    }
    return refusals == state->run.n_invalid_values;
}

static bool is_sound(State *state)
{
    bool fault = false;
    return are_members_sound(state) && !state->run.outputs_current && are_values_sound(&state->model) && are_refusals_sound(state) &&
           call_sequence_is_valid_state(&state->run, &state->model, state->run.interface == MODEL_EXCHANGE, &fault) && !fault;
}

/* The state under the seal; NULL if it is broken in any way. */
static const State *unsealed(Sealed *sealed)
{
    return is_ours(sealed) && sealed->sum == sum_under(sealed) && is_sound(&sealed->state) ? &sealed->state : NULL;
}

#endif
