"""Damaged bytes of a saved state are refused, and forged ones harm neither instance nor process.

Most tests use the classes packed in the FMUs, which check a thousand forgeries per second. Dangerous ones use built
FMUs in a clean process.
"""

import json
import random
from math import inf, nan
from zlib import crc32

import pytest
from models import MODELS, model_class, outputs, runtime
from row_comparison import assert_identical
from variants import slow_after
from worker_client import FmiError, Worker

from fmus.compiler.lowering import sibling_module

TIMES = 10_000 // len(MODELS)
EVERY_MODEL = pytest.mark.parametrize("name", slow_after(2, MODELS))
REFUSAL = (
    "a saved state is refused: another FMU wrote it or it has been changed; "
    "save the state again and pass it on unchanged"
)


@pytest.mark.parametrize("limit", [2**63 - 1, -(2**63)])
def test_integers_beyond_64_bits_are_no_part_of_a_state(limit):
    """They would raise in the code of the host."""
    matches_pattern = runtime("smd", "saved_state").matches_pattern
    assert matches_pattern({"count": [limit]}, {"count": [0]})
    assert not matches_pattern({"count": [limit + (1 if limit > 0 else -1)]}, {"count": [0]})


def running_instance(name):
    """Return the slave class of a model, and an instance during a run."""
    slave_class = runtime(name, "slave").make_slave_class(model_class(name))
    instance = slave_class(instance_name="saved")
    instance.exit_initialization_mode()
    assert instance.do_step(0.0, 0.3)
    return slave_class, instance


def state_bytes(slave_class, instance):
    """Return the bytes of the state of an instance."""
    return slave_class._fmu_state_to_bytes(instance._get_fmu_state())


def with_checksum(text):
    """Return the bytes with a valid checksum."""
    return b"%08x" % crc32(text) + text


def forge_bytes(content, change):
    """Return the bytes after a change of their content, with a valid checksum."""
    state = json.loads(content[8:])
    change(state)
    return with_checksum(json.dumps(state).encode())


def is_accepted(slave_class, content):
    """Return whether the bytes are accepted as a state."""
    try:
        slave_class._fmu_state_from_bytes(content)
    except sibling_module(slave_class.Model, "runtime.saved_state").InvalidStateError:
        return False
    return True


def iterate_members(state, path=()):
    """Yield the path of every scalar member."""
    for name, value in state.items():
        if isinstance(value, dict) and value:
            yield from iterate_members(value, (*path, name))
        else:
            yield (*path, name)


def is_alternative(value, other):
    """Return whether two values are valid alternatives: the same type, or the same shape."""
    if isinstance(value, list) and isinstance(other, list):
        return len(value) == len(other)
    return type(value) is type(other) and value != 10**30


def find_member(state, path):
    """Return the owner of the member at the end of a path, and its name."""
    for name in path[:-1]:
        state = state[name]
    return state, path[-1]


def member(content, path):
    """Return the member of serialized bytes at the end of a path."""
    owner, last = find_member(json.loads(content[8:]), path)
    return owner[last]


@EVERY_MODEL
def test_own_bytes_are_accepted_and_reproduced(name):
    slave_class, instance = running_instance(name)
    other = slave_class(instance_name="other")
    for state in ("healthy", "with an invalid value", "after a refused step", "failed"):
        if state == "with an invalid value":
            instance.set_invalid("m", "m = nan kg is refused: a sentence with a · and brackets [{")
        elif state == "after a refused step":
            assert not instance.do_step(0.3, 0.1)
        elif state == "failed":
            instance.fail("")
        other._set_fmu_state(slave_class._fmu_state_from_bytes(state_bytes(slave_class, instance)))
        assert state_bytes(slave_class, other) == state_bytes(slave_class, instance)


