"""The checkpoint of an interrupted sweep: resuming from it, its identity, and damaged ones."""

import json
import shutil
from contextlib import contextmanager
from pathlib import Path

import external_fmus
import numpy as np
import pytest

import harness
from harness import HarnessError
from harness.studies.sweep.dispatch import Checkpoint
from harness.studies.sweep.result import SweepResult

pytest.importorskip("xarray", reason="the extra 'sweep' is not installed")

MASSES = [1.0, -1.0, 2.0, 3.0, 4.0, -2.0, 5.0, 6.0, 7.0, 8.0]  # a negative one fails
COLUMNS = 3  # x, v and events at the end


def sweep(folder, fmu="fmus/smd.fmu", masses=MASSES, **options):
    return harness.sweep(fmu, {"m": masses}, stop=0.01, folder=folder, **options)


def interrupt_at(fraction):
    """Return a callback for the progress that interrupts a sweep."""

    def report(share):
        if share >= fraction:
            raise KeyboardInterrupt

    return report


def interrupt_sweep(folder, fraction=0.3, **options):
    """Interrupt a sweep, and return the file of its checkpoint and the number of its finished runs."""
    with pytest.raises(HarnessError, match=r"interrupted: \d+ of \d+ runs are finished") as error:
        sweep(folder, progress=interrupt_at(fraction), **options)
    (file,) = (Path(folder) / "sweep").glob(".*.checkpoint")
    return file, int(str(error.value).split()[1])


@pytest.fixture(scope="module")
def complete_data(fmus):
    """The data of the whole sweep."""
    return sweep(None, fmus / "smd.fmu").data


def assert_resumed(folder, n_resumed, expected, **options):
    """Assert that the sweep in a folder takes this number of runs from its checkpoint, and leaves only its results."""
    result = sweep(folder, **options)
    assert (result.n_resumed, result.damaged) == (n_resumed, False)
    assert result.data.equals(expected)
    assert [file.name for file in (Path(folder) / "sweep").iterdir()] == [result.folder.name]


@pytest.fixture(autouse=True)
def in_folder(in_workspace, monkeypatch):
    """Work in a folder with the built FMUs, without figures, which take most of the time of a short sweep."""
    monkeypatch.setattr("harness.studies.sweep.figure.draw", lambda *arguments: None)


def test_an_interrupted_sweep_is_resumed(complete_data):
    _, n_done = interrupt_sweep("here")
    assert 2 < n_done < len(MASSES)
    assert_resumed("here", n_done, complete_data)
    assert [bool(text) for text in complete_data["error"].to_numpy()] == [mass < 0 for mass in MASSES]


def test_missing_runs_are_found_in_every_part():
    masses = np.linspace(1.0, 2.0, 2100)
    expected = sweep("there", masses=masses)["final_x"].to_numpy()
    file, _ = interrupt_sweep("here", 1.0, masses=masses)
    lines = file.read_text().splitlines(keepends=True)
    assert len(lines) > 4
    file.write_text("".join(line for i, line in enumerate(lines) if i not in (0, 3, len(lines) - 1)))
    result = sweep("here", masses=masses)
    assert (0 < result.n_resumed < 2100, result.damaged) == (True, False)
    assert np.array_equal(result["final_x"], expected)


def edit(text, other):
    """Return a function that replaces the first `text` in a file."""

    def change(file):
        content = file.read_text()
        assert text in content
        file.write_text(content.replace(text, other, 1))

    return change


DAMAGE = {
    "of other columns": edit("[[", "[[0.0, "),
    "of more columns": edit("[[", "[[0.0, 0.0, 0.0, 0.0], ["),
    "of more runs": edit("[0, ", "[10, "),
    "of runs below the first": edit("[0, ", "[-1, "),
    "with runs twice": lambda file: file.write_text(2 * file.read_text()),
    "with a text": edit("[[", '[["a", '),
    "random": lambda file: file.write_bytes(np.random.default_rng(1).bytes(file.stat().st_size) + b"\n"),
    "no blocks": edit("[0,", "{0,"),
    "deep": lambda file: file.write_text("[" * 100_000 + "\n"),
}


