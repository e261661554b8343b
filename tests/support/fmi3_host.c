/* A host without Python: repeated runs of an FMI 3.0 FMU, in co-simulation and in model exchange with Euler steps.
 *
 *     fmi3_host LIBRARY TOKEN RESOURCES CYCLES STOP STEPS POSITION SPEED PARAMETER
 *
 * A cycle is a run from time 0 to the stop, whose second half is repeated from a saved state and from a serialized
 * one; then a reset, and the run again.  All must end in the same values, bit for bit, and so must all cycles.
 * In a final one the PARAMETER is set to -1, which must be refused and change nothing.
 *
 * Prints the POSITION and the SPEED (value references) at the stop, for co-simulation, then for model exchange; log
 * messages are written to standard error.  The exit status is 0 if all went well and the library could be unloaded.
 */
#include <math.h>
#include <string.h>

#include "fmi3FunctionTypes.h"
#include "library.h"

enum { STATES = 3, OUTPUTS = 2 };

#define FUNCTIONS(f)                                                                                                 \
    f(InstantiateCoSimulation) f(InstantiateModelExchange) f(FreeInstance) f(EnterInitializationMode)                \
    f(ExitInitializationMode) f(Reset) f(Terminate) f(SetFloat64) f(GetFloat64) f(DoStep) f(GetFMUState)             \
    f(SetFMUState) f(FreeFMUState) f(SerializedFMUStateSize) f(SerializeFMUState) f(DeserializeFMUState)             \
    f(EnterEventMode) f(UpdateDiscreteStates) f(EnterContinuousTimeMode) f(SetTime) f(SetContinuousStates)           \
    f(GetContinuousStates) f(GetContinuousStateDerivatives) f(GetNumberOfContinuousStates)

static struct {
#define DECLARE(name) fmi3##name##TYPE *name;
    FUNCTIONS(DECLARE)
} fmi;

typedef struct {
    const char *token, *resources;
    double stop;
    int steps;
    fmi3ValueReference outputs[OUTPUTS], invalid;
} Task;

static void ok(fmi3Status status, const char *what)
{
    if (status != fmi3OK) die(what);
}

static void on_log(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)environment;
    fprintf(stderr, "log %d %s %s\n", status, category, message);
}

static void update(fmi3Instance c)
{
    fmi3Boolean again = fmi3True, terminate = fmi3False, nominals, states, timed;
    double next;
    while (again) {
        ok(fmi.UpdateDiscreteStates(c, &again, &terminate, &nominals, &states, &timed, &next), "update");
        if (terminate) die("terminate");
    }
    ok(fmi.EnterContinuousTimeMode(c), "continuous time");
}

static fmi3Status step(fmi3Instance c, double t, double h)
{
    fmi3Boolean event = fmi3False, terminate = fmi3False, early = fmi3False;
    double reached = t;
    fmi3Status status = fmi.DoStep(c, t, h, fmi3True, &event, &terminate, &early, &reached);
    if (event || terminate || early) die("a step that ends early");
    return status;
}

static void euler(fmi3Instance c, double t, double h)
{
    double x[STATES], rates[STATES];
    size_t size;
    ok(fmi.GetNumberOfContinuousStates(c, &size), "number of states");
    if (size > STATES) die("too many states");
    ok(fmi.GetContinuousStates(c, x, size), "states");
    ok(fmi.GetContinuousStateDerivatives(c, rates, size), "derivatives");
    for (size_t i = 0; i < size; i++) x[i] += h * rates[i];
    ok(fmi.SetTime(c, t + h), "time");
    ok(fmi.SetContinuousStates(c, x, size), "set states");
    ok(fmi.EnterEventMode(c), "event mode");
    update(c);
}

static void begin(fmi3Instance c, int exchange)
{
    ok(fmi.EnterInitializationMode(c, fmi3False, 0.0, 0.0, fmi3False, 0.0), "enter");
    ok(fmi.ExitInitializationMode(c), "exit");
    if (exchange) update(c);
}

static void integrate(fmi3Instance c, int exchange, const Task *task, int from, int to)
{
    double h = task->stop / task->steps;
    for (int i = from; i < to; i++) {
        double t = i * h;
        if (exchange) euler(c, t, h);
        else ok(step(c, t, h), "step");
    }
}