@EVERY_MODEL
def test_flipped_truncated_or_extended_bytes_are_refused(name, capsys):
    """Ten thousand times in all."""
    slave_class, instance = running_instance(name)
    content, draw = state_bytes(slave_class, instance), random.Random(name)
    for i in range(TIMES):
        position, bit = draw.randrange(len(content)), 1 << draw.randrange(8)
        flipped_content = (
            bytes([*content[:position], content[position] ^ bit, *content[position + 1 :]]) if i % 4 == 0 else b""
        )
        damaged_content = [
            flipped_content,
            content[:position],
            content + draw.randbytes(1 + i % 9),
            draw.randbytes(position),
        ][i % 4]
        assert not is_accepted(slave_class, damaged_content)
    stderr = capsys.readouterr().err.splitlines()
    assert set(stderr) == {f"{slave_class.__name__}: {REFUSAL}"}
    assert len(stderr) == TIMES


@EVERY_MODEL
def test_every_member_must_be_present_with_its_name_type_and_length(name, capsys):
    """Each member is replaced by something invalid. Members of the same type and length are read alike, so the first
    of each gets all replacements."""
    slave_class, instance = running_instance(name)
    content, draw = state_bytes(slave_class, instance), random.Random(name)
    assert is_accepted(slave_class, forge_bytes(content, lambda state: None))
    state = json.loads(content[8:])
    others, seen_kinds = [None, "1", [], {}, [0.0] * 3, True, 1, 1.5, 10**30], set()
    for path in iterate_members(state):
        value = find_member(state, path)[0][path[-1]]

        def drop(state, path=path):
            owner, last = find_member(state, path)
            del owner[last]

        def rename(state, path=path):
            owner, last = find_member(state, path)
            owner["__class__"] = owner.pop(last)

        def add(state, path=path):
            find_member(state, path)[0]["compute_outputs"] = 1.0

        changes, kind = [drop, rename, add], (type(value), type(value) is list and len(value))
        wrong = [other for other in others if not is_alternative(other, value)]
        for other in wrong if kind not in seen_kinds else [draw.choice(wrong)]:

            def replace(state, path=path, other=other):
                owner, last = find_member(state, path)
                owner[last] = other

            changes.append(replace)
        seen_kinds.add(kind)
        for change in changes:
            assert not is_accepted(slave_class, forge_bytes(content, change)), (path, change)


SENTENCES = {"that is no text": {"m": 1}, "that is a list": {"m": ["a"]}}
SETTINGS = {"origin": "elsewhere", "invalid_values": [["m", "a"]], "run": {}}
RUN = {"start_time": 1, "has_pending_changes": 0}
SPELLINGS = {
    "another order": lambda text: json.dumps(dict(reversed(json.loads(text).items()))).encode(),
    "a number of a million digits": lambda text: text.replace(b'"phase": ', b'"phase": ' + b"9" * 1_000_000, 1),
    "nested without end": lambda text: b"[" * 200_000,
    "nested objects": lambda text: b'{"a":' * 200_000,
    "nested in a member": lambda text: text.replace(
        b'"invalid_values": {}', b'"invalid_values": ' + b"[" * 300 + b"]" * 300
    ),
    "very long": lambda text: text.replace(b'"origin": "', b'"origin": "' + b"a" * 2_000_000),
    "a list": lambda text: b"[]",
    "a number": lambda text: b"NaN",
    "nothing": lambda text: b"",
    "no UTF-8": lambda text: b"\xff\xfe",
}
FORGERIES = {
    **{
        f"sentence {what}": lambda content, s=s: forge_bytes(content, lambda state: state.update(invalid_values=s))
        for what, s in SENTENCES.items()
    },
    **{
        f"setting {what}": lambda content, n=what, v=v: forge_bytes(content, lambda state: state.update({n: v}))
        for what, v in SETTINGS.items()
    },
    **{
        f"run with {what}": lambda content, n=what, v=v: forge_bytes(content, lambda state: state["run"].update({n: v}))
        for what, v in RUN.items()
    },
    **{what: lambda content, spell=spell: with_checksum(spell(content[8:])) for what, spell in SPELLINGS.items()},
    "a class": lambda content: forge_bytes(content, lambda state: state["model"].update(__class__={"rules": ["a"]})),
    "rules": lambda content: forge_bytes(
        content, lambda state: state["model"].update(rules=["a"], compute_outputs=1.0)
    ),
    "no bytes": lambda content: b"",
    "a checksum alone": lambda content: with_checksum(b"")[:8],
}


