/* Python's arithmetic in C.  Where Python raises an exception, the fault flag goes up. */
#ifndef NUMERICS_H
#define NUMERICS_H

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

static inline double quotient(double a, double b, bool *fault)
{
    if (b == 0.0) {
        *fault = true;
        return 0.0;
    }
    return a / b;
}

/* A function of libm faults where it has no value, or none that a double can hold. */
static inline double judged(double y, bool has_nan, bool all_finite, bool *fault)
{
    if (!isfinite(y) && (isnan(y) ? !has_nan : all_finite)) *fault = true;
    return y;
}

#define OF_ONE(f)                                                                         \
    static inline double py_##f(double a, bool *fault)                                    \
    {                                                                                     \
        return judged(f(a), isnan(a), isfinite(a), fault);                                \
    }
#define OF_TWO(f)                                                                         \
    static inline double py_##f(double a, double b, bool *fault)                          \
    {                                                                                     \
        return judged(f(a, b), isnan(a) || isnan(b), isfinite(a) && isfinite(b), fault);  \
    }
OF_ONE(sqrt) OF_ONE(sin) OF_ONE(cos) OF_ONE(tan) OF_ONE(asin) OF_ONE(acos) OF_ONE(sinh) OF_ONE(cosh)
OF_ONE(exp) OF_ONE(expm1) OF_ONE(log) OF_ONE(log1p) OF_TWO(pow) OF_TWO(fmod)

/* min and max keep the first of equals, also beside NaN. */
static inline double lesser(double a, double b) { return b < a ? b : a; }
static inline double greater(double a, double b) { return b > a ? b : a; }

/* The place of an element of a list; negative ones count from the end. */
static inline int64_t element(int64_t i, int64_t length, bool *fault)
{
    if (i < -length || i >= length) {
        *fault = true;
        return 0;
    }
    return i < 0 ? i + length : i;
}

#endif
