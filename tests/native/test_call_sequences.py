"""All backends refuse the same calls with the same message, for any sequence of calls that FMI allows.

hypothesis generates calls for the Python FMU (FMI 2.0) and for another backend. After each call, everything visible is
compared with ==: whether the call was refused, the log, standard error, and the value of every variable.
"""

import json
from math import inf, isnan, nan

import fmi3_fixtures
import native_fmus
import pytest
import worker_client
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test
from models import EXACT, HYBRID, MODELS, declared

pytestmark = pytest.mark.slow

OTHER_BACKENDS = {
    "native": native_fmus.build_native_fmus,
    "FMI 3.0": fmi3_fixtures.build_fmi3_fmus,
}
OFTEN = settings(
    max_examples=25,
    stateful_step_count=30,
    derandomize=True,  # the same calls every time
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)

REALS = st.sampled_from([0.0, -0.0, 0.5, 1.0, 2.0, -1.0, 1e-3, 100.0, 5e-324, 1e300, nan, inf, -inf])
INTEGERS = st.sampled_from([0, 1, 2, 3, 4, 5, 99, -1, 2**31 - 1, -(2**31)])
TIMES = st.sampled_from([0.0, 0.0, -3.0, 1e4, 1e-9, nan, inf, -inf])
RUNS = st.sampled_from([None, None, 0.4, 1.0, 0.0, -1.0, nan, inf])
SIZES = st.sampled_from([0.1, 0.1, 0.05, 0.3, 1e-3, 1e-9, 1e-17, 0.0, -0.0, -0.1, nan, inf])
OFF = st.sampled_from([0.0] * 6 + [4e-16, -4e-16, 3e-15, -3e-15, 1e-14, 1e-11, -1e-11, 1e-8, 1e-6, -1e-3, nan, inf])
NEW, INITIALISING, RUNNING = range(3)
BACKENDS = range(2)  # indices of the backends


