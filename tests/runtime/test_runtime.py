"""The runtime from inside: rules of the numerics, event times to the last bit, and error handling."""

import ast
import random
import tracemalloc
from math import fsum, isnan, nextafter

import pytest
from models import (
    CASES,
    EXACT,
    LARGER_MODELS,
    MODELS,
    ROOT,
    SIGN,
    declarations_of,
    each_case,
    label,
    model_class,
    outputs,
    runtime,
)
from variants import slow_after

from fmus.compiler.lowering import lowered_files, lowered_model
from fmus.compiler.model_lookup import find_model
from fmus.runtime.codes import EPSILON
from harness.simulation.embedded_model import create_run, load_model_class

FMI_SIDE = [
    *("__init__", "failure_handling", "messages", "method_registry", "pythonfmu_workarounds"),
    *("saved_state", "slave", "variable_access", "variable_declarations"),
    *("linear_solver", "vectors"),  # of the build: never embedded
]
NUMERICS = {
    path.stem: path.read_text() for path in (ROOT / "fmus" / "runtime").glob("*.py") if path.stem not in FMI_SIDE
} | {name: find_model(name).generated_source for name in MODELS}
# it loops over the methods that it is lowered for
NUMERICS["active_method"] = lowered_files("smd")["runtime/active_method.py"]
LIBM = "acos asin atan atan2 copysign cos cosh exp expm1 fabs fmod log log1p pow sin sinh sqrt tan tanh"
MATH = {*LIBM.split(), "floor", "ceil", "isfinite", "isinf", "isnan", "inf", "nan", "pi", "radians"}
BANNED_NODES = (
    *(ast.Raise, ast.Try, ast.Lambda, ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp, ast.JoinedStr),
    *(ast.With, ast.Yield, ast.YieldFrom, ast.Await, ast.Global, ast.Nonlocal, ast.Dict, ast.Set),
    *(ast.FunctionDef, ast.ClassDef, ast.Import, ast.ImportFrom, ast.Assert, ast.Delete),
)
CALLS = {
    "isinstance",
    "type",
    "getattr",
    "setattr",
    "hasattr",
    "sum",
    "pow",
    "print",
    "eval",
    "exec",
    "map",
}


def functions(tree):
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]


def inside(function):
    """Yield every node of the body except the docstring."""
    body = function.body[1:] if ast.get_docstring(function) else function.body
    return [node for statement in body for node in ast.walk(statement)]


@pytest.mark.parametrize("name", sorted(NUMERICS))
def test_the_numerics_stay_within_the_c_subset(name):
    tree = ast.parse(NUMERICS[name])
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and not node.level:
            if node.module == "typing":  # of annotations, which lowering removes
                assert [alias.name for alias in node.names] == ["Any"]
                continue
            assert node.module == "math", f"line {node.lineno} imports {node.module}"
            assert {alias.name for alias in node.names} <= MATH, f"line {node.lineno}: not all of this is libm"
        assert not isinstance(node, ast.Import), f"line {node.lineno}: a whole module is imported"
    for function in functions(tree):
        for node in inside(function):
            line = f"{name}.py, line {getattr(node, 'lineno', function.lineno)}"
            assert not isinstance(node, BANNED_NODES), f"{line}: {type(node).__name__}"
            if isinstance(node, ast.Constant):
                assert isinstance(node.value, (bool, int, float)), f"{line}: {node.value!r} is no number"
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
                assert not isinstance(node.right, ast.Constant), f"{line}: a power that is a product"
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in CALLS, f"{line}: {node.func.id}()"
                assert node.func.id != function.name, f"{line}: recursion"


@pytest.mark.parametrize("name", sorted(NUMERICS))
def test_every_while_loop_is_bounded_by_a_counter(name):
    """A NaN or a stall would keep it going: something inside must count, and return or break."""
    for function in functions(ast.parse(NUMERICS[name])):
        for loop in [node for node in inside(function) if isinstance(node, ast.While)]:
            ways_out = [node for node in ast.walk(loop) if isinstance(node, (ast.Return, ast.Break))]
            assert ways_out, f"{name}.py, line {loop.lineno}: nothing but its condition ends this loop"


