/* Runs an FMU with derivatives through its events, with the integration of variational.c; see variational.py.
 *
 * Events, and times at which derivatives cease to exist, are written into logs, which the caller empties. */
#include "variational.c"

enum { EVENT_TERMINATED = TOO_MANY_STEPS + 1, EARLY_EVENT, UNSETTLED, NO_SAVED_STATE, NO_NEIGHBOUR, NO_VALUE, NO_END, LOG_FULL };
enum { NO_INDICATOR, SIMULTANEOUS, TOUCHED, BARELY, FIXED_PARAMETER, UNDECIDED, TIE, RECORDED }; /* notes */
enum { MAX_EVENTS = 1000, MODE_UPDATES = 3, NO_SIDE = 2 };
static const double SHIFT = 1e-3;      /* of the states or a parameter, for differences of an event indicator */
static const double JUMP_SHIFT = 1e-4; /* the same for differences of the states after an event */
static const double SAME = 1e-5;       /* relative difference of derivatives that are the same */
static const double RESET = 100.0; /* in tolerances: smaller changes of the states at an event are errors of integration */
/* Shares of the largest change of a rate at an event: of one that changes; of a derivative, which is an error then */
static const double CHANGED = 1e-6, CANCELLED = 1e-5;

typedef struct {
    int needed, terminate, nominals, values, defined;
    double next;
} EventInfo; /* of FMI 2.0 */

static bool call(const Run *run, Action action) { return action(run->instance) <= WARNING; }

static void *save(const Run *run)
{
    void *state = NULL;
    return run->save && run->save(run->instance, &state) <= WARNING ? state : NULL;
}

static bool restore(const Run *run, void *state) { return run->restore(run->instance, state) <= WARNING; }

static void release(const Run *run, void *state)
{
    if (state) run->release(run->instance, &state);
}

static bool read_modes(const Run *run, int64_t *modes)
{
    size_t n = run->n_modes;
    int values[n + 1];
    if (!n) return true;
    if (run->fmi == 3)
        return ((int (*)(Instance, const Reference *, size_t, int64_t *, size_t))run->get_mode)(
                   run->instance, run->modes, n, modes, n) <= WARNING;
    bool ok = ((int (*)(Instance, const Reference *, size_t, int *))run->get_mode)(run->instance, run->modes, n,
                                                                                 values) <= WARNING;
    for (size_t i = 0; i < n; i++) modes[i] = values[i];
    return ok;
}

/* Iterate the discrete states in event mode. */
static int update_states(Run *run, double t)
{
    for (size_t i = 0; i < MAX_EVENTS; i++) {
        bool needed = false, terminate = false, nominals = false, values = false, defined = false;
        double next = 0.0;
        if (run->fmi == 2) {
            EventInfo info = {0};
            if (((int (*)(Instance, EventInfo *))run->update)(run->instance, &info) > WARNING) return FAILED;
            needed = info.needed, terminate = info.terminate, defined = info.defined, next = info.next;
        } else if (((int (*)(Instance, bool *, bool *, bool *, bool *, bool *, double *))run->update)(
                       run->instance, &needed, &terminate, &nominals, &values, &defined, &next) > WARNING)
            return FAILED;
        run->next_event = defined ? next : INFINITY;
        if (terminate) return EVENT_TERMINATED;
        if (defined && !(next >= t)) return EARLY_EVENT;
        if (!needed && !(defined && next == t)) return REACHED;
    }
    return UNSETTLED;
}

