/* BouncingBall of the Reference FMUs with another acceleration, to measure the overhead of the framework.
 *
 *     cc "-DACCELERATION=(force - 157.9 * x) / mass" ... fmi2Functions.c cosimulation.c
 */
#include <math.h>

#define getDerivatives getOriginalDerivatives
#include <model.c>
#undef getDerivatives

Status getDerivatives(ModelInstance *comp, double dx[], size_t nx)
{
    const double x = M(h), v = M(v), force = M(g), mass = M(e);
    Status status = getOriginalDerivatives(comp, dx, nx);
    (void)x, (void)v, (void)mass;
    dx[1] = ACCELERATION;
    return status;
}