def slave(name, values=None, stop=4.0):
    """Return a slave in this process, after initialisation."""
    instance = runtime(name, "slave").make_slave_class(model_class(name))(instance_name="inside")
    for reference, (variable, declaration) in enumerate(instance.variables):
        if variable in (values or {}):
            write = instance.set_real if declaration.type == "Real" else instance.set_integer
            write([reference], [values[variable]])
    instance.setup_experiment(0.0, stop, None)
    instance.enter_initialization_mode()
    instance.exit_initialization_mode()
    return instance


def read(instance, *names):
    """Return values of Reals and Integers by name."""
    references = {v: i for i, (v, _) in enumerate(instance.variables)}
    kinds = dict(instance.variables)
    return [
        (instance.get_real if kinds[name].type == "Real" else instance.get_integer)([references[name]])[0]
        for name in names
    ]


def number_paths(owner, path, seen_ids):
    """Return path and type of every number in an object, which must own all its objects alone."""
    assert id(owner) not in seen_ids, f"{path} is owned twice"
    seen_ids.add(id(owner))
    numbers = {}
    for name, value in vars(owner).items():
        member_path = f"{path}.{name}"
        if hasattr(value, "__dict__"):
            numbers |= number_paths(value, member_path, seen_ids)
        elif isinstance(value, list):
            numbers[member_path] = (len(value), *map(type, value))
        else:
            assert type(value) in (float, int, bool), f"{member_path} is {value!r}"
            numbers[member_path] = type(value)
    return numbers


@each_case
def test_attributes_are_created_in_init_and_keep_their_type(case):
    """So that a flat copy of the numbers is the complete state."""
    name, values, stop = case
    instance = slave(name, values, stop)
    initial = number_paths(model_class(name)(), name, set())
    for i in range(8):
        assert instance.do_step(i * stop / 8, stop / 8)
        read(instance, *declarations_of(name))
        assert number_paths(instance.model, name, set()) == initial


@pytest.mark.parametrize("case", [c for c in CASES if c[1].get("friction") == 1], ids=label)
def test_turning_points_are_located_to_the_last_bit(case):
    """One float of the step size earlier the mass still moves the old way."""
    name, values, stop = case
    instance, turns = slave(name, values, stop), 0
    step, t = instance.run.solver.step, 0.0
    while t < stop:
        (ahead,) = read(instance, "solver.t_next")
        mode, waiting, event = step.modes0_mode, step.is_stuck, step.event_at_end
        if event and not waiting:
            if values["solver.method"] == EXACT:  # the closed form rounds independently
                before = step.state_at(instance.model, nextafter(ahead, 0.0))[1]
            else:
                resolution = EPSILON * step.h_full
                elapsed = fsum([step.t1, step.roundoff.t1, -step.t0, -step.roundoff.t0])
                before = step.state_after(instance.model, elapsed - resolution)[1]
                after = step.state_after(instance.model, elapsed)[1]
                assert mode * after <= 0.0
            assert mode * before > 0.0
            turns += 1
        assert instance.do_step(t, ahead - t)
        if event:
            speed = read(instance, outputs(name)[1])
            assert speed == [0.0]
        t = ahead
    assert turns >= 3


@pytest.mark.parametrize("name", MODELS)
def test_no_exception_reaches_the_host(name, monkeypatch, capfd):
    """One message, then NaN."""
    instance = slave(name)
    assert instance.do_step(0.0, 0.1)

    def raise_error(*_):
        raise RuntimeError("100 % broken")

    monkeypatch.setattr(type(instance.model), "compute_outputs", raise_error)
    monkeypatch.setattr(type(instance.model), "prepare", raise_error)
    instance.set_real([list(declarations_of(name)).index("m")], [2.0])
    assert instance.do_step(0.1, 0.1) is False
    assert all(isnan(value) for value in read(instance, *[v for v in outputs(name) if v != "mode"]))
    assert instance.do_step(0.1, 0.1) is False
    (message,) = instance.log_queue
    assert "100 %% broken" in message.msg  # the native layer takes it for a printf format
    (line,) = capfd.readouterr().err.splitlines()
    assert "100 % broken" in line


