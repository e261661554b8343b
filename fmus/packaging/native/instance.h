/* An instance of the model in model.h in the hands of an importer, whatever the version of FMI.
 *
 * Every call does what it does in the Python FMU of the same model, by the same rules (call_sequence_... in model.h) and with
 * the same sentences: a value that cannot be used is remembered and told by the next step; a run that cannot begin or
 * go on answers Error, and every calculated Real reads NaN from then on.  On top, calls out of order, wrong references
 * and missing addresses are refused: such a call changes nothing.
 *
 * All that an instance changes is in one struct, and nothing is shared: instances may run side by side in threads.
 * Who includes this says what a Host and a Status are, and how a sentence gets into the log.
 */
#ifndef INSTANCE_H
#define INSTANCE_H

#include "model.h"
#include "say.h"
#include "state.h"

typedef struct {
    State state;
    int possible; /* phases in which it can be, for what it was made */
    bool logging;
    Host host;
    char name[];
} Instance;

/* What a call answers, by the numbers that all versions of FMI have for it. */
#define DONE ((Status)0)
#define DISCARDED ((Status)2)
#define REFUSED ((Status)3)

/* A type of FMI, and what of our variables is of it. */
typedef struct {
    const char *name;
    bool is_real;
} Type;

/* Phases as bits. */
enum { NEW = 1 << INSTANTIATED, STEPPING = 1 << RUNNING, EXCHANGING = 1 << EVENT | 1 << CONTINUOUS };
enum { BEGUN = STEPPING | EXCHANGING, LIVING = NEW | 1 << INITIALISING | BEGUN, ANY = LIVING | 1 << TERMINATED };
enum { READABLE = ANY | 1 << INTERMEDIATE, AROUND = ANY & ~BEGUN }; /* what comes before and after all runs */

/* ---- saying what is wrong */

/* Out of the way of what is asked all the time. */
#if defined(__GNUC__)
#define RARE __attribute__((cold, noinline))
#else
#define RARE
#endif

static void log_to(const Host *host, const char *name, const char *sentence);

static void say(const Host *host, const char *name, bool logging, const Text *text)
{
    if (logging) log_to(host, name, text->line);
    announce(name, text->line);
}

static void say_of(const Instance *it, const Text *text) { say(&it->host, it->name, it->logging, text); }

/* A mistake of the importer, which leaves the motion as it is. */
static RARE Status refuse_call(const Instance *it, int64_t reason, const Call *call)
{
    Text text = {0};
    tell_call(&text, reason, call);
    say_of(it, &text);
    return REFUSED;
}

static RARE Status refuse(const Instance *it, int64_t reason, const char *function, const char *word)
{
    return refuse_call(it, reason, &(Call){.function = function, .word = word});
}

static RARE Status refuse_order(const Instance *it, int allowed, const char *function)
{
    Text words = {0};
    if (!it) return REFUSED;
    if (allowed & it->possible) allowed &= it->possible;
    for (int i = 0; i < PHASES; i++) {
        if (!(allowed & 1 << i)) continue;
        if (words.length) add(&words, " or ");
        add(&words, phases[i]);
    }
    return refuse_call(it, OUT_OF_ORDER, &(Call){function, words.line, phases[it->state.run.phase], 0});
}

static Status refuse_reference(const Instance *it, uint32_t reference, const char *type)
{
    return refuse_call(it, UNKNOWN_REFERENCE, &(Call){.word = type, .reference = reference});
}

/* The instance, if the call is allowed in its phase. */
#define ENTER(handle, allowed) \
    Instance *it = handle;     \
    if (!it || !(1 << it->state.run.phase & (allowed))) return refuse_order(it, (allowed), __func__)

/* A call that co-simulation does not have, where its states do not tell. */
#define EXCHANGE_ONLY \
    if (!exchanges(&it->state)) return refuse(it, NOT_SUPPORTED, __func__, "")

