/* Python's arithmetic in C. Where Python raises an exception, the function sets the fault flag. */
#ifndef PYTHON_ARITHMETIC_H
#define PYTHON_ARITHMETIC_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

/* Round after every operation (no fused multiply-add), with any compiler. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

/* In a static table, tcc accepts no minus in front of INFINITY. */
#if defined(__TINYC__)
#define MINUS_INFINITY (-1.0 / 0.0)
#else
#define MINUS_INFINITY (-INFINITY)
#endif

static inline double py_divide(double a, double b, bool *fault)
{
    if (b == 0.0) {
        *fault = true;
        return 0.0;
    }
    return a / b;
}

/* Check the result of a libm function: NaN without a NaN argument is a domain error, infinity from finite arguments is
 * an overflow. */
static inline double checked_result(double y, bool has_nan, bool all_finite, bool *fault)
{
    if (!isfinite(y) && (isnan(y) ? !has_nan : all_finite)) *fault = true;
    return y;
}

#define CHECKED_UNARY(f)                                                                           \
    static inline double py_##f(double a, bool *fault)                                             \
    {                                                                                              \
        return checked_result(f(a), isnan(a), isfinite(a), fault);                                 \
    }
#define CHECKED_BINARY(f)                                                                          \
    static inline double py_##f(double a, double b, bool *fault)                                   \
    {                                                                                              \
        return checked_result(f(a, b), isnan(a) || isnan(b), isfinite(a) && isfinite(b), fault);   \
    }
CHECKED_UNARY(sqrt) CHECKED_UNARY(sin) CHECKED_UNARY(cos) CHECKED_UNARY(tan) CHECKED_UNARY(asin) CHECKED_UNARY(acos)
CHECKED_UNARY(sinh) CHECKED_UNARY(cosh) CHECKED_UNARY(exp) CHECKED_UNARY(expm1) CHECKED_UNARY(log) CHECKED_UNARY(log1p)
CHECKED_BINARY(pow) CHECKED_BINARY(fmod)

/* Index into a list as in Python: negative indices count from the end. */
static inline int64_t py_index(int64_t i, int64_t length, bool *fault)
{
    if (i < -length || i >= length) {
        *fault = true;
        return 0;
    }
    return i < 0 ? i + length : i;
}

#endif
