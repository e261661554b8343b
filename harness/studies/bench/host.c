/* A host in C that runs the library of an FMU several times, and takes the time.
 *
 *     host LIBRARY GUID RESOURCES REPEAT STOP STEPS WORD...
 *
 * A run goes from t = 0 to STOP in so many equal communication steps.  The word R=VALUE sets the Real of value reference
 * R before it; the word R has that Real read at every point.  Printed are the seconds of the fastest run, initialisation
 * and reading included, then the values at every point of the last one.
 */
#define _POSIX_C_SOURCE 199309L
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2FunctionTypes.h"

enum { WORDS = 32 };

#define FUNCTIONS(f)                                                                                               \
    f(Instantiate) f(FreeInstance) f(SetupExperiment) f(EnterInitializationMode) f(ExitInitializationMode) f(Reset) \
    f(SetReal) f(GetReal) f(DoStep)

static struct {
#define DECLARE(name) fmi2##name##TYPE *name;
    FUNCTIONS(DECLARE)
} fmi;

typedef struct {
    fmi2ValueReference references[WORDS];
    double values[WORDS];
    size_t count;
} Reals;

static void die(const char *what)
{
    fprintf(stderr, "host: %s\n", what);
    exit(1);
}

static void check(fmi2Status status, const char *call)
{
    if (status > fmi2Warning) die(call);
}

static void hear(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                 fmi2String message, ...)
{
    (void)environment, (void)instance, (void)status, (void)category, (void)message; /* FMUs speak on standard error */
}

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* The seconds of one run; what is read at each point goes to `out`, row by row. */
static double run(fmi2Component c, const Reals *set, const Reals *read, double stop, int steps, double *out)
{
    double begun = now(), t = 0.0;
    if (set->count) check(fmi.SetReal(c, set->references, set->count, set->values), "fmi2SetReal");
    check(fmi.SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2True, stop), "fmi2SetupExperiment");
    check(fmi.EnterInitializationMode(c), "fmi2EnterInitializationMode");
    check(fmi.ExitInitializationMode(c), "fmi2ExitInitializationMode");
    check(fmi.GetReal(c, read->references, read->count, out), "fmi2GetReal");
    for (int i = 1; i <= steps; i++) {
        double next = i < steps ? stop * i / steps : stop;
        check(fmi.DoStep(c, t, next - t, fmi2True), "fmi2DoStep");
        t = next;
        check(fmi.GetReal(c, read->references, read->count, out += read->count), "fmi2GetReal");
    }
    return now() - begun;
}

int main(int argc, char **argv)
{
    static const fmi2CallbackFunctions callbacks = {hear, calloc, free, NULL, NULL};
    Reals set = {.count = 0}, read = {.count = 0};
    if (argc < 8 || argc > 7 + WORDS) die("usage: host LIBRARY GUID RESOURCES REPEAT STOP STEPS WORD...");
    void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) die(dlerror());
#define FIND(name)                                     \
    *(void **)&fmi.name = dlsym(library, "fmi2" #name); \
    if (!fmi.name) die("fmi2" #name " is not there");
    FUNCTIONS(FIND)
    int repeat = atoi(argv[4]), steps = atoi(argv[6]);
    double stop = strtod(argv[5], NULL), fastest = 0.0;
    for (char **word = argv + 7; *word; word++) {
        char *value = strchr(*word, '=');
        Reals *reals = value ? &set : &read;
        if (value) reals->values[reals->count] = strtod(value + 1, NULL);
        reals->references[reals->count++] = (fmi2ValueReference)strtoul(*word, NULL, 10);
    }
    double *out = malloc(((size_t)steps + 1) * read.count * sizeof *out);
    fmi2Component c = fmi.Instantiate("bench", fmi2CoSimulation, argv[2], argv[3], &callbacks, fmi2False, fmi2False);
    if (!c || !out) die("no instance");
    for (int i = 0; i <= repeat; i++) { /* one more, to warm up */
        double seconds = run(c, &set, &read, stop, steps, out);
        if (i == 1 || (i && seconds < fastest)) fastest = seconds;
        check(fmi.Reset(c), "fmi2Reset");
    }
    fmi.FreeInstance(c);
    printf("%.9g\n", fastest);
    for (size_t i = 0; i < ((size_t)steps + 1) * read.count; i++) {
        printf("%.17g%c", out[i], (i + 1) % read.count ? ' ' : '\n');
    }
    free(out);
    return fflush(stdout) ? 1 : 0;
}
