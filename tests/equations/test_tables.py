"""Lookup tables in model files: values against numpy and scipy, motions against scipy from point to point."""

import re
from bisect import bisect_right
from contextlib import contextmanager
from random import Random

import fmpy
import numpy as np
import pytest
from build_cache import build_user_model
from fmpy.fmi3 import FMU3Model
from model_text import remove_unused
from models import DOP853, ODE23, ODE45, RODAS, scalar_class
from native_fmus import require_compiler
from row_comparison import assert_identical
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from variants import slow_after
from worker_client import FmiError

import harness
from fmus.compiler import BuildError
from fmus.compiler.model_lookup import find_model
from fmus.runtime.variable_declarations import declarations

KINDS = {
    "": (),
    "native": ("--native", "--platform", "linux64"),
    "native/fmi3": ("--fmi", "3", "--platform", "linux64"),
}
STOP, N, M, X0 = 2.0, 10.0, 1.0, 0.2  # SI
FRICTION = ((0.0, 0.01, 0.1, 0.5, 1.0), (0.5, 0.35, 0.3, 0.32, 0.4))
SPRING = ((-0.2, -0.1, 0.1, 0.2), (-80.0, -10.0, 10.0, 80.0))
MODEL = '''from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State, Table, fabs


class Bench(Model):
    """Mass on a spring, with friction; both are tables."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    N = Parameter(10.0, "N", "normal force", low=0.0)
    x0 = Fixed(0.2, "m", "position at the start")
    mu = Table({friction})
    spring = Table({spring}, ends="continue")
    x = State("m", "position", start=x0)
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    F_friction = Contact("N", "friction", mode=mode, slip=v, slide=N * mu(fabs(v)))
    a = Output("m/s2", "acceleration", (-spring(x) - F_friction) / m, rate_of=v)
    stop_time = 2.0
'''
HEAD = '''from fmus import Model, Output, State, Table


class Wrong(Model):
    """A clock."""

    clock = State("s", "time", start=-1.0, rate=1.0)
'''


def points(table, units):
    """Return the arguments of a Table."""
    return f"{list(table[0])}, {list(table[1])}, {units}"


def build_bench(folder, friction=FRICTION, spring=SPRING, kind=""):
    """Build the model with these tables; return the path of the FMU."""
    texts = {"friction": points(friction, '"m/s", "1"'), "spring": points(spring, '"m", "N"')}
    folder.mkdir(exist_ok=True)
    (folder / "bench.py").write_text(MODEL.format(**texts))
    return build_user_model(folder / "bench.py", *KINDS[kind]) / kind / "bench.fmu"


class Line:
    """A table, as the straight line of one of its pieces; held at its ends, or continued."""

    def __init__(self, table, is_held):
        (self.x, self.y), self.is_held = table, is_held
        self.edges = self.x if is_held else self.x[1:-1]
        self.piece = 0

    def select(self, u):
        """Select the piece that contains u."""
        self.piece = bisect_right(self.edges, u)

    def ends(self):
        """Return where the piece ends."""
        edges = (-np.inf, *self.edges, np.inf)
        return edges[self.piece], edges[self.piece + 1]

    def __call__(self, u):
        if self.is_held and self.piece in (0, len(self.x)):
            return self.y[0 if self.piece == 0 else -1]
        i = self.piece - self.is_held
        return self.y[i] + (u - self.x[i]) / (self.x[i + 1] - self.x[i]) * (self.y[i + 1] - self.y[i])


