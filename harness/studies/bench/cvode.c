/* The five oscillators by SUNDIALS CVODE: an FMI 2.0 co-simulation FMU of those functions that the host in C calls.
 *
 *     y = (x, v),    y' = (v, acceleration),    mode = -1 sliding backward, 0 stuck, 1 sliding forward
 *
 * Dry friction as modes: sliding lasts until the root v = 0, sticking until the root of what friction can hold less the
 * load; CVODE starts again at each.  It runs free of the communication points, and interpolates there.
 * Smooth and dry ones by Adams with fixed-point iteration, the stiff one by BDF with Newton's and the exact Jacobian.
 *
 *     cc -DMODEL=STICKSLIP ...    (SMD, COULOMB, STICKSLIP, PACEJKA, PENDULUM)
 *     cc -DMODEL=STICKSLIP -DPLAIN=1 ...    as importers solve in model exchange: all by BDF, the Jacobian by
 *                                           differences, the position of the driver a state as well
 *
 * SI units; the default experiments.
 */
#include <cvode/cvode.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdbool.h>
#include <stdlib.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include "fmi2Functions.h"

#define SMD 1
#define COULOMB 2
#define STICKSLIP 3
#define PACEJKA 4
#define PENDULUM 5

#ifndef PLAIN
#define PLAIN 0
#endif

enum { X, V, RTOL, ATOL, X_M, FORCE, RATE, VARIABLES }; /* value references */

#define IS_DRY (MODEL == COULOMB || MODEL == STICKSLIP || MODEL == PENDULUM)
#define IS_SLED (MODEL == STICKSLIP || MODEL == PACEJKA)
#define IS_STIFF (MODEL == PACEJKA)
#define IS_DRIVEN (PLAIN && IS_SLED)
#define IS_IMPLICIT (IS_STIFF || PLAIN)
#define PI 3.14159265358979323846
#define POUND 0.45359237
#define INCH 0.0254

/* mass or moment of inertia; what friction can hold at most, and what it is while sliding */
enum { STATES = 2 + IS_DRIVEN };

#if IS_SLED
static const double m = 12.5, k = 742.5, v_driver = 0.034, hold = 0.9 * 12.5 * 9.81, slide = 0.6 * 12.5 * 9.81;
static const double start[STATES] = {0.0, 0.0};
#elif MODEL == PENDULUM
#define WEIGHT (0.46 * POUND * 386.0 * INCH)
#define ARM (3.7 * INCH)
static const double m = 1.5 * POUND * INCH * INCH + 0.46 * POUND * ARM * ARM;
static const double hold = 0.1 * 0.25 * INCH * WEIGHT, slide = 0.1 * 0.25 * INCH * WEIGHT;
static const double start[STATES] = {10.02 * PI / 180.0, 0.0};
#else
static const double m = 1.0, k = 157.9, hold = 0.5, slide = 0.5;
static const double start[STATES] = {0.1, 0.0};
#endif

typedef struct {
    double values[VARIABLES], t, B, C, E;
    double since; /* when the force of the outside began to change at its rate */
    bool pushed;  /* anew */
    int mode;
    SUNContext context;
    N_Vector y;
    SUNMatrix matrix;
    SUNLinearSolver linear;
    SUNNonlinearSolver fixed_point;
    void *cvode;
} Instance;

/* What pulls at the body besides friction and damping, N or N m. */
static double load(const Instance *it, double t, N_Vector y)
{
    double x = NV_Ith_S(y, 0), force = it->values[FORCE] + it->values[RATE] * (t - it->since);
#if MODEL == PENDULUM
    return force - WEIGHT * ARM * sin(x);
#elif IS_SLED
    return force + k * ((IS_DRIVEN ? NV_Ith_S(y, STATES - 1) : v_driver * t) - x);
#else
    return force - k * x;
#endif
}

static int slopes(sunrealtype t, N_Vector y, N_Vector slope, void *user)
{
    const Instance *it = user;
    double v = NV_Ith_S(y, 1), resistance = it->mode * slide;
    if (MODEL == SMD) resistance = 2.0 * v;
    if (MODEL == PACEJKA) {
        double z = it->B * v;
        resistance = hold * sin(it->C * atan(z - it->E * (z - atan(z))));
    }
    bool stuck = IS_DRY && it->mode == 0;
    NV_Ith_S(slope, 0) = stuck ? 0.0 : v;
    NV_Ith_S(slope, 1) = stuck ? 0.0 : (load(it, t, y) - resistance) / m;
#if IS_DRIVEN
    NV_Ith_S(slope, 2) = v_driver;
#endif
    return 0;
}

#if IS_STIFF && !PLAIN
static int derivatives(sunrealtype t, N_Vector y, N_Vector slope, SUNMatrix jacobian, void *user, N_Vector a, N_Vector b,
                       N_Vector c)
{
    (void)t, (void)slope, (void)a, (void)b, (void)c;
    const Instance *it = user;
    double B = it->B, C = it->C, E = it->E, z = B * NV_Ith_S(y, 1), u = z - E * (z - atan(z));
    SM_ELEMENT_D(jacobian, 0, 0) = 0.0;
    SM_ELEMENT_D(jacobian, 0, 1) = 1.0;
    SM_ELEMENT_D(jacobian, 1, 0) = -k / m;
    SM_ELEMENT_D(jacobian, 1, 1) = -hold / m * cos(C * atan(u)) * C / (1 + u * u) * B * (1 - E + E / (1 + z * z));
    return 0;
}
#endif

