/* A declared variable; its value reference is its place in the table of model.h. */
#ifndef VARIABLE_H
#define VARIABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "text.h"

#define NO_SLOPE SIZE_MAX

typedef struct {
    const char *name, *text;
    const char *unit, *allowed; /* the unit behind a number, and the range, in words */
    size_t offset; /* in the model */
    size_t slope;  /* in a direction; NO_SLOPE if it has none */
    bool is_real;  /* a double; otherwise an int64_t */
    bool is_calculated, is_fixed;
    bool is_answer;   /* reads NaN once the run has failed */
    bool is_reported; /* tells of the solver, and is brought up to date when it is read */
    bool moves;       /* a state or an input: one along which there are derivatives */
    size_t rate, order, derivatives; /* of an input, in the model: its present rate, and its course; or NO_SLOPE */
    double low, high, above, below;     /* low <= value <= high, above < value < below */
    const int64_t *items, *end_of_items; /* of an enumeration */
} Variable;

/* A value that was set and cannot be used; the earliest is told first. */
typedef struct {
    int64_t reason; /* OK where there is none */
    double value;
    int64_t turn;
} Refusal;

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

static inline void add_value(Text *text, const Variable *variable, double value)
{
    if (variable->is_real) add_real(text, value);
    else add_integer(text, (int64_t)value);
}

#endif