/* Set the driven inputs to their values from a time on; return the next time of their table. */
double set_table(Run *run, double t)
{
    size_t width = 1 + run->n_inputs, low = 0, high = run->n_signals;
    double *now = (double *)run->table, *then = now + width;
    if (!run->n_inputs) return INFINITY;
    while (low < high) { /* the first time after t */
        size_t middle = (low + high) / 2;
        if (run->signals[middle * width] > t) high = middle;
        else low = middle + 1;
    }
    bool is_last = low == run->n_signals;
    const double *after = run->signals + (is_last ? low - 1 : low) * width, *before = low ? run->signals + (low - 1) * width : after;
    double interval = *after - *before, share = interval > 0.0 ? (t - *before) / interval : 0.0;
    now[0] = t, then[0] = is_last ? t + 1.0 : *after;
    for (size_t j = 1; j < width; j++) now[j] = (1.0 - share) * before[j] + share * after[j], then[j] = after[j];
    write(run, run->inputs, width - 1, now + 1);
    return is_last ? INFINITY : *after;
}

/* Move to the present point; read rates, indicators and modes of contacts. */
static bool read_point(Run *run, double *rates, double *indicators, int64_t *modes)
{
    return set_point(run, run->t, run->z) && read_modes(run, modes) && get_array(run, run->get_rates, rates, run->n) &&
           get_array(run, run->get_indicators, indicators, run->q);
}

/* Largest value of state j up to now, if it is not tiny. */
static double usual_size(const Run *run, size_t j) { return fmax(run->largest[j], smallest_size(run, j)); }

static double parameter_size(const Run *run, size_t i)
{
    double size = fabs(run->parameters[i].value);
    return size > 0.0 ? size : 1.0;
}

/* Largest change of a state by a direction, relative to its usual size. */
static double share_of(const Run *run, const double *direction)
{
    double share = 0.0;
    for (size_t j = 0; j < run->n; j++) share = fmax(share, fabs(direction[j]) / usual_size(run, j));
    return share;
}

/* Time in which the states with these rates hardly change. */
static double time_shift(const Run *run, const double *rates)
{
    double share = share_of(run, rates);
    return share > 0.0 ? SHIFT / share : SHIFT * run->duration;
}

/* Differences (q) of the indicators over 2 e seconds of motion with these rates. */
static void differences(Run *run, double e, const double *rates, double *result)
{
    moved_indicator(run, 0, run->m, e, rates);
    memcpy(result, run->g1, run->q * sizeof(double));
    moved_indicator(run, 0, run->m, -e, rates);
    for (size_t k = 0; k < run->q; k++) result[k] -= run->g1[k];
}

/* Note at a time that derivatives do not exist on a side (1, -1) of each parameter, on both (NaN), or exist (0). */
static void note(Run *run, double t, int64_t indicator, int64_t reason, const double *sides)
{
    bool is_needed = reason == RECORDED;
    for (size_t i = 0; i < run->m; i++) is_needed |= sides[i] != 0.0;
    if (!is_needed) return;
    double *values = run->note_values + run->n_notes * (1 + run->m);
    int64_t *codes = run->note_codes + 2 * run->n_notes++;
    values[0] = t;
    memcpy(values + 1, sides, run->m * sizeof(double));
    codes[0] = indicator, codes[1] = reason;
}

/* Indicators at the present point, from a saved state at the start. The FMU takes its modes at the point `ahead` seconds
 * later, in several events: from sliding against its mode it first sticks. */
static int indicators_from(Run *run, void *start, const double *rates, double ahead, double *result)
{
    double point[run->n + 1];
    for (size_t j = 0; j < run->n; j++) point[j] = run->z[j] + ahead * rates[j];
    if (!restore(run, start)) return FAILED;
    for (size_t i = 0; i < MODE_UPDATES; i++) {
        if (!set_point(run, run->t + ahead, point) || !call(run, run->enter_event)) return FAILED;
        int status = update_states(run, run->t + ahead);
        if (status != REACHED) return status;
        if (!call(run, run->enter_continuous)) return FAILED;
    }
    return indicators_at(run, run->t, run->z, result) ? REACHED : FAILED;
}

/* Whether values (q) of the indicators agree, but for rounding errors of these sizes. */
static bool are_close(const Run *run, const double *a, const double *b, double relative, const double *sizes)
{
    for (size_t k = 0; k < run->q; k++)
        if (!(fabs(a[k] - b[k]) <= 1e-12 * sizes[k] + relative * fabs(b[k]))) return false;
    return true;
}