class MatchedCalls(RuleBasedStateMachine):
    """Two instances of each of two backends, called alike."""

    folders = workers = None  # of the backends

    @initialize(name=st.sampled_from(MODELS))
    def instantiate(self, name):
        self.declared = declared(name)
        paths = [folder / f"{name}.fmu" for folder in self.folders]
        self.pairs = [
            [worker.instantiate(path, "twin") for worker, path in zip(self.workers, paths, strict=True)]
            for _ in range(2)
        ]
        self.saved = []
        self.anew()
        self.seen = sorted(v for v in self.declared if v != "solver.t_next")  # which computes the next step

    def anew(self):
        self.phase, self.t, self.stop = NEW, 0.0, inf

    def both(self, function, *arguments, of=None):
        """Make the same call in both backends, or with their own entries of `of`; return the results."""
        answers = []
        for index, instance in enumerate(self.pairs[0]):
            first_argument = [of[index]] if of else []
            try:
                answers.append(getattr(instance, function)(*first_argument, *arguments))
            except worker_client.FmiError:
                answers.append(worker_client.FmiError)
        looks = self.compare(function, *arguments)
        refused = [answer is worker_client.FmiError for answer in answers]
        if function not in ("exit", "read_one"):  # which a Python FMU for FMI 2.0 cannot refuse
            assert refused[0] == refused[1], (function, arguments, looks)
        return answers

    def compare(self, *call):
        """Assert that the same is visible of both backends after a call; return it."""
        looks = [self.look(index) for index in BACKENDS]
        assert looks[0] == looks[1], call
        return looks

    def has_failed(self):
        """Return whether the run has failed or cannot go on with the present values."""
        name = next(name for name, one in self.declared.items() if one.causality == "output" and one.type == "Real")
        return isnan(self.pairs[0][0].get(name))

    def look(self, index):
        """Return what is visible of one backend: values, standard error, and the log before and during reading (fmpy
        passes all messages to the newest instance)."""
        numbers = [pair[index].number for pair in self.pairs]
        log = [[number, "messages", []] for number in numbers]
        requests = [*log, [numbers[0], "get", [self.seen]], *log]
        *before, values, one, other = self.workers[index].call(None, "batch", requests)
        messages = [
            [text.replace("%%", "%") for lines in texts for *_, text in lines] for texts in (before, [one, other])
        ]
        return json.dumps(values), messages, self.workers[index].read_stderr()  # where NaN equals NaN

    # ---- from instantiation to the end

    @precondition(lambda self: self.phase == NEW)
    @rule(start=TIMES, run=RUNS, tolerance=st.sampled_from([None, 1e-4, 0.0, 1.0, -1.0, nan]))
    def setup(self, start, run, tolerance):
        """A Python FMU refuses wrong times when the initialisation ends."""
        self.t, self.stop = start, inf if run is None else start + run
        python, other = self.pairs[0]
        refuses = False
        try:
            other.setup(start, None if run is None else self.stop, tolerance)
            other.enter()  # to which FMI 3.0 passes the times
        except worker_client.FmiError:
            refuses = True
        python.setup(start, None if run is None else self.stop, tolerance)
        python.enter()
        self.phase = INITIALISING
        if refuses:
            python.exit()
            (_, *messages), (_, *others) = (self.look(index) for index in BACKENDS)
            assert messages == others
            self.reset(False)

    @precondition(lambda self: self.phase == NEW)
    @rule()
    def enter(self):
        self.both("enter")
        self.phase = INITIALISING

    @precondition(lambda self: self.phase == INITIALISING)
    @rule()
    def exit(self):
        """A refused call leaves an FMU in initialisation mode; the Python FMU cannot refuse it, and fails."""
        self.phase = RUNNING
        if worker_client.FmiError in self.both("exit"):
            self.reset(True)

    @precondition(lambda self: self.phase == RUNNING)
    @rule(again=st.booleans())
    def reset(self, again):
        self.both("reset")
        self.anew()
        if again:
            self.both("enter")
            self.both("exit")
            self.phase = RUNNING

    # ---- the run

    @precondition(lambda self: self.phase == RUNNING)
    @rule(h=SIZES, begin=OFF, end=OFF)
    def step(self, h, begin, end):
        """Off by a fraction of the time, or of 1 s."""
        scale = max(1.0, abs(self.t))
        at, size = self.t + begin * scale, h + end * scale if h else h
        python, _ = self.both("step", at, size)
        if python is not worker_client.FmiError:
            self.t = at + size

    @precondition(lambda self: self.phase == RUNNING and self.stop < inf)
    @rule(share=st.sampled_from([0.0, 1e-12, 5e-7, 2e-6, 1e-3]))
    def last(self, share):
        """To the stop time, or a fraction of the step beyond it."""
        self.step((self.stop - self.t) * (1.0 + share), 0.0, 0.0)

    @precondition(lambda self: self.phase == RUNNING)
    @rule(off=OFF)
    def internal_step(self, off):
        """To the end of the internal step, or near it."""
        (ahead, _) = self.both("get", "solver.t_next")
        self.step(ahead - self.t, 0.0, off)

    # ---- values

    @rule(data=st.data(), n=st.integers(1, 3))
    def write(self, data, n):
        for name in data.draw(st.lists(st.sampled_from(sorted(self.declared)), min_size=n, max_size=n)):
            is_real = self.declared[name].type == "Real"
            self.set(name, data.draw(REALS if is_real else INTEGERS))

    def set(self, name, value):
        """Set a value in both backends.

        A Python FMU cannot refuse it.  If the other backend does, the next step of the Python FMU is refused with the
        same message, and it goes on from its state before.
        """
        if name in ("friction", "solver.method") and value not in (EXACT, HYBRID, 99):
            value = self.declared[name].start  # others may take arbitrarily many steps
        python, other = self.pairs[0]
        before = python.save()
        python.set({name: value})
        try:
            other.set({name: value})
        except worker_client.FmiError:
            if self.phase == RUNNING and not self.has_failed():
                with pytest.raises(worker_client.FmiError):
                    python.step(self.t, 0.1)
                python.restore(before)
                self.compare("set", name, value)
            else:
                python.restore(before)
                for index in BACKENDS:
                    self.look(index)  # the Python FMU reports nothing
        else:
            self.compare("set", name, value)

    @precondition(lambda self: self.phase == RUNNING)
    @rule(kind=st.sampled_from(["Boolean", "String"]), reference=st.sampled_from([0, 3, 2**31, 2**32 - 1]))
    def read_what_is_not_there(self, kind, reference):
        self.both("read_one", kind, reference)

    # ---- state

    @precondition(lambda self: len(self.saved) < 3)
    @rule(as_bytes=st.booleans())
    def save(self, as_bytes):
        states = self.both("save")
        if as_bytes:
            states = self.both("deserialize", of=self.both("serialize", of=states))
        self.saved.append((states, self.phase, self.t, self.stop))

    @precondition(lambda self: self.saved)
    @rule(data=st.data())
    def restore(self, data):
        states, self.phase, self.t, self.stop = data.draw(st.sampled_from(self.saved))
        self.both("restore", of=states)

    @rule()
    def move(self):
        """Continue in the other instances."""
        states = self.both("serialize", of=self.both("save"))
        self.pairs.reverse()
        self.both("restore", of=self.both("deserialize", of=states))
        self.saved = []

    def teardown(self):
        for pair in getattr(self, "pairs", []):
            for instance in pair:
                instance.free()


@pytest.mark.parametrize("kind", OTHER_BACKENDS)
def test_both_backends_refuse_the_same_calls_with_the_same_message(fmus, kind):
    workers = [worker_client.Worker(), worker_client.Worker()]
    chosen = {"workers": workers, "folders": [fmus, OTHER_BACKENDS[kind]()]}
    run_state_machine_as_test(type("Machine", (MatchedCalls,), chosen), settings=OFTEN)
    assert [worker.close() for worker in workers] == [0, 0]
