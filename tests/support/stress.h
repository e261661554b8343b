/* What the programs that abuse a native FMU share; they include its sources, then this. */
#ifndef ABUSE_H
#define ABUSE_H

#define HOLDS(condition) \
    if (!(condition)) die(#condition, __LINE__)

static void die(const char *what, int line)
{
    printf("line %d: not so: %s\n", line, what);
    fflush(stdout);
    abort();
}

/* ---- chance (S. Vigna, xorshift64*) */

static uint64_t chance = 1;

static uint64_t draw(uint64_t below)
{
    chance ^= chance >> 12, chance ^= chance << 25, chance ^= chance >> 27;
    return (chance * UINT64_C(2685821657736338717) >> 20) % below;
}

/* A number of the kind that goes wrong. */
static double number(void)
{
    static const double numbers[] = {0.0, -0.0, 1.0, -1.0, 0.5, 0.01, 2.0, -5.0, 1e-3, 1e9, 1e300, -1e300, -5e-324,
                                     NAN, INFINITY, -INFINITY, 9.81, 100.0};
    return numbers[draw(sizeof numbers / sizeof *numbers)];
}

static uint32_t reference_of(const char *name)
{
    for (uint32_t i = 0; i < VARIABLES; i++) {
        if (!strcmp(variables[i].name, name)) return i;
    }
    die(name, __LINE__);
    return 0;
}

#endif
