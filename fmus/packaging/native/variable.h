/* A declared variable. Its value reference is its index in the table in model.h. */
#ifndef VARIABLE_H
#define VARIABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "text_buffer.h"

#define NO_OFFSET SIZE_MAX

typedef struct {
    const char *name, *text;       /* text: the description */
    const char *unit, *allowed;    /* unit suffix and allowed range, as in messages */
    size_t offset;                 /* in State */
    size_t tangent_offset;         /* in struct Tangent; NO_OFFSET without a derivative */
    bool is_real;                  /* a Real of FMI; otherwise an integer */
    bool is_integer;               /* stored as an int64_t, in an FMU with Reals only also of a Real; otherwise a double */
    bool is_calculated, is_fixed;
    bool lacks_value_after_failure; /* after the run has failed, reads NaN or NO_VALUE */
    bool is_updated_on_read;       /* solver and event statistics */
    bool is_state_or_input;
    bool is_real_parameter;        /* others have partial derivatives by it, as by states and inputs */
    /* Of an input that varies between settings, in State: its time derivative and the order of its polynomial; the
     * polynomial's derivatives, if the importer may set the first one; otherwise NO_OFFSET. */
    size_t rate_offset, order_offset, derivatives_offset;
    double low, high, above, below;   /* low <= value <= high, above < value < below */
    const int64_t *items, *items_end; /* values of an enumeration */
} Variable;

/* An int or a bool in State, for validation of saved states. */
typedef struct {
    size_t offset;
    bool is_bool; /* otherwise an int64_t */
} Member;

/* Fields of a message about a refused call. */
typedef struct {
    const char *function, *word; /* word: a type, an argument or the allowed phases */
    const char *phase;
    uint32_t reference;
} Call;

static COLD void append_value(TextBuffer *text, const Variable *variable, double value)
{
    if (variable->is_real) append_real(text, value);
    else append_integer(text, (int64_t)value);
}

#endif
