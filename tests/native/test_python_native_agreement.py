"""The Python FMU and the native FMU of a model respond identically to every call, bit for bit.

Both get the same random calls: parameters, tolerances and grids; inputs and tunables that change during a run; looks
ahead; states saved, restored and transferred to another instance as bytes; invalid values and steps; runs that fail.
Everything visible to an importer is compared with ==: values, counters, statuses, log messages, standard error. The
layer of the Python FMU can refuse steps only: an impossible step follows every setting, and both FMUs then continue
from the state before it if the value is refused.
"""

import json
import random
from contextlib import suppress
from math import inf, isnan, nan

import pytest
from build_cache import build_once
from models import HYBRID, MODELS, declarations_of, label, model_class, pairwise_cases, parameters, tunable
from native_fmus import require_compiler
from worker_client import FmiError, Worker

EVENTS = 30  # per life cycle, of which there is one for each model, law and method
CASES = [
    pytest.param((name, values, 0.0), marks=() if name == "stickslip" else pytest.mark.slow)
    for name in MODELS
    for values in pairwise_cases(name)
]
EVERY_CASE = pytest.mark.parametrize("case", CASES, ids=label)


@pytest.fixture
def native_folder(case):
    """The native FMU of a case, built as users do; those of other tests are not optimised."""
    require_compiler()
    name, *_ = case
    return build_once(name, "--native", "--platform", "linux64", optimise=True)


@pytest.fixture(scope="module")
def pair():
    """Two processes: the FMUs share nothing."""
    workers = Worker(), Worker()
    yield workers
    for worker in workers:
        worker.close()


class LifeCycle:
    """The responses of one FMU to a list of events."""

    def __init__(self, worker, path, names):
        self.worker, self.names = worker, names
        self.instances = [worker.instantiate(path, "twin"), worker.instantiate(path, "twin")]
        self.saved_state = None
        self.t = 0.0

    def live(self, events):
        answers = [self.answer(*event) for event in events]
        for instance in self.instances:
            instance.free()
        return answers

    def answer(self, what, *arguments):
        """Return the result of a call, the log, standard error, and the values afterwards."""
        try:
            value = getattr(self, what)(*arguments)
        except FmiError as refusal:
            value = refusal.function  # the layer of a Python FMU can only return Discard
        # fmpy passes all messages to the newest instance
        requests = [[instance.number, "messages", []] for instance in self.instances]
        visible = self.worker.call(None, "batch", [*requests, [self.instances[0].number, "get", [self.names]]])
        return json.dumps([value, visible, self.worker.read_stderr()])  # where NaN equals NaN, and no digit is lost

    def begin(self, values, start, stop, tolerance):
        fmu = self.instances[0]
        self.t = start
        fmu.set(values)
        readings = fmu.get(*self.names)
        fmu.setup(start, stop, tolerance)
        readings += fmu.get(*self.names)
        with suppress(FmiError):  # which a Python FMU cannot raise; both log what is wrong
            fmu.init()
        messages = [text for instance in self.instances for *_, text in instance.messages()]
        if messages:
            fmu.reset()
            fmu.init()
        return readings, messages

    def step(self, h):
        t, self.t = self.t, self.t + h
        self.instances[0].step(t, h)

    def internal_step(self):
        """Step to the end of the internal step."""
        ahead = self.instances[0].get("solver.t_next")
        if self.t < ahead < inf or ahead != ahead:
            self.step(ahead - self.t if ahead == ahead else 1e-6)
        return ahead

    def wrong_step(self, shift, h):
        self.instances[0].step(self.t + shift, h)

    def set(self, values):
        fmu = self.instances[0]
        for name, value in values.items():
            if self.is_healthy():
                before = fmu.save()
                with suppress(FmiError):
                    fmu.set({name: value})
                    fmu.step(self.t, -1.0)
                if not self.is_healthy():
                    fmu.restore(before)

    def is_healthy(self):
        """Return whether all outputs can be calculated."""
        return not any(isnan(value) for value in self.instances[0].get(*self.names))

    def look(self):
        return self.instances[0].get("solver.t_next")

    def save(self):
        self.saved_state = self.instances[0].save(), self.t

    def restore(self):
        state, self.t = self.saved_state
        self.instances[0].restore(state)

    def move(self):
        """Continue in the other instance."""
        fmu, other = self.instances
        other.restore(other.deserialize(fmu.serialize(fmu.save())))
        self.instances.reverse()
        self.saved_state = other.save(), self.t

    def reset(self):
        self.instances[0].reset()


ODD = (0.0, -1.0, 1e-300, 5e-324, 1e300, -1.7e308, nan, inf, -inf)


def random_value(draw, start):
    """Return a value for a parameter that starts at `start`."""
    return (start or 1.0) * 10.0 ** draw.uniform(-0.7, 0.7)


def start_values(name):
    """Return the start values of the numeric variables."""
    numbers = {v: d.start for v, d in parameters(name).items() if not v.startswith("solver.")}
    return numbers | {v: 0.05 for v in numbers if v in ("x0", "v0", "theta0", "omega0")}


