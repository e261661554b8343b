/* Integrates the states y of an FMU for model exchange together with their derivatives S by parameters:
 *
 *     y' = f(t, y, p),   S' = (df/dy) S + df/dp
 *
 * by an explicit Runge-Kutta method with interpolant, whose coefficients the caller passes (DOP853 of scipy), up to a
 * time or to the first event. The second equation is the directional derivative of the FMU along (S, 1). An event is a
 * change of sign of an event indicator, which is located on steps of the method, not on its interpolant.
 *
 * References: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.5 and II.6.
 */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { REACHED, EVENT, GRAZE, STEP_EVENT, TERMINATED, FAILED, TOO_MANY_STEPS };
enum { TUNABLE = 1, FIXED };
enum { WARNING = 1, STAGES = 12, EXTRA = 3, DENSE = 7, SAMPLES = 8, SECTIONS = 60, HALVINGS = 200, LEVELS = 6 };
static const double SAFETY = 0.9, SHRINK = 0.2, GROW = 6.0, FLOOR = 1e-6, FLOOR_S = 1e-4, SMALL = 1e-3, CLEAR = 1e-5, GOLDEN = 0.6180339887498949;
static const double FAR = 1e50; /* an indicator as large as this stands for no event */

typedef void *Instance;
typedef uint32_t Reference;
typedef void (*Function)(void); /* whose parameters depend on the version of FMI */
typedef int (*Action)(Instance);
typedef int (*Getter)(Instance, double *, size_t);

typedef struct { /* a parameter, or the factor of a driven input, or the start value of a state */
    Reference reference;
    bool is_start;         /* whether it is the start value of a state, which enters no equation */
    int64_t input;         /* index of the driven input, or -1 */
    double value;          /* 0 if unknown */
    int64_t kind, side;    /* TUNABLE or FIXED if it is set; see `Known.side` */
    double change;         /* of FIXED ones, of which runs are saved at the start: without it, and with 1/2, 1, -1/2, -1 */
    void *starts[5];
} Parameter;

typedef struct {
    Instance instance;
    int (*set_time)(Instance, double), (*set_states)(Instance, const double *, size_t);
    Getter get_states, get_rates, get_indicators;
    Function get, set, get_mode, derive, update;
    Action enter_event, enter_continuous;
    int (*save)(Instance, void **), (*restore)(Instance, void *), (*release)(Instance, void **); /* or NULL */
    Function complete;                                                                           /* or NULL */
    int64_t fmi;                                                                                 /* 2 or 3 */
    size_t n, m, q, r, n_inputs; /* states, parameters, indicators, outputs, driven inputs */
    const Reference *states, *rates, *outputs, *inputs;
    const Parameter *parameters;
    const double *a, *c, *b, *e3, *e5, *a_extra, *c_extra, *d;
    const double *table; /* inputs: t, u at the begin and at the end of the present interval */
    double rtol, graze;
    size_t max_steps, n_steps, n_rhs;
    double t, h, t_event; /* time, next step, and time of the event */
    double *z, *z1, *k, *dense, *largest, *nominals, *g, *g1, *samples, *largest_g, *t_far, *g_far, *touch, *work;
    /* touch: z at a graze; t_far, g_far: last step at whose begin an indicator was not near zero, and its value there */
    const double *times;
    size_t n_times, next;
    double *values;
    const uint32_t *output_states; /* indices of the states that the outputs are, or NULL */
    const int64_t *positions;      /* index of the state whose rate a state is, or -1 */
    int64_t indicator;
    bool is_fresh; /* the first stage and the indicators belong to the present point */
    /* events, see variational_events.c */
    const Reference *influenced; /* rates and outputs */
    const Reference *modes;
    size_t n_influenced, n_modes, n_signals;
    const double *signals;                 /* of inputs: time and values (n_signals, 1 + n_inputs) */
    double duration, tolerance, next_event, row, last_t; /* times in s: next event that the FMU sets, next of `signals` */
    size_t n_at_once, capacity, capacity_notes, n_events, n_notes, n_splits; /* of the logs */
    double *event_values, *note_values, *split_values;
    int64_t *event_codes, *note_codes;
} Run;

