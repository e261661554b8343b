/* A declared variable; its value reference is its place in the table of model.h. */
#ifndef VARIABLE_H
#define VARIABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "text_buffer.h"

#define NO_OFFSET SIZE_MAX

typedef struct {
    const char *name, *text;
    const char *unit, *allowed; /* the unit behind a number, and the range, in words */
    size_t offset; /* in the model */
    size_t tangent_offset;  /* in a direction; NO_OFFSET if it has none */
    bool is_real;  /* a double; otherwise an int64_t */
    bool is_calculated, is_fixed;
    bool is_nan_after_failure;   /* reads NaN once the run has failed */
    bool is_updated_on_read; /* tells of the solver, and is brought up to date when it is read */
    bool is_state_or_input;       /* a state or an input: one along which there are derivatives */
    size_t rate_offset, order_offset, derivatives_offset; /* of an input, in the model: its present rate, and its course; or NO_OFFSET */
    double low, high, above, below;     /* low <= value <= high, above < value < below */
    const int64_t *items, *items_end; /* of an enumeration */
} Variable;

/* A value that was set and cannot be used; the earliest is told first. */
typedef struct {
    int64_t reason; /* OK where there is none */
    double value;
    int64_t sequence;
} RejectedValue;

/* An int or a bool of the numerics, as a member of the state. */
typedef struct {
    size_t offset;
    bool is_bool; /* otherwise an int64_t */
} Member;

/* What is told of a call that is refused. */
typedef struct {
    const char *function, *word; /* what it is about: a type, an address, phases */
    const char *phase;
    uint32_t reference;
} Call;

static inline void append_value(TextBuffer *text, const Variable *variable, double value)
{
    if (variable->is_real) append_real(text, value);
    else append_integer(text, (int64_t)value);
}

#endif
