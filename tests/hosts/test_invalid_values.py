"""Invalid values and times during a run of a Python FMU, whose layer can refuse a step only, and runs that diverge.

test_refusals.py has what all backends refuse.
"""

import itertools
from math import inf, isfinite, isnan, nan

import pytest
from models import MODELS, ODE23, counts, declarations_of, each_case, outputs, parameters, push
from row_comparison import assert_identical
from worker_client import FmiError

ERROR, DISCARD = 3, 2  # of messages; of a step that a Python FMU refuses
REALS = {name: [v for v in outputs(name) if declarations_of(name)[v].type == "Real"] for name in MODELS}


def assert_refused(fmu, t, h, *words):
    """The step from t fails, and one message with `words` is in the log and on standard error."""
    with pytest.raises(FmiError) as refusal:
        fmu.step(t, h)
    assert refusal.value.status == DISCARD
    ((status, category, sentence),) = [message for message in fmu.messages() if message[0] != 0]
    assert (status, category) == (ERROR, "logStatusError")
    assert [w for w in words if w not in sentence] == [], sentence
    (line,) = fmu.worker.read_stderr().splitlines()
    assert line.endswith(sentence)
    assert "Traceback" not in line


def assert_failed(fmu, name, t, h, *words):
    """As assert_refused(), and all outputs read NaN until a reset."""
    assert_refused(fmu, t, h, *words)
    assert all(isnan(value) for value in fmu.get(*REALS[name], "solver.t_next"))


@each_case
def test_a_value_that_becomes_invalid_during_a_run_is_refused_and_the_run_continues(launch, case):
    name, values, stop = case
    times, names = [stop * i / 20 for i in range(21)], outputs(name) + counts(name)
    expected = launch(name, values, stop=stop).run(times, names)
    for variable, value in ((push(name)[0], nan), ("m", 0.0), (outputs(name)[0] + "0", 0.5)):
        fmu = launch(name, values, stop=stop)
        rows = fmu.run(times[:11], names)
        fmu.set({variable: value})
        assert all(isnan(value) for value in fmu.get(*REALS[name]))
        assert_refused(fmu, times[10], 0.01, variable, repr(value))
        assert_identical(rows + fmu.run(times[10:], names)[1:], expected, names)
        fmu.reset()
        assert_identical(fmu.begin(values, stop=stop).run(times, names), expected, names)


@pytest.mark.parametrize("name", MODELS)
def test_an_invalid_value_may_be_corrected_before_it_is_used(launch, name):
    fmu = launch(name, stop=1.0)
    expected = fmu.run([0.0, 0.3, 0.6], outputs(name))
    fmu = launch(name, stop=1.0)
    force, _ = push(name)
    fmu.set({force: nan, "m": -1.0})
    fmu.set({force: 0.0, "m": declarations_of(name)["m"].start})
    assert_identical(fmu.run([0.0, 0.3, 0.6], outputs(name)), expected, outputs(name))


ARITHMETICS = {  # how hosts compute time and size of the n-th step
    "products": lambda start, h: lambda n: (start + n * h, h),
    "quotients": lambda start, h: lambda n: (start + n / (1.0 / h), h),
    "differences": lambda start, h: lambda n: (start + n * h, start + (n + 1) * h - (start + n * h)),
    "an even grid": lambda start, h: lambda n: (start + n * ((start + 1000 * h - start) / 1000), h),
    "ticks": lambda start, h: lambda n: ((round(start * 1e12) + n * round(h * 1e12)) * 1e-12, round(h * 1e12) / 1e12),
}


@pytest.mark.parametrize("arithmetic", ARITHMETICS.values(), ids=ARITHMETICS)
def test_step_times_within_rounding_are_accepted_wherever_zero_lies(launch, arithmetic):
    """Near t = 0 times carry the rounding of the start; steps down to 1e-10 s, around the start, 0 and 1e-5."""
    for start, h in itertools.product((-2.0, -0.3, 0.0, 1.0, 1e6), (0.1, 1e-3, 7e-6, 1e-10)):
        if h < 1e-12 * abs(start):
            continue
        step = arithmetic(start, h)
        for origin in {start, 0.0, 1e-5} if start <= 0.0 else {start}:
            first = max(0, round((origin - start) / h) - 5)
            fmu = launch("smd", start=start)
            if first:
                fmu.step(start, step(first)[0] - start)
            fmu.worker.call(None, "batch", [[fmu.number, "step", step(n)] for n in range(first, first + 12)])
            fmu.free()


def test_a_million_accumulated_steps_may_end_at_the_stop_time(launch):
    """They end 7.9e-12 beyond it, eight millionths of a step."""
    t, h = 0.0, 1e-6
    for _ in range(999_999):
        t += h
    fmu = launch("smd", stop=1.0)
    fmu.step(0.0, t)
    assert t + h > 1.0
    fmu.step(t, h)
    assert fmu.get("x") == launch("smd", stop=1.0).run([0.0, 1.0], ["x"])[1][0]


@pytest.mark.parametrize("late", [3e-6, -3e-6])
def test_a_step_that_begins_elsewhere_is_refused_even_at_zero(launch, late):
    fmu = launch("smd", start=-2.0)
    fmu.step(-2.0, 2.0)
    assert_refused(fmu, late * 0.01, 0.01, "t = 0.0 s")


def test_a_parameter_reads_what_was_set_though_the_run_fails_in_the_same_call(worker, backend_fmus):
    fmu = worker.instantiate(backend_fmus / "smd.fmu").begin()
    fmu.set({"F_ext": 1e308, "m": 1e-9})
    mass, force, a = fmu.get("m", "F_ext", "a")
    assert (mass, force, isnan(a)) == (1e-9, 1e308, True)
    assert fmu.get("m", "F_ext") == [1e-9, 1e308]