def reference(friction=FRICTION, spring=SPRING):
    """Return the final position and the changes of the mode, by scipy from one point of a table to the next."""
    mu, force = Line(friction, True), Line(spring, False)
    t, y, hold = 0.0, [X0, 0.0], N * friction[1][0]
    force.select(X0)
    mode = -int(np.sign(force(X0))) if abs(force(X0)) > hold else 0
    events = [(t, mode)]
    while mode and t < STOP:
        ahead = 1e-12 * (-force(y[0]) - mode * N * mu(abs(y[1]))) / M  # in the direction of the motion
        force.select(y[0] + 1e-12 * np.sign(y[1]))
        mu.select(mode * y[1] + mode * ahead)
        # a piece reaches a little further, so that scipy sees a sign change where the speed only just passes a point
        low, high, slow, fast = np.array([*force.ends(), *mu.ends()]) + np.array([-1.0, 1.0, -1.0, 1.0]) * 1e-12
        guards = [
            lambda t, y, mode=mode: mode * y[1],
            lambda t, y, low=low: y[0] - low if low > -np.inf else 1.0,
            lambda t, y, high=high: high - y[0] if high < np.inf else 1.0,
            lambda t, y, slow=slow, mode=mode: mode * y[1] - slow if slow > 0.0 else 1.0,
            lambda t, y, fast=fast, mode=mode: fast - mode * y[1] if fast < np.inf else 1.0,
        ]
        for guard in guards:
            guard.terminal, guard.direction = True, -1
        rates = lambda t, y, mode=mode: [y[1], (-force(y[0]) - mode * N * mu(mode * y[1])) / M]  # noqa: E731
        run = solve_ivp(rates, (t, STOP), y, "DOP853", events=guards, rtol=3e-14, atol=1e-16, max_step=STOP / 200.0)
        t, y = run.t[-1], list(run.y[:, -1])
        if run.status == 1 and len(run.t_events[0]):
            force.select(y[0])
            y[1], mode = 0.0, -int(np.sign(force(y[0]))) if abs(force(y[0])) > hold else 0
            events.append((t, mode))
    return y[0], events


# ---- values


def random_points(rng, n):
    """Return a table with points at uneven distances."""
    x = np.cumsum([rng.uniform(-1.0, 0.0), *(10.0 ** rng.uniform(-3.0, 0.0) for _ in range(n - 1))])
    return x.tolist(), [rng.uniform(-1.0, 1.0) for _ in x]


def test_values_are_those_of_numpy_and_scipy_in_each_kind_of_fmu(worker, tmp_path):
    """Random tables of 2 to 40 points, held and continued, over a clock; the same bits from each kind of FMU."""
    require_compiler()
    rng, lines = Random(5), []
    tables = {
        f"{kind}_{ends}_{n}": (kind, ends, random_points(rng, n))
        for kind in ("linear", "pchip")
        for ends in ("hold", "continue")
        for n in (2, 3, 7, 40)
    }
    for name, (kind, ends, (x, y)) in tables.items():
        lines.append(f'    {name} = Table({x}, {y}, "s", "m", interpolation="{kind}", ends="{ends}")')
        lines.append(f'    of_{name} = Output("m", "value", {name}(clock))')
    (tmp_path / "many.py").write_text(HEAD.replace("Wrong", "Many") + "\n".join(lines) + "\n")
    names, rows = ["clock", *(f"of_{name}" for name in tables)], []
    for kind, words in KINDS.items():
        path = build_user_model(tmp_path / "many.py", *words) / kind / "many.fmu"
        fmu = worker.instantiate(path).begin({}, stop=12.0)
        rows.append(fmu.run(np.linspace(0.0, 12.0, 241).tolist(), names))
        fmu.free()
        fmu_tables = harness.describe(path).tables
        assert [(t.interpolation, t.ends, ([*t.x], [*t.y])) for t in fmu_tables] == [*tables.values()]
    u, *columns = np.array(rows[0]).T
    for column, (name, (kind, ends, (x, y))) in zip(columns, tables.items(), strict=True):
        smooth = PchipInterpolator(x, y)
        inner = np.interp(u, x, y) if kind == "linear" else smooth(np.clip(u, x[0], x[-1]))
        slopes = np.diff(y) / np.diff(x) if kind == "linear" else smooth.derivative()(x)
        below, above = np.minimum(u - x[0], 0.0), np.maximum(u - x[-1], 0.0)
        expected = inner + (slopes[0] * below + slopes[-1] * above if ends == "continue" else 0.0)
        bound = 1e-15 if kind == "linear" else 1e-14
        assert np.abs(column - expected).max() <= bound * np.abs(expected).max(), name
    assert_identical(rows[0], rows[1], names)
    assert_identical(rows[0], rows[2], names)


