/* Shared by the stress programs, which include the sources of an FMU first. */
#ifndef STRESS_H
#define STRESS_H

#define CHECK(condition) \
    if (!(condition)) die(#condition, __LINE__)

static void die(const char *what, int line)
{
    printf("line %d: failed: %s\n", line, what);
    fflush(stdout);
    abort();
}

/* ---- random numbers (S. Vigna, xorshift64*) */

static uint64_t random_state = 1;

static uint64_t draw(uint64_t below)
{
    random_state ^= random_state >> 12, random_state ^= random_state << 25, random_state ^= random_state >> 27;
    return (random_state * UINT64_C(2685821657736338717) >> 20) % below;
}

/* A typical problematic number. */
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
