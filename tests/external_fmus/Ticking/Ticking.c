/* FMI 3.0, model exchange and co-simulation in event mode: x' = -k x, and clocks: a periodic one, one that changes its
   interval, a countdown, and one that the FMU itself ticks. It returns Error if a clock ticks at another time than it
   must, if a step passes a tick, or if a variable of a clock is read while the clock is not active. It has a `fault`:
   after t = 0.3 it returns EARLY in the middle of a step, it ENDS at t = 0.5 and states `value` as the last time, or its
   text `said` is NULL or not UTF-8. */

#include <math.h>
#include <stdlib.h>

#include "fmi3Functions.h"

#define TOLERANCE 1e-9

enum { TIME, X, DER_X, K, HELD, TIMED_OUT, FIFTH_X, SAMPLES, GROWTHS, SAMPLE, TIMEOUT, GROWING, FIFTH, FAULT, VALUE, SAID, VARIABLES };
enum { EARLY = 1, ENDS, NO_TEXT, BAD_TEXT };
enum mode { INITIALIZATION, FIRST_EVENT, EVENT, STEP };

typedef struct {
    enum mode mode;
    double real[VARIABLES], due[VARIABLES], growth;
    int count[VARIABLES], active[VARIABLES], is_new[VARIABLES];
} Instance;

static const int clock_of[VARIABLES] = {
    [HELD] = SAMPLE, [SAMPLES] = SAMPLE, [TIMED_OUT] = TIMEOUT, [GROWTHS] = GROWING, [FIFTH_X] = FIFTH};

static Instance *instantiate(void) {
    Instance *i = calloc(1, sizeof *i);
    if (!i) return NULL;
    i->real[X] = 1.0;
    i->real[K] = 2.0;
    i->due[SAMPLE] = 0.05;
    i->due[TIMEOUT] = INFINITY;
    i->due[GROWING] = i->growth = 0.125;
    i->is_new[GROWING] = 1;
    return i;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) { return instantiate(); }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    return instantiate();
}

void fmi3FreeInstance(fmi3Instance i) { free(i); }

static fmi3Status enter(fmi3Instance i, enum mode mode) {
    ((Instance *)i)->mode = mode;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean defined, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean ends, fmi3Float64 stop) { return enter(i, INITIALIZATION); }
fmi3Status fmi3ExitInitializationMode(fmi3Instance i) { return enter(i, FIRST_EVENT); }
fmi3Status fmi3EnterEventMode(fmi3Instance i) { return enter(i, EVENT); }
fmi3Status fmi3EnterStepMode(fmi3Instance i) { return enter(i, STEP); }
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance i) { return enter(i, STEP); }
fmi3Status fmi3Terminate(fmi3Instance i) { return fmi3OK; }

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 interval[],
                                  fmi3IntervalQualifier qualifier[]) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) {
        interval[k] = vr[k] == GROWING ? i->growth : 0.07;
        qualifier[k] = i->is_new[vr[k]] ? fmi3IntervalChanged
                       : i->due[vr[k]] < INFINITY ? fmi3IntervalUnchanged : fmi3IntervalNotYetKnown;
        i->is_new[vr[k]] = 0;
    }
    return fmi3OK;
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Clock values[]) {
    Instance *i = c;
    const double t = i->real[TIME];
    for (size_t k = 0; k < n; k++) {
        if ((i->mode != EVENT && i->mode != FIRST_EVENT) || !(fabs(i->due[vr[k]] - t) <= TOLERANCE)) return fmi3Error;
        i->active[vr[k]] = 1;
        if (vr[k] == SAMPLE) {
            i->real[HELD] = i->real[X];
            i->count[SAMPLES] += 1;
            i->due[SAMPLE] = 0.05 + 0.1 * i->count[SAMPLES];
            if (i->count[SAMPLES] == 3) {
                i->due[TIMEOUT] = t + 0.07;
                i->is_new[TIMEOUT] = 1;
            }
            if (i->count[SAMPLES] == 5) {
                i->active[FIFTH] = 1;
                i->real[FIFTH_X] = i->real[X];
            }
        } else if (vr[k] == TIMEOUT) {
            i->real[TIMED_OUT] = t;
            i->due[TIMEOUT] = INFINITY;
        } else {
            i->count[GROWTHS] += 1;
            i->growth *= 2.0;
            i->due[GROWING] = t + i->growth;
            i->is_new[GROWING] = 1;
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetClock(fmi3Instance i, const fmi3ValueReference vr[], size_t n, fmi3Clock values[]) {
    for (size_t k = 0; k < n; k++) values[k] = ((Instance *)i)->active[vr[k]];
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *more, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                    fmi3Boolean *states, fmi3Boolean *defined, fmi3Float64 *next) {
    Instance *i = c;
    for (int k = 0; k < VARIABLES; k++) i->active[k] = 0;
    *more = *terminate = *nominals = *states = *defined = fmi3False;
    return fmi3OK;
}

static int is_readable(const Instance *i, fmi3ValueReference vr) {
    return !clock_of[vr] || i->active[clock_of[vr]] || i->mode == FIRST_EVENT;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[], size_t m) {
    Instance *i = c;
    i->real[DER_X] = -i->real[K] * i->real[X];
    for (size_t k = 0; k < n; k++) {
        if (!is_readable(i, vr[k])) return fmi3Error;
        values[k] = i->real[vr[k]];
    }
    return fmi3OK;
}

fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int32 values[], size_t m) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) {
        if (!is_readable(i, vr[k])) return fmi3Error;
        values[k] = i->count[vr[k]];
    }
    return fmi3OK;
}

fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3String values[], size_t m) {
    const int fault = (int)((Instance *)c)->real[FAULT];
    values[0] = fault == NO_TEXT ? NULL : fault == BAD_TEXT ? "\xff bad" : "good";
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance i, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
                          size_t m) {
    for (size_t k = 0; k < n; k++) ((Instance *)i)->real[vr[k]] = values[k];
    return fmi3OK;
}

static fmi3Status move_to(Instance *i, double t) {
    i->real[TIME] = t;
    for (int k = SAMPLE; k <= GROWING; k++)
        if (t > i->due[k] + TOLERANCE) return fmi3Error;
    return i->mode == STEP ? fmi3OK : fmi3Error;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_set_state, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    Instance *i = c;
    *event = *terminate = *early = fmi3False;
    *last = t + h;
    if (i->real[FAULT] == EARLY) { /* also without event mode, in which no step would succeed */
        *early = t > 0.3;
        *last = t + (*early ? h / 2.0 : h);
        return fmi3OK;
    }
    if (i->real[FAULT] == ENDS && t >= 0.5 - TOLERANCE) {
        *terminate = *early = fmi3True;
        *last = i->real[VALUE];
    }
    i->real[X] *= exp(-i->real[K] * h);
    return move_to(i, t + h);
}

fmi3Status fmi3SetTime(fmi3Instance i, fmi3Float64 t) {
    ((Instance *)i)->real[TIME] = t;
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance i, const fmi3Float64 x[], size_t n) {
    ((Instance *)i)->real[X] = x[0];
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance i, fmi3Float64 x[], size_t n) {
    x[0] = ((Instance *)i)->real[X];
    return fmi3OK;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance i, fmi3Float64 x[], size_t n) {
    x[0] = 1.0;
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 rate[], size_t n) {
    const Instance *i = c;
    rate[0] = -i->real[K] * i->real[X];
    return fmi3OK;
}

fmi3Status fmi3GetEventIndicators(fmi3Instance i, fmi3Float64 z[], size_t n) { return fmi3OK; }

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance i, fmi3Boolean no_set_state, fmi3Boolean *event,
                                       fmi3Boolean *terminate) {
    *event = *terminate = fmi3False;
    return move_to(i, ((Instance *)i)->real[TIME]);
}

/* Functions that no test calls, but fmpy looks up. Their declarations have other arguments, so their names differ. */
#define UNUSED(name)                                                 \
    FMI3_Export fmi3Status unused##name(void) __asm__("fmi3" #name); \
    fmi3Status unused##name(void) { return fmi3Error; }
UNUSED(ActivateModelPartition) UNUSED(DeserializeFMUState) UNUSED(EnterConfigurationMode)
UNUSED(EvaluateDiscreteStates) UNUSED(ExitConfigurationMode) UNUSED(FreeFMUState) UNUSED(GetAdjointDerivative)
UNUSED(GetBinary) UNUSED(GetBoolean) UNUSED(GetDirectionalDerivative) UNUSED(GetFMUState) UNUSED(GetFloat32)
UNUSED(GetInt16) UNUSED(GetInt64) UNUSED(GetInt8) UNUSED(GetIntervalFraction) UNUSED(GetNumberOfContinuousStates)
UNUSED(GetNumberOfEventIndicators) UNUSED(GetNumberOfVariableDependencies) UNUSED(GetOutputDerivatives)
UNUSED(GetShiftDecimal) UNUSED(GetShiftFraction) UNUSED(GetUInt16) UNUSED(GetUInt32)
UNUSED(GetUInt64) UNUSED(GetUInt8) UNUSED(GetVariableDependencies) UNUSED(GetVersion)
UNUSED(InstantiateScheduledExecution) UNUSED(Reset) UNUSED(SerializeFMUState) UNUSED(SerializedFMUStateSize)
UNUSED(SetBinary) UNUSED(SetBoolean) UNUSED(SetDebugLogging) UNUSED(SetFMUState) UNUSED(SetFloat32) UNUSED(SetInt16)
UNUSED(SetInt32) UNUSED(SetInt64) UNUSED(SetInt8) UNUSED(SetIntervalDecimal) UNUSED(SetIntervalFraction)
UNUSED(SetShiftDecimal) UNUSED(SetShiftFraction) UNUSED(SetString) UNUSED(SetUInt16) UNUSED(SetUInt32)
UNUSED(SetUInt64) UNUSED(SetUInt8)
