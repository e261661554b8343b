/* The FMI 3.0 FMU in fmi3.c as the core module of a WebAssembly component, for FMI-LS-WASM (interfaces.py).
 *
 * Every function has the parameters of the canonical ABI of the component model: a list or string is an address and a
 * length, an option a flag and a value. It returns a status, or the address of a result: a struct with the layout that
 * the canonical ABI gives to result<...>. Memory of arguments and results is released after the call. */
#define WASM_COMPONENT /* no WASI: messages go to the importer's log only */
#include "fmi3.c"

#define EXPORT(name) __attribute__((export_name(name)))

__attribute__((import_module("callbacks"), import_name("log-message"))) void log_message(
    const char *instance, size_t instance_length, uint32_t status, const char *category, size_t category_length,
    const char *message, size_t message_length);

/* ---- memory of a call */

typedef struct Block {
    struct Block *next;
    size_t size;
    uint64_t content[]; /* of the largest alignment */
} Block;

static Block *blocks; /* of the current call */

static void *allocate(size_t size)
{
    Block *block = size < SIZE_MAX / 2 ? malloc(sizeof *block + size) : NULL;
    if (!block) __builtin_trap();
    block->next = blocks;
    block->size = size;
    blocks = block;
    return block->content;
}

/* The importer allocates arguments with this function. An old block stays until the end of the call. */
EXPORT("allocate") void *reallocate(void *old, size_t old_size, size_t alignment, size_t size)
{
    (void)alignment;
    return old ? memcpy(allocate(size), old, old_size < size ? old_size : size) : allocate(size);
}

EXPORT("release") void release(uint32_t result)
{
    (void)result;
    while (blocks) {
        Block *next = blocks->next;
        free(blocks);
        blocks = next;
    }
}

typedef struct {
    const char *bytes;
    size_t length;
} Text; /* of a string or of list<u8> */

static const char *null_terminated(const char *bytes, size_t length)
{
    char *copy = allocate(length + 1);
    memcpy(copy, bytes, length);
    copy[length] = '\0';
    return copy;
}

/* ---- results */

#define RESULT(NAME, ...)     \
    typedef struct {          \
        bool is_error;        \
        union {               \
            __VA_ARGS__ value; \
            uint8_t status;   \
        } content;            \
    } NAME

RESULT(ListResult, Text);
RESULT(CountResult, uint64_t);
RESULT(DiscreteStatesResult, struct {
    bool discrete_states_need_update, terminate, nominals_changed, values_changed, next_event_time_defined;
    double next_event_time;
});
RESULT(StepResult, struct {
    double last_time;
    bool event_handling_needed, terminate, early_return;
});
RESULT(CompletedStepResult, struct {
    bool enter_event_mode, terminate;
});

/* A result has no place for values beside a status: a warning, which the log has, comes with the values. */
static bool has_failed(fmi3Status status) { return status > fmi3Warning; }

/* Return the address of a result, whose values are those of an initializer. */
#define RETURN(RESULT_TYPE, outcome_of_call, ...)           \
    do {                                                    \
        RESULT_TYPE *result = allocate(sizeof *result);     \
        fmi3Status outcome = (outcome_of_call);             \
        memset(result, 0, sizeof *result);                  \
        result->is_error = has_failed(outcome);             \
        if (result->is_error) {                             \
            result->content.status = (uint8_t)outcome;      \
        } else {                                            \
            RESULT_TYPE given = {.content = {__VA_ARGS__}}; \
            result->content = given.content;                \
        }                                                   \
        return result;                                      \
    } while (0)
#define RETURN_LIST(outcome_of_call, values, length) \
    RETURN(ListResult, outcome_of_call, {(const char *)(values), length})

/* ---- instances */

typedef struct {
    fmi3Instance fmu;
    Text name;
} Component;

typedef struct {
    bool is_some;
    Component *component;
} OptionalComponent;

