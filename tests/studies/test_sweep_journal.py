"""The journal of a sweep: its identity, and how damaged ones are read."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import commands
import numpy as np
import pytest

from harness.errors import HarnessError
from harness.scenes.run_spec import RunSpec
from harness.studies.sweep.journal import Journal, JournalBlock
from harness.studies.sweep.runner import SweepSpec
from harness.studies.sweep.sampling import SweepAxis, SweepPoints, parse_axis
from harness.studies.sweep.study import Sweep


@pytest.fixture
def harness(fmus, tmp_path):
    """Return harness(argument, ...): the finished process, in a folder with the built FMUs."""
    (tmp_path / "fmus").symlink_to(fmus)

    return partial(commands.harness, tmp_path)


def test_the_fmu_is_part_of_the_identity_of_a_sweep():
    runs = SweepSpec(RunSpec(Path("smd.fmu")), ("m",), ("final",))
    one, two = (Sweep(runs, SweepPoints((SweepAxis("m", (1.0, 2.0)),)), fmu, 2) for fmu in (b"a", b"b"))
    assert one.key != two.key
    assert one.key == replace(two, fmu=b"a").key


def line(first, values, messages):
    return JournalBlock(first, np.array(values), messages).to_line()


GOOD = line(3, [[0.5, np.nan], [1.0, 2.0]], {0: "failed"})
DAMAGED = (
    *(b"", b"7", b"null", b"[]", b"00000000 []", b"\xff\xfe", b"\0", b"[" * 5000, b"9" * 5000),
    *(GOOD[:-1].replace(b"failed", b"fooled"), GOOD[:-4], GOOD[1:-1]),
    *(line(9, [[0.5, 1.5]] * 2, {})[:-1], line(-1, [[0.5, 1.5]], {})[:-1]),  # missing runs
    line(2, [[0.5, 1.5]] * 2, {})[:-1],  # one of them repeated
    line(0, [[0.5]], {})[:-1],  # with another number of columns
)


@pytest.mark.parametrize("damaged", DAMAGED)
def test_a_damaged_journal_line_is_skipped_and_counted(tmp_path, damaged):
    file = tmp_path / "journal"
    file.write_bytes(GOOD + damaged + b"\n" + line(7, [[3.0, 4.0]], {}))
    journal = Journal(file, 10, 2)
    assert (journal.n_done, journal.damaged, journal.missing_spans) == (3, 1, [(0, 3), (5, 7), (8, 10)])
    with journal.open():
        journal.add(JournalBlock(0, np.zeros((3, 2)), {}))
    again = Journal(file, 10, 2)
    assert (again.n_done, again.damaged) == (6, 1)
    assert [(block.first, block.messages) for block in again.blocks()] == [(0, {}), (3, {0: "failed"}), (7, {})]
    file.write_bytes(GOOD + line(7, [[3.0, 4.0]], {})[:-5])
    journal = Journal(file, 10, 2)
    assert (journal.n_done, journal.damaged) == (2, 0)  # truncated by a kill


def test_a_damaged_journal_is_reported_and_its_runs_are_repeated(harness, tmp_path):
    arguments = ("sweep", "smd", "--vary", "m=1:2:4", "--workers", 1, "--name", "mine")
    assert harness(*arguments, "--out", "whole", blank=True).returncode == 0
    (tmp_path / "results/sweep").mkdir(parents=True)
    points = SweepPoints((parse_axis("m=1:2:4", False),))
    runs = SweepSpec(RunSpec(tmp_path / "fmus/smd.fmu", follow=False), ("m",))
    sweep = Sweep(runs, points, runs.run.fmu.read_bytes(), 3)
    sweep.journal(tmp_path / "results/sweep").path.write_bytes(b"garbage\n" + line(0, [[1.0]], {}))
    done = harness(*arguments, blank=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "4 runs, 0 of them resumed, 0 failed" in done.stdout
    assert "2 damaged lines" in done.stdout
    name = "sweep/mine/sweep.csv"
    assert (tmp_path / "results" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_an_unusable_journal_is_reported(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(HarnessError, match=r"cannot use the journal .*folder: Is a directory"):
        Journal(tmp_path / "folder", 1, 1)
