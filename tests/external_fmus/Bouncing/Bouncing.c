/* FMI 2.0, model exchange alone: a ball that bounces, h' = v, v' = -g; at h = 0 its speed is turned, e times as large.
   After a bounce it has a `fault`: TERMINATES at the bounce number `value`, is UNSETTLED, or has its NEXT_EVENT at the
   time `value`, or LOGS an error and then a warning; IMMEDIATE, an event at once, is no fault. */

#include <stdlib.h>

#include "fmi2Functions.h"

enum { H, V, DER_H, DER_V, E, FAULT, VALUE, G, REALS };
enum { TERMINATES = 1, UNSETTLED, NEXT_EVENT, IMMEDIATE, LOGS };

typedef struct {
    fmi2Real real[REALS], time;
    fmi2Integer bounces;
    fmi2CallbackLogger log;
} Ball;

static const Ball start = {{1.0, 0.0, 0.0, 0.0, 0.7, 0.0, 0.0, 9.81}, 0.0, 0, NULL};

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    Ball *ball = type == fmi2ModelExchange ? malloc(sizeof *ball) : NULL;
    if (!ball) return NULL;
    *ball = start;
    ball->log = functions->logger;
    return ball;
}

fmi2Status fmi2Reset(fmi2Component c) {
    const fmi2CallbackLogger log = ((Ball *)c)->log;
    *(Ball *)c = start;
    ((Ball *)c)->log = log;
    return fmi2OK;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean ends, fmi2Real stop) { return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2EnterEventMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real t) {
    ((Ball *)c)->time = t;
    return fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean final, fmi2Boolean *event, fmi2Boolean *terminate) {
    *event = *terminate = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    static const fmi2EventInfo settled;
    Ball *ball = c;
    const int fault = (int)ball->real[FAULT], falls = ball->real[H] <= 0.0 && ball->real[V] < 0.0;
    *info = settled;
    if (falls) {
        ball->real[V] *= -ball->real[E];
        ball->bounces += 1;
        info->valuesOfContinuousStatesChanged = fmi2True;
    }
    if (!ball->bounces) return fmi2OK;
    if (fault == LOGS) {
        ball->log(NULL, "ball", fmi2Error, "", "its rubber is torn");
        ball->log(NULL, "ball", fmi2Warning, "", "the step is long");
        return fmi2Error;
    }
    info->terminateSimulation = fault == TERMINATES && ball->bounces == ball->real[VALUE];
    info->newDiscreteStatesNeeded = fault == UNSETTLED;
    info->nextEventTimeDefined = fault == NEXT_EVENT || (fault == IMMEDIATE && falls);
    info->nextEventTime = fault == NEXT_EVENT ? ball->real[VALUE] : ball->time;
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) ((Ball *)c)->real[vr[i]] = value[i];
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Ball *ball = c;
    ball->real[DER_H] = ball->real[V];
    ball->real[DER_V] = -ball->real[G];
    for (size_t i = 0; i < n; i++) value[i] = ball->real[vr[i]];
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    for (size_t i = 0; i < n; i++) value[i] = ((Ball *)c)->bounces;
    return fmi2OK;
}

static const fmi2ValueReference states[] = {H, V}, rates[] = {DER_H, DER_V};

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { return fmi2GetReal(c, states, n, x); }
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) { return fmi2SetReal(c, states, n, x); }
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real x[], size_t n) { return fmi2GetReal(c, rates, n, x); }
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) { return fmi2GetReal(c, states, n, z); }

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    for (size_t i = 0; i < n; i++) x[i] = 1.0;
    return fmi2OK;
}

/* Of h and v by themselves, and of their derivatives by v and g. */
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference of[], size_t m,
                                        const fmi2ValueReference by[], size_t n, const fmi2Real seed[], fmi2Real value[]) {
    for (size_t i = 0; i < m; i++) {
        value[i] = 0.0;
        for (size_t j = 0; j < n; j++) {
            if (of[i] == by[j] || (of[i] == DER_H && by[j] == V)) value[i] += seed[j];
            if (of[i] == DER_V && by[j] == G) value[i] -= seed[j];
        }
    }
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (!*state && !(*state = malloc(sizeof(Ball)))) return fmi2Error;
    *(Ball *)*state = *(Ball *)c;
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    *(Ball *)c = *(Ball *)state;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    free(*state);
    *state = NULL;
    return fmi2OK;
}

/* What it has not got, and has to have all the same. */

#define NONE(name, ...) \
    fmi2Status fmi2##name(fmi2Component c, __VA_ARGS__) { return fmi2Error; }

NONE(SetDebugLogging, fmi2Boolean on, size_t n, const fmi2String categories[])
NONE(GetBoolean, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
NONE(GetString, const fmi2ValueReference vr[], size_t n, fmi2String value[])
NONE(SetInteger, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
NONE(SetBoolean, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
NONE(SetString, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
NONE(SerializedFMUstateSize, fmi2FMUstate state, size_t *size)
NONE(SerializeFMUstate, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
NONE(DeSerializeFMUstate, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