static void log_to_importer(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                            fmi3String message)
{
    const Component *component = environment;
    log_message(component->name.bytes, component->name.length, (uint32_t)status, category, strlen(category), message,
                strlen(message));
}

/* Return an instance without an FMU, or NULL. */
static Component *create(const char *name, size_t length)
{
    Component *component = malloc(sizeof *component + length);
    if (!component) return NULL;
    component->fmu = NULL;
    component->name.bytes = memcpy(component + 1, name, length);
    component->name.length = length;
    return component;
}

EXPORT("free-instance") void free_component(Component *component)
{
    fmi3FreeInstance(component->fmu);
    free(component);
}

static OptionalComponent *optional(Component *component)
{
    OptionalComponent *result = allocate(sizeof *result);
    bool exists = component && component->fmu;
    if (component && !exists) free(component);
    result->is_some = exists;
    result->component = exists ? component : NULL;
    return result;
}

EXPORT("instantiate-co-simulation") OptionalComponent *instantiate_co_simulation(
    const char *name, size_t name_length, const char *token, size_t token_length, const char *path, size_t path_length,
    uint32_t visible, uint32_t logging_on, uint32_t event_mode_used, uint32_t early_return_allowed,
    const fmi3ValueReference *required, size_t n_required)
{
    Component *component = create(name, name_length);
    if (component) {
        component->fmu = fmi3InstantiateCoSimulation(
            null_terminated(name, name_length), null_terminated(token, token_length), null_terminated(path, path_length),
            visible, logging_on, event_mode_used, early_return_allowed, required, n_required, component,
            log_to_importer, NULL);
    }
    return optional(component);
}

EXPORT("instantiate-model-exchange") OptionalComponent *instantiate_model_exchange(
    const char *name, size_t name_length, const char *token, size_t token_length, const char *path, size_t path_length,
    uint32_t visible, uint32_t logging_on)
{
    Component *component = create(name, name_length);
    if (component) {
        component->fmu = fmi3InstantiateModelExchange(
            null_terminated(name, name_length), null_terminated(token, token_length), null_terminated(path, path_length),
            visible, logging_on, component, log_to_importer);
    }
    return optional(component);
}

EXPORT("get-version") Text *get_version(void)
{
    Text *version = allocate(sizeof *version);
    version->bytes = fmi3GetVersion();
    version->length = strlen(version->bytes);
    return version;
}

EXPORT("set-debug-logging") fmi3Status set_debug_logging(Component *self, uint32_t logging_on, const Text *categories,
                                                        size_t n)
{
    const char **names = allocate(n * sizeof *names);
    for (size_t i = 0; i < n; i++) names[i] = null_terminated(categories[i].bytes, categories[i].length);
    return fmi3SetDebugLogging(self->fmu, logging_on, n, names);
}

EXPORT("enter-initialization-mode") fmi3Status enter_initialization_mode(Component *self, uint32_t has_tolerance,
                                                                        double tolerance, double start,
                                                                        uint32_t has_stop, double stop)
{
    return fmi3EnterInitializationMode(self->fmu, has_tolerance, tolerance, start, has_stop, stop);
}

#define CALL(name, NAME) \
    EXPORT(name) fmi3Status call_##NAME(Component *self) { return fmi3##NAME(self->fmu); }

CALL("exit-initialization-mode", ExitInitializationMode)
CALL("enter-event-mode", EnterEventMode)
CALL("terminate", Terminate)
CALL("reset", Reset)
CALL("enter-configuration-mode", EnterConfigurationMode)
CALL("exit-configuration-mode", ExitConfigurationMode)
CALL("evaluate-discrete-states", EvaluateDiscreteStates)
CALL("enter-step-mode", EnterStepMode)
CALL("enter-continuous-time-mode", EnterContinuousTimeMode)

/* ---- variables */