/* Partial derivatives (q) of the indicators by parameter i, which can be set before the start only, from saved states of
 * runs that start with neighbouring values; *is_known is false if these take other modes. */
static int fixed_slopes(Run *run, size_t i, const double *rates, bool is_before, double *slopes, bool *is_known)
{
    size_t q = run->q;
    const Parameter *parameter = run->parameters + i;
    double ahead = (is_before ? -10.0 : 10.0) * time_shift(run, rates), next_event = run->next_event;
    double values[q + 1], base[q + 1], near[q + 1], far[q + 1], ends[4][q + 1], sizes[q + 1], e = parameter->change;
    *is_known = false;
    for (size_t l = 0; l < (parameter->side ? 3 : 5); l++)
        if (!parameter->starts[l]) return REACHED;
    if (!indicators_at(run, run->t, run->z, values)) return FAILED;
    void *saved = save(run);
    int status = saved ? indicators_from(run, parameter->starts[0], rates, ahead, base) : NO_SAVED_STATE;
    if (status == REACHED && are_close(run, base, values, 1e-9, run->largest_g)) {
        for (size_t l = 0; l < 4 && status == REACHED; l++)
            if (parameter->starts[1 + l]) status = indicators_from(run, parameter->starts[1 + l], rates, ahead, ends[l]);
        for (size_t k = 0; k < q && status == REACHED; k++) {
            if (parameter->side) { /* one-sided differences */
                near[k] = (ends[0][k] - base[k]) / (0.5 * e), far[k] = (ends[1][k] - base[k]) / e;
                slopes[k] = 2.0 * near[k] - far[k];
            } else {
                near[k] = (ends[0][k] - ends[2][k]) / e, far[k] = (ends[1][k] - ends[3][k]) / (2.0 * e);
                slopes[k] = (4.0 * near[k] - far[k]) / 3.0;
            }
            sizes[k] = run->largest_g[k] / fabs(e);
        }
        *is_known = status == REACHED && are_close(run, near, far, 1e-3, sizes);
    }
    run->next_event = next_event;
    if (saved && !restore(run, saved)) status = FAILED;
    release(run, saved);
    return status == REACHED && !set_point(run, run->t, run->z) ? FAILED : status;
}

/* Whether a rate or an output depends on parameter i directly, at the present point. */
static bool enters_outputs(Run *run, size_t i)
{
    double zeros[run->n + 1], values[run->n_influenced + 1];
    for (size_t j = 0; j < run->n; j++) zeros[j] = 0.0;
    if (!tangent(run, run->influenced, run->n_influenced, i, run->t, zeros, values)) return true;
    for (size_t j = 0; j < run->n_influenced; j++)
        if (values[j] != 0.0) return true;
    return false;
}

/* Total derivatives (count, m + 1) of indicators by the parameters and by time, just before or after an event; enters
 * event mode. */