def test_a_step_fails_though_a_read_of_the_next_time_has_failed_before(worker, backend_fmus):
    """The motion overflows at the end of the internal step, which the time solver.t_next needs."""
    fmu = worker.instantiate(backend_fmus / "smd.fmu").begin(stop=1.0)
    fmu.set({"F_ext": 1e308})
    assert isnan(fmu.get("solver.t_next"))
    with pytest.raises(FmiError):
        fmu.step(0.0, 1e-9)


@pytest.mark.parametrize("tolerance", [0.0, -1e-3, 1.0, 2.0, nan, inf])
def test_an_invalid_tolerance_is_ignored(worker, backend_fmus, tolerance):
    """Otherwise the error of the solver would be as large as the motion."""
    names, times = ["x", "solver.steps"], [0.0, 1.0, 2.0]

    def run(value):
        fmu = worker.instantiate(backend_fmus / "smd.fmu")
        rows = fmu.begin({"solver.method": ODE23}, stop=2.0, tolerance=value).run(times, names)
        fmu.free()
        return rows

    assert_identical(run(tolerance), run(None), names)
    assert run(0.9) != run(None)


def test_a_stop_before_the_start_and_a_nonfinite_start_are_refused(launch):
    assert_failed(launch("smd", start=2.0, stop=1.0), "smd", 2.0, 0.1, "stop time", "1.0", "2.0")
    assert_failed(launch("smd", start=nan), "smd", 0.0, 0.1, "start time", "nan")


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("smd", {"x0": 1e300, "k": 1e300}),
        ("smd", {"x0": 1e300, "k": 1e300, "solver.method": ODE23}),
        ("coulomb", {"F_ext": 1e308, "m": 1e-308}),
        ("stickslip", {"F_ext": 1e308, "m": 1e-308}),
        ("stickslip", {"F_ext": 1e308, "m": 1e-308, "solver.method": ODE23}),
        ("pacejka", {"F_ext": 1e308, "m": 1e-300}),
        ("pendulum", {"omega0": 1e150}),
        ("pendulum", {"T_ext": 1e308}),
    ],
)
def test_a_diverging_motion_fails_in_one_sentence_or_stays_finite(launch, name, values):
    fmu = launch(name, values, stop=4.0)
    try:
        fmu.step(0.0, 1e-3)
        fmu.step(1e-3, 1.0)
    except FmiError:
        assert all(isnan(value) for value in fmu.get(*REALS[name]))
        ((status, _, sentence),) = fmu.messages()
        assert status == ERROR
        assert "Traceback" not in sentence
        assert len(fmu.worker.read_stderr().splitlines()) == 1
    else:
        assert all(isfinite(value) for value in fmu.get(*REALS[name]))


@pytest.mark.parametrize("name", [name for name in MODELS if "k" in parameters(name)])
def test_overflowing_outputs_of_a_finite_motion_are_reported(launch, name):
    fmu = launch(name, {"k": 1e300, "m": 1e300, "x0": 1e20, "solver.rtol": 1e-3})
    assert all(isnan(value) for value in fmu.get(*REALS[name]))
    assert "the solution diverges" in fmu.worker.read_stderr()
    with pytest.raises(FmiError):
        fmu.step(0.0, 1e-3)
    fmu.reset()
    fmu.begin().step(0.0, 0.1)
    assert all(isfinite(value) for value in fmu.get(*REALS[name]))


def test_a_wrong_read_fails_without_ending_the_instance(launch):
    """It returns no plausible value and reports one error per call; all other reads and the run continue."""
    assert next(iter(declarations_of("stickslip"))) == "m"  # has reference 0
    wrong = [(kind, 0) for kind in ("Integer", "Boolean", "String")]
    wrong += [(kind, reference) for kind in ("Real", "Integer") for reference in (10**6, 2**31, 2**32 - 1)]
    times, names = [0.0, 0.1, 0.2, 0.3], list(declarations_of("stickslip"))
    expected, fmu = launch("stickslip").run(times, names), launch("stickslip")
    rows = [fmu.get(*names)]
    for t, ahead in itertools.pairwise(times):
        for kind, reference in wrong:
            value = fmu.read_one(kind, reference)
            assert isnan(value) if kind == "Real" else not value
            ((status, category, sentence),) = fmu.messages()
            assert (status, category) == (ERROR, "logStatusError")
            assert f"value reference {reference} is refused" in sentence
            assert fmu.worker.read_stderr().splitlines() == [f"Stickslip (test): {sentence}"]
        fmu.step(t, ahead - t)
        rows.append(fmu.get(*names))
    assert_identical(rows, expected, names)


def test_an_invalid_reference_reads_as_nan_among_valid_ones(launch):
    fmu = launch("stickslip")
    a, unknown, b = fmu.read("Real", [0, 10**6, 1])
    assert [a, b] == fmu.get(*list(declarations_of("stickslip"))[:2])
    assert isnan(unknown)


def test_percent_signs_in_an_instance_name_are_harmless(worker, fmus):
    fmu = worker.instantiate(fmus / "smd.fmu", "50 %s %n %d sled")
    fmu.begin({"m": -1.0})
    with pytest.raises(FmiError):
        fmu.step(0.0, 0.1)
    assert "50 %s %n %d sled" in worker.read_stderr()
    assert [status for status, _, _ in fmu.messages()] == [ERROR]
    fmu.free()


def test_t_next_announces_a_run_that_will_fail(launch):
    fmu = launch("smd", {"x0": 1e300, "k": 1e300, "solver.method": ODE23}, stop=4.0)
    assert isnan(fmu.get("solver.t_next"))
    assert_failed(fmu, "smd", 0.0, 4.0)