static bool read(const Run *run, const Reference *references, size_t n, double *values)
{
    if (!n) return true;
    if (run->fmi == 2)
        return ((int (*)(Instance, const Reference *, size_t, double *))run->get)(run->instance, references, n,
                                                                               values) <= WARNING;
    return ((int (*)(Instance, const Reference *, size_t, double *, size_t))run->get)(run->instance, references, n,
                                                                                   values, n) <= WARNING;
}

static bool write(const Run *run, const Reference *references, size_t n, const double *values)
{
    if (!n) return true;
    if (run->fmi == 2)
        return ((int (*)(Instance, const Reference *, size_t, const double *))run->set)(run->instance, references, n,
                                                                                     values) <= WARNING;
    return ((int (*)(Instance, const Reference *, size_t, const double *, size_t))run->set)(run->instance, references, n,
                                                                                         values, n) <= WARNING;
}

static double input_at(const Run *run, size_t j, double t)
{
    const double *begin = run->table, *end = begin + 1 + run->n_inputs;
    double share = *end > *begin ? (t - *begin) / (*end - *begin) : 0.0;
    return (1.0 - share) * begin[1 + j] + share * end[1 + j];
}

/* Set time, driven inputs and states; `factor` is that of the input `which`. */
static bool set_point_with(const Run *run, double t, const double *y, int64_t which, double factor)
{
    bool ok = run->set_time(run->instance, t) <= WARNING;
    double *u = run->work;
    size_t n = run->n_inputs;
    for (size_t j = 0; j < n; j++) u[j] = input_at(run, j, t) * ((int64_t)j == which ? factor : 1.0);
    ok &= write(run, run->inputs, n, u);
    return ok & (!run->n || run->set_states(run->instance, y, run->n) <= WARNING);
}

bool set_point(const Run *run, double t, const double *y) { return set_point_with(run, t, y, -1, 1.0); }

static bool get_array(const Run *run, Getter getter, double *values, size_t n)
{
    return !n || getter(run->instance, values, n) <= WARNING;
}

/* Derivatives of unknowns at the present point by parameter i, whose states change by s. */
static bool tangent(const Run *run, const Reference *unknowns, size_t count, size_t i, double t, const double *s,
                    double *values)
{
    const Parameter *parameter = &run->parameters[i];
    size_t n = run->n, knowns = n + !parameter->is_start;
    Reference *references = (Reference *)(run->work + run->n_inputs);
    double *seed = run->work + run->n_inputs + n + 1;
    if (!count) return true;
    memcpy(references, run->states, n * sizeof *references);
    references[n] = parameter->reference;
    memcpy(seed, s, n * sizeof *seed);
    seed[n] = parameter->input < 0 ? 1.0 : input_at(run, (size_t)parameter->input, t);
    if (run->fmi == 2)
        return ((int (*)(Instance, const Reference *, size_t, const Reference *, size_t, const double *, double *))
                    run->derive)(run->instance, unknowns, count, references, knowns, seed, values) <= WARNING;
    return ((int (*)(Instance, const Reference *, size_t, const Reference *, size_t, const double *, size_t, double *,
                     size_t))run->derive)(run->instance, unknowns, count, references, knowns, seed, knowns, values,
                                          count) <= WARNING;
}

/* Right-hand side for the states and m parameters. */
static bool evaluate(Run *run, double t, const double *z, double *f, size_t m)
{
    size_t n = run->n;
    bool ok = set_point(run, t, z) && get_array(run, run->get_rates, f, n);
    for (size_t i = 0; i < m && ok; i++) ok = tangent(run, run->rates, n, i, t, z + n * (1 + i), f + n * (1 + i));
    for (size_t j = 0; j < n * (1 + m) && ok; j++) ok = isfinite(f[j]);
    run->n_rhs++;
    return ok;
}

