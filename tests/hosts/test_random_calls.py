"""Calls in any order with any arguments, as hypothesis finds them: nothing crashes, lies or stays silent.

What is claimed after each call: the process lives; whoever refuses a call has said a sentence; all calculated Reals are
finite while the run is healthy and NaN once it has failed; and an instance beside it goes its way as if alone.
"""

from math import inf, isfinite, isnan, nan

import fmi3_fixtures
import native_fmus
import pytest
import worker_client
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test
from models import MODELS, declared, outputs

KINDS = {  # the process, the folder of the FMUs, and the types of FMI
    "python": (worker_client.Worker, None, ("Real", "Integer", "Boolean", "String")),
    "native": (worker_client.Worker, native_fmus.build_native_fmus, ("Real", "Integer", "Boolean", "String")),
    "fmi3": (
        fmi3_fixtures.Worker,
        fmi3_fixtures.build_fmi3_fmus,
        ("Float64", "Int32", "Int64", "UInt64", "Boolean", "String"),
    ),
}
SHORT = settings(
    max_examples=25,
    stateful_step_count=40,
    derandomize=True,  # the same calls every time
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)

NEW, READY, RUNNING, LOST = range(4)  # LOST: calls came in an order that FMI forbids
REALS = st.sampled_from([0.0, -0.0, 0.5, 1.0, 2.0, -1.0, 1e-3, 100.0, nan, inf, -inf])
INTEGERS = st.sampled_from([0, 1, 2, 3, 5, 99, -1, 2**31 - 1, -(2**31)])
TIMES = st.sampled_from([0.0, -2.0, 1.0, 1e6, nan, inf])
SIZES = st.sampled_from([1e-9, 1e-3, 0.01, 0.1, 0.3, 0.0, -0.1, nan, inf])
STRANGE = st.sampled_from([10**6, 2**31 - 1, 2**31, 2**32 - 1])  # value references
VALUES = {"Boolean": True, "String": "1"}  # of a type of FMI; 1 of all others
CHATTER = {"friction", "solver.method"}  # choices that may take steps without number