# ---- motions


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
def test_the_error_is_proportional_to_the_tolerance(worker, tmp_path, kind):
    """Each method, against a solution from one point of the tables to the next: position and changes of the mode."""
    if kind:
        require_compiler()
    x, events = reference()
    path = build_bench(tmp_path, kind=kind)
    for method in (ODE23, ODE45, DOP853, RODAS):
        for rtol in (1e-6, 1e-10):
            fmu = worker.instantiate(path).begin({"solver.method": method, "solver.rtol": rtol}, stop=STOP)
            fmu.step(0.0, STOP)
            assert abs(fmu.get("x") - x) < 10.0 * rtol
            assert fmu.get("events.count") == len(events) - 1
            assert abs(fmu.get("events.t_last") - events[-1][0]) < 10.0 * rtol
            fmu.free()


def random_tables(seed):
    """Return a friction curve with points among the speeds of the motion, and a spring that hardens or softens."""
    rng = Random(seed)
    speeds = sorted(rng.uniform(0.0, 1.5) for _ in range(rng.randint(1, 12)))
    friction = ((0.0, *speeds), tuple(rng.uniform(0.05, 0.5) for _ in range(len(speeds) + 1)))
    lengths = sorted({round(rng.uniform(-0.2, 0.2), 6) for _ in range(rng.randint(2, 8))} | {-0.21, 0.21})
    rise = np.cumsum([rng.uniform(2.0, 30.0) for _ in lengths])
    return friction, (tuple(lengths), tuple((rise - rise.mean()).tolist()))


@pytest.mark.parametrize(
    "seed",
    [
        1,
        *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 7)),
        *(pytest.param(seed, marks=pytest.mark.campaign) for seed in range(7, 21)),
    ],
)
def test_random_tables_give_the_motion_of_an_event_located_solution(worker, tmp_path, seed):
    tables = random_tables(seed)
    x, events = reference(*tables)
    fmu = worker.instantiate(build_bench(tmp_path, *tables))
    fmu.begin({"solver.method": DOP853, "solver.rtol": 1e-11}, stop=STOP)
    fmu.step(0.0, STOP)
    assert abs(fmu.get("x") - x) < 1e-9
    assert fmu.get("events.count") == len(events) - (events[0][0] == 0.0)
    fmu.free()


def test_a_motion_may_settle_at_a_point(worker, tmp_path):
    """A motor whose torque equals its friction at a point of the table does not step from event to event there."""
    (tmp_path / "motor.py").write_text('''from fmus import Fixed, Model, Output, Parameter, State, Table


class Motor(Model):
    """Motor with a friction torque over speed."""

    M = Parameter(2.0, "N.m", "torque")
    J = Parameter(1.0, "kg.m2", "inertia", above=0.0)
    w0 = Fixed(0.0, "rad/s", "initial speed")
    brake = Table([0.0, 1.0, 3.0], [0.5, 2.0, 8.0], "rad/s", "N.m", ends="continue")
    w = State("rad/s", "speed", start=w0)
    alpha = Output("rad/s2", "acceleration", (M - brake(w)) / J, rate_of=w)
''')
    path = build_user_model(tmp_path / "motor.py") / "motor.fmu"
    for method in (ODE23, ODE45, DOP853, RODAS):
        for w0 in (0.0, 2.0):
            fmu = worker.instantiate(path).begin({"solver.method": method, "w0": w0}, stop=100.0)
            fmu.step(0.0, 100.0)
            assert abs(fmu.get("w") - 1.0) < 1e-6
            assert fmu.get("solver.steps") < 600
            fmu.free()


