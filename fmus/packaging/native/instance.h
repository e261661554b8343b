/* An instance of the model in model.h, for both versions of FMI.
 *
 * Every call uses the same call sequence (call_sequence_... in model.h) and the same messages as the Python FMU of the
 * model. A call that is wrong is refused: it returns Error and changes nothing, so that the next correct call works. A
 * run that cannot continue fails: the call returns Error, and all calculated Reals read NaN from then on.
 *
 * An instance is one struct without shared data, so instances can run in parallel threads. The including file defines
 * Host, Status and log_to_host.
 */
#ifndef INSTANCE_H
#define INSTANCE_H

#include "model.h"
#include "stderr_output.h"
#include "saved_state.h"

typedef struct {
    State state;
    int possible_phases; /* bits of the phases that its interface has */
    bool logging, logging_warnings;
    bool has_warned; /* about the rate of an input */
    bool has_direction[VARIABLES];
    struct Tangent directions[VARIABLES]; /* of each parameter: a change of 1, and those of the constants by it */
    Host host;
    char name[];
} Instance;

/* Status codes; FMI 2.0 and 3.0 use the same numbers. */
#define STATUS_OK ((Status)0)
#define STATUS_WARNING ((Status)1)
#define STATUS_DISCARD ((Status)2)
#define STATUS_ERROR ((Status)3)

/* A variable type of FMI and the corresponding type of our variables. */
typedef struct {
    const char *name;
    bool is_real;
} FmiType;

/* Sets of phases, one bit per phase. */
enum {
    IN_INSTANTIATED = 1 << INSTANTIATED,
    IN_STEP_MODE = 1 << RUNNING,
    IN_MODEL_EXCHANGE = 1 << EVENT | 1 << CONTINUOUS,
    IN_SIMULATION = IN_STEP_MODE | IN_MODEL_EXCHANGE,
    BEFORE_TERMINATION = IN_INSTANTIATED | 1 << INITIALISING | IN_SIMULATION,
    IN_ANY_PHASE = BEFORE_TERMINATION | 1 << TERMINATED,
    IN_READABLE_PHASE = IN_ANY_PHASE | 1 << INTERMEDIATE,
    OUTSIDE_SIMULATION = IN_ANY_PHASE & ~IN_SIMULATION
};

/* ---- error messages */

static void log_to_host(const Host *host, const char *name, Status status, const char *category, const char *message);

static COLD void report_error_for(const Host *host, const char *name, bool logging, const TextBuffer *text)
{
    if (logging) log_to_host(host, name, STATUS_ERROR, "logStatusError", text->buffer);
    print_to_stderr(name, text->buffer);
}

static COLD void report_error(const Instance *self, const TextBuffer *text)
{
    report_error_for(&self->host, self->name, self->logging, text);
}

/* Refuse an invalid call of the importer. The state does not change. */
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
    TextBuffer allowed_phases = {0};
    if (!self) return STATUS_ERROR;
    if (allowed & self->possible_phases) allowed &= self->possible_phases;
    for (int i = 0; i < PHASES; i++) {
        if (!(allowed & 1 << i)) continue;
        if (allowed_phases.length) append(&allowed_phases, " or ");
        append(&allowed_phases, phases[i]);
    }
    return refuse_call(self, OUT_OF_ORDER, &(Call){function, allowed_phases.buffer, phases[self->state.run.phase], 0});
}

static COLD Status refuse_reference(const Instance *self, uint32_t reference, const char *type)
{
    return refuse_call(self, UNKNOWN_REFERENCE, &(Call){.word = type, .reference = reference});
}

/* Define self as the instance, or refuse the call if it is not allowed in the current phase. */
#define REQUIRE_PHASE(handle, allowed) \
    Instance *self = handle;           \
    if (!self || !(1 << self->state.run.phase & (allowed))) return refuse_phase(self, (allowed), __func__)

/* Refuse a model-exchange function of a co-simulation instance, for functions that are allowed in all phases. */
#define REQUIRE_MODEL_EXCHANGE \
    if (!is_model_exchange(&self->state)) return refuse(self, NOT_SUPPORTED, __func__, "")