@pytest.fixture
def fmu(fmus):
    """A process that must exit cleanly, and the path of an FMU."""
    worker = Worker()
    yield worker, fmus / "stickslip.fmu"
    assert worker.close() == 0


def test_forged_bytes_change_neither_instance_nor_neighbour_nor_process(fmu):
    """In the built FMU, one after the other: an error status and a message, and all instances continue unchanged."""
    worker, path = fmu
    times, names = [0.1 * i for i in range(len(FORGERIES) + 1)], outputs("stickslip")
    expected = worker.instantiate(path).begin().run(times, names)
    neighbour, target = worker.instantiate(path).begin(), worker.instantiate(path).begin()
    rows = [neighbour.get(*names)], [target.get(*names)]
    worker.read_stderr()
    for (title, forge), t, ahead in zip(FORGERIES.items(), times[:-1], times[1:], strict=True):
        content = bytes.fromhex(target.serialize(target.save()))
        forged_content = forge(content)
        assert forged_content != content, title
        with pytest.raises(FmiError) as refusal:
            target.deserialize(forged_content.hex())
        assert refusal.value.status >= 3, title
        assert worker.read_stderr() == f"Stickslip: {REFUSAL}\n"
        assert REFUSAL in target.messages()[-1][2]
        for instance, row in zip((neighbour, target), rows, strict=True):
            instance.step(t, ahead - t)
            row.append(instance.get(*names))
    for row in rows:
        assert_identical(row, expected, names)
    for instance in (neighbour, target):
        instance.reset()
        assert_identical(instance.begin().run(times[:3], names), expected[:3], names)
        instance.free()


def test_forged_numbers_end_in_a_status_and_a_reset_restores_the_instance(fmu):
    """A valid checksum over random numbers, in the built FMU: it may be accepted, and the run may then fail."""
    worker, path = fmu
    names, draw, n_accepted = outputs("stickslip"), random.Random(1), 0
    instance = worker.instantiate(path).begin()
    expected = instance.run([0.0, 0.1, 0.2], names)
    content = bytes.fromhex(instance.serialize(instance.save()))
    numbers = [p for p in iterate_members(json.loads(content[8:])) if type(member(content, p)) in (int, float)]

    def forge(state):
        for path in draw.sample(numbers, 4):
            owner, last = find_member(state, path)
            values = (0, 1, -1, 99, 2**40) if type(owner[last]) is int else (0.0, -1.0, 1e300, nan, inf, -inf)
            owner[last] = draw.choice(values)

    for _ in range(60):
        try:
            instance.restore(instance.deserialize(forge_bytes(content, forge).hex()))
            n_accepted += 1
            instance.step(0.2, 0.1)
        except FmiError:
            pass
        instance.get(*names, "solver.t_next")
        instance.reset()
        assert_identical(instance.begin().run([0.0, 0.1, 0.2], names), expected, names)
    assert n_accepted > 20
    instance.free()


def test_a_state_of_another_fmu_is_refused_and_the_instance_continues(fmu):
    worker, path = fmu
    other = worker.instantiate(path.with_name("pacejka.fmu")).begin()
    instance = worker.instantiate(path).begin()
    names = outputs("stickslip")
    before = instance.get(*names)
    with pytest.raises(FmiError):
        instance.deserialize(other.serialize(other.save()))
    assert instance.get(*names) == before
    instance.step(0.0, 0.1)
    instance.free()
    other.free()