@pytest.mark.parametrize("n_missing", [1, 5])
def test_a_checkpoint_that_is_cut_off_resumes_from_its_complete_blocks(complete_data, n_missing):
    """Of the last block, its line break or more is missing."""
    file, n_done = interrupt_sweep("here")
    _, last_block, _ = json.loads(file.read_text().splitlines()[-1])
    file.write_bytes(file.read_bytes()[:-n_missing])
    assert_resumed("here", n_done - len(last_block), complete_data)


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_checkpoint_is_reported_and_its_runs_are_repeated(complete_data, damage):
    file, _ = interrupt_sweep("here")
    damage(file)
    result = sweep("here")
    assert (result.n_resumed, result.damaged) == (0, True)
    assert "10 runs, 0 of them resumed" in str(result)
    assert "the checkpoint of an interrupted sweep was damaged" in str(result)
    assert result.data.equals(complete_data)


def test_the_content_of_the_fmu_is_part_of_the_identity_of_a_sweep(complete_data):
    """Its folder is not."""
    Path("elsewhere").mkdir()
    _, n_done = interrupt_sweep("here")
    name, text = "documentation/licenses/license.txt", "another text"
    external_fmus.edited_copy("fmus/smd.fmu", "elsewhere/smd.fmu", {name: text})
    assert sweep("here", "elsewhere/smd.fmu").n_resumed == 0
    shutil.copy("fmus/smd.fmu", "elsewhere/smd.fmu")
    result = sweep("here", "elsewhere/smd.fmu")
    assert result.n_resumed == n_done
    assert result.data.equals(complete_data)


def test_a_checkpoint_that_cannot_be_used_is_reported():
    file, _ = interrupt_sweep("here")
    file.unlink()
    file.mkdir()
    with pytest.raises(HarnessError, match=r"cannot use the checkpoint .*\.checkpoint: Is a directory$"):
        sweep("here")


def test_a_second_command_with_the_same_sweep_is_refused(complete_data):
    """While the first one runs."""
    refusals = []

    def repeat(share):
        if share < 1.0:
            with pytest.raises(HarnessError, match="another command runs this sweep; wait until it has finished"):
                sweep("here")
            refusals.append(share)

    assert sweep("here", progress=repeat).data.equals(complete_data)
    assert refusals


@contextmanager
def limited_files(size):
    """Let the system refuse what exceeds a size of a file in bytes, as it does on a full disk."""
    resource = pytest.importorskip("resource", reason="the system has no such limit")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.mark.parametrize("size", [0, 10, 1000])
def test_a_sweep_on_a_full_disk_ends_in_one_sentence_and_resumes(size, monkeypatch):
    """The disk is full from the start, within the first block, or later."""
    masses = np.linspace(1.0, 2.0, 200)
    expected = sweep("there", masses=masses).data
    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "add", limited_files(size)(Checkpoint.add))
        with pytest.raises(
            HarnessError,
            match=r"^cannot use the checkpoint \S*: File too large($|; \d+ of 200 runs are finished; repeat the call)",
        ):
            sweep("here", masses=masses)
    result = sweep("here", masses=masses)
    assert (0 < result.n_resumed < 200) == (size == 1000)
    assert not result.damaged
    assert result.data.equals(expected)


@pytest.mark.parametrize("size", [1000, 10_000])
def test_results_that_do_not_fit_on_the_disk_are_one_sentence_and_no_run_is_lost(size, monkeypatch):
    """The disk is full before the data, or before the table."""
    masses = np.linspace(1.0, 2.0, 200)
    with monkeypatch.context() as patch:
        patch.setattr(SweepResult, "_write", limited_files(size)(SweepResult._write))
        with pytest.raises(HarnessError, match=r"^cannot write \S*: File too large; choose another `folder`$"):
            sweep("here", masses=masses)
    assert sweep("here", masses=masses).n_resumed == 200