static bool indicators_at(Run *run, double t, const double *y, double *g)
{
    return set_point(run, t, y) && get_array(run, run->get_indicators, g, run->q);
}

static bool begin(Run *run)
{
    if (run->is_fresh) return true;
    run->is_fresh = evaluate(run, run->t, run->z, run->k, run->m) && indicators_at(run, run->t, run->z, run->g);
    for (size_t k = 0; k < run->q; k++) run->t_far[k] = run->t, run->g_far[k] = run->g[k];
    return run->is_fresh;
}

/* Sum of the first `count` components of `stages` stages with the weights of a row; several components at once. */
static void combine(const Run *run, const double *row, size_t stages, size_t count, double *sum)
{
    size_t n = run->n * (1 + run->m), j = 0;
    for (; j + 4 <= count; j += 4) {
        double a = 0.0, b = 0.0, c = 0.0, d = 0.0;
        for (size_t l = 0; l < stages; l++) {
            const double *k = run->k + l * n + j;
            a += row[l] * k[0], b += row[l] * k[1], c += row[l] * k[2], d += row[l] * k[3];
        }
        sum[j] = a, sum[j + 1] = b, sum[j + 2] = c, sum[j + 3] = d;
    }
    for (; j < count; j++) {
        double a = 0.0;
        for (size_t l = 0; l < stages; l++) a += row[l] * run->k[l * n + j];
        sum[j] = a;
    }
}

/* One step of size h from the present point, for the states and m parameters: stages k and the result z1. */
static bool step(Run *run, double h, size_t m)
{
    size_t n = run->n * (1 + run->m), count = run->n * (1 + m);
    for (size_t s = 1; s <= STAGES; s++) {
        combine(run, s < STAGES ? run->a + s * STAGES : run->b, s, count, run->z1);
        for (size_t j = 0; j < count; j++) run->z1[j] = run->z[j] + h * run->z1[j];
        if (!evaluate(run, run->t + (s < STAGES ? run->c[s] : 1.0) * h, run->z1, run->k + s * n, m)) return false;
    }
    return true;
}

/* Size of state j below which its errors do not count: a small part of what is usual, and of a speed, a small part of the
 * one that moves its position by its largest value in the whole run. */
static double smallest_size(const Run *run, size_t j)
{
    double size = FLOOR * run->nominals[j];
    int64_t position = run->positions[j];
    return position < 0 ? size : fmax(size, FLOOR * run->largest[position] / run->duration);
}

/* Typical size of component j of z: its largest value up to now, but not less than a small part of what is usual. */
static double size_of(const Run *run, size_t j)
{
    size_t n = run->n, own = j % n, first = j - own;
    double size = fmax(run->largest[j], fabs(run->z1[j])), relative = 0.0;
    double state = fmax(fmax(run->largest[own], fabs(run->z1[own])), smallest_size(run, own));
    if (first == 0) return state;
    for (size_t l = 0; l < n; l++)
        relative = fmax(relative, fmax(run->largest[first + l], fabs(run->z1[first + l])) /
                                      fmax(run->largest[l], smallest_size(run, l)));
    double value = run->parameters[first / n - 1].value;
    return fmax(size, fmax(SMALL * relative, value != 0.0 ? FLOOR_S / fabs(value) : 0.0) * state);
}

static double step_error(const Run *run, double h)
{
    size_t n = run->n * (1 + run->m);
    double fifth = 0.0, third = 0.0;
    for (size_t j = 0; j < n; j++) {
        double five = 0.0, three = 0.0, size = size_of(run, j);
        for (size_t s = 0; s <= STAGES; s++) {
            five += run->e5[s] * run->k[s * n + j];
            three += run->e3[s] * run->k[s * n + j];
        }
        if (size > 0.0) fifth = fmax(fifth, fabs(five) / size), third = fmax(third, fabs(three) / size);
    }
    return fifth == 0.0 ? 0.0 : h * fifth * fifth / sqrt(fifth * fifth + 0.01 * third * third) / run->rtol;
}

