/* A host without Python of its own: lives of an FMI 3.0 FMU, for co-simulation and for model exchange by Euler's steps.
 *
 *     fmi3_host LIBRARY TOKEN RESOURCES LIVES STOP STEPS POSITION SPEED PARAMETER
 *
 * A life is a run from time 0 to the stop, its second half once more from a state that was saved, and from that state
 * after it went through bytes; then a reset, and the run again.  All must end in the same values, to the last bit, and
 * so must all lives.  At last one in which the PARAMETER is -1: it must be refused.
 *
 * Prints the POSITION and the SPEED (value references) at the stop, for co-simulation, then for model exchange; what is
 * logged goes to standard error.  The exit status is 0 if all went well and the library could be unloaded.
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
    fmi3ValueReference outputs[OUTPUTS], bad;
} Task;

static void ok(fmi3Status status, const char *what)
{
    if (status != fmi3OK) die(what);
}

static void hear(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
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
    if (size > STATES) die("more states than expected");
    ok(fmi.GetContinuousStates(c, x, size), "states");
    ok(fmi.GetContinuousStateDerivatives(c, rates, size), "derivatives");
    for (size_t i = 0; i < size; i++) x[i] += h * rates[i];
    ok(fmi.SetTime(c, t + h), "time");
    ok(fmi.SetContinuousStates(c, x, size), "set states");
    ok(fmi.EnterEventMode(c), "event mode");
    update(c);
}

static void begin(fmi3Instance c, int exchange, const Task *task)
{
    ok(fmi.EnterInitializationMode(c, fmi3False, 0.0, 0.0, fmi3False, 0.0), "enter");
    ok(fmi.ExitInitializationMode(c), "exit");
    if (exchange) update(c);
}

static void go(fmi3Instance c, int exchange, const Task *task, int from, int to)
{
    double h = task->stop / task->steps;
    for (int i = from; i < to; i++) {
        double t = i * h;
        if (exchange) euler(c, t, h);
        else ok(step(c, t, h), "step");
    }
}

/* The values now, which must be those in `seen` unless nothing was seen. */
static void compare(fmi3Instance c, const Task *task, double *seen, const char *when)
{
    double now[OUTPUTS];
    ok(fmi.GetFloat64(c, task->outputs, OUTPUTS, now, OUTPUTS), "values");
    if (isnan(seen[0])) memcpy(seen, now, sizeof now);
    if (memcmp(seen, now, sizeof now)) die(when);
}

static fmi3Instance born(int exchange, const Task *task)
{
    fmi3Instance c = exchange
        ? fmi.InstantiateModelExchange("life", task->token, task->resources, fmi3False, fmi3True, NULL, hear)
        : fmi.InstantiateCoSimulation("life", task->token, task->resources, fmi3False, fmi3True, fmi3False, fmi3False,
                                      NULL, 0, NULL, hear, NULL);
    if (!c) die("no instance");
    return c;
}

static void live(int exchange, const Task *task, double *seen)
{
    fmi3Instance c = born(exchange, task);
    fmi3FMUState state = NULL, read = NULL;
    size_t size;
    begin(c, exchange, task);
    go(c, exchange, task, 0, task->steps / 2);
    ok(fmi.GetFMUState(c, &state), "save");
    go(c, exchange, task, task->steps / 2, task->steps);
    compare(c, task, seen, "another life ended otherwise");
    ok(fmi.SetFMUState(c, state), "restore");
    go(c, exchange, task, task->steps / 2, task->steps);
    compare(c, task, seen, "it did not go on from its state as before");
    ok(fmi.SerializedFMUStateSize(c, state, &size), "size");
    fmi3Byte *bytes = malloc(size);
    ok(fmi.SerializeFMUState(c, state, bytes, size), "serialize");
    ok(fmi.DeserializeFMUState(c, bytes, size, &read), "deserialize");
    free(bytes);
    ok(fmi.SetFMUState(c, read), "restore what was read");
    go(c, exchange, task, task->steps / 2, task->steps);
    compare(c, task, seen, "it did not go on from the bytes as before");
    ok(fmi.FreeFMUState(c, &state), "free state");
    ok(fmi.FreeFMUState(c, &read), "free what was read");
    ok(fmi.Reset(c), "reset");
    begin(c, exchange, task);
    go(c, exchange, task, 0, task->steps);
    compare(c, task, seen, "after a reset it ended otherwise");
    ok(fmi.Terminate(c), "terminate");
    fmi.FreeInstance(c);
}

static void refuse(const Task *task)
{
    fmi3Instance c = born(0, task);
    double bad = -1.0, values[OUTPUTS];
    ok(fmi.SetFloat64(c, &task->bad, 1, &bad, 1), "set");
    ok(fmi.EnterInitializationMode(c, fmi3False, 0.0, 0.0, fmi3False, 0.0), "enter");
    if (fmi.ExitInitializationMode(c) != fmi3Error) die("a bad parameter was not refused");
    if (step(c, 0.0, 1.0) != fmi3Error) die("a run goes on that never began");
    ok(fmi.GetFloat64(c, task->outputs, OUTPUTS, values, OUTPUTS), "values after a failure");
    if (!isnan(values[0]) || !isnan(values[1])) die("a failed run gives numbers");
    ok(fmi.Reset(c), "reset after a failure");
    begin(c, 0, task);
    ok(step(c, 0.0, 1.0), "a step after a failure and a reset");
    fmi.FreeInstance(c);
}

int main(int argc, char **argv)
{
    if (argc != 10) die("usage: fmi3_host LIBRARY TOKEN RESOURCES LIVES STOP STEPS POSITION SPEED PARAMETER");
    void *library = opened(argv[1]);
#define FIND(name) *(void **)&fmi.name = found(library, "fmi3" #name);
    FUNCTIONS(FIND)
    fmi3ValueReference references[3];
    for (int i = 0; i < 3; i++) references[i] = (fmi3ValueReference)strtoul(argv[7 + i], NULL, 10);
    Task task = {argv[2], argv[3], strtod(argv[5], NULL), atoi(argv[6]), {references[0], references[1]}, references[2]};
    double seen[2][OUTPUTS] = {{NAN, NAN}, {NAN, NAN}};
    for (int life = 0; life < atoi(argv[4]); life++) {
        live(0, &task, seen[0]);
        live(1, &task, seen[1]);
    }
    refuse(&task);
    for (int exchange = 0; exchange < 2; exchange++) printf("%a %a\n", seen[exchange][0], seen[exchange][1]);
    return closed(library) ? 0 : 1;
}