def test_importers_integrate_tables_and_get_exact_derivatives(worker, tmp_path):
    """Model exchange by CVode, and directional and adjoint derivatives of FMI 3.0 in each piece."""
    require_compiler()
    path, (x, _) = build_bench(tmp_path, kind="native/fmi3"), reference()
    columns = worker.simulate(path, "ModelExchange", stop_time=STOP, relative_tolerance=1e-10, output=["x"])
    assert abs(columns["x"][-1] - x) < 1e-7
    with fmi3_instance(path, tmp_path) as (fmu, number):
        for speed, slope in (0.005, -15.0), (0.05, -0.05 / 0.09), (0.3, 0.05), (2.0, 0.0):
            move(fmu, 0.15, -speed)
            knowns = [number["x"], number["v"]]
            by_x, by_v = (fmu.getDirectionalDerivative([number["a"]], [state], [1.0])[0] for state in knowns)
            assert (by_x, by_v) == pytest.approx((-700.0, -N * slope), rel=1e-12)
            assert list(fmu.getAdjointDerivative([number["a"]], knowns, [1.0], 2)) == [by_x, by_v]


@contextmanager
def fmi3_instance(path, folder):
    """An initialized instance for model exchange, and the value references by name."""
    description = fmpy.read_model_description(path)
    unzipped_folder = str(fmpy.extract(path, folder / "unzipped"))
    fmu = FMU3Model(guid=description.guid, unzipDirectory=unzipped_folder, modelIdentifier="bench")
    fmu.instantiate()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    yield fmu, {variable.name: variable.valueReference for variable in description.modelVariables}
    fmu.freeInstance()


def move(fmu, x, v):
    """Set the states of an instance in event mode, and update its modes and pieces."""
    fmu.updateDiscreteStates()
    fmu.enterContinuousTimeMode()
    fmu.setContinuousStates((fmpy.fmi3.fmi3Float64 * 2)(x, v), 2)
    fmu.enterEventMode()
    fmu.updateDiscreteStates()


def test_values_may_be_parameters(worker, tmp_path):
    """The motion and its changes in FMI 3.0 are those of the same numbers, and derivatives by a value are exact."""
    require_compiler()
    lines = "".join(f'    mu_{n} = Parameter(0.1, "1", "friction at point {n}", low=0.0)\n' for n in range(1, 6))
    friction = f'{[*FRICTION[0]]}, [mu_1, mu_2, mu_3, mu_4, mu_5], "m/s", "1"'
    text = MODEL.format(friction=friction, spring=points(SPRING, '"m", "N"'))
    (tmp_path / "bench.py").write_text(text.replace("    mu = ", f"{lines}    mu = "))
    path = build_user_model(tmp_path / "bench.py", *KINDS["native/fmi3"]) / "native" / "fmi3" / "bench.fmu"
    values = {f"mu_{n}": value for n, value in enumerate(FRICTION[1], 1)}
    times, names, rows = np.linspace(0.0, STOP, 41).tolist(), ["x", "v", "F_friction", "events.count"], []
    for fmu, start in (path, values), (build_bench(tmp_path / "fixed", kind="native/fmi3"), {}):
        instance = worker.instantiate(fmu).begin(start, stop=STOP)
        rows.append(instance.run(times, names))
        instance.free()
    assert_identical(rows[0], rows[1], names)
    with fmi3_instance(path, tmp_path) as (fmu, number):
        fmu.setFloat64([number[name] for name in values], [*values.values()])
        move(fmu, 0.15, -0.04)
        for n, share in (2, 2.0 / 3.0), (3, 1.0 / 3.0), (4, 0.0):
            (derivative,) = fmu.getDirectionalDerivative([number["a"]], [number[f"mu_{n}"]], [1.0])
            assert derivative == pytest.approx(N / M * share, rel=1e-12)


# ---- values as parameters, declared by the table

TUNABLE = ((0.0, 0.01, 0.1, 0.5, 1.0), (0.5, 0.3, 0.0, 0.3, 0.3))  # start values
ELEMENTS = [f"mu.y[{n}]" for n in range(1, 6)]
FITTED_VALUES = {"mu.y[2]": 0.35, "mu.y[3]": 0.28}


@pytest.fixture(scope="module")
def tunable_fmus(tmp_path_factory):
    """The bench of each kind, whose table of friction declares its values as parameters."""
    require_compiler()
    folder = tmp_path_factory.mktemp("tunable")
    friction = points(TUNABLE, '"m/s", "1"') + ', values="tunable", low=0.0'
    (folder / "bench.py").write_text(MODEL.format(friction=friction, spring=points(SPRING, '"m", "N"')))
    return {kind: build_user_model(folder / "bench.py", *KINDS[kind]) / kind / "bench.fmu" for kind in KINDS}