/* Prepare the interpolant of the step just computed. */
static bool prepare_dense(Run *run, double h)
{
    size_t n = run->n * (1 + run->m);
    for (size_t s = 0; s < EXTRA; s++) {
        double *z = run->dense;
        combine(run, run->a_extra + s * 16, STAGES + s + 1, n, z);
        for (size_t j = 0; j < n; j++) z[j] = run->z[j] + h * z[j];
        if (!evaluate(run, run->t + run->c_extra[s] * h, z, run->k + (STAGES + 1 + s) * n, run->m)) return false;
    }
    for (size_t j = 0; j < n; j++) {
        double change = run->z1[j] - run->z[j], first = run->k[j], last = run->k[STAGES * n + j];
        run->dense[j] = change;
        run->dense[n + j] = h * first - change;
        run->dense[2 * n + j] = 2.0 * change - h * (first + last);
    }
    for (size_t i = 3; i < DENSE; i++) {
        combine(run, run->d + (i - 3) * 16, 16, n, run->dense + i * n);
        for (size_t j = 0; j < n; j++) run->dense[i * n + j] *= h;
    }
    return true;
}

/* The first `count` components of the interpolant at a share of the step. */
static void dense_at(const Run *run, double share, size_t count, double *z)
{
    size_t n = run->n * (1 + run->m);
    for (size_t j = 0; j < count; j++) {
        double sum = 0.0;
        for (size_t i = DENSE; i-- > 0;) sum = (sum + run->dense[i * n + j]) * (i % 2 ? 1.0 - share : share);
        z[j] = run->z[j] + sum;
    }
}

/* Write the outputs and their derivatives at a time; those that are states are known without a call. */
static bool read_outputs(Run *run, double t, const double *z, double *values)
{
    size_t n = run->n, r = run->r, m = run->m;
    if (run->output_states) {
        for (size_t i = 0; i <= m; i++)
            for (size_t j = 0; j < r; j++) values[i * r + j] = z[i * n + run->output_states[j]];
        return true;
    }
    bool ok = set_point(run, t, z) && read(run, run->outputs, r, values);
    for (size_t i = 0; i < m && ok; i++)
        ok = tangent(run, run->outputs, r, i, t, z + n * (1 + i), values + r * (1 + i));
    return ok;
}

static bool record(Run *run, double t, const double *z)
{
    return read_outputs(run, t, z, run->values + run->next++ * run->r * (1 + run->m));
}

static double indicator_at(Run *run, double h, double share, size_t k)
{
    double *y = run->dense + DENSE * run->n * (1 + run->m);
    dense_at(run, share, run->n, y);
    return indicators_at(run, run->t + share * h, y, run->g1) ? run->g1[k] : NAN;
}

/* Smallest value of |indicator k| near a sample of the interpolant, as shares of the step. */
static double find_minimum(Run *run, double h, double low, double high, size_t k, double sign, double *share)
{
    double left = high - GOLDEN * (high - low), right = low + GOLDEN * (high - low);
    double at_left = sign * indicator_at(run, h, left, k), at_right = sign * indicator_at(run, h, right, k);
    for (size_t i = 0; i < SECTIONS && at_left > 0.0 && at_right > 0.0; i++) {
        if (at_left < at_right) {
            high = right, right = left, at_right = at_left, left = high - GOLDEN * (high - low);
            at_left = sign * indicator_at(run, h, left, k);
        } else {
            low = left, left = right, at_left = at_right, right = low + GOLDEN * (high - low);
            at_right = sign * indicator_at(run, h, right, k);
        }
    }
    *share = at_left < at_right ? left : right;
    return fmin(at_left, at_right);
}

