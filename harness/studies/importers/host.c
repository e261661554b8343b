/* A host that is not Python: plays FMI calls, one a line from standard input, on the library of an FMU.
 *
 *     host LIBRARY GUID RESOURCES
 *
 *     I new NAME             I begin                 I step T H              I setr REFERENCE VALUE
 *     I getr REFERENCE...    I pass REFERENCE J TO   I save                  I restore             I reset
 *     I free                 0 unload
 *
 * I and J are numbers of instances.  step answers its status, getr the values; whatever else fails ends the host.
 */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

enum { INSTANCES = 4, WORDS = 64, LINE = 4096 };

#define FUNCTIONS(f)                                                                                               \
    f(Instantiate) f(FreeInstance) f(SetupExperiment) f(EnterInitializationMode) f(ExitInitializationMode) f(Reset) \
    f(Terminate) f(SetReal) f(GetReal) f(DoStep) f(GetFMUstate) f(SetFMUstate) f(FreeFMUstate)

static struct {
#define DECLARE(name) fmi2##name##TYPE *name;
    FUNCTIONS(DECLARE)
} fmi;

static void die(const char *what, const char *why)
{
    fprintf(stderr, "host: %s: %s\n", what, why);
    exit(1);
}

static void hear(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                 fmi2String message, ...)
{
    va_list values;
    va_start(values, message);
    fprintf(stderr, "log: ");
    vfprintf(stderr, message, values);
    fprintf(stderr, "\n");
    va_end(values);
}

static const fmi2CallbackFunctions callbacks = {hear, calloc, free, NULL, NULL};

static void play(const char *command, int i, char **words, int count, char **host)
{
    static fmi2Component instances[INSTANCES];
    static fmi2FMUstate states[INSTANCES];
    fmi2ValueReference references[WORDS];
    fmi2Real values[WORDS];
    fmi2Component c = instances[i];
    fmi2Status status = fmi2OK;
#define IS(name) (!strcmp(command, name))
    if (IS("new")) {
        instances[i] = fmi.Instantiate(words[0], fmi2CoSimulation, host[2], host[3], &callbacks, fmi2False, fmi2True);
        if (!instances[i]) die("new", "no instance");
    } else if (IS("begin")) {
        status = fmi.SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
        if (status == fmi2OK) status = fmi.EnterInitializationMode(c);
        if (status == fmi2OK) fmi.ExitInitializationMode(c); /* what it refuses, the steps refuse too */
    } else if (IS("step")) {
        printf("status %d\n", fmi.DoStep(c, strtod(words[0], NULL), strtod(words[1], NULL), fmi2True));
    } else if (IS("setr")) {
        references[0] = (fmi2ValueReference)strtoul(words[0], NULL, 10);
        values[0] = strtod(words[1], NULL);
        status = fmi.SetReal(c, references, 1, values);
    } else if (IS("getr")) {
        for (int n = 0; n < count; n++) references[n] = (fmi2ValueReference)strtoul(words[n], NULL, 10);
        status = fmi.GetReal(c, references, (size_t)count, values);
        printf("values");
        for (int n = 0; n < count; n++) printf(" %.17g", values[n]);
        printf("\n");
    } else if (IS("pass")) {
        references[0] = (fmi2ValueReference)strtoul(words[0], NULL, 10);
        references[1] = (fmi2ValueReference)strtoul(words[2], NULL, 10);
        status = fmi.GetReal(c, references, 1, values);
        if (status == fmi2OK) status = fmi.SetReal(instances[atoi(words[1])], references + 1, 1, values);
    } else if (IS("save")) {
        status = fmi.GetFMUstate(c, &states[i]);
    } else if (IS("restore")) {
        status = fmi.SetFMUstate(c, states[i]);
        if (status == fmi2OK) status = fmi.FreeFMUstate(c, &states[i]);
    } else if (IS("reset")) {
        status = fmi.Reset(c);
    } else if (IS("free")) {
        fmi.FreeInstance(c);
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
#define FIND(name)                                     \
    *(void **)&fmi.name = dlsym(library, "fmi2" #name); \
    if (!fmi.name) die("fmi2" #name, "not there");
    FUNCTIONS(FIND)
    while (fgets(line, sizeof line, stdin)) {
        int count = 0;
        for (char *word = strtok(line, " \n"); word && count < WORDS; word = strtok(NULL, " \n")) words[count++] = word;
        if (count < 2) die("line", "an instance and a command are needed");
        if (!strcmp(words[1], "unload")) {
            if (dlclose(library)) die("dlclose", dlerror());
        } else {
            play(words[1], atoi(words[0]), words + 2, count - 2, argv);
        }
    }
    return fflush(stdout) ? 1 : 0;
}