@pytest.mark.campaign
def test_values_of_a_table_have_structured_names(tunable_fmus):
    """Each kind is valid by the schema and fmpy, with a scalar for each value."""
    for path in tunable_fmus.values():
        description = fmpy.read_model_description(path, validate_variable_names=True)
        assert description.variableNamingConvention == "structured"
        variables = {v.name: v for v in description.modelVariables if v.name.startswith("mu.")}
        assert [*variables] == ELEMENTS
        assert " ".join(v.start for v in variables.values()) == "0.5 0.3 0.0 0.3 0.3"
        assert {v.variability for v in variables.values()} == {"tunable"}
        info = harness.describe(path)
        assert [v.name for v in info.variables if v.name.startswith("mu.")] == ELEMENTS == [*info.tables[0].parameters]
        assert (info["mu.y[2]"].start, info["mu.y[2]"].low) == (0.3, 0.0)


def test_values_of_a_table_give_the_motion_of_the_same_numbers(worker, tunable_fmus, tmp_path):
    """Set in fmpy, by co-simulation and model exchange, and by name in this harness, for each kind."""
    constant = build_bench(tmp_path)
    expected = worker.simulate(constant, "CoSimulation", stop_time=STOP, output=["x", "F_friction"])
    run = harness.simulate(constant, rtol=1e-8)
    for kind, path in tunable_fmus.items():
        start = {
            "start_values": dict(zip(ELEMENTS, FRICTION[1], strict=True)),
            "stop_time": STOP,
            "output": ["x", "F_friction"],
        }
        assert worker.simulate(path, "CoSimulation", **start) == expected
        if kind:
            columns = worker.simulate(path, "ModelExchange", relative_tolerance=1e-10, **start)
            assert abs(columns["x"][-1] - reference()[0]) < 1e-7
        by_name = harness.simulate(path, dict(zip(ELEMENTS, FRICTION[1], strict=True)), rtol=1e-8)
        assert abs(by_name["x"][-1] - run["x"][-1]) < 1e-6
        assert by_name.parameters["mu.y[2]"] == 0.35
        with pytest.raises(harness.HarnessError, match=r"mu\.y\[4\] = -0\.1 is outside its range; allowed: at least 0"):
            harness.simulate(path, {"mu.y[4]": -0.1})


def test_derivatives_by_values_of_a_table_are_exact(tunable_fmus, tmp_path):
    with fmi3_instance(tunable_fmus["native/fmi3"], tmp_path) as (fmu, number):
        values = [number[name] for name in ELEMENTS]
        fmu.setFloat64([*values, number["m"]], [*FRICTION[1], M])
        move(fmu, 0.15, -0.04)
        expected = [0.0, N / M * 2.0 / 3.0, N / M / 3.0, 0.0, 0.0]
        assert list(fmu.getAdjointDerivative([number["a"]], values, [1.0], 5)) == pytest.approx(expected, rel=1e-12)
        (derivative,) = fmu.getDirectionalDerivative([number["a"]], values, [0.0, 3.0, 6.0, 1.0, 1.0])
        assert derivative == pytest.approx(3.0 * expected[1] + 6.0 * expected[2], rel=1e-12)


@pytest.mark.campaign
@pytest.mark.parametrize("kind", ["native/fmi3"])
def test_a_fit_finds_values_of_a_table(tunable_fmus, kind):
    """Without ranges to search: one of them starts at zero, and both have the scale of the table."""
    run = harness.simulate(tunable_fmus["native"], FITTED_VALUES, times=np.linspace(0.0, STOP, 101), rtol=1e-10)
    record = {"t": run.time, "x": run["x"]}
    fit = harness.fit(tunable_fmus[kind], record, [*FITTED_VALUES], observe=["x"], sigma={"x": 1e-5})
    for name, value in FITTED_VALUES.items():
        assert fit[name].value == pytest.approx(value, rel=1e-4)


