/* Python's arithmetic in C.  Where Python raises an exception, the fault flag goes up. */
#ifndef PYTHON_ARITHMETIC_H
#define PYTHON_ARITHMETIC_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

/* One rounding for each operation, whoever compiles this. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

static inline double py_divide(double a, double b, bool *fault)
{
    if (b == 0.0) {
        *fault = true;
        return 0.0;
    }
    return a / b;
}

/* A function of libm faults where it has no value, or none that a double can hold. */
static inline double checked_result(double y, bool has_nan, bool all_finite, bool *fault)
{
    if (!isfinite(y) && (isnan(y) ? !has_nan : all_finite)) *fault = true;
    return y;
}

#define CHECKED_UNARY(f)                                                                         \
    static inline double py_##f(double a, bool *fault)                                    \
    {                                                                                     \
        return checked_result(f(a), isnan(a), isfinite(a), fault);                                \
    }
#define CHECKED_BINARY(f)                                                                         \
    static inline double py_##f(double a, double b, bool *fault)                          \
    {                                                                                     \
        return checked_result(f(a, b), isnan(a) || isnan(b), isfinite(a) && isfinite(b), fault);  \
    }
CHECKED_UNARY(sqrt) CHECKED_UNARY(sin) CHECKED_UNARY(cos) CHECKED_UNARY(tan) CHECKED_UNARY(asin) CHECKED_UNARY(acos) CHECKED_UNARY(sinh) CHECKED_UNARY(cosh)
CHECKED_UNARY(exp) CHECKED_UNARY(expm1) CHECKED_UNARY(log) CHECKED_UNARY(log1p) CHECKED_BINARY(pow) CHECKED_BINARY(fmod)

/* min and max keep the first of equals, also beside NaN. */
static inline double py_min(double a, double b) { return b < a ? b : a; }
static inline double py_max(double a, double b) { return b > a ? b : a; }

/* The place of an element of a list; negative ones count from the end. */
static inline int64_t py_index(int64_t i, int64_t length, bool *fault)
{
    if (i < -length || i >= length) {
        *fault = true;
        return 0;
    }
    return i < 0 ? i + length : i;
}

#endif
