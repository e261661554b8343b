/* The five oscillators, and LuGre friction, solved by SUNDIALS CVODE: an FMI 2.0 co-simulation FMU with the functions
 * that the C host calls.
 *
 *     y = (x, v),    y' = (v, acceleration),    mode = -1 sliding backward, 0 stuck, 1 sliding forward
 *     y = (x, v, z) with LuGre friction, where z is the deflection of the bristles
 *
 * Dry friction is modelled by modes: sliding lasts until the root v = 0, sticking until the load exceeds the limit of
 * static friction; CVODE is restarted at each event.  Internal steps do not depend on communication points, where the
 * solution is interpolated.  The stiff models use BDF with Newton iteration and the exact Jacobian, all others Adams
 * with fixed-point iteration.
 *
 *     cc -DMODEL=STICKSLIP ...    (SMD, COULOMB, STICKSLIP, PACEJKA, PENDULUM, LUGRE)
 *     cc -DMODEL=STICKSLIP -DPLAIN=1 ...    as importers solve in model exchange: BDF with a finite-difference
 *                                           Jacobian, and the position of the driver as a state
 *     cc -DMODEL=PACEJKA -DADAMS=1 ...    Adams with Newton iteration for a stiff model
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
#define LUGRE 6

#ifndef PLAIN
#define PLAIN 0
#endif
#ifndef ADAMS
#define ADAMS 0
#endif

enum { X, V, Z, RTOL, ATOL, X_M, FORCE, RATE, VARIABLES }; /* value references */

#define IS_DRY (MODEL == COULOMB || MODEL == STICKSLIP || MODEL == PENDULUM)
#define IS_PULLED (MODEL == STICKSLIP || MODEL == PACEJKA || MODEL == LUGRE)
#define HAS_BRISTLES (MODEL == LUGRE)
#define IS_STIFF (MODEL == PACEJKA || HAS_BRISTLES)
#define IS_DRIVEN (PLAIN && IS_PULLED)
#define IS_IMPLICIT (IS_STIFF || PLAIN)
#define PI 3.14159265358979323846
#define POUND 0.45359237
#define INCH 0.0254

/* m: mass or moment of inertia; hold, slide: static and sliding friction */
enum { STATES = 2 + HAS_BRISTLES + IS_DRIVEN };

#if HAS_BRISTLES
static const double m = 1.0, k = 2.0, v_driver = 0.1, hold = 1.5, slide = 1.0, v_s = 1e-3;
static const double sigma_0 = 1e5, sigma_1 = 316.22776601683796, sigma_2 = 0.4;
static const double start[STATES] = {0.0, 0.0, 0.0};
#elif IS_PULLED
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
    double ramp_start; /* time at which the external force started to change at its rate */
    bool input_changed;
    int mode;
    SUNContext context;
    N_Vector y;
    SUNMatrix matrix;
    SUNLinearSolver linear;
    SUNNonlinearSolver fixed_point;
    void *cvode;
} Instance;

/* Force or torque on the body without friction and damping, N or N m. */
static double load(const Instance *instance, double t, N_Vector y)
{
    double x = NV_Ith_S(y, 0), force = instance->values[FORCE] + instance->values[RATE] * (t - instance->ramp_start);
#if MODEL == PENDULUM
    return force - WEIGHT * ARM * sin(x);
#elif IS_PULLED
    return force + k * ((IS_DRIVEN ? NV_Ith_S(y, STATES - 1) : v_driver * t) - x);
#else
    return force - k * x;
#endif
}

