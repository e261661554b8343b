"""FMUs whose binary is a WebAssembly component (FMI-LS-WASM), run by wasmtime."""

import re
import stat
import subprocess
from itertools import pairwise
from xml.etree import ElementTree
from zipfile import ZipFile

import build_cache
import numpy as np
import pytest
from commands import build
from fmpy import read_model_description
from model_text import CURVE
from models import outputs
from native_fmus import require_compiler
from scipy.integrate import solve_ivp

from fmus.packaging.model_lookup import FMUS
from fmus.packaging.native.compiler import compile_and_link
from fmus.packaging.native.component.encoder import parse_signature
from fmus.packaging.native.component.interfaces import COMMIT, FUNCTIONS

pytest.importorskip("wasmtime.component", reason="pip install wasmtime")
from component_host import CO_SIMULATION, MODEL_EXCHANGE, ComponentHost, RefusedError

pytestmark = pytest.mark.slow  # the compiler builds the C library of WASI

STOP, STEP, STEPS = 16.0, 0.01, 1600
LARGEST_MEMORY = 5 << 20
PASSED = 1e-10  # in s
NAMES = outputs("stickslip")
REFERENCE = """\
#include "fmi3.c"

int main(void)
{
    static const fmi3ValueReference references[] = {%(references)s};
    enum { N = sizeof references / sizeof *references };
    double values[N], time;
    bool event, terminate, early;
    fmi3Instance fmu = fmi3InstantiateCoSimulation("reference", MODEL_GUID, "", false, false, false, false, NULL, 0,
                                                   NULL, NULL, NULL);
    fmi3Status status = fmi3EnterInitializationMode(fmu, false, 0.0, 0.0, true, %(stop)r);
    if (!status) status = fmi3ExitInitializationMode(fmu);
    for (int i = 0; i < %(steps)d && !status; i++) {
        status = fmi3DoStep(fmu, i * %(step)r, %(step)r, true, &event, &terminate, &early, &time);
        if (!status) status = fmi3GetFloat64(fmu, references, N, values, N);
        for (int j = 0; j < N; j++) printf("%%a ", values[j]);
        printf("\\n");
    }
    return status;
}
"""


@pytest.fixture(scope="module")
def fmu():
    """Return the FMU of the sled."""
    require_compiler()
    options = ("stickslip", "--fmi", "3", "--platform", "wasm32-wasip2")
    return build_cache.build_once("component", *options, timeout=600) / "stickslip.fmu"


@pytest.fixture(scope="module")
def description(fmu):
    return read_model_description(fmu)


@pytest.fixture
def host(fmu):
    with ZipFile(fmu) as archive:
        return ComponentHost(archive.read("binaries/wasm32-wasip2/stickslip.wasm"), LARGEST_MEMORY)


@pytest.fixture
def references(description):
    return {variable.name: variable.valueReference for variable in description.modelVariables}


@pytest.fixture
def instantiate(host, description):
    """Return instantiate(interface), which returns an FMU after its initialization."""

    def start(interface):
        options = (False, False, []) if interface == CO_SIMULATION else ()
        instance = host.instantiate(interface, description.instantiationToken, *options)
        instance.enter_initialization_mode(None, 0.0, STOP)
        instance.exit_initialization_mode()
        return instance

    return start


def test_the_fmu_names_the_draft_and_has_no_intermediate_update(fmu, host, description):
    with ZipFile(fmu) as archive:
        root = ElementTree.fromstring(archive.read("extra/org.modelica.fmi-ls-wasm/manifest.xml"))
        assert [name for name in archive.namelist() if name.startswith("binaries/")] == [
            "binaries/wasm32-wasip2/stickslip.wasm"
        ]
    values = {name.rpartition("}")[2]: value for name, value in root.attrib.items()}
    assert values["fmi-ls-name"] == "org.modelica.fmi-ls-wasm"
    assert values["fmi-ls-version"].endswith(f"+{COMMIT[:7]}")
    assert not description.coSimulation.providesIntermediateUpdate
    assert not description.coSimulation.canReturnEarlyAfterIntermediateUpdate
    assert host.imports == {"fmi:fmi3/types@3.0.0", "fmi:fmi3/callbacks@3.0.0"}
    assert host.function("common", "get-version")() == "3.0"


