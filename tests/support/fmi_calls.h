/* The calls of a host, alike for FMI 2.0 and, where FMI3 is defined, for FMI 3.0; on any platform. */
#ifndef FMI_CALLS_H
#define FMI_CALLS_H

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

typedef struct {
    double tolerance, start, stop; /* NAN: not given */
} Experiment;

/* Functions with the same arguments in both versions: our name, and that of FMI 2.0 and of FMI 3.0. */
#define SAME(f)                                                                                                \
    f(free_instance, FreeInstance, FreeInstance) f(set_logging, SetDebugLogging, SetDebugLogging)              \
    f(exit_initialization, ExitInitializationMode, ExitInitializationMode) f(terminate, Terminate, Terminate)  \
    f(reset, Reset, Reset) f(save, GetFMUstate, GetFMUState) f(restore, SetFMUstate, SetFMUState)              \
    f(drop, FreeFMUstate, FreeFMUState) f(size_of_state, SerializedFMUstateSize, SerializedFMUStateSize)       \
    f(serialize, SerializeFMUstate, SerializeFMUState) f(deserialize, DeSerializeFMUstate, DeserializeFMUState) \
    f(enter_event_mode, EnterEventMode, EnterEventMode) f(set_time, SetTime, SetTime)                          \
    f(enter_continuous_time, EnterContinuousTimeMode, EnterContinuousTimeMode)                                 \
    f(get_states, GetContinuousStates, GetContinuousStates)                                                    \
    f(set_states, SetContinuousStates, SetContinuousStates)                                                    \
    f(get_rates, GetDerivatives, GetContinuousStateDerivatives)                                                \
    f(complete_step, CompletedIntegratorStep, CompletedIntegratorStep)

#ifdef FMI3
#include "fmi3FunctionTypes.h"
#define PREFIX "fmi3"
#define TYPE(two, three) fmi3##three##TYPE
#define NAME(two, three) "fmi3" #three
#define OTHERS(f)                                                                             \
    f(InstantiateCoSimulation) f(InstantiateModelExchange) f(EnterInitializationMode) f(DoStep) \
    f(GetFloat64) f(SetFloat64) f(GetInt64) f(SetInt64) f(GetBoolean) f(SetBoolean)           \
    f(GetString) f(SetString) f(UpdateDiscreteStates)
#define OTHER_TYPE(name) fmi3##name##TYPE
typedef fmi3FMUState SavedState;
typedef fmi3Boolean Flag;
typedef int64_t Integer;
#else
#include "fmi2FunctionTypes.h"
#define PREFIX "fmi2"
#define TYPE(two, three) fmi2##two##TYPE
#define NAME(two, three) "fmi2" #two
#define OTHERS(f)                                                                                   \
    f(Instantiate) f(SetupExperiment) f(EnterInitializationMode) f(DoStep) f(GetReal) f(SetReal)    \
    f(GetInteger) f(SetInteger) f(GetBoolean) f(SetBoolean) f(GetString) f(SetString)               \
    f(NewDiscreteStates) f(GetRealStatus) f(GetBooleanStatus) f(GetStatus) f(GetIntegerStatus)      \
    f(GetStringStatus) f(GetDirectionalDerivative) f(SetRealInputDerivatives) f(GetRealOutputDerivatives) f(CancelStep)
#define OTHER_TYPE(name) fmi2##name##TYPE
typedef fmi2FMUstate SavedState;
typedef fmi2Boolean Flag;
typedef fmi2Integer Integer;
#endif

static struct {
#define DECLARE(name, two, three) TYPE(two, three) *name;
#define DECLARE_OTHER(name) OTHER_TYPE(name) *name;
    SAME(DECLARE) OTHERS(DECLARE_OTHER)
} fmi;

static void die(const char *what)
{
    fprintf(stderr, "host: %s\n", what);
    exit(2);
}

static void *library;

/* NULL if there is none: Python FMUs have no model exchange. */
static void *find_function(const char *name)
{
#ifdef _WIN32
    return (void *)GetProcAddress((HMODULE)library, name);
#else
    return dlsym(library, name);
#endif
}

static void open_library(const char *path)
{
#ifdef _WIN32
    library = LoadLibraryA(path);
    if (!library) die("the library does not load");
#else
    library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library) die(dlerror());
