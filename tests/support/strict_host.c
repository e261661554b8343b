/* A host that ends a run like fmusim: by an error if a function does not return OK, without one if a step returns
 * Discard and the FMU says that it terminates.
 *
 *     strict_host LIBRARY GUID RESOURCES STOP [euler STATES | completing STATES] [REFERENCE=VALUE...]
 *                 [during REFERENCE=VALUE...] [step T H]
 *
 * Sets values before the run and, after `during`, in the middle of it; takes 10 steps up to the stop, or up to half of
 * it and then the given one. With `euler` the host integrates by Euler's method in model exchange, with `completing` it
 * also completes its steps. The exit status is 0 if the run ends well, 1 after an error, 2 if it cannot begin.
 */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

enum { STEPS = 10, MOST_STATES = 8 };

static void *library;
static size_t states; /* 0 in co-simulation */
static int completes_steps;

static void log_message(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                        fmi2String category, fmi2String message, ...)
{
    (void)environment, (void)instance, (void)status, (void)category, (void)message;
}

static const fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};

static void *find(const char *name)
{
    void *function = dlsym(library, name);
    if (!function) exit(2);
    return function;
}

#define CALL(name, ...)                                           \
    do {                                                          \
        name##TYPE *function;                                     \
        *(void **)&function = find(#name);                        \
        check(function(__VA_ARGS__), #name);                      \
    } while (0)

static void check(fmi2Status status, const char *name)
{
    if (status == fmi2OK) return;
    printf("%s %d\n", name, status);
    exit(1);
}

static void set(fmi2Component c, const char *word)
{
    fmi2ValueReference reference = (fmi2ValueReference)strtoul(word, NULL, 10);
    fmi2Real value = strtod(strchr(word, '=') + 1, NULL);
    CALL(fmi2SetReal, c, &reference, 1, &value);
}

/* Update the discrete states and leave event mode. */
static void handle_event(fmi2Component c)
{
    fmi2EventInfo event = {.newDiscreteStatesNeeded = fmi2True};
    while (event.newDiscreteStatesNeeded) CALL(fmi2NewDiscreteStates, c, &event);
    CALL(fmi2EnterContinuousTimeMode, c);
}

/* Set the values of all words of the form REFERENCE=VALUE; return the number of the word after them. */
static int set_all(fmi2Component c, int argc, char **argv, int n)
{
    for (; n < argc && strchr(argv[n], '='); n++) set(c, argv[n]);
    return n;
}

static void euler_step(fmi2Component c, double t, double h)
{
    fmi2Real x[MOST_STATES], rates[MOST_STATES];
    fmi2Boolean has_event = fmi2False, terminates = fmi2False;
    CALL(fmi2GetContinuousStates, c, x, states);
    CALL(fmi2GetDerivatives, c, rates, states);
    for (size_t i = 0; i < states; i++) x[i] += h * rates[i];
    CALL(fmi2SetTime, c, t + h);
    CALL(fmi2SetContinuousStates, c, x, states);
    if (completes_steps) CALL(fmi2CompletedIntegratorStep, c, fmi2True, &has_event, &terminates);
}

/* Return whether the run goes on. */
static int step(fmi2Component c, double t, double h)
{
    fmi2DoStepTYPE *do_step;
    fmi2Boolean terminated = fmi2False;
    *(void **)&do_step = find("fmi2DoStep");
    fmi2Real last_time;
    if (states) {
        euler_step(c, t, h);
        return 1;
    }
    fmi2Status status = do_step(c, t, h, fmi2True);
    if (status != fmi2Discard) {
        check(status, "fmi2DoStep");
        return 1;
    }
    CALL(fmi2GetRealStatus, c, fmi2LastSuccessfulTime, &last_time);
    CALL(fmi2GetBooleanStatus, c, fmi2Terminated, &terminated);
    if (!terminated) check(status, "fmi2DoStep");
    printf("the FMU terminates\n");
    return 0;
}

int main(int argc, char **argv)
{
    fmi2InstantiateTYPE *instantiate;
    if (argc < 5) return 2;
    library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 2;
    }
    double stop = strtod(argv[4], NULL), h = stop / STEPS;
    int n = 5;
    if (n + 1 < argc && (!strcmp(argv[n], "euler") || !strcmp(argv[n], "completing"))) {
        completes_steps = *argv[n] == 'c';
        states = strtoul(argv[n + 1], NULL, 10);
        if (states < 1 || states > MOST_STATES) return 2;
        n += 2;
    }
    *(void **)&instantiate = find("fmi2Instantiate");
    fmi2Type type = states ? fmi2ModelExchange : fmi2CoSimulation;
    fmi2Component c = instantiate("strict", type, argv[2], argv[3], &callbacks, fmi2False, fmi2True);
    if (!c) return 2;
    n = set_all(c, argc, argv, n);
    CALL(fmi2SetupExperiment, c, fmi2False, 0.0, 0.0, fmi2True, stop);
    CALL(fmi2EnterInitializationMode, c);
    CALL(fmi2ExitInitializationMode, c);
    if (states) handle_event(c);
    for (int i = 0; i < STEPS; i++) {
        if (i == STEPS / 2 && n < argc && !strcmp(argv[n], "during")) {
            if (states) CALL(fmi2EnterEventMode, c);
            n = set_all(c, argc, argv, n + 1);
            if (states) handle_event(c);
        }
        if (i == STEPS / 2 && n + 2 < argc) {
            step(c, strtod(argv[n + 1], NULL), strtod(argv[n + 2], NULL));
            return 0;
        }
        if (!step(c, i * h, h)) return 0;
    }
    CALL(fmi2Terminate, c);
    return 0;
}
