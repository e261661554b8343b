"""The checkpoint of an interrupted sweep: resuming from it, its identity, and damaged ones.

It has a record of 8 bytes of status and of the measures of each run, and a file of error messages beside it.
"""

import shutil
from pathlib import Path

import external_fmus
import numpy as np
import pytest

import harness
from harness import HarnessError

pytest.importorskip("xarray", reason="the extra 'sweep' is not installed")

MASSES = [1.0, -1.0, 2.0, 3.0, 4.0, -2.0, 5.0, 6.0, 7.0, 8.0]  # a negative one fails
COLUMNS = 3  # x, v and events at the end


def sweep(folder, fmu="fmus/smd.fmu", masses=MASSES, **options):
    return harness.sweep(fmu, {"m": masses}, stop=0.01, folder=folder, **options)


def interrupt_at(fraction):
    """Return a callback for the progress that interrupts a sweep."""

    def report(done):
        if done >= fraction:
            raise KeyboardInterrupt

    return report


def interrupted(folder, fraction=0.3, **options):
    """Interrupt a sweep, and return the file of its checkpoint and the number of its finished runs."""
    with pytest.raises(HarnessError, match=r"interrupted: \d+ of \d+ runs are finished") as stopped:
        sweep(folder, progress=interrupt_at(fraction), **options)
    (file,) = (Path(folder) / "sweep").glob(".*.checkpoint")
    return file, int(str(stopped.value).split()[1])


@pytest.fixture(scope="module")
def undisturbed(fmus):
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


def test_an_interrupted_sweep_is_resumed(undisturbed):
    _, n_done = interrupted("here")
    assert 2 < n_done < len(MASSES)
    assert_resumed("here", n_done, undisturbed)
    assert [bool(text) for text in undisturbed["error"].to_numpy()] == [mass < 0 for mass in MASSES]


@pytest.mark.parametrize("part", ["values", "messages"])
def test_a_block_cut_off_by_a_kill_is_repeated(undisturbed, part):
    """Its messages and values are written before its status, so none of its runs counts as finished."""
    file, n_done = interrupted("here")
    if part == "messages":
        with file.with_suffix(".messages").open("ab") as messages:
            messages.write(b'"trunca')
    else:
        records = np.memmap(file, "<f8", "r+", shape=(len(MASSES), 1 + COLUMNS))
        records[-1, 1:] = 5.0
        records.flush()
    assert_resumed("here", n_done, undisturbed)


def test_missing_runs_are_found_in_every_part():
    """The file is read in parts of 1000 runs: runs at the start, at the end, and across an edge are missing."""
    masses = np.linspace(1.0, 2.0, 2100)
    file, _ = interrupted("here", 1.0, masses=masses)
    records = np.memmap(file, "<f8", "r+", shape=(2100, 1 + COLUMNS))
    expected = records[:, 1].copy()
    for first, end in (0, 1), (999, 1001), (2099, 2100):
        records[first:end] = 0.0
    records.flush()
    result = sweep("here", masses=masses)
    assert (result.n_resumed, result.damaged) == (2096, False)
    assert np.array_equal(result["final_x"], expected)


DAMAGE = {
    "cut": lambda file: file.write_bytes(file.read_bytes()[:100]),
    "of other columns": lambda file: file.write_bytes(bytes(len(MASSES) * 8 * (2 + COLUMNS))),
    "random": lambda file: file.write_bytes(np.random.default_rng(1).bytes(file.stat().st_size)),
    "without messages": lambda file: file.with_suffix(".messages").unlink(),
    "empty": lambda file: file.write_bytes(b""),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_checkpoint_is_reported_and_its_runs_are_repeated(undisturbed, damage):
    file, _ = interrupted("here")
    damage(file)
    result = sweep("here")
    assert (result.n_resumed, result.damaged) == (0, True)
    assert "10 runs, 0 of them resumed" in str(result)
    assert "the checkpoint of an interrupted sweep was damaged" in str(result)
    assert result.data.equals(undisturbed)


def test_a_damaged_message_is_one_sentence():
    file, _ = interrupted("here")
    file.with_suffix(".messages").write_bytes(b"garbage" * 20)
    with pytest.raises(HarnessError, match=r"\.messages is damaged; delete it and repeat the sweep$"):
        sweep("here")


def test_the_content_of_the_fmu_is_part_of_the_identity_of_a_sweep(undisturbed):
    """Its folder is not."""
    Path("elsewhere").mkdir()
    _, n_done = interrupted("here")
    name, text = "documentation/licenses/license.txt", "another text"
    external_fmus.edited_copy("fmus/smd.fmu", "elsewhere/smd.fmu", {name: text})
    assert sweep("here", "elsewhere/smd.fmu").n_resumed == 0
    shutil.copy("fmus/smd.fmu", "elsewhere/smd.fmu")
    result = sweep("here", "elsewhere/smd.fmu")
    assert result.n_resumed == n_done
    assert result.data.equals(undisturbed)


def test_a_checkpoint_that_cannot_be_used_is_reported():
    file, _ = interrupted("here")
    file.unlink()
    file.mkdir()
    with pytest.raises(HarnessError, match=r"cannot use the checkpoint .*\.checkpoint: Is a directory$"):
        sweep("here")


def test_a_second_command_with_the_same_sweep_is_refused(undisturbed):
    """While the first one runs."""
    refusals = []

    def repeat(done):
        if done < 1.0:
            with pytest.raises(HarnessError, match="another command runs this sweep; wait until it has finished"):
                sweep("here")
            refusals.append(done)

    assert sweep("here", progress=repeat).data.equals(undisturbed)
    assert refusals


def test_runs_that_another_command_has_finished_meanwhile_are_kept(undisturbed, monkeypatch):
    """After the first look at the checkpoint, and before this command locks it."""
    _, n_done = interrupted("there")
    shares = []

    def begin():
        if not shares:
            shutil.copytree("there/sweep", "here/sweep", dirs_exist_ok=True)
        shares.append(0.0)
        return 0.0

    monkeypatch.setattr("harness.studies.sweep.study.perf_counter", begin)
    assert sweep("here", progress=shares.append).data.equals(undisturbed)
    assert min(share for share in shares if share) > n_done / len(MASSES)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no device that is always full")
def test_a_full_disk_is_one_sentence():
    file, _ = interrupted("here")
    file.unlink()
    messages = file.with_suffix(".messages")
    messages.unlink()
    messages.symlink_to("/dev/full")
    with pytest.raises(HarnessError, match=r"^cannot use the checkpoint [^\n]*$"):
        sweep("here")