@pytest.mark.campaign  # the compiler builds musl for this test
def test_co_simulation_is_equal_to_the_same_c_with_musl_bit_for_bit(fmu, instantiate, references, tmp_path):
    component, numbers = instantiate(CO_SIMULATION), [references[name] for name in NAMES if name != "mode"]
    with ZipFile(fmu) as archive:
        names = [name for name in archive.namelist() if re.fullmatch(r"sources/.*\.[ch]", name)]
        files = {name.removeprefix("sources/"): archive.read(name).decode() for name in names}
    values = {"references": ", ".join(map(str, numbers)), "stop": STOP, "step": STEP, "steps": STEPS}
    source = {**files, "reference.c": REFERENCE % values}
    program = tmp_path / "reference"
    program.write_bytes(
        compile_and_link(source, "reference.c", "x86_64-linux-musl", program.name, ("-lc", "-lm", "-static"))
    )
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    lines = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
    for i, line in enumerate(lines):
        component.do_step(i * STEP, STEP, True)
        assert [value.hex() for value in component.get_float64(numbers)] == [
            float.fromhex(word).hex() for word in line.split()
        ]
    assert len(lines) == STEPS


def certified(file, column):
    """Return a column of a certified result."""
    heads, *rows = [line for line in (FMUS / file).read_text().splitlines() if not line.startswith("#")]
    position = heads.split(",").index(column)
    return [row.split(",")[position] for row in rows]


def test_co_simulation_has_the_certified_result(instantiate, references):
    component = instantiate(CO_SIMULATION)
    times, expected = (list(map(float, certified("stickslip.csv", name))) for name in ("t [s]", "x [m]"))
    found = component.get_float64([references["x"]])
    for start, end in pairwise(times):
        component.do_step(start, end - start, True)
        found += component.get_float64([references["x"]])
    assert found == pytest.approx(expected, abs=1e-12)


def test_model_exchange_has_the_certified_result(instantiate, references):
    """Some events have a known time; the solver locates the others by the indicators."""
    component = instantiate(MODEL_EXCHANGE)
    n = component.get_number_of_continuous_states()
    assert len(component.get_nominals_of_continuous_states()) == n

    def at(t, states):
        component.set_time(t)
        component.set_continuous_states(list(states))

    def rates(t, states):
        at(t, states)
        return component.get_continuous_state_derivatives()

    def indicator(i):
        def value(t, states):
            at(t, states)
            return component.get_event_indicators()[i]

        value.terminal, value.direction = True, -1.0
        return value

    indicators = [indicator(i) for i in range(component.get_number_of_event_indicators())]
    t, times = 0.0, []
    for _ in range(20):
        flags = component.update_discrete_states()
        assert not flags["new-discrete-states-needed"]
        end = min(STOP, flags["next-event-time"]) if flags["next-event-time-defined"] else STOP
        component.enter_continuous_time_mode()
        states = component.get_continuous_states()
        part = solve_ivp(rates, (t, end), states, "DOP853", events=indicators, rtol=1e-12, atol=1e-14)
        t, states = part.t[-1], part.y[:, -1]
        if part.status == 1:  # the solver may find an event a bit too early: pass it
            t, states = t + PASSED, states + PASSED * np.array(rates(t, states))
        at(t, states)
        assert component.completed_integrator_step(True)["terminate-simulation"] is False
        if t == STOP:
            break
        times.append(t)
        component.enter_event_mode()
    expected = [float(word) for word in certified("stickslip-events.csv", "t [s]")[1:]]
    assert times == pytest.approx(expected, abs=1e-8)
    assert component.get_float64([references["x"]]) == pytest.approx(
        [float(certified("stickslip.csv", "x [m]")[-1])], abs=1e-8
    )