#define ACCESSORS(name, NAME)                                                                                    \
    EXPORT("get-" name) ListResult *get_##NAME(Component *self, const fmi3ValueReference *references, size_t n)  \
    {                                                                                                            \
        size_t n_values = count_values(references, n);                                                           \
        fmi3##NAME *values = allocate(n_values * sizeof *values);                                                \
        RETURN_LIST(fmi3Get##NAME(self->fmu, references, n, values, n_values), values, n_values);                \
    }                                                                                                            \
    EXPORT("set-" name)                                                                                          \
    fmi3Status set_##NAME(Component *self, const fmi3ValueReference *references, size_t n, fmi3##NAME *values,   \
                          size_t n_values)                                                                       \
    {                                                                                                            \
        return fmi3Set##NAME(self->fmu, references, n, values, n_values);                                        \
    }

ACCESSORS("float32", Float32)
ACCESSORS("float64", Float64)
ACCESSORS("int8", Int8)
ACCESSORS("int16", Int16)
ACCESSORS("int32", Int32)
ACCESSORS("int64", Int64)
ACCESSORS("uint8", UInt8)
ACCESSORS("uint16", UInt16)
ACCESSORS("uint32", UInt32)
ACCESSORS("uint64", UInt64)
ACCESSORS("boolean", Boolean)

EXPORT("get-string") ListResult *get_string(Component *self, const fmi3ValueReference *references, size_t n)
{
    fmi3String *values = allocate(n * sizeof *values);
    Text *texts = allocate(n * sizeof *texts);
    fmi3Status status = fmi3GetString(self->fmu, references, n, values, n);
    for (size_t i = 0; i < n && !has_failed(status); i++) texts[i] = (Text){values[i], strlen(values[i])};
    RETURN_LIST(status, texts, n);
}

EXPORT("set-string") fmi3Status set_string(Component *self, const fmi3ValueReference *references, size_t n,
                                          const Text *texts, size_t n_values)
{
    fmi3String *values = allocate(n_values * sizeof *values);
    for (size_t i = 0; i < n_values; i++) values[i] = null_terminated(texts[i].bytes, texts[i].length);
    return fmi3SetString(self->fmu, references, n, values, n_values);
}

EXPORT("get-binary") ListResult *get_binary(Component *self, const fmi3ValueReference *references, size_t n)
{
    size_t *sizes = allocate(n * sizeof *sizes);
    fmi3Binary *values = allocate(n * sizeof *values);
    Text *contents = allocate(n * sizeof *contents);
    fmi3Status status = fmi3GetBinary(self->fmu, references, n, sizes, values, n);
    for (size_t i = 0; i < n && !has_failed(status); i++) contents[i] = (Text){(const char *)values[i], sizes[i]};
    RETURN_LIST(status, contents, n);
}

EXPORT("set-binary") fmi3Status set_binary(Component *self, const fmi3ValueReference *references, size_t n,
                                          const Text *contents, size_t n_values)
{
    size_t *sizes = allocate(n_values * sizeof *sizes);
    fmi3Binary *values = allocate(n_values * sizeof *values);
    for (size_t i = 0; i < n_values; i++) {
        values[i] = (fmi3Binary)contents[i].bytes;
        sizes[i] = contents[i].length;
    }
    return fmi3SetBinary(self->fmu, references, n, sizes, values, n_values);
}

EXPORT("get-clock") ListResult *get_clock(Component *self, const fmi3ValueReference *references, size_t n)
{
    fmi3Clock *values = allocate(n * sizeof *values);
    RETURN_LIST(fmi3GetClock(self->fmu, references, n, values), values, n);
}

EXPORT("set-clock") fmi3Status set_clock(Component *self, const fmi3ValueReference *references, size_t n,
                                        const fmi3Clock *values, size_t n_values)
{
    if (n != n_values) return refuse(self->fmu, WRONG_LENGTH, "set-clock", "the number of values");
    return fmi3SetClock(self->fmu, references, n, values);
}

/* ---- states and derivatives */

