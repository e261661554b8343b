"""The interfaces of FMI-LS-WASM, as in the WIT files of its working draft at COMMIT.

https://github.com/modelica/fmi-ls-wasm
"""

COMMIT = "c1aac17d392bec989fe2d059db3cc57bb7a0fff5"
LAYERED_STANDARD = {  # the draft has no version of its own: 0.1.0 is its example
    "name": "org.modelica.fmi-ls-wasm",
    "version": f"0.1.0-draft+{COMMIT[:7]}",
    "description": "FMI Layered Standard for WebAssembly",
}
MANIFEST_FILE = "extra/org.modelica.fmi-ls-wasm/manifest.xml"
PLATFORM = "wasm32-wasip2"
PACKAGE, VERSION = "fmi:fmi3", "3.0.0"

TYPES = {
    "value-reference": "u32",
    "status": "enum<ok, warning, discard, error, fatal>",
    "fmu-state": "list<u8>",
    "interval-qualifier": "enum<interval-not-yet-known, interval-unchanged, interval-changed>",
    "interval-fraction": "record<counter: u64, resolution: u64>",
    "dependency-kind": "enum<dependent, constant, fixed, tunable, discrete>",
    "variable-dependency": "record<dependent-value-reference: value-reference, element-index-of-dependent: u32, "
    "independent-value-reference: value-reference, element-index-of-independent: u32, kind: dependency-kind>",
    "discrete-states-info": "record<new-discrete-states-needed: bool, terminate-simulation: bool, "
    "nominals-of-continuous-states-changed: bool, values-of-continuous-states-changed: bool, "
    "next-event-time-defined: bool, next-event-time: f64>",
}
LOG_MESSAGE = "log-message(instance-name: string, status: status, category: string, message: string)"
GET_VERSION = "get-version() -> string"

VALUE_TYPES = {  # of the functions get-... and set-...
    **{"float32": "f32", "float64": "f64", "int8": "s8", "int16": "s16", "int32": "s32", "int64": "s64"},
    **{"uint8": "u8", "uint16": "u16", "uint32": "u32", "uint64": "u64", "boolean": "bool", "string": "string"},
    **{"binary": "list<u8>", "clock": "bool"},
}
REFERENCES = "value-references: list<value-reference>"
METHODS = [  # of both resources, without the first parameter, self
    "set-debug-logging(logging-on: bool, categories: list<string>) -> status",
    "enter-initialization-mode(tolerance: option<f64>, start-time: f64, stop-time: option<f64>) -> status",
    "exit-initialization-mode() -> status",
    "enter-event-mode() -> status",
    "update-discrete-states() -> result<discrete-states-info, status>",
    "terminate() -> status",
    "reset() -> status",
    "enter-configuration-mode() -> status",
    "exit-configuration-mode() -> status",
    *(f"get-{name}({REFERENCES}) -> result<list<{value}>, status>" for name, value in VALUE_TYPES.items()),
    *(f"set-{name}({REFERENCES}, values: list<{value}>) -> status" for name, value in VALUE_TYPES.items()),
    "get-number-of-variable-dependencies(vr: value-reference) -> result<u64, status>",
    "get-variable-dependencies(dependent: value-reference) -> result<list<variable-dependency>, status>",
    "get-fmu-state() -> result<fmu-state, status>",
    "set-fmu-state(state: fmu-state) -> status",
    *(
        f"get-{kind}-derivative(unknowns: list<value-reference>, knowns: list<value-reference>, seed: list<f64>) "
        "-> result<list<f64>, status>"
        for kind in ("directional", "adjoint")
    ),
    f"get-interval-decimal({REFERENCES}) -> result<list<tuple<f64, interval-qualifier>>, status>",
    f"get-interval-fraction({REFERENCES}) -> result<list<tuple<interval-fraction, interval-qualifier>>, status>",
    f"get-shift-decimal({REFERENCES}) -> result<list<f64>, status>",
    f"get-shift-fraction({REFERENCES}) -> result<list<interval-fraction>, status>",
    f"set-interval-decimal({REFERENCES}, intervals: list<f64>) -> status",
    f"set-interval-fraction({REFERENCES}, intervals: list<interval-fraction>) -> status",
    f"set-shift-decimal({REFERENCES}, shifts: list<f64>) -> status",
    f"set-shift-fraction({REFERENCES}, shifts: list<interval-fraction>) -> status",
    "evaluate-discrete-states() -> status",
    "get-output-derivatives(requests: list<tuple<value-reference, u32>>) -> result<list<f64>, status>",
    "enter-step-mode() -> status",
]
INSTANTIATE = (
    "instance-name: string, instantiation-token: string, resource-path: string, visible: bool, logging-on: bool"
)
CO_SIMULATION = [
    f"instantiate-co-simulation({INSTANTIATE}, event-mode-used: bool, early-return-allowed: bool, "
    "required-intermediate-variables: list<value-reference>) -> option<co-simulation-instance>",
    *METHODS,
    "set-input-derivatives(requests: list<tuple<value-reference, u32>>, values: list<f64>) -> status",
    "do-step(current-communication-point: f64, communication-step-size: f64, "
    "no-set-fmu-state-prior-to-current-point: bool) -> result<do-step-result, status>",
]
MODEL_EXCHANGE = [
    f"instantiate-model-exchange({INSTANTIATE}) -> option<model-exchange-instance>",
    *METHODS,
    "enter-continuous-time-mode() -> status",
    "set-time(time: f64) -> status",
    "set-continuous-states(continuous-states: list<f64>) -> status",
    "get-continuous-state-derivatives() -> result<list<f64>, status>",
    "get-event-indicators() -> result<list<f64>, status>",
    "get-continuous-states() -> result<list<f64>, status>",
    "get-nominals-of-continuous-states() -> result<list<f64>, status>",
    "get-number-of-event-indicators() -> result<u64, status>",
    "get-number-of-continuous-states() -> result<u64, status>",
    "completed-integrator-step(no-set-fmu-state-prior-to-current-point: bool) -> result<completed-step-result, status>",
]
RECORDS = {  # the record of each interface with a resource
    "co-simulation": (
        "do-step-result",
        "record<last-successful-time: f64, event-handling-needed: bool, terminate-simulation: bool, "
        "early-return: bool>",
    ),
    "model-exchange": (
        "completed-step-result",
        "record<enter-event-mode: bool, terminate-simulation: bool>",
    ),
}
FUNCTIONS = {"co-simulation": CO_SIMULATION, "model-exchange": MODEL_EXCHANGE}