class Calls(RuleBasedStateMachine):
    """One instance that anything may happen to, and one beside it."""

    process = folder = types = worker = None  # of the kind

    @initialize(name=st.sampled_from(MODELS))
    def instantiate(self, name):
        self.declared, self.outputs = declared(name), outputs(name)
        reals = {v: d for v, d in self.declared.items() if d.type == "Real"}
        self.calculated = [v for v, d in reals.items() if d.causality in ("output", "local")]
        if self.worker is None or not self.worker.alive:
            type(self).worker = self.process()
        path = self.path = self.folder / f"{name}.fmu"
        self.beside = self.worker.instantiate(path).begin()
        self.beside.step(0.0, 0.1)
        self.fmu = self.worker.instantiate(path)
        self.saved = []
        self.anew()

    def anew(self):
        self.phase, self.failed, self.t, self.sentences, self.changed = NEW, False, 0.0, [], False

    def hear(self):
        """What was said since the run was last healthy."""
        for instance in (self.fmu, self.beside):  # the logger of fmpy calls back the newest, whichever speaks
            self.sentences += [text for status, _, text in instance.messages() if status > 1]
        self.sentences += self.worker.read_stderr().splitlines()
        assert all(sentence for sentence in self.sentences)
        return self.sentences

    def called(self, function, *arguments):
        """What a call answers, or Refused; who refuses has said why."""
        try:
            return getattr(self.fmu, function)(*arguments)
        except worker_client.FmiError:
            said = self.hear()
        assert said, f"{function}{arguments} is refused without a sentence"
        return worker_client.FmiError

    def go(self, allowed, then):
        """The phase after a call that FMI allows in some phases only."""
        self.phase = then if self.phase in allowed else LOST

    # ---- from instantiation to the end

    @rule(start=TIMES, stop=TIMES, tolerance=st.sampled_from([1e-4, 0.0, 1.0, nan]))
    def setup(self, start, stop, tolerance):
        self.called("setup", start, stop if stop != start else None, tolerance)
        self.t = start
        self.go([NEW], READY)

    @rule()
    def init(self):
        self.called("init")
        self.go([READY], RUNNING)

    @precondition(lambda self: self.phase == NEW)
    @rule()
    def begin(self):
        self.called("begin")
        self.phase = RUNNING

    @rule()
    def terminate(self):
        self.called("terminate")
        self.go([], LOST)

    @rule()
    def reset(self):
        assert self.called("reset") is None
        self.anew()
        self.begin()
        assert self.called("step", 0.0, 0.01) is None
        self.t = 0.01
        self.healthy()

    # ---- the run

    @rule(h=SIZES, late=st.sampled_from([0.0, 0.0, 0.0, 1.0, -1e-3, nan]))
    def step(self, h, late):
        answer = self.called("step", self.t + late, h)
        self.changed = False
        if answer is worker_client.FmiError:
            self.failed = self.failed or self.phase == RUNNING
            if self.failed:
                self.broken()
        else:
            assert not self.failed
            assert h > 0.0
            self.t = self.t + late + h
            self.healthy()

    @precondition(lambda self: self.phase == RUNNING)
    @rule(n=st.integers(1, 5))
    def steps(self, n):
        for _ in range(n):
            self.step(0.1, 0.0)

    def healthy(self):
        told = [v for v in self.declared if v != "solver.t_next"]  # which is NaN where the next step will fail
        values = dict(zip(told, self.fmu.get(*told), strict=True))
        assert [v for v in told if self.declared[v].causality in ("output", "local") and not isfinite(values[v])] == []
        self.hear()
        self.sentences.clear()

    def broken(self):
        assert self.hear()
        assert all(isnan(value) for value in self.fmu.get(*self.calculated))

    # ---- values

    @rule(data=st.data())
    def write(self, data):
        name = data.draw(st.sampled_from(sorted(self.declared)))
        value = data.draw(REALS if self.declared[name].type == "Real" else INTEGERS)
        if name in CHATTER and value in (1, 2, 3, 5):
            value = self.declared[name].start
        self.called("set", {name: value})
        self.changed = True

    @rule(data=st.data())
    def read(self, data):
        names = data.draw(st.lists(st.sampled_from(sorted(self.declared)), min_size=2, max_size=5))
        values = self.called("get", *names)
        if self.failed and not self.changed and values is not worker_client.FmiError:
            calculated = {
                v for v, d in self.declared.items() if d.causality in ("output", "local") and d.type == "Real"
            }
            assert all(isnan(value) for name, value in zip(names, values, strict=True) if name in calculated)

    @rule(data=st.data(), reference=STRANGE | st.integers(0, 30))
    def read_one(self, data, reference):
        """As a type that the variable is not of, or a variable that there is not: the others read on."""
        kind = data.draw(st.sampled_from(self.types))
        before = None if self.changed or self.phase == LOST else self.called("get", *self.outputs)
        value = self.called("read_one", kind, reference)
        if reference > 30 and value is not worker_client.FmiError:
            assert isnan(value) if kind in ("Real", "Float64") else not value
            assert self.hear()
        if before is not None:
            assert str(self.called("get", *self.outputs)) == str(before)

    @rule(data=st.data(), reference=STRANGE)
    def write_one(self, data, reference):
        kind = data.draw(st.sampled_from(self.types))
        self.called("write_one", kind, reference, VALUES.get(kind, 1))
        self.changed = True

    # ---- state

    @precondition(lambda self: len(self.saved) < 4)
    @rule(through_bytes=st.booleans())
    def save(self, through_bytes):
        state = self.called("save")
        if state is not worker_client.FmiError and through_bytes:
            state = self.fmu.deserialize(self.fmu.serialize(state))  # own bytes are always taken
        if state is not worker_client.FmiError:
            self.saved.append((state, self.phase, self.failed, self.t, self.changed))

    @precondition(lambda self: self.saved)
    @rule(data=st.data())
    def restore(self, data):
        state, phase, failed, t, changed = data.draw(st.sampled_from(self.saved))
        if self.called("restore", state) is None:
            self.phase, self.failed, self.t, self.changed = phase, failed, t, changed

    @rule(data=st.data())
    def foreign_bytes(self, data):
        """Flipped, cut, extended, or anything else: refused, and the instance is as it was."""
        state = self.called("save")
        if state is worker_client.FmiError:
            return
        before = self.called("get", *self.outputs)
        own = bytes.fromhex(self.fmu.serialize(state))
        place = data.draw(st.integers(0, len(own) - 1))
        flipped = bytes([*own[:place], own[place] ^ 1 << data.draw(st.integers(0, 7)), *own[place + 1 :]])
        foreign = data.draw(st.sampled_from([flipped, own[:place], own + own[:place] + b" ", b"[" * place]))
        assert self.called("deserialize", foreign.hex()) is worker_client.FmiError
        assert str(self.called("get", *self.outputs)) == str(before)

    def teardown(self):
        if not self.worker.alive:
            return  # which has been told
        self.fmu.free()
        self.beside.step(0.1, 0.1)
        alone = self.worker.instantiate(self.path).begin()
        alone.step(0.0, 0.1)
        alone.step(0.1, 0.1)
        assert self.beside.get(*self.outputs) == alone.get(*self.outputs)
        self.beside.free()
        alone.free()


@pytest.mark.parametrize("kind", KINDS)
def test_no_call_sequence_crashes_or_fails_silently(fmus, kind):
    process, built, types = KINDS[kind]
    chosen = {"process": process, "folder": built() if built else fmus, "types": types}
    machine = type("Machine", (Calls,), chosen)
    run_state_machine_as_test(machine, settings=SHORT)
    assert machine.worker.close() == 0