EXPORT("get-fmu-state") ListResult *get_fmu_state(Component *self)
{
    fmi3FMUState state = NULL;
    size_t size = 0;
    fmi3Status status = fmi3GetFMUState(self->fmu, &state);
    if (!status) status = fmi3SerializedFMUStateSize(self->fmu, state, &size);
    fmi3Byte *bytes = allocate(size);
    if (!status) status = fmi3SerializeFMUState(self->fmu, state, bytes, size);
    if (state) fmi3FreeFMUState(self->fmu, &state);
    RETURN_LIST(status, bytes, size);
}

EXPORT("set-fmu-state") fmi3Status set_fmu_state(Component *self, const fmi3Byte *bytes, size_t size)
{
    fmi3FMUState state = NULL;
    fmi3Status status = fmi3DeserializeFMUState(self->fmu, bytes, size, &state);
    if (!status) status = fmi3SetFMUState(self->fmu, state);
    if (state) fmi3FreeFMUState(self->fmu, &state);
    return status;
}

#define DERIVATIVE(name, NAME, results)                                                                                \
    EXPORT(name)                                                                                                       \
    ListResult *get_##NAME(Component *self, const fmi3ValueReference *unknowns, size_t n_unknowns,                     \
                           const fmi3ValueReference *knowns, size_t n_knowns, const double *seed, size_t n_seed)       \
    {                                                                                                                  \
        size_t n_values = count_values(results, n_##results);                                                          \
        double *values = allocate(n_values * sizeof *values);                                                          \
        RETURN_LIST(fmi3Get##NAME(self->fmu, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, values, n_values), \
                    values, n_values);                                                                                 \
    }

DERIVATIVE("get-directional-derivative", DirectionalDerivative, unknowns)
DERIVATIVE("get-adjoint-derivative", AdjointDerivative, knowns)

typedef struct {
    fmi3ValueReference reference;
    uint32_t order;
} DerivativeRequest;

EXPORT("get-output-derivatives") ListResult *get_output_derivatives(Component *self, const DerivativeRequest *requests,
                                                                   size_t n)
{
    fmi3ValueReference *references = allocate(n * sizeof *references);
    fmi3Int32 *orders = allocate(n * sizeof *orders);
    double *values = allocate(n * sizeof *values);
    for (size_t i = 0; i < n; i++) {
        references[i] = requests[i].reference;
        orders[i] = requests[i].order > INT32_MAX ? INT32_MAX : (fmi3Int32)requests[i].order;
    }
    RETURN_LIST(fmi3GetOutputDerivatives(self->fmu, references, n, orders, values, n), values, n);
}

/* FMI 3.0 has no such function. */
EXPORT("set-input-derivatives") fmi3Status set_input_derivatives(Component *self, const DerivativeRequest *requests,
                                                                size_t n, const double *values, size_t n_values)
{
    (void)requests, (void)n, (void)values, (void)n_values;
    return refuse(self->fmu, NOT_SUPPORTED, "set-input-derivatives", "");
}

/* ---- co-simulation */

EXPORT("update-discrete-states") DiscreteStatesResult *update_discrete_states(Component *self)
{
    bool need_update, terminate, nominals_changed, values_changed, time_defined;
    double time;
    fmi3Status status = fmi3UpdateDiscreteStates(self->fmu, &need_update, &terminate, &nominals_changed,
                                                 &values_changed, &time_defined, &time);
    RETURN(DiscreteStatesResult, status,
           {need_update, terminate, nominals_changed, values_changed, time_defined, time});
}

EXPORT("do-step") StepResult *do_communication_step(Component *self, double time, double size, uint32_t no_rollback)
{
    bool event_handling_needed, terminate, early_return;
    double last_time;
    fmi3Status status = fmi3DoStep(self->fmu, time, size, no_rollback, &event_handling_needed, &terminate,
                                   &early_return, &last_time);
    RETURN(StepResult, status, {last_time, event_handling_needed, terminate, early_return});
}

/* ---- model exchange */

EXPORT("set-time") fmi3Status set_time(Component *self, double time) { return fmi3SetTime(self->fmu, time); }

EXPORT("set-continuous-states") fmi3Status set_continuous_states(Component *self, const double *states, size_t n)
{
    return fmi3SetContinuousStates(self->fmu, states, n);
}

#define VALUES(name, NAME, n)                                                \
    EXPORT(name) ListResult *get_##NAME(Component *self)                     \
    {                                                                        \
        double *values = allocate((n) * sizeof *values);                     \
        RETURN_LIST(fmi3Get##NAME(self->fmu, values, n), values, (size_t)n); \
    }

VALUES("get-continuous-states", ContinuousStates, STATES)
VALUES("get-continuous-state-derivatives", ContinuousStateDerivatives, STATES)
VALUES("get-nominals-of-continuous-states", NominalsOfContinuousStates, STATES)
VALUES("get-event-indicators", EventIndicators, INDICATORS)

#define COUNT(name, NAME)                                 \
    EXPORT(name) CountResult *get_##NAME(Component *self) \
    {                                                     \
        size_t n;                                         \
        fmi3Status status = fmi3Get##NAME(self->fmu, &n); \
        RETURN(CountResult, status, n);                   \
    }

COUNT("get-number-of-continuous-states", NumberOfContinuousStates)
COUNT("get-number-of-event-indicators", NumberOfEventIndicators)

EXPORT("completed-integrator-step") CompletedStepResult *completed_integrator_step(Component *self,
                                                                                  uint32_t no_rollback)
{
    bool enter_event_mode, terminate;
    fmi3Status status = fmi3CompletedIntegratorStep(self->fmu, no_rollback, &enter_event_mode, &terminate);
    RETURN(CompletedStepResult, status, {enter_event_mode, terminate});
}

/* ---- functions that fmi3.c refuses with any arguments: there is no value to return */

EXPORT("get-number-of-variable-dependencies") CountResult *get_number_of_dependencies(Component *self,
                                                                                     fmi3ValueReference reference)
{
    RETURN(CountResult, fmi3GetNumberOfVariableDependencies(self->fmu, reference, NULL), 0);
}

EXPORT("get-variable-dependencies") ListResult *get_dependencies(Component *self, fmi3ValueReference reference)
{
    RETURN_LIST(fmi3GetVariableDependencies(self->fmu, reference, NULL, NULL, NULL, NULL, 0), NULL, 0);
}

#define REFUSED_GETTER(name, NAME, ...)                                                                         \
    EXPORT("get-" name) ListResult *get_##NAME(Component *self, const fmi3ValueReference *references, size_t n) \
    {                                                                                                           \
        RETURN_LIST(fmi3Get##NAME(self->fmu, references, n, __VA_ARGS__), NULL, 0);                             \
    }
#define REFUSED_SETTER(name, NAME, ...)                                                                            \
    EXPORT("set-" name)                                                                                            \
    fmi3Status set_##NAME(Component *self, const fmi3ValueReference *references, size_t n, const void *values,     \
                          size_t n_values)                                                                         \
    {                                                                                                              \
        (void)values, (void)n_values;                                                                              \
        return fmi3Set##NAME(self->fmu, references, n, __VA_ARGS__);                                               \
    }

REFUSED_GETTER("interval-decimal", IntervalDecimal, NULL, NULL)
REFUSED_GETTER("interval-fraction", IntervalFraction, NULL, NULL, NULL)
REFUSED_GETTER("shift-decimal", ShiftDecimal, NULL)
REFUSED_GETTER("shift-fraction", ShiftFraction, NULL, NULL)
REFUSED_SETTER("interval-decimal", IntervalDecimal, NULL)
REFUSED_SETTER("interval-fraction", IntervalFraction, NULL, NULL)
REFUSED_SETTER("shift-decimal", ShiftDecimal, NULL)
REFUSED_SETTER("shift-fraction", ShiftFraction, NULL, NULL)