static int rates(sunrealtype t, N_Vector y, N_Vector slope, void *user)
{
    const Instance *instance = user;
    double v = NV_Ith_S(y, 1), resistance = instance->mode * slide;
    if (MODEL == SMD) resistance = 2.0 * v;
    if (MODEL == PACEJKA) {
        double z = instance->B * v;
        resistance = hold * sin(instance->C * atan(z - instance->E * (z - atan(z))));
    }
#if HAS_BRISTLES
    double z = NV_Ith_S(y, 2), ratio = v / v_s, steady_force = slide + (hold - slide) * exp(-ratio * ratio);
    NV_Ith_S(slope, 2) = v - sigma_0 * fabs(v) * z / steady_force;
    resistance = sigma_0 * z + sigma_1 * NV_Ith_S(slope, 2) + sigma_2 * v;
#endif
    bool stuck = IS_DRY && instance->mode == 0;
    NV_Ith_S(slope, 0) = stuck ? 0.0 : v;
    NV_Ith_S(slope, 1) = stuck ? 0.0 : (load(instance, t, y) - resistance) / m;
#if IS_DRIVEN
    NV_Ith_S(slope, STATES - 1) = v_driver;
#endif
    return 0;
}

#if IS_STIFF && !PLAIN
static int derivatives(sunrealtype t, N_Vector y, N_Vector slope, SUNMatrix jacobian, void *user, N_Vector a, N_Vector b,
                       N_Vector c)
{
    (void)t, (void)slope, (void)a, (void)b, (void)c;
#if HAS_BRISTLES
    (void)user;
    double v = NV_Ith_S(y, 1), z = NV_Ith_S(y, 2), size = fabs(v), ratio = v / v_s;
    double peak = (hold - slide) * exp(-ratio * ratio);
    double g = slide + peak, g_v = -2.0 * ratio / v_s * peak, sign = (v > 0.0) - (v < 0.0);
    double rate_v = 1.0 - sigma_0 * z * (sign / g - size * g_v / (g * g)), rate_z = -sigma_0 * size / g;
    SM_ELEMENT_D(jacobian, 0, 0) = SM_ELEMENT_D(jacobian, 0, 2) = SM_ELEMENT_D(jacobian, 2, 0) = 0.0;
    SM_ELEMENT_D(jacobian, 0, 1) = 1.0;
    SM_ELEMENT_D(jacobian, 1, 0) = -k / m;
    SM_ELEMENT_D(jacobian, 1, 1) = -(sigma_1 * rate_v + sigma_2) / m;
    SM_ELEMENT_D(jacobian, 1, 2) = -(sigma_0 + sigma_1 * rate_z) / m;
    SM_ELEMENT_D(jacobian, 2, 1) = rate_v;
    SM_ELEMENT_D(jacobian, 2, 2) = rate_z;
#else
    const Instance *instance = user;
    double B = instance->B, C = instance->C, E = instance->E, z = B * NV_Ith_S(y, 1), u = z - E * (z - atan(z));
    SM_ELEMENT_D(jacobian, 0, 0) = 0.0;
    SM_ELEMENT_D(jacobian, 0, 1) = 1.0;
    SM_ELEMENT_D(jacobian, 1, 0) = -k / m;
    SM_ELEMENT_D(jacobian, 1, 1) = -hold / m * cos(C * atan(u)) * C / (1 + u * u) * B * (1 - E + E / (1 + z * z));
#endif
    return 0;
}
#endif

static int change_of_mode(sunrealtype t, N_Vector y, sunrealtype *root, void *user)
{
    const Instance *instance = user;
    root[0] = instance->mode ? NV_Ith_S(y, 1) : hold - fabs(load(instance, t, y));
    return 0;
}

/* Set the mode of a body at rest; a stuck body breaks away. */
static void resolve_mode(Instance *instance, bool was_stuck)
{
    double force = load(instance, instance->t, instance->y);
    instance->mode = was_stuck || fabs(force) > hold ? (force > 0.0) - (force < 0.0) : 0;
}

