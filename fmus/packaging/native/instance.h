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
#include "stderr_output.h"
#include "saved_state.h"

typedef struct {
    State state;
    int possible_phases; /* phases in which it can be, for what it was made */
    bool logging;
    Host host;
    char name[];
} Instance;

/* What a call answers, by the numbers that all versions of FMI have for it. */
#define STATUS_OK ((Status)0)
#define STATUS_DISCARD ((Status)2)
#define STATUS_ERROR ((Status)3)

/* A type of FMI, and what of our variables is of it. */
typedef struct {
    const char *name;
    bool is_real;
} FmiType;

/* Phases as bits. */
enum { IN_INSTANTIATED = 1 << INSTANTIATED, IN_STEP_MODE = 1 << RUNNING, IN_MODEL_EXCHANGE = 1 << EVENT | 1 << CONTINUOUS };
enum { IN_SIMULATION = IN_STEP_MODE | IN_MODEL_EXCHANGE, BEFORE_TERMINATION = IN_INSTANTIATED | 1 << INITIALISING | IN_SIMULATION, IN_ANY_PHASE = BEFORE_TERMINATION | 1 << TERMINATED };
enum { IN_READABLE_PHASE = IN_ANY_PHASE | 1 << INTERMEDIATE, OUTSIDE_SIMULATION = IN_ANY_PHASE & ~IN_SIMULATION }; /* what comes before and after all runs */

/* ---- saying what is wrong */

/* Out of the way of what is asked all the time. */
#if defined(__GNUC__)
#define COLD __attribute__((cold, noinline))
#else
#define COLD
#endif

static void log_to_host(const Host *host, const char *name, const char *sentence);

static void report_error_for(const Host *host, const char *name, bool logging, const TextBuffer *text)
{
    if (logging) log_to_host(host, name, text->buffer);
    print_to_stderr(name, text->buffer);
}

static void report_error(const Instance *self, const TextBuffer *text) { report_error_for(&self->host, self->name, self->logging, text); }

/* A mistake of the importer, which leaves the motion as it is. */
static COLD Status refuse_call(const Instance *self, int64_t reason, const Call *call)
{
    TextBuffer text = {0};
    append_call_message(&text, reason, call);
    report_error(self, &text);
    return STATUS_ERROR;
}

static COLD Status refuse(const Instance *self, int64_t reason, const char *function, const char *word)
{
    return refuse_call(self, reason, &(Call){.function = function, .word = word});
}

static COLD Status refuse_phase(const Instance *self, int allowed, const char *function)
{
    TextBuffer words = {0};
    if (!self) return STATUS_ERROR;
    if (allowed & self->possible_phases) allowed &= self->possible_phases;
    for (int i = 0; i < PHASES; i++) {
        if (!(allowed & 1 << i)) continue;
        if (words.length) append(&words, " or ");
        append(&words, phases[i]);
    }
    return refuse_call(self, OUT_OF_ORDER, &(Call){function, words.buffer, phases[self->state.run.phase], 0});
}

static Status refuse_reference(const Instance *self, uint32_t reference, const char *type)
{
    return refuse_call(self, UNKNOWN_REFERENCE, &(Call){.word = type, .reference = reference});
}

/* The instance, if the call is allowed in its phase. */
#define REQUIRE_PHASE(handle, allowed) \
    Instance *self = handle;     \
    if (!self || !(1 << self->state.run.phase & (allowed))) return refuse_phase(self, (allowed), __func__)

/* A call that co-simulation does not have, where its states do not tell. */
#define REQUIRE_MODEL_EXCHANGE \
    if (!is_model_exchange(&self->state)) return refuse(self, NOT_SUPPORTED, __func__, "")

