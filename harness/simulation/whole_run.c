/* One co-simulation run in one call: sets values, initializes, takes the steps between the given times and reads outputs.
 *
 * The instance is new or has been reset. The functions of the FMU are passed as pointers, so the library links only the
 * C library. The first row of the inputs u (n, n_in) is set at the start, and each other row before the step to its
 * time, with the row of their slopes if these are given (FMI 2.0). The outputs y are read at the times at which `is_recorded` is true. The result is 0, REFUSED if the FMU does not
 * initialize, FAILED if a later call fails or an output is not finite, or TOO_SLOW after `limit` seconds of processor
 * time.
 */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>

enum { REFUSED = 1, FAILED, TOO_SLOW };
enum { WARNING = 1, STEPS_PER_CHECK = 128 };

typedef void *Instance;
typedef uint32_t Reference;

typedef struct {
    int (*set)(Instance, const Reference *, size_t, const double *);
    int (*setup)(Instance, int, double, double, int, double);
    int (*enter)(Instance);
    int (*leave)(Instance);
    int (*get)(Instance, const Reference *, size_t, double *);
    int (*step)(Instance, double, double, int);
    int (*derive)(Instance, const Reference *, size_t, const int *, const double *);
} Fmi2;

typedef struct {
    int (*set)(Instance, const Reference *, size_t, const double *, size_t);
    int (*enter)(Instance, bool, double, double, bool, double);
    int (*leave)(Instance);
    int (*get)(Instance, const Reference *, size_t, double *, size_t);
    int (*step)(Instance, double, double, bool, bool *, bool *, bool *, double *);
} Fmi3;

typedef struct {
    int fmi; /* 2 or 3 */
    const void *functions;
    Instance instance;
    double limit; /* s */
} Fmu;

typedef struct {
    const Reference *references;
    size_t count;
    double *values;
} Variables;

static bool set(const Fmu *fmu, const Variables *which, const double *values)
{
    if (!which->count) return true;
    if (fmu->fmi == 2)
        return ((const Fmi2 *)fmu->functions)->set(fmu->instance, which->references, which->count, values) <= WARNING;
    return ((const Fmi3 *)fmu->functions)
               ->set(fmu->instance, which->references, which->count, values, which->count) <= WARNING;
}

static bool get(const Fmu *fmu, const Variables *which, double *values)
{
    const Reference *references = which->references;
    size_t n = which->count;
    int status = fmu->fmi == 2 ? ((const Fmi2 *)fmu->functions)->get(fmu->instance, references, n, values)
                               : ((const Fmi3 *)fmu->functions)->get(fmu->instance, references, n, values, n);
    for (size_t i = 0; i < n; i++)
        if (!isfinite(values[i])) return false;
    return status <= WARNING;
}

static bool initialize(const Fmu *fmu, const Variables *parameters, const Variables *inputs, double start, double stop)
{
    if (fmu->fmi == 2) {
        const Fmi2 *fmi = fmu->functions;
        return set(fmu, parameters, parameters->values) &&
               fmi->setup(fmu->instance, 0, 0.0, start, 1, stop) <= WARNING &&
               fmi->enter(fmu->instance) <= WARNING && set(fmu, inputs, inputs->values) &&
               fmi->leave(fmu->instance) <= WARNING;
    }
    const Fmi3 *fmi = fmu->functions;
    return set(fmu, parameters, parameters->values) &&
           fmi->enter(fmu->instance, false, 0.0, start, true, stop) <= WARNING &&
           set(fmu, inputs, inputs->values) && fmi->leave(fmu->instance) <= WARNING;
}

static bool step(const Fmu *fmu, double t, double h)
{
    if (fmu->fmi == 2) return ((const Fmi2 *)fmu->functions)->step(fmu->instance, t, h, 1) <= WARNING;
    bool event = false, terminate = false, early = false;
    double reached = 0.0;
    int status =
        ((const Fmi3 *)fmu->functions)->step(fmu->instance, t, h, true, &event, &terminate, &early, &reached);
    return status <= WARNING && !terminate && !early;
}

/* `orders` has a 1 for each input. */
static bool set_slopes(const Fmu *fmu, const Variables *inputs, const int *orders, const double *slopes)
{
    return ((const Fmi2 *)fmu->functions)->derive(fmu->instance, inputs->references, inputs->count, orders, slopes) <=
           WARNING;
}

int run(const Fmu *fmu, const Variables *parameters, const Variables *inputs, const Variables *outputs,
        const double *t, const bool *is_recorded, size_t n, const int *orders, const double *slopes)
{
    double *y = outputs->values;
    const double *u = inputs->values;
    clock_t start_time = clock();
    if (!initialize(fmu, parameters, inputs, t[0], t[n - 1])) return REFUSED;
    for (size_t i = 0; i < n; i++) {
        if (i > 0) {
            u += inputs->count;
            if (!set(fmu, inputs, u)) return FAILED;
            if (slopes && !set_slopes(fmu, inputs, orders, slopes += inputs->count)) return FAILED;
            if (!step(fmu, t[i - 1], t[i] - t[i - 1])) return FAILED;
        }
        if (is_recorded[i]) {
            if (!get(fmu, outputs, y)) return FAILED;
            y += outputs->count;
        }
        if (i % STEPS_PER_CHECK == 0 && (double)(clock() - start_time) > fmu->limit * CLOCKS_PER_SEC) return TOO_SLOW;
    }
    return 0;
}