static int gradients(Run *run, const size_t *which, size_t count, const double *rates, bool is_before, double *result)
{
    size_t n = run->n, m = run->m, q = run->q;
    double shift = time_shift(run, rates);
    for (size_t l = 0; l < count; l++) {
        double *gradient = result + l * (m + 1);
        for (size_t i = 0; i < m; i++) {
            bool is_input = run->parameters[i].input >= 0;
            double share = share_of(run, run->z + n * (1 + i));
            double e = fmin(share > 0.0 ? SHIFT / share : INFINITY, is_input ? SHIFT : INFINITY);
            gradient[i] = e < INFINITY ? indicator_slope(run, which[l], i, e, 0, rates) : 0.0;
        }
        gradient[m] = indicator_slope(run, which[l], m, shift, 0, rates);
    }
    for (size_t i = 0; i < m && count; i++) {
        if (run->parameters[i].kind != FIXED) continue;
        double slopes[q + 1], sides[m];
        bool is_known = false;
        int status = fixed_slopes(run, i, rates, is_before, slopes, &is_known);
        if (status != REACHED) return status;
        for (size_t j = 0; j < m; j++) sides[j] = j == i ? NAN : 0.0;
        if (!is_known && is_before && enters_outputs(run, i)) note(run, run->t, (int64_t)which[0], FIXED_PARAMETER, sides);
        for (size_t l = 0; l < count && is_known; l++) result[l * (m + 1) + i] += slopes[which[l]];
    }
    if (!set_point(run, run->t, run->z) || !call(run, run->enter_event)) return FAILED;
    for (size_t l = 0; l < count; l++) {
        double *gradient = result + l * (m + 1);
        for (size_t i = 0; i < m; i++) {
            const Parameter *parameter = run->parameters + i;
            if (parameter->kind != TUNABLE) continue;
            run->indicator = (int64_t)i;
            if (parameter->side == NO_SIDE) return NO_NEIGHBOUR;
            gradient[i] += indicator_slope(run, which[l], i, SHIFT * parameter_size(run, i), (int)parameter->side, NULL);
        }
        for (size_t i = 0; i <= m; i++)
            if (!isfinite(gradient[i])) return NO_VALUE;
    }
    return REACHED;
}

/* Note the parameters that decide what happens next, because an indicator is zero just after an event, whose time has
 * the derivatives `slopes`. */
int check_ties(Run *run, int64_t fired, const double *slopes, double speed)
{
    size_t m = run->m, q = run->q, near[q + 1], count = 0;
    double rates[run->n + 1], values[q + 1], reach[q + 1], sides[m + 1];
    int64_t modes[run->n_modes + 1];
    if (!read_point(run, rates, values, modes)) return FAILED;
    differences(run, time_shift(run, rates), rates, reach);
    for (size_t k = 0; k < q; k++) {
        reach[k] = fmax(run->largest_g[k], fabs(reach[k]) / SHIFT);
        if (!stands_for_no_event(values[k]) && fabs(values[k]) <= run->graze * reach[k]) near[count++] = k;
    }
    if (!read_point(run, rates, values, modes)) return FAILED;
    if (!count) return REACHED;
    double result[count * (m + 1)];
    int status = gradients(run, near, count, rates, false, result);
    if (status != REACHED) return status;
    for (size_t l = 0; l < count; l++) {
        size_t k = near[l];
        double *gradient = result + l * (m + 1), drift = gradient[m];
        for (size_t i = 0; i < m; i++) sides[i] = NAN;
        if ((int64_t)k == fired && fabs(drift) <= run->graze * fabs(speed))
            note(run, run->t, (int64_t)k, UNDECIDED, sides);
        for (size_t i = 0; i < m; i++) {
            double by_time = drift * slopes[i], change = gradient[i] + by_time;
            bool is_zero = fabs(change) * parameter_size(run, i) <= run->graze * reach[k] ||
                           fabs(change) <= SAME * fmin(fabs(gradient[i]), fabs(by_time));
            sides[i] = is_zero ? 0.0 : isnan(change) ? NAN : (change > 0.0) == (values[k] > 0.0) ? 1.0 : -1.0;
        }
        note(run, run->t, (int64_t)k, TIE, sides);
    }
    if ((status = update_states(run, run->t)) != REACHED) return status;
    return call(run, run->enter_continuous) && read_point(run, rates, values, modes) ? REACHED : FAILED;
}

