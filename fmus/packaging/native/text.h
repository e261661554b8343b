/* Sentences, with numbers as Python's repr writes them: the fewest digits that read back as the same double. */
#ifndef TEXT_H
#define TEXT_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    size_t length;
    char line[2048]; /* longer than any sentence; what is too long is cut */
} Text;

static inline void add(Text *text, const char *piece)
{
    size_t room = sizeof text->line - 1 - text->length, length = strlen(piece);
    if (length > room) length = room;
    memcpy(text->line + text->length, piece, length);
    text->length += length;
    text->line[text->length] = '\0';
}

static inline void add_integer(Text *text, int64_t number)
{
    char digits[24];
    snprintf(digits, sizeof digits, "%lld", (long long)number);
    add(text, digits);
}

/* One more in the last of some decimal digits; true if that made one digit more. */
static inline int count_up(char *digits, int length)
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
static inline int reads_back(const char *digits, int power, double number)
{
    char plain[40];
    snprintf(plain, sizeof plain, "%se%d", digits, power - (int)strlen(digits));
    return strtod(plain, NULL) == number;
}

/* The digits of a positive number and its power: number = 0.d1d2d3... * 10^power. */
static inline int shortest(double number, char digits[20])
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
        if (length == 17 || reads_back(digits, power, number)) return power;
        power += count_up(digits, found); /* beside a power of two the neighbours are not equally far */
        if (reads_back(digits, power, number)) return power;
    }
}

static inline void add_real(Text *text, double number)
{
    char digits[20], piece[40];
    int power, length;
    if (isnan(number)) {
        add(text, "nan");
        return;
    }
    if (signbit(number)) add(text, "-");
    number = fabs(number);
    if (isinf(number) || number == 0.0) {
        add(text, number == 0.0 ? "0.0" : "inf");
        return;
    }
    power = shortest(number, digits);
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
    add(text, piece);
}

#endif