@pytest.mark.parametrize("name", MODELS)
def test_a_run_whose_initialisation_ends_twice_continues(name):
    finished_once, finished_twice = slave(name), slave(name)
    for instance in finished_once, finished_twice:
        assert instance.do_step(0.0, 0.1)
    finished_twice.exit_initialization_mode()
    assert read(finished_twice, *outputs(name)) == read(finished_once, *outputs(name))
    for instance in finished_once, finished_twice:
        assert instance.do_step(0.1, 0.1)
    assert read(finished_twice, *outputs(name)) == pytest.approx(read(finished_once, *outputs(name)), rel=1e-4)


def test_cached_reference_lists_are_bounded():
    """If an importer always reads other lists, only some readers are cached."""
    instance, draw = slave("stickslip"), random.Random(1)
    reals = [i for i, d in enumerate(declarations_of("stickslip").values()) if d.type == "Real"]

    def ask(times):
        for _ in range(times):
            references = draw.choices(reals, k=8)
            assert len(instance.get_real(references)) == 8
        assert len(instance.readers) <= runtime("stickslip", "variable_access").MAX_READERS

    ask(200)
    tracemalloc.start()
    ask(200)
    before, _ = tracemalloc.get_traced_memory()
    ask(500)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert after - before < 200_000  # the size of the cached ones; 500 would take 650_000


def test_an_endless_run_is_stopped_with_a_message(monkeypatch, capfd):
    monkeypatch.setattr(runtime("pacejka", "integrator"), "MAX_BATCHES", 2)
    instance = slave("pacejka", {"solver.method": 2}, stop=16.0)
    assert instance.do_step(0.0, 16.0) is False
    assert "internal steps" in capfd.readouterr().err
    assert isnan(read(instance, "x")[0])


def test_the_cost_of_many_events_is_bounded(monkeypatch, capfd):
    """A swing of the pendulum takes as many event evaluations as right-hand sides."""
    integrator = runtime("pendulum", "integrator")
    monkeypatch.setattr(integrator, "MAX_EVALUATIONS", 20 * integrator.BATCH_STEPS)
    instance = slave("pendulum", {"mu": 0.0}, stop=1e7)
    assert instance.do_step(0.0, 1e7) is False
    assert "right-hand sides" in capfd.readouterr().err
    step = instance.run.solver.step
    assert (
        step.n_accepted == 1 + 2 * integrator.BATCH_STEPS
    )  # with twelve right-hand sides and some event evaluations each
    assert step.interpolant.n_event_evals > 0


def test_a_solver_without_progress_is_stopped_with_a_message(capfd):
    """At the tightest tolerances the sign law requires steps below the rounding of the time."""
    instance = slave("coulomb", {"friction": SIGN, "solver.method": 2, "solver.rtol": 1e-15})
    assert instance.do_step(0.0, 4.0) is False
    assert len(capfd.readouterr().err.splitlines()) == 1
    assert isnan(read(instance, "x")[0])


@pytest.mark.parametrize(
    "source",
    slow_after(len(MODELS), [*MODELS, *LARGER_MODELS]),
    ids=lambda source: getattr(source, "stem", source),
)
def test_a_model_owns_numbers_only_and_no_part_of_the_solver(source):
    value_types = {type(value) for value in vars(lowered_model(source)()).values()}
    assert {kind.__name__ for kind in value_types} <= {"bool", "float", "int", "list", "InputPolynomial"}


@pytest.mark.parametrize("name", MODELS)
def test_hot_objects_have_fewer_attributes_than_the_inline_limit_of_cpython(name, fmus):
    """With thirty attributes a step takes 10 % longer (Python 3.11)."""
    solver = create_run(load_model_class(fmus / f"{name}.fmu")()).solver
    sizes = {type(item).__name__: len(vars(item)) for item in (solver, solver.step, solver.step.interpolant)}
    assert max(sizes.values()) < 30, sizes