/* Note the parameters that decide whether the indicator, which touches zero without an event, passes it. */
static int handle_touch(Run *run)
{
    size_t k = (size_t)run->indicator, m = run->m, size = run->n * (1 + m) * sizeof(double);
    double sides[m + 1], t = run->t, z[run->n * (1 + m) + 1], rates[run->n + 1], values[run->q + 1], gradient[m + 1];
    int64_t modes[run->n_modes + 1];
    void *saved = save(run);
    int status = REACHED;
    for (size_t i = 0; i < m; i++) sides[i] = NAN;
    if (saved) {
        memcpy(z, run->z, size);
        memcpy(run->z, run->touch, size);
        run->t = run->t_event;
        status = read_point(run, rates, values, modes) ? gradients(run, &k, 1, rates, true, gradient) : FAILED;
        for (size_t i = 0; i < m && status == REACHED; i++) {
            bool is_zero = fabs(gradient[i]) * parameter_size(run, i) <= SAME * run->largest_g[k];
            sides[i] = is_zero ? 0.0 : (gradient[i] > 0.0) == (run->g_far[k] > 0.0) ? 1.0 : -1.0;
        }
        memcpy(run->z, z, size);
        run->t = t;
        bool ok = restore(run, saved);
        release(run, saved);
        run->is_fresh = false;
        if (status == REACHED && !(ok && read_point(run, rates, values, modes))) status = FAILED;
    }
    note(run, run->t_event, (int64_t)k, TOUCHED, sides);
    return status;
}

/* How far indicator k, which passes zero at a speed, goes until it turns, by a parabola; infinite if never. */
static double turning_depth(const Run *run, size_t k, double speed)
{
    double elapsed = run->t - run->t_far[k], far = fabs(run->g_far[k]);
    double curvature = elapsed > 0.0 ? 2.0 * (far - fabs(speed) * elapsed) / (elapsed * elapsed) : 0.0;
    return curvature > 0.0 ? 0.5 * speed * speed / curvature : INFINITY;
}

/* States `delay` seconds after the event of a run with parameter i (m: none) changed by e. */
static int states_after(Run *run, void *saved, const double *y, const double *rates, size_t i, const double *direction,
                        double e, double slope, double delay, double *states)
{
    double t = run->t + e * slope + delay, point[run->n + 1];
    for (size_t j = 0; j < run->n; j++) point[j] = y[j] + e * direction[j] + delay * rates[j];
    if (!restore(run, saved) || !set_point(run, t, point) || !call(run, run->enter_event)) return FAILED;
    bool is_set = i < run->m && run->parameters[i].kind == TUNABLE;
    if (is_set && !set_parameter(run, i, run->parameters[i].value + e)) return FAILED;
    int status = update_states(run, t);
    if (status != REACHED) return status;
    return get_array(run, run->get_states, states, run->n) && call(run, run->enter_continuous) ? REACHED : FAILED;
}

/* Derivatives (m, n) of the states just after an event that changes them, at the moving event time: differences between
 * points that have just passed the event, extrapolated to the event itself. */
static int jump_slopes(Run *run, void *saved, const double *y, const double *rates, const double *slopes, double *result)
{
    size_t n = run->n, m = run->m;
    double delay = 10.0 * JUMP_SHIFT * JUMP_SHIFT * run->h, direction[n + 1], ends[4][n + 1];
    int status = saved ? REACHED : NO_SAVED_STATE;
    for (size_t i = 0; i < m && status == REACHED; i++) {
        for (size_t j = 0; j < n; j++) direction[j] = run->z[n * (1 + i) + j] + rates[j] * slopes[i];
        double share = share_of(run, direction), e = share > 0.0 ? JUMP_SHIFT / share : INFINITY;
        if (run->parameters[i].kind == TUNABLE) e = fmin(e, JUMP_SHIFT * parameter_size(run, i));
        for (size_t l = 0; l < 4 && e < INFINITY && status == REACHED; l++)
            status = states_after(run, saved, y, rates, i, direction, l % 2 ? -e : e, slopes[i],
                                  l < 2 ? delay : 2.0 * delay, ends[l]);
        for (size_t j = 0; j < n; j++)
            result[i * n + j] =
                e < INFINITY ? (2.0 * (ends[0][j] - ends[1][j]) - (ends[2][j] - ends[3][j])) / (2.0 * e) : 0.0;
    }
    for (size_t j = 0; j < n; j++) direction[j] = 0.0;
    return status == REACHED ? states_after(run, saved, y, rates, m, direction, 0.0, 0.0, 0.0, ends[0]) : status;
}

