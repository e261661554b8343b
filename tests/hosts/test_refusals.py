"""What the FMUs of all backends refuse, with one sentence, and that a refused call leaves the instance as it was.

The native FMUs refuse the call itself.  The layer of a Python FMU can refuse steps only; it refuses the step after a
wrong setting.
"""

from math import inf, isfinite, isnan, nan, nextafter

import fmi3_fixtures
import native_fmus
import pytest
import worker_client
from models import EXACT, MODELS, SIGN, THRESHOLD, declarations_of, outputs, parameters
from row_comparison import assert_identical
from variants import slow_after
from worker_client import FmiError

BACKENDS = ("python", "native", "FMI 3.0")
STOP = 4.0
INVALID_VALUES = [
    *(
        {"x": 0.2},
        {"F_friction": 1.0},
        {"energy": -1.0},
        {"mode": 1},
        {"solver.h": 1.0},
        {"events.count": 7},
    ),  # outputs
    *({"x0": 0.5}, {"v0": nan}, {"solver.rtol": 1e-3}, {"solver.method": 3}, {"friction": 2}),  # fixed since the start
    *({"m": 0.0}, {"m": -1.0}, {"k": -1e-3}, {"k": inf}, {"F_ext": nan}, {"F_ext": -inf}),  # out of range
]
INVALID_STEPS = [  # shift of the start from the present time, and size
    *((0.0, 0.0), (0.0, -0.5), (0.0, nan), (0.0, inf), (0.0, 9.0)),
    *((0.1, 0.1), (-0.1, 0.1), (nan, 0.1), (3e-7, 0.1), (-3e-7, 0.1)),
]
CONTRADICTIONS = [  # model, start values, words of the sentence
    ("coulomb", {"friction": SIGN, "solver.method": EXACT}, ("friction = 2", "exact", "hybrid")),
    ("stickslip", {"friction": THRESHOLD, "solver.method": EXACT}, ("friction = 3", "exact", "hybrid")),
    ("stickslip", {"mu_d": 1.0}, ("mu_d", "1.0", "mu_s", "0.9")),
    ("pacejka", {"mu_d": 1.0}, ("mu_d", "1.0", "mu_s", "0.9")),
    ("pacejka", {"mu_d": 0.9}, ("mu_d = mu_s", "the factor C is 1", "no finite E", "x_m")),
]
REAL = {"python": "Real", "native": "Real", "FMI 3.0": "Float64"}
OTHER_TYPES = dict.fromkeys(("python", "native"), ("Integer", "Boolean", "String"))
OTHER_TYPES["FMI 3.0"] = ("Float32", "Int32", "Int64", "UInt64", "Boolean", "String")
TEXTS = {"Boolean": True, "String": "1"}  # a value of each type; 1 for the others


@pytest.fixture(scope="module", params=BACKENDS)
def backend(request):
    return request.param


@pytest.fixture(scope="module")
def own_worker(backend):
    worker = worker_client.Worker()
    yield worker
    assert worker.close() == 0


@pytest.fixture
def instance(backend, own_worker, fmus):
    """Return a function that instantiates a model."""
    folders = {"native": native_fmus.build_native_fmus, "FMI 3.0": fmi3_fixtures.build_fmi3_fmus}
    folder = folders[backend]() if backend in folders else fmus
    return lambda name: own_worker.instantiate(folder / f"{name}.fmu")


def expect_refusal(fmu, backend, function, *arguments):
    """Assert that a call is refused with one message; return it."""
    with pytest.raises(FmiError) as error:
        getattr(fmu, function)(*arguments)
    assert error.value.status == (2 if backend == "python" else 3), (function, arguments)
    ((status, category, sentence),) = fmu.messages()
    assert (status, category) == (3, "logStatusError")
    (line,) = fmu.worker.read_stderr().splitlines()
    assert line.endswith(f" (test): {sentence}")
    return sentence


def wrong_references(backend):
    """Return type and reference of variables that do not exist; reference 0 is the mass."""
    missing = [(kind, 0) for kind in OTHER_TYPES[backend]] + [(REAL[backend], 10**6)]
    return missing + [(kind, 2**32 - 1) for kind in (REAL[backend], *OTHER_TYPES[backend])]


def wrong_settings(backend):
    """Return a list of calls that set a wrong value."""
    return [("set", values) for values in INVALID_VALUES] + [
        ("write_one", kind, reference, TEXTS.get(kind, 1)) for kind, reference in wrong_references(backend)
    ]


def wrong_reads(backend):
    """Return a list of calls that read a wrong variable; test_invalid_values.py has those of Python FMUs."""
    return [] if backend == "python" else [("read_one", *wrong) for wrong in wrong_references(backend)]


def wrong_calls(fmu, backend):
    """Return a list of other calls that are wrong while the model runs."""
    if backend == "python":  # whose layer knows no phases
        return []
    calls = [("enter",), ("exit",), ("output_rates", ["m"]), ("output_rates", ["x"], 2), ("deserialize", "00" * 99)]
    if backend == "native":
        calls += [("setup", 0.0, 1.0, None), ("ramp", "m", 1.0), ("ramp", "F_ext", nan), ("ramp", "F_ext", 1.0, 9)]
    return calls


def values_out_of_range(declaration):
    """Return values just outside the range, far outside it, and nonfinite ones; numbers that no choice has."""
    if declaration.items:
        return [0, 99, -1, 2**31 - 1]
    values = [nan, inf, -inf]
    if isfinite(declaration.low):
        values += [nextafter(declaration.low, -inf), declaration.low - 1e9]
    if isfinite(declaration.high):
        values += [nextafter(declaration.high, inf), declaration.high + 1e9]
    return values + [bound for bound in (declaration.above, declaration.below) if isfinite(bound)]