#endif
#define FIND(name, two, three) *(void **)&fmi.name = find_function(NAME(two, three));
#define FIND_OTHER(name) *(void **)&fmi.name = find_function(PREFIX #name);
    SAME(FIND) OTHERS(FIND_OTHER)
}

static bool close_library(void)
{
#ifdef _WIN32
    return FreeLibrary((HMODULE)library);
#else
    return !dlclose(library);
#endif
}

#ifdef FMI3
static void on_log(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    fprintf(environment, "log %d %s %s\n", status, category, message);
}

typedef FILE *Log;

static void open_log(Log *log, FILE *out) { *log = out; }

static void *instantiate(const char *name, const char *guid, const char *resources, bool exchange, Log *log)
{
    return exchange ? fmi.InstantiateModelExchange(name, guid, resources, false, true, *log, on_log)
                    : fmi.InstantiateCoSimulation(name, guid, resources, false, true, false, false, NULL, 0, *log,
                                                  on_log, NULL);
}

static int set_up(void *c, const Experiment *it) { return (void)c, (void)it, fmi3OK; }

static int enter_initialization(void *c, const Experiment *it)
{
    return fmi.EnterInitializationMode(c, !isnan(it->tolerance), it->tolerance, it->start, !isnan(it->stop), it->stop);
}

static int do_step(void *c, double t, double h)
{
    bool event = false, terminate = false, early = false;
    double reached = t;
    int status = fmi.DoStep(c, t, h, true, &event, &terminate, &early, &reached);
    if (event || terminate || early) die("a step that ends early");
    return status;
}

static int update_discrete_states(void *c)
{
    bool again = false, terminate = false, nominals, states, timed;
    double next;
    return fmi.UpdateDiscreteStates(c, &again, &terminate, &nominals, &states, &timed, &next);
}

#define ACCESS(function, name, type)                                                                    \
    static int function(void *c, const uint32_t *references, size_t size, type *values)                 \
    {                                                                                                   \
        return fmi.name(c, references, size, values, size);                                             \
    }
ACCESS(get_reals, GetFloat64, double)
ACCESS(set_reals, SetFloat64, const double)
ACCESS(get_integers, GetInt64, Integer)
ACCESS(set_integers, SetInt64, const Integer)
ACCESS(get_flags, GetBoolean, Flag)
ACCESS(set_flags, SetBoolean, const Flag)
ACCESS(get_strings, GetString, const char *)
ACCESS(set_strings, SetString, const char *)

#else
static void on_log(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    va_list values;
    va_start(values, message);
    fprintf(environment, "log %s %d %s ", instance, status, category);
    vfprintf(environment, message, values);
    fprintf(environment, "\n");
    va_end(values);
}

typedef fmi2CallbackFunctions Log;

static void open_log(Log *log, FILE *out)
{
    fmi2CallbackFunctions functions = {on_log, calloc, free, NULL, out};
    memcpy(log, &functions, sizeof functions);
}

static void *instantiate(const char *name, const char *guid, const char *resources, bool exchange, Log *log)
{
    return fmi.Instantiate(name, exchange ? fmi2ModelExchange : fmi2CoSimulation, guid, resources, log, fmi2False,
                           fmi2True);
}

static int set_up(void *c, const Experiment *it)
{
    return fmi.SetupExperiment(c, !isnan(it->tolerance), it->tolerance, it->start, !isnan(it->stop), it->stop);
}

static int enter_initialization(void *c, const Experiment *it) { return (void)it, fmi.EnterInitializationMode(c); }

static int do_step(void *c, double t, double h) { return fmi.DoStep(c, t, h, fmi2True); }

static int update_discrete_states(void *c)
{
    fmi2EventInfo event;
    return fmi.NewDiscreteStates(c, &event);
}

#define ACCESS(function, name, type)                                                      \
    static int function(void *c, const unsigned *references, size_t size, type *values)   \
    {                                                                                     \
        return fmi.name(c, references, size, values);                                     \
    }
ACCESS(get_reals, GetReal, double)
ACCESS(set_reals, SetReal, const double)
ACCESS(get_integers, GetInteger, Integer)
ACCESS(set_integers, SetInteger, const Integer)
ACCESS(get_flags, GetBoolean, Flag)
ACCESS(set_flags, SetBoolean, const Flag)
ACCESS(get_strings, GetString, const char *)
ACCESS(set_strings, SetString, const char *)
#endif

#endif