static double side(double g) { return g > 0.0 ? 1.0 : -1.0; }

/* Whether an indicator has the value that stands for no event, and is no measure of its size: 1 in FMUs of this project. */
static bool stands_for_no_event(double g) { return g == 1.0 || fabs(g) >= FAR; }

/* Search the step just computed for the first change of sign of an indicator: shares of the step around it. Returns
 * REACHED if there is none, and GRAZE if one only touches zero at the share `high`. */
static int search(Run *run, double h, double *low, double *high, size_t *which)
{
    size_t q = run->q;
    int found = REACHED;
    memcpy(run->samples, run->g, q * sizeof(double));
    for (size_t i = 1; i < SAMPLES; i++) {
        indicator_at(run, h, (double)i / SAMPLES, 0);
        memcpy(run->samples + i * q, run->g1, q * sizeof(double));
    }
    if (!indicators_at(run, run->t + h, run->z1, run->samples + SAMPLES * q)) return FAILED;
    for (size_t k = 0; k < q; k++) {
        double sign = side(run->g[k]), span = 0.0;
        for (size_t i = 0; i <= SAMPLES; i++)
            if (!stands_for_no_event(run->samples[i * q + k])) span = fmax(span, fabs(run->samples[i * q + k]));
        run->largest_g[k] = fmax(run->largest_g[k], span);
        for (size_t i = 1; i <= SAMPLES; i++) {
            double g = sign * run->samples[i * q + k], before = sign * run->samples[(i - 1) * q + k];
            double from = (double)(i - 1) / SAMPLES, to = (double)i / SAMPLES;
            if (found != REACHED && from >= *high) break;
            if (g <= 0.0 || !isfinite(g)) {
                if (found == REACHED || to < *high || *which > k) *low = from, *high = to, *which = k, found = EVENT;
                break;
            }
            double after = i < SAMPLES ? sign * run->samples[(i + 1) * q + k] : INFINITY;
            double curvature = after - 2.0 * g + before, slope = 0.5 * (after - before);
            bool dips = i < SAMPLES && g < before && g <= after && curvature > 0.0;
            if (!dips || g - 0.5 * slope * slope / curvature > 0.05 * span) continue;
            double share, least = find_minimum(run, h, from, to + 1.0 / SAMPLES, k, sign, &share);
            if (least > run->graze * run->largest_g[k] || (found != REACHED && share >= *high)) continue;
            *low = from, *high = share, *which = k, found = least <= 0.0 ? EVENT : GRAZE;
            break;
        }
    }
    return found;
}

/* Indicator k after a step of size h of the states alone. */
static double indicator_after(Run *run, double h, size_t k)
{
    return step(run, h, 0) && get_array(run, run->get_indicators, run->g1, run->q) ? run->g1[k] : NAN;
}

/* Size of the step at whose end indicator k has just changed its sign, between two sizes (Illinois method). */
static double locate(Run *run, double low, double high, size_t k)
{
    double sign = side(run->g[k]), at_low = low > 0.0 ? sign * indicator_after(run, low, k) : fabs(run->g[k]);
    double at_high = sign * indicator_after(run, high, k);
    int kept = 0;
    if (!(at_low > 0.0)) low = 0.0, at_low = fabs(run->g[k]);
    if (at_high > 0.0) return NAN; /* the interpolant shows a zero that the method does not have */
    for (size_t i = 0; i < HALVINGS; i++) {
        double middle = 0.5 * (low + high);
        if (i < SECTIONS && at_low > 0.0 && at_high < 0.0) {
            double secant = low + (high - low) * (at_low / (at_low - at_high));
            if (secant > low && secant < high) middle = secant;
        }
        if (run->t + middle == run->t + low || run->t + middle == run->t + high) {
            middle = 0.5 * (low + high);
            if (run->t + middle == run->t + low || run->t + middle == run->t + high) break;
        }
        double g = sign * indicator_after(run, middle, k);
        if (g > 0.0) {
            low = middle, at_low = g;
            if (kept == 1) at_high *= 0.5;
            kept = 1;
        } else {
            high = middle, at_high = g;
            if (kept == -1) at_low *= 0.5;
            kept = -1;
        }
    }
    return high;
}

