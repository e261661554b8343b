/* FMI 2.0 host without Python: reads FMI calls from standard input, one per line, and makes them in an FMU's library.
 *
 *     host LIBRARY GUID RESOURCES
 *
 *     I new NAME [quiet [exchange]]                  I begin [T]             I step T H
 *     I setr REFERENCE VALUE                         I calls STATES INDICATORS CALLS
 *     I getr REFERENCE...    I pass REFERENCE J TO   I save                  I restore             I reset
 *     I free                 I time REPEAT STOP STEPS WORD...                0 unload
 *
 * I and J are indices of instances. step prints the status, getr prints the values. After a refused value, all steps
 * print its status until the instance is reset. After any other failure the program exits.
 *
 * time simulates from t = 0 to STOP in STEPS equal communication steps, REPEAT times. A word R=VALUE sets the Real with
 * value reference R before each run, iR=VALUE an Integer; a word R reads that Real at every point. It prints the run
 * time of the fastest run in s, including initialization and reading, and the values at every point of the last run.
 *
 * calls measures the model exchange calls of a solver, CALLS calls at a time. It prints the shortest time per call in
 * s: to set the time, to set the states, to get the derivatives, to get the event indicators.
 */
#define _POSIX_C_SOURCE 199309L
#include <dlfcn.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2FunctionTypes.h"

enum { INSTANCES = 4, WORDS = 64, LINE = 4096, REPETITIONS = 500 };

#define FUNCTIONS(f)                                                                                               \
    f(Instantiate) f(FreeInstance) f(SetupExperiment) f(EnterInitializationMode) f(ExitInitializationMode) f(Reset) \
    f(SetReal) f(SetInteger) f(GetReal) f(DoStep) f(GetFMUstate) f(SetFMUstate) f(FreeFMUstate)                     \
    f(NewDiscreteStates) f(EnterContinuousTimeMode) f(GetContinuousStates) f(SetTime) f(SetContinuousStates)        \
    f(GetDerivatives) f(GetEventIndicators)

static struct {
#define DECLARE(name) fmi2##name##TYPE *name;
    FUNCTIONS(DECLARE)
} fmi;

typedef struct {
    fmi2ValueReference references[WORDS];
    fmi2Real values[WORDS];
    size_t count;
} Reals;

typedef struct {
    fmi2ValueReference references[WORDS];
    fmi2Integer values[WORDS];
    size_t count;
} Integers;

static void die(const char *what, const char *why)
{
    fprintf(stderr, "host: %s: %s\n", what, why);
    exit(1);
}

#define DO(call) \
    if (fmi.call > fmi2Warning) die("fmi2" #call, "does not return OK")

static void log_message(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                        fmi2String category, fmi2String message, ...)
{
    (void)environment, (void)instance, (void)status, (void)category;
    va_list values;
    va_start(values, message);
    fprintf(stderr, "log: ");
    vfprintf(stderr, message, values);
    fprintf(stderr, "\n");
    va_end(values);
}

static const fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};

/* Append a word R or R=VALUE. */
static void add(Reals *reals, const char *word)
{
    const char *value = strchr(word, '=');
    if (value) reals->values[reals->count] = strtod(value + 1, NULL);
    reals->references[reals->count++] = (fmi2ValueReference)strtoul(word, NULL, 10);
}

/* Append a word R=VALUE. */
static void add_integer(Integers *integers, const char *word)
{
    char *value;
    integers->references[integers->count] = (fmi2ValueReference)strtoul(word, &value, 10);
    integers->values[integers->count++] = atoi(value + 1);
}

static void print_values(const fmi2Real *values, size_t count)
{
    printf("values");
    for (size_t n = 0; n < count; n++) printf(" %.17g", values[n]);
    printf("\n");
}

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* Return the time of one run in s; write the values at each point to `out`, row by row. */
static double run(fmi2Component c, const Reals *set, const Integers *choices, const Reals *read, double stop, int steps,
                  double *out)
{
    double start_time = now(), t = 0.0;
    if (set->count) DO(SetReal(c, set->references, set->count, set->values));
    if (choices->count) DO(SetInteger(c, choices->references, choices->count, choices->values));
    DO(SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2True, stop));
    DO(EnterInitializationMode(c));
    DO(ExitInitializationMode(c));
    DO(GetReal(c, read->references, read->count, out));
    for (int i = 1; i <= steps; i++) {
        double next = i < steps ? stop * i / steps : stop;
        DO(DoStep(c, t, next - t, fmi2True));
        t = next;
        DO(GetReal(c, read->references, read->count, out += read->count));
    }
    return now() - start_time;
}

static void time_runs(fmi2Component c, char **words, int count)
{
    Reals set = {.count = 0}, read = {.count = 0};
    Integers choices = {.count = 0};
    int repeat = atoi(words[0]), steps = atoi(words[2]);
    double stop = strtod(words[1], NULL), fastest = 0.0;
    for (int n = 3; n < count; n++) {
        if (words[n][0] == 'i')
            add_integer(&choices, words[n] + 1);
        else
            add(strchr(words[n], '=') ? &set : &read, words[n]);
    }
    double *out = malloc(((size_t)steps + 1) * read.count * sizeof *out);
    if (!out) die("time", "no memory");
    for (int i = 0; i <= repeat; i++) { /* the first one warms up */
        double seconds = run(c, &set, &choices, &read, stop, steps, out);
        if (i == 1 || (i && seconds < fastest)) fastest = seconds;
        DO(Reset(c));
    }
    printf("seconds %.9g\n", fastest);
    for (int i = 0; i <= steps; i++) print_values(out + (size_t)i * read.count, read.count);
    free(out);
}