/* An address that the call cannot do without. */
#define NEED(address) \
    if (!(address)) return refuse(it, NULL_POINTER, __func__, #address)

/* ---- failure */

static void silence(Model *model)
{
    for (const Variable *variable = variables; variable < variables + VARIABLES; variable++) {
        if (variable->is_real && variable->is_answer) *(double *)place(model, variable) = NAN;
    }
}

static bool exchanges(const State *state) { return state->run.interface == MODEL_EXCHANGE; }

/* The refused value that came first. */
static const Refusal *refused(const State *state)
{
    const Refusal *first = NULL, *end = state->refused + VARIABLES;
    for (const Refusal *refusal = state->refused; refusal < end; refusal++) {
        if (refusal->reason != OK && (!first || refusal->turn < first->turn)) first = refusal;
    }
    return first;
}

/* Fail for the reason that the rules give, in a communication step of h from t. */
static RARE Status give_up(Instance *it, int64_t status, double t, double h)
{
    State *state = &it->state;
    Text text = {0};
    if (status == FAILED) return REFUSED; /* which has been told */
    if (status == BAD_VALUE) {
        const Refusal *first = refused(state);
        tell_value(&text, first->reason, &variables[first - state->refused], first->value);
    } else {
        tell_status(&text, status, &state->run, &state->model, t, h);
    }
    state->run.has_failed = true;
    state->run.outputs_current = false;
    silence(&state->model);
    say_of(it, &text);
    return REFUSED;
}

/* What becomes of a call for which the rules found a status, and whether something faulted: where Python would raise. */
static Status judged_by(Instance *it, int64_t status, bool fault, double t, double h)
{
    return status == OK && !fault ? DONE : give_up(it, fault ? DIVERGED : status, t, h);
}

/* ---- reading and writing */

static bool is_one(uint32_t reference, const Type *type)
{
    return reference < VARIABLES && variables[reference].is_real == type->is_real;
}

/* Refuse a call unless every reference is that of a variable of the type, and there is room for the values. */
static Status check(const Instance *it, const Type *type, const uint32_t vr[], size_t n, const void *value,
                    const char *function)
{
    if (n && (!vr || !value)) return refuse(it, NULL_POINTER, function, "vr or value");
    for (size_t i = 0; i < n; i++) {
        if (!is_one(vr[i], type)) return refuse_reference(it, vr[i], type->name);
    }
    return DONE;
}

/* Make the values ready to be read; DISCARDED after a fault. */
static Status ready(Instance *it, const Type *type, const uint32_t vr[], size_t n, const void *value,
                    const char *function)
{
    State *state = &it->state;
    bool reported = false, ahead = false, shown = false, fault = false;
    if (!vr || !value) return check(it, type, vr, n, value, function);
    for (size_t i = 0; i < n; i++) {
        if (!is_one(vr[i], type)) return check(it, type, vr, n, value, function);
        reported |= variables[vr[i]].is_reported;
        ahead |= vr[i] == T_NEXT;
        shown |= vr[i] >= DECLARED;
    }
    if (!state->run.outputs_current && !state->run.has_failed) {
        int64_t status = call_sequence_update_outputs(&state->run, &state->model, &fault);
        if (status == DIVERGED) fault = true;
        else if (status != OK) silence(&state->model);
    }
    if (reported && state->run.outputs_current && !fault) call_sequence_update_statistics(&state->model, ahead, &fault);
    if (shown && state->run.outputs_current && !fault) model_exchange_update_variables(&state->model, &fault);
    if (!fault) return DONE;
    if (exchanges(state)) { /* a state that the importer's solver only tries may be anything */
        silence(&state->model);
        return DONE;
    }
    give_up(it, DIVERGED, NAN, NAN);
    return DISCARDED;
}

/* Of an input that has derivatives: that they are zero above this order. */
static int64_t *order_of(State *state, const Variable *variable)
{
    return (int64_t *)((char *)&state->model + variable->order);
}

/* Take over a value, or remember that it cannot be used.  False after a fault. */
static bool write_one(Instance *it, uint32_t reference, double value)
{
    State *state = &it->state;
    const Variable *variable = &variables[reference];
    Refusal *refusal = &state->refused[reference];
    bool allowed = accepts(variable, value), fault = false;
    bool stays = variable->order == NO_SLOPE || *order_of(state, variable) == 0;
    if (stays && value == value_of(&state->model, variable) && refusal->reason == OK) return true;
    state->run.outputs_current = false;
    state->run.n_invalid_values -= refusal->reason != OK;
    refusal->reason = call_sequence_rejection_reason(&state->run, variable->is_calculated, variable->is_fixed, allowed, &fault);
    if (refusal->reason != OK) {
        state->run.n_invalid_values++;
        refusal->value = value;
        refusal->turn = ++state->turns;
        return true;
    }
    call_sequence_note_change(&state->run, &state->model, &fault);
    if (fault) {
        give_up(it, DIVERGED, NAN, NAN);
        return false;
    }
    if (variable->is_real) *(double *)place(&state->model, variable) = value;
    else *(int64_t *)place(&state->model, variable) = (int64_t)value;
    return true;
}

static double real_at(const Instance *it, uint32_t reference)
{
    return *(const double *)((const char *)&it->state.model + variables[reference].offset);
}

static int64_t integer_at(const Instance *it, uint32_t reference)
{
    return *(const int64_t *)((const char *)&it->state.model + variables[reference].offset);
}

/* Reading and writing by the functions of a version of FMI; after a fault each value is `blank`. */
#define READ(it, type, vr, n, value, at, blank)                                            \
    Status status = ready(it, type, vr, n, value, __func__);                               \
    if (status == REFUSED) return REFUSED;                                                 \
    for (size_t i = 0; i < (n); i++) value[i] = status ? (blank) : at(it, vr[i]);          \
    return DONE

#define WRITE(it, type, vr, n, value)                                            \
    if (check(it, type, vr, n, value, __func__)) return REFUSED;                 \
    for (size_t i = 0; i < (n) && write_one(it, vr[i], value[i]); i++) continue; \
    return DONE

/* Of a type that no variable is of. */
#define REFUSE_ALL(it, vr, n, type) \
    if (!(n)) return DONE;          \
    NEED(vr);                       \
    return refuse_reference(it, vr[0], type)

/* ---- from instantiation to the end */

static void fresh(Instance *it)
{
    bool fault = false;
    memcpy(&it->state, &initial, sizeof initial);
    if (it->possible & 1 << CONTINUOUS) model_exchange_enable(&it->state.run, &fault);
}

/* None: such an instance cannot be. */
static Instance *dismissed(Instance *it, int64_t reason, const char *function, const char *word)
{
    refuse(it, reason, function, word);
    free(it);
    return NULL;
}

/* A new instance, whose runs are in some phases; NULL with a sentence for another FMU's token, or without memory. */
static Instance *instantiate(const char *name, const char *token, const Host *host, int running, bool logging,
                             const char *function)
{
    Text why = {0};
    if (!name) name = "";
    Instance *it = calloc(1, sizeof *it + 4 * strlen(name) + 1);
    if (!it) {
        tell_call(&why, NO_MEMORY, &(Call){.function = function});
        say(host, "", logging, &why);
        return NULL;
    }
    copy_name(it->name, name);
    it->host = *host;
    it->logging = logging;
    it->possible = AROUND | running;
    fresh(it);
    return token && !strcmp(token, MODEL_GUID) ? it : dismissed(it, WRONG_TOKEN, function, MODEL_GUID);
}

/* Every message is of the category logStatusError. */
static Status choose_log(Instance *it, bool logging, size_t n, const char *const categories[])
{
    it->logging = logging && n == 0;
    for (size_t i = 0; i < n; i++) {
        const char *category = categories[i] ? categories[i] : "";
        it->logging |= logging && (!strcmp(category, "logStatusError") || !strcmp(category, "logAll"));
    }
    return DONE;
}

/* The run begins, with an event if the importer handles them. */
static Status begin(Instance *it, bool handles)
{
    State *state = &it->state;
    bool fault = false;
    int64_t status = call_sequence_exit_initialization(&state->run, &state->model, &fault);
    if (status == OK && !fault && exchanges(state)) model_exchange_begin(&state->model, &fault);
    if (handles) state->run.phase = EVENT;
    return judged_by(it, status, fault, NAN, NAN);
}

static Status step_by(Instance *it, double t, double h)
{
    bool fault = false;
    int64_t status = call_sequence_do_step(&it->state.run, &it->state.model, t, h, &fault);
    return judged_by(it, status, fault, t, h);
}

/* ---- events */

/* An event is handled; what is new stands in the exchange. */
static Status handle(Instance *it)
{
    State *state = &it->state;
    bool fault = false;
    int64_t status = model_exchange_handle_event(&state->run, &state->model, &fault);
    return judged_by(it, status, fault, NAN, NAN);
}

/* ---- directional derivatives */

static double *slope_of(struct Tangent *to, uint32_t reference)
{
    return (double *)((char *)to + variables[reference].slope);
}

/* Refuse a call unless all knowns are states or inputs, and all unknowns what follows from them. */
static Status check_slopes(const Instance *it, const uint32_t unknowns[], size_t n, const uint32_t knowns[], size_t m,
                           const double *seed, const double *sensitivity, const char *function)
{
    if ((n && !unknowns) || (m && !knowns) || !seed || !sensitivity) {
        return refuse(it, NULL_POINTER, function, "one of unknowns, knowns, seed and sensitivity");
    }
    for (size_t i = 0; i < n + m; i++) {
        uint32_t reference = i < n ? unknowns[i] : knowns[i - n];
        const Variable *variable = reference < VARIABLES ? &variables[reference] : NULL;
        if (!variable || variable->slope == NO_SLOPE || !(i < n ? variable->is_calculated : variable->moves)) {
            return refuse_call(it, NO_PARTIAL_DERIVATIVE, &(Call){.function = function, .reference = reference});
        }
    }
    return DONE;
}

/* What follows along a direction, at the present point; DISCARDED where there is nothing to calculate with. */
static Status follow(Instance *it, struct Tangent *to)
{
    State *state = &it->state;
    bool fault = false;
    int64_t status = model_exchange_prepare(&state->run, &state->model, &fault);
    if (status != OK && state->run.phase >= RUNNING) return give_up(it, status, NAN, NAN);
    if (status == OK && !fault) along(&state->model, to, &fault);
    return status == OK && !fault ? DONE : DISCARDED;
}

/* The rates of outputs at the present point: what follows along the motion. */
static Status read_rates(Instance *it, const uint32_t vr[], size_t n, const int32_t order[], double value[],
                         const char *function)
{
    State *state = &it->state;
    struct Tangent to = {0};
    bool fault = false;
    if (n && (!vr || !order || !value)) return refuse(it, NULL_POINTER, function, "vr, order or value");
    for (size_t i = 0; i < n; i++) {
        bool has_one = vr[i] < VARIABLES && variables[vr[i]].slope != NO_SLOPE && variables[vr[i]].is_calculated;
        if (has_one && order[i] == 1) continue;
        return refuse_call(it, NO_OUTPUT_DERIVATIVE, &(Call){.function = function, .reference = vr[i]});
    }
    int64_t status = model_exchange_prepare(&state->run, &state->model, &fault);
    if (status == OK && !fault) model_exchange_update_rates(&state->model, &fault);
    if (status == OK && !fault) model_exchange_update_input_rates(&state->model, &fault);
    const double *rate = state->model.model_exchange.rates;
    for (const Variable *variable = variables; variable < variables + VARIABLES; variable++) {
        if (!variable->moves) continue;
        double *seed = slope_of(&to, (uint32_t)(variable - variables));
        if (variable->is_calculated) *seed = *rate++;
        else if (variable->rate != NO_SLOPE) *seed = *(double *)((char *)&state->model + variable->rate);
    }
    if (status == OK && !fault) along(&state->model, &to, &fault);
    for (size_t i = 0; i < n; i++) value[i] = status == OK && !fault ? *slope_of(&to, vr[i]) : NAN;
    return judged_by(it, status, fault, NAN, NAN);
}

static Status directional(Instance *it, const uint32_t unknowns[], size_t n, const uint32_t knowns[], size_t m,
                          const double seed[], double sensitivity[], const char *function)
{
    struct Tangent to = {0};
    if (check_slopes(it, unknowns, n, knowns, m, seed, sensitivity, function)) return REFUSED;
    for (size_t j = 0; j < m; j++) *slope_of(&to, knowns[j]) += seed[j];
    Status status = follow(it, &to);
    for (size_t i = 0; i < n; i++) sensitivity[i] = status ? NAN : *slope_of(&to, unknowns[i]);
    return status;
}

/* ---- state */

static Status refuse_state(const Instance *it) { return refuse(it, INVALID_STATE, "", ""); }

/* The state under a seal; NULL if it is broken, or that of an instance for something else. */
static const State *own_state(const Instance *it, Sealed *sealed)
{
    const State *state = unsealed(sealed);
    return state && exchanges(state) == exchanges(&it->state) ? state : NULL;
}

/* Keep a state in memory, in place of an older one if there is one. */
static Status keep(const Instance *it, const State *state, void **kept, const char *function)
{
    if (*kept && !is_ours(*kept)) return refuse_state(it);
    if (!*kept && !(*kept = malloc(sizeof(Sealed)))) return refuse(it, NO_MEMORY, function, "");
    seal(*kept, state);
    return DONE;
}

#endif