/* Index of the recorded time at the present time, or -1. */
static int64_t row_at_present(const Run *run)
{
    size_t i = run->next;
    while (i > 0 && run->times[i - 1] >= run->t - run->tolerance) i--;
    return i < run->n_times && fabs(run->times[i] - run->t) <= run->tolerance ? (int64_t)i : -1;
}

/* Update the derivatives of the states after an event: their change, and that by the derivatives of the event time. */
static void update_slopes(Run *run, const double *y, const double *moved, const double *slopes, const double *rates,
                          const double *new_rates)
{
    double largest = 0.0;
    for (size_t j = 0; j < run->n; j++) largest = fmax(largest, fabs(rates[j] - new_rates[j]));
    for (size_t i = 0; i < run->m; i++)
        for (size_t j = 0; j < run->n; j++) {
            double *slope = run->z + run->n * (1 + i) + j, change = rates[j] - new_rates[j];
            *slope = moved ? moved[i * run->n + j] - slopes[i] * new_rates[j] : *slope + slopes[i] * change;
            if (!moved && run->z[j] == 0.0 && y[j] != 0.0) *slope = -slopes[i] * new_rates[j]; /* the event stops it */
            /* what is left of a speed at rest is an error, and would decide on modes at the next break-away */
            bool is_speed = fabs(change) >= CHANGED * largest && fabs(new_rates[j]) <= CANCELLED * fabs(rates[j]);
            if (is_speed && fabs(*slope) <= CANCELLED * fabs(slopes[i]) * largest) *slope = 0.0;
        }
}