/* Refuse the call if a pointer is NULL. */
#define REQUIRE_ADDRESS(address) \
    if (!(address)) return refuse(self, NULL_POINTER, __func__, #address)

/* ---- failure */

/* Set every calculated Real to NaN, and every output that is an integer to a value that is no mode. */
static void set_outputs_to_nan(State *state)
{
    for (const Variable *variable = variables; variable < variables + VARIABLES; variable++) {
        if (!variable->lacks_value_after_failure) continue;
        if (variable->is_integer) *(int64_t *)variable_address(state, variable) = NO_VALUE;
        else *(double *)variable_address(state, variable) = NAN;
    }
}

static bool is_model_exchange(const State *state) { return state->run.interface == MODEL_EXCHANGE; }

/* Refuse a call, or fail the run, and report why; t and h are the communication step, NaN outside of steps. */
static COLD Status fail_run(Instance *self, int64_t status, double t, double h)
{
    State *state = &self->state;
    TextBuffer text = {0};
    bool fault = false;
    if (status == FAILED) return STATUS_ERROR; /* already reported */
    append_run_message(&text, status, &state->run, &state->model, t, h);
    if (!call_sequence_is_refusal(&state->run, status, &fault)) {
        state->run.has_failed = true;
        state->run.outputs_current = false;
        set_outputs_to_nan(state);
    }
    report_error(self, &text);
    return STATUS_ERROR;
}

/* Turn the result of the numerics into a status of FMI. A fault is what raises an exception in Python. */
static Status finish_call(Instance *self, int64_t status, bool fault, double t, double h)
{
    return status == OK && !fault ? STATUS_OK : fail_run(self, fault ? DIVERGED : status, t, h);
}

/* Log once that an input jumps against its rate at one communication point after another. */
static void warn_of_inconsistent_rate(Instance *self)
{
    TextBuffer text = {0};
    if (self->has_warned || !inconsistent_input(&self->state.model)) return;
    self->has_warned = true;
    append_inconsistent_rate(&text, &self->state.run, &self->state.model);
    if (self->logging_warnings) log_to_host(&self->host, self->name, STATUS_WARNING, "logStatusWarning", text.buffer);
}

/* ---- reading and writing */

static bool has_type(uint32_t reference, const FmiType *type)
{
    return reference < VARIABLES && variables[reference].is_real == type->is_real;
}

/* Refuse a call unless all value references have the type and no pointer is NULL. */
static Status check_references(const Instance *self, const FmiType *type, const uint32_t vr[], size_t n,
                               const void *value, const char *function)
{
    if (n && (!vr || !value)) return refuse(self, NULL_POINTER, function, "vr or value");
    for (size_t i = 0; i < n; i++) {
        if (!has_type(vr[i], type)) return refuse_reference(self, vr[i], type->name);
    }
    return STATUS_OK;
}

/* Calculate the values that a call reads. If that fails, calculated values read NaN, and all others what was set. */
static Status prepare_values(Instance *self, const FmiType *type, const uint32_t vr[], size_t n, const void *value,
                             const char *function)
{
    State *state = &self->state;
    bool needs_statistics = false, needs_t_next = false, needs_indicators = false, fault = false;
    if (!vr || !value) return check_references(self, type, vr, n, value, function);
    for (size_t i = 0; i < n; i++) {
        if (!has_type(vr[i], type)) return check_references(self, type, vr, n, value, function);
        needs_statistics |= variables[vr[i]].is_updated_on_read;
        needs_t_next |= vr[i] == T_NEXT;
        needs_indicators |= vr[i] >= DECLARED;
    }
    if (!state->run.outputs_current && !state->run.has_failed) {
        int64_t status = call_sequence_update_outputs(&state->run, &state->model, &fault);
        if (status == DIVERGED) fault = true;
        else if (status != OK) set_outputs_to_nan(state);
    }
    if (needs_statistics && state->run.outputs_current && !fault)
        call_sequence_update_statistics(&state->run, &state->model, needs_t_next, &fault);
    if (needs_indicators && state->run.outputs_current && !fault)
        model_exchange_update_variables(&state->run, &state->model, &fault);
    if (!fault) return STATUS_OK;
    if (is_model_exchange(state)) { /* the importer's solver may try states without finite results */
        set_outputs_to_nan(state);
        return STATUS_OK;
    }
    fail_run(self, DIVERGED, NAN, NAN);
    return STATUS_OK;
}

/* Order of the polynomial of an input: its derivatives above this order are zero. */
static int64_t *input_order(State *state, const Variable *variable)
{
    return (int64_t *)((char *)state + variable->order_offset);
}

/* Return whether a variable already has the value; an input that follows a polynomial may only happen to have it. */
static bool has_value(State *state, const Variable *variable, double value)
{
    bool is_constant = variable->order_offset == NO_OFFSET || *input_order(state, variable) == 0;
    return is_constant && value == variable_value(state, variable);
}

static COLD Status refuse_value(const Instance *self, int64_t reason, const Variable *variable, double value)
{
    TextBuffer text = {0};
    append_value_message(&text, reason, variable, value);
    report_error(self, &text);
    return STATUS_ERROR;
}

/* Refuse a value that the variable cannot have now. */
static Status check_value(Instance *self, uint32_t reference, double value)
{
    const Variable *variable = &variables[reference];
    bool allowed = is_allowed_value(variable, value), fault = false;
    if (has_value(&self->state, variable, value)) return STATUS_OK;
    int64_t reason = call_sequence_rejection_reason(&self->state.run, variable->is_calculated, variable->is_fixed,
                                                    allowed, &fault);
    return reason == OK ? STATUS_OK : refuse_value(self, reason, variable, value);
}

static void replace_state(Instance *self, const State *state)
{
    memcpy(&self->state, state, sizeof *state);
    memset(self->has_direction, 0, sizeof self->has_direction);
}

/* Set a variable to a valid value. */
static Status write_value(Instance *self, uint32_t reference, double value)
{
    State *state = &self->state;
    const Variable *variable = &variables[reference];
    bool fault = false;
    if (has_value(state, variable, value)) return STATUS_OK;
    if (!variable->is_state_or_input) memset(self->has_direction, 0, sizeof self->has_direction);
    state->run.outputs_current = false;
    call_sequence_note_change(&state->run, &state->model, &fault);
    if (fault) return fail_run(self, DIVERGED, NAN, NAN);
    if (variable->is_integer) *(int64_t *)variable_address(state, variable) = (int64_t)value;
    else *(double *)variable_address(state, variable) = value;
    return STATUS_OK;
}

static double read_real(const Instance *self, uint32_t reference)
{
    return variable_value(&self->state, &variables[reference]);
}

static int64_t read_integer(const Instance *self, uint32_t reference)
{
    return *(const int64_t *)((const char *)&self->state + variables[reference].offset);
}

/* Bodies of the functions that read and write values. */
#define READ_VALUES(self, type, vr, n, value, at)                                \
    if (prepare_values(self, type, vr, n, value, __func__)) return STATUS_ERROR; \
    for (size_t i = 0; i < (n); i++) value[i] = at(self, vr[i]);                 \
    return STATUS_OK

#define WRITE_VALUES(self, type, vr, n, value)                                     \
    if (check_references(self, type, vr, n, value, __func__)) return STATUS_ERROR; \
    for (size_t i = 0; i < (n); i++) {                                             \
        if (check_value(self, vr[i], value[i])) return STATUS_ERROR;               \
    }                                                                              \
    for (size_t i = 0; i < (n); i++) {                                             \
        if (write_value(self, vr[i], value[i])) return STATUS_ERROR;               \
    }                                                                              \
    return STATUS_OK

/* Body of the functions for a type without variables. */
#define REFUSE_REFERENCES(self, vr, n, type) \
    if (!(n)) return STATUS_OK;              \
    REQUIRE_ADDRESS(vr);                     \
    return refuse_reference(self, vr[0], type)

/* ---- life cycle */

static void reset_state(Instance *self)
{
    bool fault = false;
    replace_state(self, &initial);
    self->has_warned = false;
    if (self->possible_phases & 1 << CONTINUOUS) model_exchange_enable(&self->state.run, &fault);
}

/* Refuse to instantiate. */
static Instance *refuse_instance(Instance *self, int64_t reason, const char *function, const char *word)
{
    refuse(self, reason, function, word);
    free(self);
    return NULL;
}

/* Create an instance; `simulation_phases` are the phases of its interface. Returns NULL and reports an error if the
 * token is not that of this FMU or memory is exhausted. */
static Instance *instantiate(const char *name, const char *token, const Host *host, int simulation_phases, bool logging,
                             const char *function)
{
    TextBuffer text = {0};
    if (!name) name = "";
    Instance *self = calloc(1, sizeof *self + 4 * strlen(name) + 1);
    if (!self) {
        append_call_message(&text, NO_MEMORY, &(Call){.function = function});
        report_error_for(host, "", logging, &text);
        return NULL;
    }
    copy_as_utf8(self->name, name);
    self->host = *host;
    self->logging = self->logging_warnings = logging;
    self->possible_phases = OUTSIDE_SIMULATION | simulation_phases;
    reset_state(self);
    return token && !strcmp(token, MODEL_GUID) ? self : refuse_instance(self, WRONG_TOKEN, function, MODEL_GUID);
}

/* Messages have the category logStatusError or logStatusWarning. */
static Status set_logging(Instance *self, bool logging, size_t n, const char *const categories[])
{
    self->logging = self->logging_warnings = logging && n == 0;
    for (size_t i = 0; i < n && logging; i++) {
        const char *category = categories[i] ? categories[i] : "";
        bool all = !strcmp(category, "logAll");
        self->logging |= all || !strcmp(category, "logStatusError");
        self->logging_warnings |= all || !strcmp(category, "logStatusWarning");
    }
    return STATUS_OK;
}

/* Refuse the start or stop time that `run` has. */
static COLD Status refuse_experiment(const Instance *self, int64_t reason, const Run *run)
{
    TextBuffer text = {0};
    append_run_message(&text, reason, run, &self->state.model, NAN, NAN);
    report_error(self, &text);
    return STATUS_ERROR;
}

/* Set start time, stop time (infinite if unknown) and tolerance (0 if unknown) of the run. */
static Status set_experiment(Instance *self, double start, double stop, double tolerance)
{
    Run run = self->state.run;
    bool fault = false;
    call_sequence_set_experiment(&run, start, stop, tolerance, &fault);
    int64_t status = call_sequence_check_experiment(&run, &fault);
    if (status != OK) return refuse_experiment(self, status, &run);
    self->state.run = run;
    return STATUS_OK;
}

/* Start the run. If the importer handles events, it starts in event mode. */
static Status begin_run(Instance *self, bool event_mode_used)
{
    State *state = &self->state;
    bool fault = false;
    int64_t status = call_sequence_exit_initialization(&state->run, &state->model, &fault);
    if (status == OK && !fault && is_model_exchange(state)) model_exchange_begin(&state->run, &state->model, &fault);
    if (event_mode_used && state->run.phase == RUNNING) state->run.phase = EVENT;
    return finish_call(self, status, fault, NAN, NAN);
}

static Status do_step(Instance *self, double t, double h)
{
    bool fault = false;
    int64_t status = call_sequence_do_step(&self->state.run, &self->state.model, t, h, &fault);
    if (status == OK && !fault) warn_of_inconsistent_rate(self);
    return finish_call(self, status, fault, t, h);
}

/* ---- events */

/* Handle an event. The results are in the model-exchange part of the run. */
static Status handle_event(Instance *self)
{
    State *state = &self->state;
    bool fault = false;
    int64_t status = model_exchange_handle_event(&state->run, &state->model, &fault);
    return finish_call(self, status, fault, NAN, NAN);
}

/* Check a point that the importer's solver has accepted. */
static Status complete_step(Instance *self)
{
    State *state = &self->state;
    bool fault = false;
    int64_t status = model_exchange_complete_step(&state->run, &state->model, &fault);
    return finish_call(self, status, fault, NAN, NAN);
}

/* ---- directional derivatives */

static double *tangent_value(struct Tangent *tangent, uint32_t reference)
{
    return (double *)((char *)tangent + variables[reference].tangent_offset);
}

/* Refuse a call unless all knowns are states, inputs or parameters and all unknowns depend on them. */
static Status check_derivative_references(const Instance *self, const uint32_t unknowns[], size_t n,
                                          const uint32_t knowns[], size_t m, const double *seed,
                                          const double *sensitivity, const char *function)
{
    if ((n && !unknowns) || (m && !knowns) || !seed || !sensitivity) {
        return refuse(self, NULL_POINTER, function, "one of unknowns, knowns, seed and sensitivity");
    }
    for (size_t i = 0; i < n + m; i++) {
        uint32_t reference = i < n ? unknowns[i] : knowns[i - n];
        const Variable *variable = reference < VARIABLES ? &variables[reference] : NULL;
        if (!variable || variable->tangent_offset == NO_OFFSET ||
            !(i < n ? variable->is_calculated : variable->is_state_or_input || variable->is_real_parameter)) {
            return refuse_call(self, NO_PARTIAL_DERIVATIVE, &(Call){.function = function, .reference = reference});
        }
    }
    return STATUS_OK;
}

/* Add a change of a parameter and of the constants that depend on it. */
static void add_direction(Instance *self, uint32_t parameter, double change, struct Tangent *tangent, bool *fault)
{
    struct Tangent *direction = &self->directions[parameter];
    if (!self->has_direction[parameter]) {
        memset(direction, 0, sizeof *direction);
        *tangent_value(direction, parameter) = 1.0;
        propagate_constant_tangent(&self->state.model, &self->state.run.solver, direction, fault);
        self->has_direction[parameter] = !*fault;
    }
    const double *values = (const double *)direction;
    double *sums = (double *)tangent;
    for (size_t i = 0; i < sizeof *tangent / sizeof *sums; i++) sums[i] += change * values[i];
}

/* Calculate the directional derivative at the current point. Until initialisation ends, the states depend on the
 * parameters. Returns STATUS_DISCARD if values are missing. */
static Status evaluate_tangent(Instance *self, const uint32_t knowns[], size_t m, const double seed[],
                               struct Tangent *tangent)
{
    State *state = &self->state;
    bool fault = false;
    int64_t status = model_exchange_prepare(&state->run, &state->model, &fault);
    if (status != OK) return state->run.phase < RUNNING ? STATUS_DISCARD : fail_run(self, status, NAN, NAN);
    for (size_t i = 0; i < m && !fault; i++) {
        if (!variables[knowns[i]].is_real_parameter) *tangent_value(tangent, knowns[i]) += seed[i];
        else if (seed[i] != 0.0) add_direction(self, knowns[i], seed[i], tangent, &fault);
    }
    if (!fault && state->run.phase < RUNNING) propagate_start_tangent(&state->model, &state->run.solver, tangent, &fault);
    if (!fault) propagate_tangent(&state->model, &state->run.solver, tangent, &fault);
    return fault ? STATUS_DISCARD : STATUS_OK;
}

/* Read time derivatives of outputs: the directional derivative along the time derivatives of states and inputs. */
static Status read_output_derivatives(Instance *self, const uint32_t vr[], size_t n, const int32_t order[],
                                      double value[], const char *function)
{
    State *state = &self->state;
    struct Tangent tangent = {0};
    bool fault = false;
    if (n && (!vr || !order || !value)) return refuse(self, NULL_POINTER, function, "vr, order or value");
    for (size_t i = 0; i < n; i++) {
        bool has_derivative = vr[i] < VARIABLES && variables[vr[i]].tangent_offset != NO_OFFSET &&
                              variables[vr[i]].is_calculated;
        if (has_derivative && order[i] == 1) continue;
        return refuse_call(self, NO_OUTPUT_DERIVATIVE, &(Call){.function = function, .reference = vr[i]});
    }
    int64_t status = model_exchange_prepare(&state->run, &state->model, &fault);
    if (status == OK && !fault) model_exchange_update_rates(&state->run, &state->model, &fault);
    if (status == OK && !fault) model_exchange_update_input_rates(&state->run, &state->model, &fault);
    const double *rate = state->run.model_exchange.rates;
    for (const Variable *variable = variables; variable < variables + VARIABLES; variable++) {
        if (!variable->is_state_or_input) continue;
        double *seed = tangent_value(&tangent, (uint32_t)(variable - variables));
        if (variable->is_calculated) *seed = *rate++;
        else if (variable->rate_offset != NO_OFFSET) *seed = *(double *)((char *)state + variable->rate_offset);
    }
    if (status == OK && !fault) propagate_tangent(&state->model, &state->run.solver, &tangent, &fault);
    for (size_t i = 0; i < n; i++) value[i] = status == OK && !fault ? *tangent_value(&tangent, vr[i]) : NAN;
    return finish_call(self, status, fault, NAN, NAN);
}

static Status get_directional_derivative(Instance *self, const uint32_t unknowns[], size_t n, const uint32_t knowns[],
                                         size_t m, const double seed[], double sensitivity[], const char *function)
{
    struct Tangent tangent = {0};
    if (check_derivative_references(self, unknowns, n, knowns, m, seed, sensitivity, function)) return STATUS_ERROR;
    Status status = evaluate_tangent(self, knowns, m, seed, &tangent);
    for (size_t i = 0; i < n; i++) sensitivity[i] = status ? NAN : *tangent_value(&tangent, unknowns[i]);
    return status;
}

/* ---- saved states */

static Status refuse_state(const Instance *self) { return refuse(self, INVALID_STATE, "", ""); }

/* Return a saved state, or NULL if it is invalid or belongs to an instance with another interface. */
static const State *matching_state(const Instance *self, SavedState *saved)
{
    const State *state = valid_state(saved);
    return state && is_model_exchange(state) == is_model_exchange(&self->state) ? state : NULL;
}

/* Save a state, into *target if it is not NULL, otherwise into new memory. */
static Status store_state(const Instance *self, const State *state, void **target, const char *function)
{
    if (*target && !has_model_guid(*target)) return refuse_state(self);
    if (!*target && !(*target = malloc(sizeof(SavedState)))) return refuse(self, NO_MEMORY, function, "");
    write_saved_state(*target, state);
    return STATUS_OK;
}

#endif