def test_refused_calls_return_an_error_and_change_nothing(host, instantiate, references):
    component = instantiate(CO_SIMULATION)
    component.do_step(0.0, 8.0, True)
    state, x = component.get_fmu_state(), component.get_float64([references["x"]])
    for call in (
        lambda: component.get_float64([999]),
        lambda: component.set_float64([references["x"]], [1.0]),
        lambda: component.set_float64([references["m"]], [-1.0]),
        lambda: component.set_float64([references["m"]], []),
        lambda: component.do_step(1.0, 1.0, True),
        lambda: component.set_fmu_state(state[:-1]),
        lambda: component.set_input_derivatives([(references["m"], 1)], [0.0]),
        lambda: component.enter_event_mode(),
    ):
        host.messages.clear()
        with pytest.raises(RefusedError, match="error"):
            call()
        ((name, status, category, text),) = host.messages
        assert (name, status, category) == ("test", "error", "logStatusError")
        assert "refused" in text
    assert component.get_float64([references["x"]]) == x
    component.do_step(8.0, 8.0, True)
    end = component.get_float64([references["x"]])
    component.set_fmu_state(state)
    component.do_step(8.0, 8.0, True)
    assert component.get_float64([references["x"]]) == end
    assert host.instantiate(CO_SIMULATION, "another FMU", False, False, []) is None


ARGUMENTS = {"list": [], "option": None, "bool": False, "f64": 0.0, "u32": 0, "fmu": b"", "value": 0}  # by first word


@pytest.mark.parametrize("interface", [CO_SIMULATION, MODEL_EXCHANGE])
def test_no_function_traps(host, instantiate, interface):
    component, refused = instantiate(interface), set()
    for signature in FUNCTIONS[interface][1:]:
        name, parameters, _ = parse_signature(signature)
        arguments = [b"" if kind == "list<u8>" else ARGUMENTS[re.split("[<-]", kind)[0]] for _, kind in parameters]
        try:
            getattr(component, name)(*arguments)
        except RefusedError:
            refused.add(name)
    assert {"enter-configuration-mode", "get-variable-dependencies"} <= refused
    assert not {"get-fmu-state", "get-string", "get-clock", "set-binary", "get-directional-derivative"} & refused


def test_instances_and_results_are_released(host, description, instantiate, references):
    """A component that kept them would need more memory than the host allows."""
    for _ in range(1500):
        host.instantiate(CO_SIMULATION, description.instantiationToken, False, False, []).free()
    component = instantiate(CO_SIMULATION)
    for _ in range(12):
        component.get_float64([references["x"]] * 20_000)


def test_values_of_a_table_are_a_list(tmp_path):
    """They are read and set with those of scalars, and the adjoint derivative has one number for each."""
    require_compiler()
    (tmp_path / "curve.py").write_text(CURVE)
    words = ("--fmi", "3", "--platform", "wasm32-wasip2")
    fmu = build_cache.build_user_model(tmp_path / "curve.py", *words, optimised=True) / "native/fmi3/curve.fmu"
    description = read_model_description(fmu)
    force, m, a = (
        next(v.valueReference for v in description.modelVariables if v.name == name) for name in ("force.y", "m", "a")
    )
    with ZipFile(fmu) as archive:
        host = ComponentHost(archive.read("binaries/wasm32-wasip2/curve.wasm"), LARGEST_MEMORY)
    component = host.instantiate(CO_SIMULATION, description.instantiationToken, False, False, [])
    component.set_float64([m, force], [4.0, 3.0, 11.0, 7.0])
    with pytest.raises(RefusedError, match="error"):
        component.set_float64([force], [1.0])
    component.enter_initialization_mode(None, 0.0, STOP)
    component.exit_initialization_mode()
    assert component.get_float64([force, m]) == [3.0, 11.0, 7.0, 4.0]
    assert component.get_float64([a]) == [(0.75 * 3.0 + 0.25 * 11.0) / 4.0]
    assert component.get_adjoint_derivative([a], [force], [1.0]) == [0.75 / 4.0, 0.25 / 4.0, 0.0]
    assert component.get_directional_derivative([a], [force], [2.0, 2.0, 5.0]) == [0.5]


def test_a_component_needs_fmi_3(tmp_path):
    done = build("smd", "--native", "--platform", "wasm32-wasip2", "--out", tmp_path)
    assert done.returncode == 1
    assert done.stderr == "Error: The platform 'wasm32-wasip2' needs FMI 3.0: add --fmi 3.\n"