def invalid_starts():
    """Yield model, start values and words of the sentence."""
    yield from CONTRADICTIONS
    for name in MODELS:
        for variable, declaration in declarations_of(name).items():
            if variable in parameters(name):
                words = [variable, declaration.allowed_range]
            elif declaration.items:
                words = [variable, *(item[0] for item in declaration.items)]
            else:
                continue
            for value in values_out_of_range(declaration):
                yield name, {variable: value}, [*words, repr(value)]


@pytest.mark.parametrize("name", slow_after(2, MODELS))
def test_an_invalid_start_value_is_refused_by_name_with_the_allowed_ones(instance, backend, name):
    """A Python FMU reads NaN until its first step, which is refused."""
    reals = [v for v in outputs(name) if declarations_of(name)[v].type == "Real"]
    for model, values, words in invalid_starts():
        if model != name:
            continue
        fmu = instance(name)
        if backend == "python":
            fmu.begin(values)
            assert all(isnan(value) for value in fmu.get(*reals))
            sentence = expect_refusal(fmu, backend, "step", 0.0, 0.1)
            assert all(isnan(value) for value in fmu.get(*reals, "solver.t_next"))
        else:
            sentence = expect_refusal(fmu, backend, "begin", values)
        assert [word for word in words if word not in sentence] == [], sentence
        fmu.free()


def test_every_refused_call_leaves_a_run_as_it_was(instance, backend):
    """Before and between the steps of a run with changes of the force, all wrong calls are made."""
    names = [name for name in declarations_of("coulomb") if name != "solver.t_next"]
    rows = []
    for is_disturbed in False, True:
        fmu = instance("coulomb").begin({"k": 100.0}, stop=STOP)
        rows.append([])
        for t, force in ((0.0, 0.0), (0.3, 2.0), (0.9, -3.0), (2.0, 0.5)):
            fmu.set({"F_ext": force})
            wrong = wrong_settings(backend) + wrong_reads(backend) if is_disturbed else []
            for function, *arguments in wrong:
                if backend == "python":
                    getattr(fmu, function)(*arguments)
                    sentence = expect_refusal(fmu, backend, "step", t, 0.1)
                else:
                    row = fmu.get(*names)
                    sentence = expect_refusal(fmu, backend, function, *arguments)
                    assert fmu.get(*names) == row, arguments
                if function != "set":
                    kind, reference, *_ = arguments
                    missing = f"value reference {reference} is refused: this FMU has no such variable of type {kind}"
                    assert missing in sentence
            for offset, h in INVALID_STEPS if is_disturbed else []:
                sentence = expect_refusal(fmu, backend, "step", t + offset, h)
                words = ("step", repr(t + offset), repr(h), f"{t!r} s", f"{STOP!r} s")
                assert [word for word in words if word not in sentence] == [], sentence
            for function, *arguments in wrong_calls(fmu, backend) if is_disturbed else []:
                expect_refusal(fmu, backend, function, *arguments)
            fmu.step(t, 0.25)
            rows[-1].append(fmu.get(*names))
            fmu.step(t + 0.25, {0.0: 0.05, 0.3: 0.35, 0.9: 0.85, 2.0: 1.0}[t])
            rows[-1].append(fmu.get(*names))
        assert fmu.messages() == []
        fmu.free()
    assert_identical(rows[1], rows[0], names)


def test_values_that_contradict_each_other_are_refused_until_one_is_corrected(instance, backend):
    other, fmu = (instance("stickslip").begin(stop=STOP) for _ in range(2))  # fmpy logs to the latter
    for running_fmu in fmu, other:
        running_fmu.step(0.0, 1.0)
    fmu.set({"mu_d": 1.0})
    for _ in range(2):
        expect_refusal(fmu, backend, "step", 1.0, 0.5)
    for running_fmu in fmu, other:
        running_fmu.set({"mu_d": 0.5})
        running_fmu.step(1.0, 0.5)
    assert fmu.get("x", "v", "solver.steps") == other.get("x", "v", "solver.steps")
    fmu.free()
    other.free()


def test_a_refused_start_can_be_corrected(instance, backend):
    """Times, start values and their combinations."""
    if backend == "python":
        pytest.skip("the layer of a Python FMU refuses nothing before the first step")
    other, fmu = instance("stickslip"), instance("stickslip")  # fmpy logs to the latter
    expect_refusal(fmu, backend, "set", {"m": -1.0})
    fmu.setup(0.0, STOP, None)
    for start, stop in ((nan, None), (1.0, 1.0), (0.0, -1.0)):
        if backend == "native":  # the first times stay
            expect_refusal(fmu, backend, "setup", start, stop, None)
        else:
            fmu.setup(start, stop, None)
            expect_refusal(fmu, backend, "enter")
    if backend == "FMI 3.0":
        fmu.setup(0.0, STOP, None)
    fmu.set({"friction": 3, "solver.method": EXACT})
    fmu.enter()
    expect_refusal(fmu, backend, "exit")
    expect_refusal(fmu, backend, "step", 0.0, 1.0)
    fmu.set({"friction": 1})
    fmu.exit()
    other.begin(stop=STOP)
    for running_fmu in fmu, other:
        running_fmu.step(0.0, 1.0)
    assert fmu.get("x", "v", "solver.steps") == other.get("x", "v", "solver.steps")
    expect_refusal(fmu, backend, "step", 1.0, STOP)
    fmu.free()
    other.free()