static bool restart(Instance *instance)
{
    bool good = !CVodeReInit(instance->cvode, instance->t, instance->y);
    int direction = instance->mode ? -instance->mode : -1;
    return good && (!IS_DRY || !CVodeSetRootDirection(instance->cvode, &direction));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, const fmi2Real values[])
{
    Instance *instance = c;
    for (size_t i = 0; i < count; i++) {
        instance->values[references[i]] = values[i];
        instance->input_changed |= references[i] == FORCE || references[i] == RATE;
    }
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Real values[])
{
    const Instance *instance = c;
    for (size_t i = 0; i < count; i++) {
        values[i] = references[i] <= Z ? NV_Ith_S(instance->y, references[i]) : instance->values[references[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    Instance *instance = c;
    instance->values[RTOL] = 1e-6, instance->values[ATOL] = 1e-9, instance->values[X_M] = 0.01;
    instance->t = instance->ramp_start = instance->values[FORCE] = instance->values[RATE] = 0.0;
    instance->input_changed = false;
    for (int i = 0; i < STATES; i++) NV_Ith_S(instance->y, i) = start[i];
    return fmi2OK;
}

void fmi2FreeInstance(fmi2Component c)
{
    Instance *instance = c;
    CVodeFree(&instance->cvode);
    if (instance->linear) SUNLinSolFree(instance->linear);
    if (instance->matrix) SUNMatDestroy(instance->matrix);
    if (instance->fixed_point) SUNNonlinSolFree(instance->fixed_point);
    if (instance->y) N_VDestroy(instance->y);
    SUNContext_Free(&instance->context);
    free(instance);
}

static bool create_solver(Instance *instance)
{
    if (SUNContext_Create(0, &instance->context)) return false;
    instance->y = N_VNew_Serial(STATES, instance->context);
    instance->cvode = CVodeCreate(IS_IMPLICIT && !ADAMS ? CV_BDF : CV_ADAMS, instance->context);
    if (!instance->y || !instance->cvode) return false;
    bool good = !CVodeInit(instance->cvode, rates, 0.0, instance->y) && !CVodeSetUserData(instance->cvode, instance) &&
                !CVodeSetMaxNumSteps(instance->cvode, 1000000);
#if IS_IMPLICIT
    instance->matrix = SUNDenseMatrix(STATES, STATES, instance->context);
    instance->linear = SUNLinSol_Dense(instance->y, instance->matrix, instance->context);
    good = good && !CVodeSetLinearSolver(instance->cvode, instance->linear, instance->matrix);
#if !PLAIN
    good = good && !CVodeSetJacFn(instance->cvode, derivatives);
#endif
#else
    instance->fixed_point = SUNNonlinSol_FixedPoint(instance->y, 0, instance->context);
    good = good && !CVodeSetNonlinearSolver(instance->cvode, instance->fixed_point);
#endif
    return good && (!IS_DRY || !CVodeRootInit(instance->cvode, 1, change_of_mode));
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)name, (void)type, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
    Instance *instance = calloc(1, sizeof *instance);
    if (instance && create_solver(instance)) {
        fmi2Reset(instance);
        return instance;
    }
    if (instance) fmi2FreeInstance(instance);
    return NULL;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start_time,
                               fmi2Boolean has_stop, fmi2Real stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    Instance *instance = c;
    instance->t = instance->ramp_start = start_time;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    Instance *instance = c;
    double x_m = instance->values[X_M];
    instance->C = 1.0 + (1.0 - 2.0 * asin(slide / hold) / PI);
    instance->B = 2.0 / (x_m * instance->C);
    instance->E = (instance->B * x_m - tan(PI / (2.0 * instance->C))) / (instance->B * x_m - atan(instance->B * x_m));
    instance->input_changed = false;
    if (IS_DRY) resolve_mode(instance, false);
    bool failed = CVodeSStolerances(instance->cvode, instance->values[RTOL], instance->values[ATOL]);
    return failed || !restart(instance) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean final)
{
    (void)final;
    Instance *instance = c;
    double target = t + h;
    if (instance->input_changed) {
        instance->input_changed = false;
        instance->ramp_start = instance->t = t;
        if (IS_DRY && !instance->mode) resolve_mode(instance, false);
        if (!restart(instance)) return fmi2Discard;
    }
    while (target - instance->t > 1e-13 * target) { /* CVODE rejects smaller intervals */
        int result = CVode(instance->cvode, target, instance->y, &instance->t, CV_NORMAL);
        if (result < 0) return fmi2Discard;
        if (result != CV_ROOT_RETURN) break;
        NV_Ith_S(instance->y, 1) = 0.0;
        resolve_mode(instance, instance->mode == 0);
        if (!restart(instance)) return fmi2Discard;
    }
    return fmi2OK;
}