/* An address that the call cannot do without. */
#define REQUIRE_ADDRESS(address) \
    if (!(address)) return refuse(self, NULL_POINTER, __func__, #address)

/* ---- failure */

static void set_outputs_to_nan(Model *model)
{
    for (const Variable *variable = variables; variable < variables + VARIABLES; variable++) {
        if (variable->is_real && variable->is_nan_after_failure) *(double *)variable_address(model, variable) = NAN;
    }
}

static bool is_model_exchange(const State *state) { return state->run.interface == MODEL_EXCHANGE; }

/* The refused value that came first. */
static const RejectedValue *first_rejection(const State *state)
{
    const RejectedValue *first = NULL, *end = state->rejected + VARIABLES;
    for (const RejectedValue *refusal = state->rejected; refusal < end; refusal++) {
        if (refusal->reason != OK && (!first || refusal->sequence < first->sequence)) first = refusal;
    }
    return first;
}

/* Fail for the reason that the rules give, in a communication step of h from t. */
static COLD Status fail_run(Instance *self, int64_t status, double t, double h)
{
    State *state = &self->state;
    TextBuffer text = {0};
    if (status == FAILED) return STATUS_ERROR; /* which has been told */
    if (status == BAD_VALUE) {
        const RejectedValue *first = first_rejection(state);
        append_value_message(&text, first->reason, &variables[first - state->rejected], first->value);
    } else {
        append_run_message(&text, status, &state->run, &state->model, t, h);
    }
    state->run.has_failed = true;
    state->run.outputs_current = false;
    set_outputs_to_nan(&state->model);
    report_error(self, &text);
    return STATUS_ERROR;
}

/* What becomes of a call for which the rules found a status, and whether something faulted: where Python would raise. */
static Status finish_call(Instance *self, int64_t status, bool fault, double t, double h)
{
    return status == OK && !fault ? STATUS_OK : fail_run(self, fault ? DIVERGED : status, t, h);
}

/* ---- reading and writing */

static bool has_type(uint32_t reference, const FmiType *type)
{
    return reference < VARIABLES && variables[reference].is_real == type->is_real;
}

/* Refuse a call unless every reference is that of a variable of the type, and there is room for the values. */
static Status check_references(const Instance *self, const FmiType *type, const uint32_t vr[], size_t n, const void *value,
                    const char *function)
{
    if (n && (!vr || !value)) return refuse(self, NULL_POINTER, function, "vr or value");
    for (size_t i = 0; i < n; i++) {
        if (!has_type(vr[i], type)) return refuse_reference(self, vr[i], type->name);
    }
    return STATUS_OK;
}

/* Make the values ready to be read; STATUS_DISCARD after a fault. */
static Status prepare_values(Instance *self, const FmiType *type, const uint32_t vr[], size_t n, const void *value,
                    const char *function)
{
    State *state = &self->state;
    bool reported = false, ahead = false, shown = false, fault = false;
    if (!vr || !value) return check_references(self, type, vr, n, value, function);
    for (size_t i = 0; i < n; i++) {
        if (!has_type(vr[i], type)) return check_references(self, type, vr, n, value, function);
        reported |= variables[vr[i]].is_updated_on_read;
        ahead |= vr[i] == T_NEXT;
        shown |= vr[i] >= DECLARED;
    }
    if (!state->run.outputs_current && !state->run.has_failed) {
        int64_t status = call_sequence_update_outputs(&state->run, &state->model, &fault);
        if (status == DIVERGED) fault = true;
        else if (status != OK) set_outputs_to_nan(&state->model);
    }
    if (reported && state->run.outputs_current && !fault) call_sequence_update_statistics(&state->model, ahead, &fault);
    if (shown && state->run.outputs_current && !fault) model_exchange_update_variables(&state->model, &fault);
    if (!fault) return STATUS_OK;
    if (is_model_exchange(state)) { /* a state that the importer's solver only tries may be anything */
        set_outputs_to_nan(&state->model);
        return STATUS_OK;
    }
    fail_run(self, DIVERGED, NAN, NAN);
    return STATUS_DISCARD;
}

/* Of an input that has derivatives: that they are zero above this order. */
static int64_t *input_order(State *state, const Variable *variable)
{
    return (int64_t *)((char *)&state->model + variable->order_offset);
}

/* Take over a value, or remember that it cannot be used.  False after a fault. */
static bool write_value(Instance *self, uint32_t reference, double value)
{
    State *state = &self->state;
    const Variable *variable = &variables[reference];
    RejectedValue *refusal = &state->rejected[reference];
    bool allowed = is_allowed_value(variable, value), fault = false;
    bool stays = variable->order_offset == NO_OFFSET || *input_order(state, variable) == 0;
    if (stays && value == variable_value(&state->model, variable) && refusal->reason == OK) return true;
    state->run.outputs_current = false;
    state->run.n_invalid_values -= refusal->reason != OK;
    refusal->reason = call_sequence_rejection_reason(&state->run, variable->is_calculated, variable->is_fixed, allowed, &fault);
    if (refusal->reason != OK) {
        state->run.n_invalid_values++;
        refusal->value = value;
        refusal->sequence = ++state->rejection_count;
        return true;
    }
    call_sequence_note_change(&state->run, &state->model, &fault);
    if (fault) {
        fail_run(self, DIVERGED, NAN, NAN);
        return false;
    }
    if (variable->is_real) *(double *)variable_address(&state->model, variable) = value;
    else *(int64_t *)variable_address(&state->model, variable) = (int64_t)value;
    return true;
}

static double read_real(const Instance *self, uint32_t reference)
{
    return *(const double *)((const char *)&self->state.model + variables[reference].offset);
}

static int64_t read_integer(const Instance *self, uint32_t reference)
{
    return *(const int64_t *)((const char *)&self->state.model + variables[reference].offset);
}

/* Reading and writing by the functions of a version of FMI; after a fault each value is `blank`. */
#define READ_VALUES(self, type, vr, n, value, at, blank)                                            \
    Status status = prepare_values(self, type, vr, n, value, __func__);                               \
    if (status == STATUS_ERROR) return STATUS_ERROR;                                                 \
    for (size_t i = 0; i < (n); i++) value[i] = status ? (blank) : at(self, vr[i]);          \
    return STATUS_OK

#define WRITE_VALUES(self, type, vr, n, value)                                            \
    if (check_references(self, type, vr, n, value, __func__)) return STATUS_ERROR;                 \
    for (size_t i = 0; i < (n) && write_value(self, vr[i], value[i]); i++) continue; \
    return STATUS_OK

/* Of a type that no variable is of. */
#define REFUSE_REFERENCES(self, vr, n, type) \
    if (!(n)) return STATUS_OK;          \
    REQUIRE_ADDRESS(vr);                       \
    return refuse_reference(self, vr[0], type)

/* ---- from instantiation to the end */

static void reset_state(Instance *self)
{
    bool fault = false;
    memcpy(&self->state, &initial, sizeof initial);
    if (self->possible_phases & 1 << CONTINUOUS) model_exchange_enable(&self->state.run, &fault);
}

/* None: such an instance cannot be. */
static Instance *refuse_instance(Instance *self, int64_t reason, const char *function, const char *word)
{
    refuse(self, reason, function, word);
    free(self);
    return NULL;
}

/* A new instance, whose runs are in some phases; NULL with a sentence for another FMU's token, or without memory. */
static Instance *instantiate(const char *name, const char *token, const Host *host, int running, bool logging,
                             const char *function)
{
    TextBuffer why = {0};
    if (!name) name = "";
    Instance *self = calloc(1, sizeof *self + 4 * strlen(name) + 1);
    if (!self) {
        append_call_message(&why, NO_MEMORY, &(Call){.function = function});
        report_error_for(host, "", logging, &why);
        return NULL;
    }
    copy_as_utf8(self->name, name);
    self->host = *host;
    self->logging = logging;
    self->possible_phases = OUTSIDE_SIMULATION | running;
    reset_state(self);
    return token && !strcmp(token, MODEL_GUID) ? self : refuse_instance(self, WRONG_TOKEN, function, MODEL_GUID);
}

/* Every message is of the category logStatusError. */
static Status set_logging(Instance *self, bool logging, size_t n, const char *const categories[])
{
    self->logging = logging && n == 0;
    for (size_t i = 0; i < n; i++) {
        const char *category = categories[i] ? categories[i] : "";
        self->logging |= logging && (!strcmp(category, "logStatusError") || !strcmp(category, "logAll"));
    }
    return STATUS_OK;
}

/* The run begins, with an event if the importer handles them. */
static Status begin_run(Instance *self, bool event_mode_used)
{
    State *state = &self->state;
    bool fault = false;
    int64_t status = call_sequence_exit_initialization(&state->run, &state->model, &fault);
    if (status == OK && !fault && is_model_exchange(state)) model_exchange_begin(&state->model, &fault);
    if (event_mode_used) state->run.phase = EVENT;
    return finish_call(self, status, fault, NAN, NAN);
}

static Status do_step(Instance *self, double t, double h)
{
    bool fault = false;
    int64_t status = call_sequence_do_step(&self->state.run, &self->state.model, t, h, &fault);
    return finish_call(self, status, fault, t, h);
}

/* ---- events */

/* An event is handled; what is new stands in the exchange. */
static Status handle_event(Instance *self)
{
    State *state = &self->state;
    bool fault = false;
    int64_t status = model_exchange_handle_event(&state->run, &state->model, &fault);
    return finish_call(self, status, fault, NAN, NAN);
}

/* ---- directional derivatives */

static double *tangent_value(struct Tangent *tangent, uint32_t reference)
{
    return (double *)((char *)tangent + variables[reference].tangent_offset);
}

/* Refuse a call unless all knowns are states or inputs, and all unknowns what follows from them. */
static Status check_derivative_references(const Instance *self, const uint32_t unknowns[], size_t n, const uint32_t knowns[], size_t m,
                           const double *seed, const double *sensitivity, const char *function)
{
    if ((n && !unknowns) || (m && !knowns) || !seed || !sensitivity) {
        return refuse(self, NULL_POINTER, function, "one of unknowns, knowns, seed and sensitivity");
    }
    for (size_t i = 0; i < n + m; i++) {
        uint32_t reference = i < n ? unknowns[i] : knowns[i - n];
        const Variable *variable = reference < VARIABLES ? &variables[reference] : NULL;
        if (!variable || variable->tangent_offset == NO_OFFSET || !(i < n ? variable->is_calculated : variable->is_state_or_input)) {
            return refuse_call(self, NO_PARTIAL_DERIVATIVE, &(Call){.function = function, .reference = reference});
        }
    }
    return STATUS_OK;
}

/* What follows along a direction, at the present point; STATUS_DISCARD where there is nothing to calculate with. */
static Status evaluate_tangent(Instance *self, struct Tangent *tangent)
{
    State *state = &self->state;
    bool fault = false;
    int64_t status = model_exchange_prepare(&state->run, &state->model, &fault);
    if (status != OK && state->run.phase >= RUNNING) return fail_run(self, status, NAN, NAN);
    if (status == OK && !fault) propagate_tangent(&state->model, tangent, &fault);
    return status == OK && !fault ? STATUS_OK : STATUS_DISCARD;
}

/* The rates of outputs at the present point: what follows along the motion. */
static Status read_output_derivatives(Instance *self, const uint32_t vr[], size_t n, const int32_t order[], double value[],
                         const char *function)
{
    State *state = &self->state;
    struct Tangent tangent = {0};
    bool fault = false;
    if (n && (!vr || !order || !value)) return refuse(self, NULL_POINTER, function, "vr, order or value");
    for (size_t i = 0; i < n; i++) {
        bool has_one = vr[i] < VARIABLES && variables[vr[i]].tangent_offset != NO_OFFSET && variables[vr[i]].is_calculated;
        if (has_one && order[i] == 1) continue;
        return refuse_call(self, NO_OUTPUT_DERIVATIVE, &(Call){.function = function, .reference = vr[i]});
    }
    int64_t status = model_exchange_prepare(&state->run, &state->model, &fault);
    if (status == OK && !fault) model_exchange_update_rates(&state->model, &fault);
    if (status == OK && !fault) model_exchange_update_input_rates(&state->model, &fault);
    const double *rate = state->model.model_exchange.rates;
    for (const Variable *variable = variables; variable < variables + VARIABLES; variable++) {
        if (!variable->is_state_or_input) continue;
        double *seed = tangent_value(&tangent, (uint32_t)(variable - variables));
        if (variable->is_calculated) *seed = *rate++;
        else if (variable->rate_offset != NO_OFFSET) *seed = *(double *)((char *)&state->model + variable->rate_offset);
    }
    if (status == OK && !fault) propagate_tangent(&state->model, &tangent, &fault);
    for (size_t i = 0; i < n; i++) value[i] = status == OK && !fault ? *tangent_value(&tangent, vr[i]) : NAN;
    return finish_call(self, status, fault, NAN, NAN);
}

static Status get_directional_derivative(Instance *self, const uint32_t unknowns[], size_t n, const uint32_t knowns[], size_t m,
                          const double seed[], double sensitivity[], const char *function)
{
    struct Tangent tangent = {0};
    if (check_derivative_references(self, unknowns, n, knowns, m, seed, sensitivity, function)) return STATUS_ERROR;
    for (size_t j = 0; j < m; j++) *tangent_value(&tangent, knowns[j]) += seed[j];
    Status status = evaluate_tangent(self, &tangent);
    for (size_t i = 0; i < n; i++) sensitivity[i] = status ? NAN : *tangent_value(&tangent, unknowns[i]);
    return status;
}

/* ---- state */

static Status refuse_state(const Instance *self) { return refuse(self, INVALID_STATE, "", ""); }

/* The state under a seal; NULL if it is broken, or that of an instance for something else. */
static const State *matching_state(const Instance *self, SavedState *saved)
{
    const State *state = valid_state(saved);
    return state && is_model_exchange(state) == is_model_exchange(&self->state) ? state : NULL;
}

/* Keep a state in memory, in place of an older one if there is one. */
static Status store_state(const Instance *self, const State *state, void **kept, const char *function)
{
    if (*kept && !has_model_guid(*kept)) return refuse_state(self);
    if (!*kept && !(*kept = malloc(sizeof(SavedState)))) return refuse(self, NO_MEMORY, function, "");
    write_saved_state(*kept, state);
    return STATUS_OK;
}

#endif
