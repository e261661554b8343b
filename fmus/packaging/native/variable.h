/* A declared variable; its value reference is its place in the table of model.h. */
#ifndef VARIABLE_H
#define VARIABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    const char *name, *text;
    size_t offset; /* in the model */
    bool is_real;  /* a double; otherwise an int64_t */
    bool is_calculated, is_fixed;
    bool is_reported; /* tells of the solver, and is brought up to date when it is read */
    double low, high, above, below;     /* low <= value <= high, above < value < below */
    const int64_t *items, *end_of_items; /* of an enumeration */
    const char *refusal;                /* what is said behind a value out of range */
} Variable;

/* A member of the model, or of what it owns, that is an int or a bool of the numerics. */
typedef struct {
    size_t offset;
    bool is_bool; /* otherwise an int64_t */
} Member;

#endif