@pytest.mark.parametrize(
    "spring", slow_after(1, [(SPRING,), (((-0.2, 0.2), (-40.0, 40.0)),)]), ids=["four points", "two points"]
)
def test_an_argument_beyond_the_ends_is_refused_where_the_table_says_so(worker, tmp_path, spring):
    text = remove_unused(MODEL).format(friction=points(FRICTION, '"m/s", "1"'), spring=points(spring, '"m", "N"'))
    (tmp_path / "bench.py").write_text(text.replace('ends="continue"', 'ends="refuse"'))
    fmu = worker.instantiate(build_user_model(tmp_path / "bench.py") / "bench.fmu").begin({"x0": 0.2}, stop=STOP)
    fmu.step(0.0, STOP)
    fmu.free()
    fmu = worker.instantiate(build_user_model(tmp_path / "bench.py") / "bench.fmu")
    with pytest.raises(FmiError):
        fmu.begin({"x0": 0.21}, stop=STOP).step(0.0, STOP)
    (message,) = [text for status, _, text in fmu.messages() if status != 0]
    assert (
        "the argument of spring exceeds the last point of the table, 0.2 m, at t = 0.0 s: extend the table" in message
    )
    fmu.free()


# ---- files and mistakes


@pytest.mark.parametrize("headings", ["slip (m/s),mu (1)", "slip [m/s],mu [1]", "v (forward) (m/s) ,mu[1]"])
def test_a_table_reads_a_file_beside_the_model(tmp_path, headings):
    """And reads it again if it changes."""
    text = MODEL.format(friction='"mu.csv"', spring=points(SPRING, '"m", "N"'))
    (tmp_path / "bench.py").write_text(text)
    for value in (0.5, 0.7):
        (tmp_path / "mu.csv").write_text(f"{headings}\n0,{value}\n1,0.25\n")
        source = find_model(tmp_path / "bench.py")
        assert f"_mu_value = ({value}, {value}, 0.25)" in source.generated_source
        assert scalar_class(source)().prepare() == 0


def test_values_of_a_file_become_parameters_that_keep_their_kind(tmp_path):
    (tmp_path / "mu.csv").write_text("v [m/s],mu [1]\n0,0.5\n1,0.25\n")
    text = MODEL.format(friction='"mu.csv", values="fixed", low=0.125', spring=points(SPRING, '"m", "N"'))
    (tmp_path / "bench.py").write_text(text)
    parameters = [d for d in declarations(scalar_class(tmp_path / "bench.py")) if d.name.startswith("mu_")]
    elements = [(d.element, d.start, d.unit, d.low, d.variability, d.text) for d in parameters]
    assert elements == [
        ("mu.y[1]", 0.5, "1", 0.125, "fixed", "value at 0 m/s"),
        ("mu.y[2]", 0.25, "1", 0.125, "fixed", "value at 1 m/s"),
    ]