static int change_of_mode(sunrealtype t, N_Vector y, sunrealtype *root, void *user)
{
    const Instance *it = user;
    root[0] = it->mode ? NV_Ith_S(y, 1) : hold - fabs(load(it, t, y));
    return 0;
}

/* The mode from here on, where the body stands still; it breaks away if it was stuck. */
static void settle(Instance *it, bool was_stuck)
{
    double pull = load(it, it->t, it->y);
    it->mode = was_stuck || fabs(pull) > hold ? (pull > 0.0) - (pull < 0.0) : 0;
}

static bool begin(Instance *it)
{
    bool good = !CVodeReInit(it->cvode, it->t, it->y);
    int direction = it->mode ? -it->mode : -1;
    return good && (!IS_DRY || !CVodeSetRootDirection(it->cvode, &direction));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, const fmi2Real values[])
{
    Instance *it = c;
    for (size_t i = 0; i < count; i++) {
        it->values[references[i]] = values[i];
        it->pushed |= references[i] == FORCE || references[i] == RATE;
    }
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Real values[])
{
    const Instance *it = c;
    for (size_t i = 0; i < count; i++) {
        values[i] = references[i] <= V ? NV_Ith_S(it->y, references[i]) : it->values[references[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    Instance *it = c;
    it->values[RTOL] = 1e-6, it->values[ATOL] = 1e-9, it->values[X_M] = 0.01;
    it->t = it->since = it->values[FORCE] = it->values[RATE] = 0.0;
    it->pushed = false;
    for (int i = 0; i < STATES; i++) NV_Ith_S(it->y, i) = start[i];
    return fmi2OK;
}

void fmi2FreeInstance(fmi2Component c)
{
    Instance *it = c;
    CVodeFree(&it->cvode);
    if (it->linear) SUNLinSolFree(it->linear);
    if (it->matrix) SUNMatDestroy(it->matrix);
    if (it->fixed_point) SUNNonlinSolFree(it->fixed_point);
    if (it->y) N_VDestroy(it->y);
    SUNContext_Free(&it->context);
    free(it);
}

static bool prepared(Instance *it)
{
    if (SUNContext_Create(0, &it->context)) return false;
    it->y = N_VNew_Serial(STATES, it->context);
    it->cvode = CVodeCreate(IS_IMPLICIT ? CV_BDF : CV_ADAMS, it->context);
    if (!it->y || !it->cvode) return false;
    bool good = !CVodeInit(it->cvode, slopes, 0.0, it->y) && !CVodeSetUserData(it->cvode, it) &&
                !CVodeSetMaxNumSteps(it->cvode, 1000000);
#if IS_IMPLICIT
    it->matrix = SUNDenseMatrix(STATES, STATES, it->context);
    it->linear = SUNLinSol_Dense(it->y, it->matrix, it->context);
    good = good && !CVodeSetLinearSolver(it->cvode, it->linear, it->matrix);
#if !PLAIN
    good = good && !CVodeSetJacFn(it->cvode, derivatives);
#endif
#else
    it->fixed_point = SUNNonlinSol_FixedPoint(it->y, 0, it->context);
    good = good && !CVodeSetNonlinearSolver(it->cvode, it->fixed_point);
#endif
    return good && (!IS_DRY || !CVodeRootInit(it->cvode, 1, change_of_mode));
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)name, (void)type, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
    Instance *it = calloc(1, sizeof *it);
    if (it && prepared(it)) {
        fmi2Reset(it);
        return it;
    }
    if (it) fmi2FreeInstance(it);
    return NULL;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start_time,
                               fmi2Boolean has_stop, fmi2Real stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    Instance *it = c;
    it->t = it->since = start_time;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    Instance *it = c;
    double x_m = it->values[X_M];
    it->C = 1.0 + (1.0 - 2.0 * asin(slide / hold) / PI);
    it->B = 2.0 / (x_m * it->C);
    it->E = (it->B * x_m - tan(PI / (2.0 * it->C))) / (it->B * x_m - atan(it->B * x_m));
    it->pushed = false;
    if (IS_DRY) settle(it, false);
    return CVodeSStolerances(it->cvode, it->values[RTOL], it->values[ATOL]) || !begin(it) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean final)
{
    (void)final;
    Instance *it = c;
    double target = t + h;
    if (it->pushed) {
        it->pushed = false;
        it->since = it->t = t;
        if (IS_DRY && !it->mode) settle(it, false);
        if (!begin(it)) return fmi2Discard;
    }
    while (target - it->t > 1e-13 * target) { /* nearer than that it would not start again */
        int told = CVode(it->cvode, target, it->y, &it->t, CV_NORMAL);
        if (told < 0) return fmi2Discard;
        if (told != CV_ROOT_RETURN) break;
        NV_Ith_S(it->y, 1) = 0.0;
        settle(it, it->mode == 0);
        if (!begin(it)) return fmi2Discard;
    }
    return fmi2OK;
}
