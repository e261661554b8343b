"""The checkpoint of a sweep: its identity, resuming from it, and damaged ones."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import commands
import numpy as np
import pytest

from harness import HarnessError
from harness.scenes.run_spec import RunSpec
from harness.studies.sweep.checkpoint import Checkpoint, RunBlock
from harness.studies.sweep.runner import SweepSpec
from harness.studies.sweep.sampling import SweepAxis, SweepPoints, parse_axis
from harness.studies.sweep.study import Sweep


@pytest.fixture
def harness(workspace):
    """Return harness(argument, ...): the finished process, in a folder with the built FMUs."""
    return partial(commands.harness, workspace)


def test_the_fmu_is_part_of_the_identity_of_a_sweep():
    runs = SweepSpec(RunSpec(Path("smd.fmu")), ("m",), ("final",))
    one, two = (Sweep(runs, SweepPoints((SweepAxis("m", (1.0, 2.0)),)), fmu, 2) for fmu in (b"a", b"b"))
    assert one.key != two.key
    assert one.key == replace(two, fmu=b"a").key


def example_checkpoint(path):
    """Return the checkpoint of a sweep of 10 runs, of which run 3 failed and run 4 finished."""
    checkpoint = Checkpoint(path, 10, 2)
    with checkpoint.open():
        checkpoint.add(RunBlock(3, np.array([[np.nan, np.nan], [1.0, 2.0]]), {0: "failed \u00e9"}))
    return checkpoint


def test_a_checkpoint_is_read_back(tmp_path):
    example_checkpoint(tmp_path / "a.checkpoint")
    checkpoint = Checkpoint(tmp_path / "a.checkpoint", 10, 2)
    assert (checkpoint.n_done, checkpoint.damaged, checkpoint.missing_spans) == (2, False, [(0, 3), (5, 10)])
    with checkpoint.open():
        checkpoint.add(RunBlock(0, np.ones((3, 2)), {1: "first"}))
        checkpoint.add(RunBlock(5, np.full((5, 2), 7.0), {4: "last"}))
    reopened = Checkpoint(tmp_path / "a.checkpoint", 10, 2)
    assert (reopened.n_done, reopened.missing_spans) == (10, [])
    (block,) = reopened.blocks()
    assert block.messages == {1: "first", 3: "failed \u00e9", 9: "last"}
    assert block.values[[0, 4, 5]].tolist() == [[1.0, 1.0], [1.0, 2.0], [7.0, 7.0]]
    reopened.delete()
    assert list(tmp_path.iterdir()) == []


def test_runs_that_another_command_has_finished_meanwhile_are_kept(tmp_path):
    checkpoint = Checkpoint(tmp_path / "a.checkpoint", 10, 2)
    example_checkpoint(checkpoint.path)
    with checkpoint.open():
        assert (checkpoint.n_done, checkpoint.missing_spans) == (2, [(0, 3), (5, 10)])


def test_a_run_that_is_added_twice_counts_once(tmp_path):
    checkpoint = Checkpoint(tmp_path / "a.checkpoint", 10, 1)
    with checkpoint.open():
        for end in (2, 3):
            checkpoint.add(RunBlock(0, np.zeros((end, 1)), {}))
        assert checkpoint.n_done == 3


@pytest.mark.parametrize("spans", [[], [(0, 1)], [(999, 1001)], [(0, 1000)], [(2499, 2500)], [(0, 2500)]])
def test_missing_runs_are_found_in_every_part(tmp_path, spans):
    checkpoint = Checkpoint(tmp_path / "a.checkpoint", 2500, 1)
    with checkpoint.open():
        for first, end in spans:
            checkpoint.add(RunBlock(first, np.zeros((end - first, 1)), {}))
    missing = np.ones(2500, bool)
    for first, end in checkpoint.missing_spans:
        missing[first:end] = False
    assert np.flatnonzero(missing).tolist() == [run for first, end in spans for run in range(first, end)]


@pytest.mark.parametrize("part", ["values", "status", "messages"])
def test_a_block_cut_off_by_a_kill_is_repeated(tmp_path, part):
    """Its values are written before its status, so none of its runs counts as finished."""
    checkpoint = example_checkpoint(tmp_path / "a.checkpoint")
    if part == "messages":
        with checkpoint.message_path.open("ab") as file:
            file.write(b'"trunca')
    elif part == "values":
        checkpoint.array["values"][7] = 5.0
    else:
        checkpoint.array["status"][4] = 0
    reopened = Checkpoint(tmp_path / "a.checkpoint", 10, 2)
    assert (reopened.damaged, reopened.n_done) == (False, 1 if part == "status" else 2)
    with reopened.open():
        reopened.add(RunBlock(8, np.full((1, 2), np.nan), {0: "after the cut"}))
    assert reopened.messages(reopened.array["status"])[8] == "after the cut"


def cut_values(checkpoint):
    with checkpoint.path.open("r+b") as file:
        file.truncate(100)


def other_columns(checkpoint):
    checkpoint.path.write_bytes(bytes(10 * 8 * 4))


def random_bytes(checkpoint):
    size = checkpoint.path.stat().st_size
    checkpoint.path.write_bytes(np.random.default_rng(1).bytes(size))


def no_messages(checkpoint):
    checkpoint.message_path.unlink()


def empty(checkpoint):
    checkpoint.path.write_bytes(b"")


@pytest.mark.parametrize("damage", [cut_values, other_columns, random_bytes, no_messages, empty])
def test_a_damaged_checkpoint_is_not_used(tmp_path, damage):
    damage(example_checkpoint(tmp_path / "a.checkpoint"))
    checkpoint = Checkpoint(tmp_path / "a.checkpoint", 10, 2)
    assert (checkpoint.damaged, checkpoint.n_done, checkpoint.missing_spans) == (True, 0, [(0, 10)])
    with checkpoint.open():
        checkpoint.add(RunBlock(0, np.zeros((10, 2)), {9: "new"}))
    (block,) = Checkpoint(tmp_path / "a.checkpoint", 10, 2).blocks()
    assert block.messages == {9: "new"}


def test_a_damaged_message_is_one_sentence(tmp_path):
    checkpoint = example_checkpoint(tmp_path / "a.checkpoint")
    checkpoint.message_path.write_bytes(b"garbage\n")
    with pytest.raises(HarnessError, match=r"a.messages is damaged; delete it and repeat the sweep"):
        list(checkpoint.blocks())


def test_a_damaged_checkpoint_is_reported_and_its_runs_are_repeated(harness, tmp_path):
    arguments = ("sweep", "smd", "--vary", "m=1:2:4", "--workers", 1, "--name", "mine")
    assert harness(*arguments, "--out", "whole", blank=True).returncode == 0
    (tmp_path / "results/sweep").mkdir(parents=True)
    points = SweepPoints((parse_axis("m=1:2:4", False),))
    runs = SweepSpec(RunSpec(tmp_path / "fmus/smd.fmu", follow=False), ("m",))
    sweep = Sweep(runs, points, runs.run.fmu.read_bytes(), 3)
    sweep.checkpoint(tmp_path / "results/sweep").path.write_bytes(b"garbage")
    done = harness(*arguments, blank=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "4 runs, 0 of them resumed, 0 failed" in done.stdout
    assert "the checkpoint of an interrupted sweep was damaged" in done.stdout
    name = "sweep/mine/sweep.csv"
    assert (tmp_path / "results" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_an_unusable_checkpoint_is_reported(tmp_path):
    (tmp_path / "a.checkpoint").mkdir()
    checkpoint = Checkpoint(tmp_path / "a.checkpoint", 1, 1)
    refusal = pytest.raises(HarnessError, match=r"cannot use the checkpoint .*a.checkpoint: Is a directory")
    with refusal, checkpoint.open():
        pass


def test_a_second_command_with_the_same_sweep_is_refused(tmp_path):
    first, second = (Checkpoint(tmp_path / "a.checkpoint", 10, 2) for _ in range(2))
    refusal = pytest.raises(HarnessError, match="another command runs this sweep")
    with first.open(), refusal, second.open():
        pass
    with second.open():
        pass


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no device that is always full")
def test_a_full_disk_is_one_sentence(tmp_path):
    (tmp_path / "a.messages").symlink_to("/dev/full")
    checkpoint = Checkpoint(tmp_path / "a.checkpoint", 10, 2)
    with pytest.raises(HarnessError, match="cannot use the checkpoint"), checkpoint.open():
        checkpoint.add(RunBlock(0, np.full((1, 2), np.nan), {0: "failed"}))