WRONG = {
    "one point": ('Table([0.0], [1.0], "s", "1")', "a table needs at least two points, got 1"),
    "points that do not rise": (
        'Table([0.0, 1.0, 1.0], [1.0, 2.0, 3.0], "s", "1")',
        "x of a table must rise, but point 3 has 1.0 after 1.0",
    ),
    "no number": (
        'Table([0.0, 1.0], [1.0, float("nan")], "s", "1")',
        "y of a table must be finite numbers, got nan as point 2",
    ),
    "a large number": (
        'Table([0.0, 1.0], [1.0, -1e308], "s", "1")',
        "y of a table must be between -1e+60 and 1e+60, got -1e+308 as point 2",
    ),
    "points that almost coincide": (
        'Table([0.0, 5e-324], [1.0, 2.0], "s", "1")',
        "x of a table must rise by 1e-60 or more, but point 2 has 5e-324 after 0.0",
    ),
    "other lengths": ('Table([0.0, 1.0], [1.0], "s", "1")', "a table needs as many values of y as of x, got 1 and 2"),
    "no unit": ("Table([0.0, 1.0], [1.0, 2.0])", "a table needs its units: unit_x is ''"),
    "an unknown unit": (
        'Table([0.0, 1.0], [1.0, 2.0], "sec", "1")',
        "x of the table T has the unit 'sec': write \"s\"",
    ),
    "another unit": (
        'Table([0.0, 1.0, 2.0], [1.0, 2.0, 2.0], "m", "1")',
        "T takes an argument in m, but clock is in s",
    ),
    "a missing file": ('Table("none.csv")', "the table none.csv beside the model file cannot be read: No such file"),
    "unknown values": (
        'Table([0.0, 1.0], [1.0, 2.0], "s", "1", values="free")',
        "values of a table must be 'constant' or 'fixed' or 'tunable', got 'free'",
    ),
    "a limit of constants": (
        'Table([0.0, 1.0], [1.0, 2.0], "s", "1", low=0.0)',
        'low = 0.0 has no effect on constant values: add values="tunable", or leave it out',
    ),
    "a limit of a curve, whose values are always constant": (
        'Table([0.0, 1.0, 2.0], [1.0, 2.0, 2.0], "s", "1", interpolation="pchip", low=0.0)',
        "low = 0.0 has no effect on constant values: leave it out",
    ),
    "a value below the limit": (
        'Table([0.0, 1.0], [1.0, -2.0], "s", "1", values="fixed", low=0.0)',
        "T.y[2] has the start value -2.0; it must be at least 0.0.",
    ),
    "values of a curve without kinks": (
        'Table([0.0, 1.0, 2.0], [1.0, 2.0, 2.0], "s", "1", interpolation="pchip", values="tunable")',
        'the values of a table with interpolation="pchip" are constant',
    ),
    "an unknown interpolation": (
        'Table([0.0, 1.0], [1.0, 2.0], "s", "1", interpolation="spline")',
        "interpolation of a table must be 'linear' or 'pchip', got 'spline'",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_table_is_refused_in_one_sentence(tmp_path, name):
    table, message = WRONG[name]
    (tmp_path / "wrong.py").write_text(f'{HEAD}    T = {table}\n    y = Output("1", "value", T(clock))\n')
    with pytest.raises(BuildError) as error:
        find_model(tmp_path / "wrong.py").generated_source  # noqa: B018
    line = 8 if name not in ("another unit",) else 9
    assert str(error.value).startswith(f"{tmp_path / 'wrong.py'}, line {line}: {message}")


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('    y = Output("1", "value", 2.0 * T)\n', "line 9: T is a table: call it with its argument, as in T(x)"),
        ("", "line 8: no equation uses T: use it, or remove its declaration"),
    ],
)
def test_a_table_is_called(tmp_path, lines, message):
    (tmp_path / "wrong.py").write_text(f'{HEAD}    T = Table([0.0, 1.0], [1.0, 2.0], "s", "1")\n{lines}')
    with pytest.raises(BuildError, match=message.replace("(", r"\(").replace(")", r"\)")):
        find_model(tmp_path / "wrong.py").generated_source  # noqa: B018


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("slip,mu\n0,1", "mu.csv must begin with the names and units of two columns"),
        ("v [m/s],mu [1]\n0,1", "mu.csv: a table needs at least two points, got 1"),
        ("v [m/s],mu [1]\n0,1\n1,nan", "mu.csv: y of a table must be finite numbers, got nan as point 2"),
        ("v [m/s],mu [1]\n0,1\n0,2", "mu.csv: x of a table must rise, but point 2 has 0.0 after 0.0"),
        ("v [mm/s],mu [1]\n0,1\n1,2", "mu.csv: the column v [mm/s], x of the table T, has the unit 'mm/s': convert"),
        ("v (m/s), F [lbf]\n0,1\n1,2", "mu.csv: the column F [lbf], y of the table T, has the unit 'lbf'"),
    ],
)
def test_a_refusal_of_a_file_names_the_file(tmp_path, content, message):
    (tmp_path / "mu.csv").write_text(content)
    (tmp_path / "wrong.py").write_text(f'{HEAD}    T = Table("mu.csv")\n    F = Output("N", "force", T(clock))\n')
    with pytest.raises(BuildError, match=re.escape(message)):
        find_model(tmp_path / "wrong.py").generated_source  # noqa: B018
