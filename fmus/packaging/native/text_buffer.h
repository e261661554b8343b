/* Sentences, with numbers as Python's repr writes them: the fewest digits that read back as the same double. */
#ifndef TEXT_BUFFER_H
#define TEXT_BUFFER_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    size_t length;
    char buffer[2048]; /* longer than any sentence; what is too long is cut */
} TextBuffer;

static inline void append(TextBuffer *text, const char *piece)
{
    size_t space = sizeof text->buffer - 1 - text->length, length = strlen(piece);
    if (length > space) length = space;
    memcpy(text->buffer + text->length, piece, length);
    text->length += length;
    text->buffer[text->length] = '\0';
}

static inline void append_integer(TextBuffer *text, int64_t number)
{
    char digits[24];
    snprintf(digits, sizeof digits, "%lld", (long long)number);
    append(text, digits);
}

/* One more in the last of some decimal digits; true if that made one digit more. */
static inline int increment_digits(char *digits, int length)
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

/* Whether 0.d1d2d3... times ten to the power reads back as the number; free of any decimal point. */
static inline int round_trips(const char *digits, int power, double number)
{
    char plain[40];
    snprintf(plain, sizeof plain, "%se%d", digits, power - (int)strlen(digits));
    return strtod(plain, NULL) == number;
}

/* The digits of a positive number and its power: number = 0.d1d2d3... * 10^power. */
static inline int shortest_digits(double number, char digits[20])
{
    for (int length = 1;; length++) {
        char full[40];
        int power, found = 0;
        snprintf(full, sizeof full, "%.*e", length - 1, number);
        for (const char *c = full; *c != 'e'; c++) { /* whatever stands for the decimal point */
            if (*c >= '0' && *c <= '9') digits[found++] = *c;
        }
        digits[found] = '\0';
        power = atoi(strchr(full, 'e') + 1) + 1;
        if (length == 17 || round_trips(digits, power, number)) return power;
        power += increment_digits(digits, found); /* beside a power of two the neighbours are not equally far */
        if (round_trips(digits, power, number)) return power;
    }
}

static inline void append_real(TextBuffer *text, double number)
{
    char digits[20], piece[40];
    int power, length;
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
    power = shortest_digits(number, digits);
    length = (int)strlen(digits);
    while (length > 1 && digits[length - 1] == '0') digits[--length] = '\0';
    if (power < -3 || power > 16) {
        snprintf(piece, sizeof piece, "%c%s%se%c%02d", digits[0], length > 1 ? "." : "", digits + 1,
                 power > 0 ? '+' : '-', abs(power - 1));
    } else if (power <= 0) {
        snprintf(piece, sizeof piece, "0.%.*s%s", -power, "0000", digits);
    } else if (power >= length) {
        snprintf(piece, sizeof piece, "%s%.*s.0", digits, power - length, "0000000000000000");
    } else {
        snprintf(piece, sizeof piece, "%.*s.%s", power, digits, digits + power);
    }
    append(text, piece);
}

#endif