/* The same for the first indicator that changes its sign, which may be another than `which`. */
static double locate_first(Run *run, double low, double high, size_t *which)
{
    double event = locate(run, low, high, *which);
    for (size_t k = 0; k < run->q && !isnan(event); k++) {
        if (k == *which || side(indicator_after(run, event, k)) == side(run->g[k])) continue;
        double other = locate(run, 0.0, event, k);
        if (other < event) event = other, *which = k;
    }
    return event;
}

/* Accept a step of size h: record the times in it and move to its end. */
static bool accept(Run *run, double h, double t_end, bool has_dense)
{
    size_t n = run->n * (1 + run->m);
    double *z = run->dense + DENSE * n;
    while (run->next < run->n_times && run->times[run->next] <= t_end) {
        double t = run->times[run->next];
        if (t == t_end) {
            if (!record(run, t, run->z1)) return false;
            continue;
        }
        if (!has_dense && !prepare_dense(run, h)) return false;
        has_dense = true;
        dense_at(run, (t - run->t) / h, n, z);
        if (!record(run, t, z)) return false;
    }
    run->t = t_end;
    memcpy(run->z, run->z1, n * sizeof(double));
    for (size_t j = 0; j < n; j++) run->largest[j] = fmax(run->largest[j], fabs(run->z[j]));
    return true;
}

/* Tell the FMU that a step is complete. */
static int complete_step(Run *run)
{
    bool event = false, terminate = false;
    int events = 0, terminates = 0;
    if (!run->complete) return REACHED;
    if (!set_point(run, run->t, run->z)) return FAILED;
    if (run->fmi == 2) {
        if (((int (*)(Instance, int, int *, int *))run->complete)(run->instance, 1, &events, &terminates) > WARNING)
            return FAILED;
        event = events, terminate = terminates;
    } else if (((int (*)(Instance, bool, bool *, bool *))run->complete)(run->instance, true, &event, &terminate) >
               WARNING)
        return FAILED;
    return terminate ? TERMINATED : event ? STEP_EVENT : REACHED;
}

/* Integrate to a time, or to the first event, whose indicator is in run->indicator then. */
static int advance(Run *run, double target)
{
    size_t n = run->n * (1 + run->m), failures = 0;
    if (!begin(run)) return FAILED;
    while (run->next < run->n_times && run->times[run->next] <= run->t)
        if (!record(run, run->t, run->z)) return FAILED;
    while (run->t < target) {
        double h = run->h < target - run->t ? run->h : target - run->t, low = 0.0, high = 1.0;
        bool is_last = run->t + 1.001 * h >= target;
        size_t which = 0;
        if (run->n_steps++ >= run->max_steps) return TOO_MANY_STEPS;
        if (is_last) h = target - run->t;
        double error = step(run, h, run->m) ? step_error(run, h) : INFINITY;
        double factor = error > 0.0 ? SAFETY * pow(error, -1.0 / 8.0) : GROW;
        if (!(error <= 1.0)) {
            run->h = h * (error < INFINITY ? fmax(SHRINK, factor) : 0.25);
            if (++failures > HALVINGS || run->t + run->h == run->t) return FAILED;
            continue;
        }
        int found = REACHED;
        bool has_dense = false;
        if (run->q) {
            if (!prepare_dense(run, h)) return FAILED;
            has_dense = true;
            found = search(run, h, &low, &high, &which);
            if (found == FAILED) return FAILED;
        }
        run->indicator = (int64_t)which;
        if (found == EVENT) {
            double event = locate_first(run, low * h, high * h, &which);
            run->indicator = (int64_t)which;
            if (isnan(event)) {
                event = high * h;
                found = GRAZE;
            } else if (event < h) {
                h = event, is_last = false, has_dense = false;
            }
            if (!step(run, h, run->m)) return FAILED;
            if (found == GRAZE && !(has_dense = prepare_dense(run, h))) return FAILED;
            run->t_event = run->t + event;
        } else {
            run->t_event = run->t + high * h;
            if (failures == 0 || factor < 1.0) run->h = h * fmin(GROW, factor);
            failures = 0;
        }
        if (found == GRAZE) dense_at(run, (run->t_event - run->t) / h, n, run->touch);
        if (!accept(run, h, is_last ? target : run->t + h, has_dense)) return FAILED;
        if (found == EVENT) {
            run->is_fresh = false;
            return set_point(run, run->t, run->z) ? EVENT : FAILED;
        }
        memcpy(run->k, run->k + STAGES * n, n * sizeof(double));
        memcpy(run->g, run->samples + SAMPLES * run->q, run->q * sizeof(double));
        for (size_t k = 0; k < run->q; k++)
            if (stands_for_no_event(run->g[k]) || fabs(run->g[k]) >= CLEAR * run->largest_g[k])
                run->t_far[k] = run->t, run->g_far[k] = run->g[k];
        int status = complete_step(run);
        if (status != REACHED || found == GRAZE) return status != REACHED ? status : GRAZE;
    }
    return REACHED;
}

