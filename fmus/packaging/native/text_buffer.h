/* A fixed-size text buffer. Numbers are written like Python's repr: the fewest digits that read back as the same
 * double. */
#ifndef TEXT_BUFFER_H
#define TEXT_BUFFER_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Keeps rarely executed code out of the hot path. */
#if defined(__GNUC__)
#define COLD __attribute__((cold, noinline))
#else
#define COLD
#endif

typedef struct {
    size_t length;
    char buffer[2048]; /* longer than any message; longer text is truncated */
} TextBuffer;

static COLD void append(TextBuffer *text, const char *addition)
{
    size_t space = sizeof text->buffer - 1 - text->length, length = strlen(addition);
    if (length > space) length = space;
    memcpy(text->buffer + text->length, addition, length);
    text->length += length;
    text->buffer[text->length] = '\0';
}

static COLD void append_integer(TextBuffer *text, int64_t number)
{
    char digits[24];
    snprintf(digits, sizeof digits, "%lld", (long long)number);
    append(text, digits);
}

/* Increment a string of decimal digits in its last place. Returns 1 if the carry runs through all digits; the digits
 * are then 1000... and the decimal exponent must grow by one. */
static COLD int increment_digits(char *digits, int length)
{
    for (int i = length - 1; i >= 0; i--) {
        if (digits[i] != '9') {
            digits[i]++;
            return 0;
        }
        digits[i] = '0';
    }
    digits[0] = '1';
    return 1;
}

/* Check whether 0.d1d2d3... * 10^exponent reads back as the number. The text passed to strtod has no decimal point, so
 * the result does not depend on the locale. */
static COLD int round_trips(const char *digits, int exponent, double number)
{
    char decimal[40];
    snprintf(decimal, sizeof decimal, "%se%d", digits, exponent - (int)strlen(digits));
    return strtod(decimal, NULL) == number;
}

/* Find the shortest digits of a positive number. Returns the exponent: number = 0.d1d2d3... * 10^exponent. */
static COLD int shortest_digits(double number, char digits[20])
{
    for (int length = 1;; length++) {
        char scientific[40];
        int exponent, n_digits = 0;
        snprintf(scientific, sizeof scientific, "%.*e", length - 1, number);
        for (const char *c = scientific; *c != 'e'; c++) { /* skip the decimal point, which depends on the locale */
            if (*c >= '0' && *c <= '9') digits[n_digits++] = *c;
        }
        digits[n_digits] = '\0';
        exponent = atoi(strchr(scientific, 'e') + 1) + 1;
        if (length == 17 || round_trips(digits, exponent, number)) return exponent;
        /* At a power of two the spacing of doubles differs above and below, so try the next decimal as well. */
        exponent += increment_digits(digits, n_digits);
        if (round_trips(digits, exponent, number)) return exponent;
    }
}

static COLD void append_real(TextBuffer *text, double number)
{
    char digits[20], formatted[40];
    int exponent, length;
    if (isnan(number)) {
        append(text, "nan");
        return;
    }
    if (signbit(number)) append(text, "-");
    number = fabs(number);
    if (isinf(number) || number == 0.0) {
        append(text, number == 0.0 ? "0.0" : "inf");
        return;
    }
    exponent = shortest_digits(number, digits);
    length = (int)strlen(digits);
    while (length > 1 && digits[length - 1] == '0') digits[--length] = '\0';
    if (exponent < -3 || exponent > 16) {
        snprintf(formatted, sizeof formatted, "%c%s%se%c%02d", digits[0], length > 1 ? "." : "", digits + 1,
                 exponent > 0 ? '+' : '-', abs(exponent - 1));
    } else if (exponent <= 0) {
        snprintf(formatted, sizeof formatted, "0.%.*s%s", -exponent, "0000", digits);
    } else if (exponent >= length) {
        snprintf(formatted, sizeof formatted, "%s%.*s.0", digits, exponent - length, "0000000000000000");
    } else {
        snprintf(formatted, sizeof formatted, "%.*s.%s", exponent, digits, digits + exponent);
    }
    append(text, formatted);
}

#endif