def random_start(draw, name, choices, stop):
    """Return the first events of a life cycle, or those after a reset."""
    values = choices | {
        v: random_value(draw, s) for v, s in start_values(name).items() if draw.random() < 0.4 and v != "x_m"
    }
    is_chattering = choices.get("friction", HYBRID) != HYBRID
    values["solver.rtol"] = draw.choice([1e-2, 1e-3] if is_chattering else [0.0, 1e-3, 1e-5, 1e-7])
    if draw.random() < 0.3:
        values["solver.h_max"] = stop * draw.uniform(0.001, 0.2)
    start = draw.choice([0.0, 0.0, -3.0, 1e4])
    end = draw.choice([start + stop, start + stop, None])
    return [("begin", values, start, end, draw.choice([None, 1e-4, 0.0, 2.0])), ("save",)]


def random_mistake(draw, name, stop):
    """Return an invalid setting, a step that reports it, and possibly a recovery."""
    declarations = declarations_of(name)
    odd = {v: draw.choice(ODD) for v in draw.sample(list(tunable(name)), 2)}
    fixed_variable = draw.choice([v for v, d in declarations.items() if d.variability == "fixed"])
    calculated_variable = draw.choice([v for v, d in declarations.items() if d.causality in ("output", "local")])
    mistake = draw.choice(
        [
            ("set", odd),
            ("set", odd),
            ("set", {fixed_variable: 1 if declarations[fixed_variable].items else 0.125}),
            ("set", {calculated_variable: 0.125 if declarations[calculated_variable].type == "Real" else 1}),
            ("wrong_step", draw.choice([0.1, -0.1, nan, 1e-3]), draw.choice([0.01, -0.01, 0.0, nan, inf])),
            ("step", draw.choice([0.0, -stop, inf])),
        ]
    )
    return [mistake, ("step", 1e-6 * stop), ("internal_step",), ("restore",)]


def random_scenario(draw, name, choices):
    """Return the events of one life cycle."""
    stop = model_class(name).stop_time * (0.3 if choices.get("friction", HYBRID) == HYBRID else 0.02)
    tunables = [v for v in tunable(name) if v != "x_m"]  # a stiff curve is too slow for most methods
    starts = start_values(name)
    events = {
        "step": lambda: [("step", stop * draw.choice([1e-9, 0.003, 0.02, 0.02, 0.1]))],
        "internal_step": lambda: [("internal_step",)],
        "look": lambda: [("look",)],
        "set": lambda: [("set", {v: random_value(draw, starts[v]) for v in draw.sample(tunables, 2)})],
        "save": lambda: [("save",)],
        "restore": lambda: [("restore",)],
        "move": lambda: [("move",)],
        "mistake": lambda: random_mistake(draw, name, stop),
        "reset": lambda: [("reset",), *random_start(draw, name, choices, stop)],
    }
    weights = {
        "step": 10,
        "internal_step": 5,
        "look": 2,
        "set": 3,
        "save": 1,
        "restore": 1,
        "move": 1,
        "mistake": 1,
        "reset": 1,
    }
    kinds = draw.choices(list(weights), list(weights.values()), k=EVENTS)
    return random_start(draw, name, choices, stop) + [event for kind in kinds for event in events[kind]()]


def random_breakdown(draw, name, choices):
    """Return a life cycle with extreme values, one internal step at a time."""

    def far(start):
        return draw.choice(
            [start, start, random_value(draw, start), start * 1e9, start * 1e-9, 10.0 ** draw.uniform(-320, 308)]
        )

    values = choices | {v: far(s) for v, s in start_values(name).items()}
    values["solver.rtol"] = draw.choice([0.0, 1e-2, 1e-5])
    change = {v: far(start_values(name)[v]) for v in draw.sample(list(tunable(name)), 2)}
    stop = draw.choice([1e-3, 1.0, 1e3])
    return [("begin", values, 0.0, stop, None), *[("internal_step",)] * 8, ("set", change), *[("internal_step",)] * 8]


def assert_agree(folders, pair, name, events):
    """Apply the events to a Python FMU and to a native one, and compare."""
    names = [
        v for v in declarations_of(name) if v != "solver.t_next"
    ]  # which computes the next step: an event of its own
    responses = [
        LifeCycle(worker, folder / f"{name}.fmu", names).live(events)
        for worker, folder in zip(pair, folders, strict=True)
    ]
    for event, python, native in zip(events, *responses, strict=True):
        assert python == native, event


@EVERY_CASE
def test_both_backends_respond_identically_to_every_call(fmus, native_folder, pair, case):
    name, choices, _ = case
    assert_agree((fmus, native_folder), pair, name, random_scenario(random.Random(label(case)), name, choices))


@EVERY_CASE
def test_both_backends_fail_at_the_same_point_with_the_same_message(fmus, native_folder, pair, case):
    name, choices, _ = case
    assert_agree((fmus, native_folder), pair, name, random_breakdown(random.Random(label(case)), name, choices))