static bool set_parameter(const Run *run, size_t i, double value)
{
    return write(run, &run->parameters[i].reference, 1, &value);
}

/* Indicator k at the present point, with the states moved by e along their change by parameter i, or, for i = m, along
 * the motion, in continuous-time mode; without `rates`, parameter i is moved instead, in event mode. */
static double moved_indicator(Run *run, size_t k, size_t i, double e, const double *rates)
{
    size_t n = run->n;
    double *y = run->dense;
    bool by_time = i == run->m, ok;
    const double *direction = by_time ? rates : run->z + n * (1 + i);
    if (!rates) {
        double value = run->parameters[i].value;
        ok = set_parameter(run, i, value + e) && get_array(run, run->get_indicators, run->g1, run->q);
        return set_parameter(run, i, value) && ok ? run->g1[k] : NAN;
    }
    for (size_t j = 0; j < n; j++) y[j] = run->z[j] + e * direction[j];
    ok = set_point_with(run, by_time ? run->t + e : run->t, y, by_time ? -1 : run->parameters[i].input, 1.0 + e);
    return ok && get_array(run, run->get_indicators, run->g1, run->q) ? run->g1[k] : NAN;
}

/* Derivative of indicator k along such a move: the limit of differences over e, e/2, ... by extrapolation (Ridders).
 * `sides` is 0 for central differences, and 1 or -1 for one-sided ones. */
static double indicator_slope(Run *run, size_t k, size_t i, double e, int sides, const double *rates)
{
    double table[LEVELS][LEVELS], best = NAN, least = INFINITY, base = moved_indicator(run, k, i, 0.0, rates);
    for (size_t level = 0; level < LEVELS; level++, e *= 0.5) {
        double up = moved_indicator(run, k, i, sides < 0 ? -e : e, rates);
        double down = sides ? base : moved_indicator(run, k, i, -e, rates), factor = 1.0;
        table[level][0] = sides ? sides * (up - down) / e : (up - down) / (2.0 * e);
        for (size_t j = 1; j <= level; j++) {
            factor *= sides ? 2.0 : 4.0;
            table[level][j] = (factor * table[level][j - 1] - table[level - 1][j - 1]) / (factor - 1.0);
            double error = fmax(fabs(table[level][j] - table[level][j - 1]),
                                fabs(table[level][j] - table[level - 1][j - 1]));
            if (error < least) least = error, best = table[level][j];
        }
        if (level && least <= 1e-12 * fabs(best)) break;
    }
    return fabs(best) <= 10.0 * least ? 0.0 : best;
}