/* Compare the values with `expected`, or store them there the first time. */
static void compare(fmi3Instance c, const Task *task, double *expected, const char *when)
{
    double now[OUTPUTS];
    ok(fmi.GetFloat64(c, task->outputs, OUTPUTS, now, OUTPUTS), "values");
    if (isnan(expected[0])) memcpy(expected, now, sizeof now);
    if (memcmp(expected, now, sizeof now)) die(when);
}

static fmi3Instance instantiate(int exchange, const Task *task)
{
    fmi3Instance c = exchange
        ? fmi.InstantiateModelExchange("cycle", task->token, task->resources, fmi3False, fmi3True, NULL, on_log)
        : fmi.InstantiateCoSimulation("cycle", task->token, task->resources, fmi3False, fmi3True, fmi3False, fmi3False,
                                      NULL, 0, NULL, on_log, NULL);
    if (!c) die("no instance");
    return c;
}

static void run_life_cycle(int exchange, const Task *task, double *expected)
{
    fmi3Instance c = instantiate(exchange, task);
    fmi3FMUState state = NULL, read = NULL;
    size_t size;
    begin(c, exchange);
    integrate(c, exchange, task, 0, task->steps / 2);
    ok(fmi.GetFMUState(c, &state), "save");
    integrate(c, exchange, task, task->steps / 2, task->steps);
    compare(c, task, expected, "another cycle ended differently");
    ok(fmi.SetFMUState(c, state), "restore");
    integrate(c, exchange, task, task->steps / 2, task->steps);
    compare(c, task, expected, "it continued differently from a saved state");
    ok(fmi.SerializedFMUStateSize(c, state, &size), "size");
    fmi3Byte *bytes = malloc(size);
    ok(fmi.SerializeFMUState(c, state, bytes, size), "serialize");
    ok(fmi.DeserializeFMUState(c, bytes, size, &read), "deserialize");
    free(bytes);
    ok(fmi.SetFMUState(c, read), "restore the deserialized state");
    integrate(c, exchange, task, task->steps / 2, task->steps);
    compare(c, task, expected, "it continued differently from a serialized state");
    ok(fmi.FreeFMUState(c, &state), "free state");
    ok(fmi.FreeFMUState(c, &read), "free the deserialized state");
    ok(fmi.Reset(c), "reset");
    begin(c, exchange);
    integrate(c, exchange, task, 0, task->steps);
    compare(c, task, expected, "it ended differently after a reset");
    ok(fmi.Terminate(c), "terminate");
    fmi.FreeInstance(c);
}

static void check_error(const Task *task)
{
    fmi3Instance c = instantiate(0, task);
    double invalid = -1.0, values[OUTPUTS];
    if (fmi.SetFloat64(c, &task->invalid, 1, &invalid, 1) != fmi3Error) die("an invalid parameter was not refused");
    begin(c, 0);
    ok(step(c, 0.0, 1.0), "a step after a refused parameter");
    ok(fmi.GetFloat64(c, task->outputs, OUTPUTS, values, OUTPUTS), "values after a refused parameter");
    if (isnan(values[0]) || isnan(values[1])) die("a refused parameter changes values");
    fmi.FreeInstance(c);
}

int main(int argc, char **argv)
{
    if (argc != 10) die("usage: fmi3_host LIBRARY TOKEN RESOURCES CYCLES STOP STEPS POSITION SPEED PARAMETER");
    void *library = open_library(argv[1]);
#define FIND(name) *(void **)&fmi.name = find_function(library, "fmi3" #name);
    FUNCTIONS(FIND)
    fmi3ValueReference references[3];
    for (int i = 0; i < 3; i++) references[i] = (fmi3ValueReference)strtoul(argv[7 + i], NULL, 10);
    Task task = {argv[2], argv[3], strtod(argv[5], NULL), atoi(argv[6]), {references[0], references[1]}, references[2]};
    double expected[2][OUTPUTS] = {{NAN, NAN}, {NAN, NAN}};
    for (int cycle = 0; cycle < atoi(argv[4]); cycle++) {
        run_life_cycle(0, &task, expected[0]);
        run_life_cycle(1, &task, expected[1]);
    }
    check_error(&task);
    for (int exchange = 0; exchange < 2; exchange++) printf("%a %a\n", expected[exchange][0], expected[exchange][1]);
    return close_library(library) ? 0 : 1;
}