/* Handle an event at the present time: of an indicator, or at a time that the FMU or a table sets (-1). */
static int handle_event(Run *run, int64_t indicator, bool is_row)
{
    size_t n = run->n, m = run->m, q = run->q, r = run->r, due[q + 1], count = 0, n_modes = run->n_modes;
    double y[n + 1], rates[n + 1], new_rates[n + 1], values[q + 1], drift[q + 1], after[n + 1], sides[m + 1];
    double moved[m * n + 1], no_slopes[m + 1], *split = run->split_values + run->n_splits * 2 * (1 + m) * r;
    int64_t modes[n_modes + 1], new_modes[n_modes + 1], row = row_at_present(run);
    bool is_located = indicator >= 0;
    memcpy(y, run->z, n * sizeof(double));
    if (row >= 0 && !read_outputs(run, run->t, run->z, split)) return FAILED;
    if (!read_point(run, rates, values, modes)) return FAILED;
    double e = time_shift(run, rates);
    differences(run, e, rates, drift);
    if (is_located) due[count++] = (size_t)indicator;
    for (size_t k = 0; k < q && !(is_row && !is_located); k++) {
        double speed = fabs(drift[k]) / (2.0 * e);
        if ((int64_t)k != indicator && speed != 0.0 && fabs(values[k]) <= speed * run->tolerance) due[count++] = k;
    }
    if (!set_point(run, run->t, run->z)) return FAILED;
    void *saved = save(run);
    double result[(count + 1) * (m + 1)], *slopes = count ? result : no_slopes;
    int status = gradients(run, due, count, rates, true, result);
    double speed = count ? result[m] : 0.0;
    for (size_t i = 0; i < m; i++) no_slopes[i] = 0.0;
    for (size_t l = 0; l < count; l++)
        for (size_t i = 0; i < m; i++) {
            double *slope = result + l * (m + 1) + i, by_time = result[l * (m + 1) + m];
            *slope = *slope == 0.0 ? 0.0 : by_time != 0.0 ? -*slope / by_time : NAN;
        }
    if (is_row && status == REACHED) set_table(run, run->t);
    if (status == REACHED) status = update_states(run, run->t);
    if (status == REACHED && !(get_array(run, run->get_states, after, n) && call(run, run->enter_continuous))) status = FAILED;
    bool jumps = false, differs = false;
    for (size_t j = 0; j < n; j++) jumps |= fabs(after[j] - y[j]) > RESET * run->rtol * run->largest[j];
    if (jumps && status == REACHED) status = jump_slopes(run, saved, y, rates, slopes, moved);
    release(run, saved);
    if (status != REACHED) return status;
    memcpy(run->z, after, n * sizeof(double));
    run->is_fresh = false;
    if (!read_point(run, new_rates, values, new_modes)) return FAILED;
    for (size_t i = 0; i < n_modes; i++) differs |= modes[i] != new_modes[i];
    for (size_t j = 0; j < n; j++) {
        double size = fmax(fabs(new_rates[j]), fabs(rates[j]));
        differs |= fabs(new_rates[j] - rates[j]) > RESET * run->rtol * size;
    }
    if (!jumps && !differs) return is_row ? check_ties(run, -1, no_slopes, 0.0) : REACHED;
    update_slopes(run, y, jumps ? moved : NULL, slopes, rates, new_rates);
    for (size_t i = 0; i < m; i++) sides[i] = NAN;
    if (!count) {
        if (!is_row) note(run, run->t, -1, NO_INDICATOR, sides);
        return is_row ? check_ties(run, -1, no_slopes, 0.0) : REACHED;
    }
    for (size_t l = 1; l < count; l++) {
        double others[m + 1];
        for (size_t i = 0; i < m; i++) {
            double one = slopes[i], other = result[l * (m + 1) + i];
            others[i] = fabs(other - one) <= SAME * fmax(fabs(other), fabs(one)) ? 0.0 : NAN;
        }
        note(run, run->t, (int64_t)due[l], SIMULTANEOUS, others);
    }
    if (is_located && turning_depth(run, due[0], speed) <= run->graze * run->largest_g[due[0]])
        note(run, run->t, indicator, BARELY, sides);
    double *event = run->event_values + run->n_events * (1 + m);
    int64_t *codes = run->event_codes + run->n_events++ * (1 + 2 * n_modes);
    event[0] = run->t, codes[0] = (int64_t)due[0];
    memcpy(event + 1, slopes, m * sizeof(double));
    memcpy(codes + 1, modes, n_modes * sizeof *modes);
    memcpy(codes + 1 + n_modes, new_modes, n_modes * sizeof *modes);
    status = check_ties(run, (int64_t)due[0], slopes, speed);
    if (row < 0 || status != REACHED) return status;
    note(run, (double)row, (int64_t)due[0], RECORDED, slopes);
    run->n_splits++;
    return read_outputs(run, run->t, run->z, split + (1 + m) * r) ? REACHED : FAILED;
}

/* Integrate to the end, through all events. */
int solve(Run *run, double end)
{
    while (run->t < end) {
        double target = fmin(end, fmin(run->row, run->next_event));
        int status = advance(run, target);
        if (status > GRAZE) return status;
        bool is_row = status == REACHED && target == run->row;
        if (status == GRAZE) status = handle_touch(run);
        else if (status == EVENT || target < end) {
            status = handle_event(run, status == EVENT ? run->indicator : -1, is_row);
            if (run->t >= run->row) run->row = set_table(run, run->t);
        }
        if (status != REACHED) return status;
        bool is_at_once = run->t - run->last_t <= run->tolerance;
        run->n_at_once = is_at_once ? run->n_at_once + 1 : 0;
        if (!is_at_once) run->last_t = run->t;
        if (run->n_at_once > MAX_EVENTS) return NO_END;
        bool is_full = run->n_events + 1 > run->capacity || run->n_splits + 1 > run->capacity;
        if (is_full || run->n_notes + 3 * run->q + 3 * run->m + 6 > run->capacity_notes) return LOG_FULL;
    }
    return REACHED;
}
