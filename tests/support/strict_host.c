/* A host that ends a run like fmusim: by an error if a function returns Error or Fatal, without one if a step returns
 * Discard and the FMU says that it terminates.
 *
 *     strict_host LIBRARY GUID RESOURCES STOP [REFERENCE=VALUE...] [during REFERENCE=VALUE...] [step T H]
 *
 * Sets values before the run and, after `during`, in the middle of it; takes 10 steps up to the stop, or up to half of it
 * and then the given one. The exit status is 0 if the run ends well, 1 after an error, 2 if it cannot begin.
 */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

enum { STEPS = 10 };

static void *library;

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
    if (status <= fmi2Warning) return;
    printf("%s %d\n", name, status);
    exit(1);
}

static void set(fmi2Component c, const char *word)
{
    fmi2ValueReference reference = (fmi2ValueReference)strtoul(word, NULL, 10);
    fmi2Real value = strtod(strchr(word, '=') + 1, NULL);
    CALL(fmi2SetReal, c, &reference, 1, &value);
}

/* Return whether the run goes on. */
static int step(fmi2Component c, double t, double h)
{
    fmi2DoStepTYPE *do_step;
    fmi2Boolean terminated = fmi2False;
    *(void **)&do_step = find("fmi2DoStep");
    fmi2Status status = do_step(c, t, h, fmi2True);
    if (status != fmi2Discard) {
        check(status, "fmi2DoStep");
        return 1;
    }
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
    *(void **)&instantiate = find("fmi2Instantiate");
    fmi2Component c = instantiate("strict", fmi2CoSimulation, argv[2], argv[3], &callbacks, fmi2False, fmi2True);
    if (!c) return 2;
    for (; n < argc && strchr(argv[n], '='); n++) set(c, argv[n]);
    CALL(fmi2SetupExperiment, c, fmi2False, 0.0, 0.0, fmi2True, stop);
    CALL(fmi2EnterInitializationMode, c);
    CALL(fmi2ExitInitializationMode, c);
    for (int i = 0; i < STEPS; i++) {
        if (i == STEPS / 2 && n < argc && !strcmp(argv[n], "during")) {
            for (n++; n < argc && strchr(argv[n], '='); n++) set(c, argv[n]);
        }
        if (i == STEPS / 2 && n + 2 < argc) {
            step(c, strtod(argv[n + 1], NULL), strtod(argv[n + 2], NULL));
            return 0;
        }
        if (!step(c, i * h, h)) return 0;
    }
    return 0;
}