#define TIME(call)                                                       \
    do {                                                                 \
        double fastest = INFINITY;                                       \
        for (int i = 0; i < REPETITIONS; i++) {                          \
            double start_time = now();                                        \
            for (long n = 0; n < n_calls; n++) DO(call);                 \
            fastest = fmin(fastest, now() - start_time);                      \
        }                                                                \
        printf(" %.9g", fastest / (double)n_calls);                        \
    } while (0)

static void time_calls(fmi2Component c, size_t states, size_t indicators, long n_calls)
{
    double x[WORDS], rates[WORDS], values[WORDS];
    fmi2EventInfo event = {.newDiscreteStatesNeeded = fmi2True};
    if (states > WORDS || indicators > WORDS) die("calls", "too many states or indicators");
    while (event.newDiscreteStatesNeeded) DO(NewDiscreteStates(c, &event));
    DO(EnterContinuousTimeMode(c));
    DO(GetContinuousStates(c, x, states));
    printf("seconds");
    TIME(SetTime(c, 1e-6 * (double)n));
    TIME(SetContinuousStates(c, x, states));
    TIME(GetDerivatives(c, rates, states));
    TIME(GetEventIndicators(c, values, indicators));
    printf("\n");
}

static void execute(const char *command, int i, char **words, int count, char **host)
{
    static fmi2Component instances[INSTANCES];
    static fmi2FMUstate states[INSTANCES];
    static fmi2Status refusals[INSTANCES];
    Reals read = {.count = 0};
    fmi2Component c = instances[i];
    fmi2Status status = fmi2OK;
#define IS(name) (!strcmp(command, name))
    if (IS("new")) {
        fmi2Type type = count < 3 ? fmi2CoSimulation : fmi2ModelExchange;
        refusals[i] = fmi2OK;
        instances[i] = fmi.Instantiate(words[0], type, host[2], host[3], &callbacks, fmi2False, count < 2);
        if (!instances[i]) die("new", "no instance");
    } else if (IS("begin")) {
        status = fmi.SetupExperiment(c, fmi2False, 0.0, count ? strtod(words[0], NULL) : 0.0, fmi2False, 0.0);
        if (status == fmi2OK) status = fmi.EnterInitializationMode(c);
        if (status == fmi2OK) fmi.ExitInitializationMode(c); /* an error here appears again in the steps */
    } else if (IS("step")) {
        status = refusals[i];
        if (status == fmi2OK) status = fmi.DoStep(c, strtod(words[0], NULL), strtod(words[1], NULL), fmi2True);
        printf("status %d\n", status);
        return;
    } else if (IS("setr")) {
        add(&read, words[0]);
        read.values[0] = strtod(words[1], NULL);
        if (refusals[i] == fmi2OK) refusals[i] = fmi.SetReal(c, read.references, 1, read.values);
    } else if (IS("getr")) {
        for (int n = 0; n < count; n++) add(&read, words[n]);
        status = fmi.GetReal(c, read.references, read.count, read.values);
        print_values(read.values, read.count);
    } else if (IS("pass")) {
        add(&read, words[0]);
        add(&read, words[2]);
        status = fmi.GetReal(c, read.references, 1, read.values);
        if (status == fmi2OK) status = fmi.SetReal(instances[atoi(words[1])], read.references + 1, 1, read.values);
    } else if (IS("time")) {
        time_runs(c, words, count);
    } else if (IS("calls")) {
        time_calls(c, strtoul(words[0], NULL, 10), strtoul(words[1], NULL, 10), atol(words[2]));
    } else if (IS("reset")) {
        refusals[i] = fmi2OK;
        status = fmi.Reset(c);
    } else if (IS("free")) {
        fmi.FreeInstance(c);
    } else if (IS("save")) {
        status = fmi.GetFMUstate(c, &states[i]);
    } else if (IS("restore")) {
        status = fmi.SetFMUstate(c, states[i]);
        if (status == fmi2OK) status = fmi.FreeFMUstate(c, &states[i]);
    } else {
        die(command, "unknown");
    }
    if (status != fmi2OK) die(command, "does not return OK");
}

int main(int argc, char **argv)
{
    char line[LINE], *words[WORDS];
    if (argc != 4) die("usage", "host LIBRARY GUID RESOURCES < calls");
    void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) die("dlopen", dlerror());
#define FIND(name) *(void **)&fmi.name = dlsym(library, "fmi2" #name); /* NULL if missing: not all FMUs save states */
    FUNCTIONS(FIND)
    while (fgets(line, sizeof line, stdin)) {
        int count = 0;
        for (char *word = strtok(line, " \n"); word && count < WORDS; word = strtok(NULL, " \n")) words[count++] = word;
        if (count < 2) die("line", "an instance and a command are needed");
        if (!strcmp(words[1], "unload")) {
            if (dlclose(library)) die("dlclose", dlerror());
        } else {
            execute(words[1], atoi(words[0]), words + 2, count - 2, argv);
        }
    }
    return fflush(stdout) ? 1 : 0;
}
