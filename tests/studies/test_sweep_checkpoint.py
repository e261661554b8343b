"""The checkpoint of an interrupted sweep: resuming from it, its identity, and damaged ones."""

import shutil
import sqlite3
from contextlib import closing
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


def change(file, statement):
    """Run a statement of SQL on a checkpoint, and return the number of rows that it changed."""
    with closing(sqlite3.connect(file)) as connection, connection:
        return connection.execute(statement).rowcount


def test_missing_runs_are_found_in_every_part():
    masses = np.linspace(1.0, 2.0, 2100)
    expected = sweep("there", masses=masses)["final_x"].to_numpy()
    file, _ = interrupted("here", 1.0, masses=masses)
    blocks = "SELECT first FROM blocks ORDER BY first"
    lost = f"({blocks} LIMIT 1), ({blocks} LIMIT 1 OFFSET 3), ({blocks} DESC LIMIT 1)"
    assert change(file, f"DELETE FROM blocks WHERE first IN ({lost})") == 3
    result = sweep("here", masses=masses)
    assert (0 < result.n_resumed < 2100, result.damaged) == (True, False)
    assert np.array_equal(result["final_x"], expected)


DAMAGE = {
    "cut": lambda file: file.write_bytes(file.read_bytes()[:5000]),
    "of other columns": lambda file: change(file, "UPDATE blocks SET content = zeroblob(length(content) + 8)"),
    "of more runs": lambda file: change(file, "UPDATE blocks SET first = first + 8"),
    "with runs twice": lambda file: change(file, "UPDATE blocks SET size = 2, content = zeroblob(48) WHERE first = 0"),
    "random": lambda file: file.write_bytes(np.random.default_rng(1).bytes(file.stat().st_size)),
    "with a damaged page": lambda file: file.write_bytes(file.read_bytes()[:4096] + bytes(8192)),
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
    with pytest.raises(HarnessError, match=r"cannot use the checkpoint .*\.checkpoint: unable to open database file$"):
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


@pytest.mark.parametrize("pages", [2, 12])
def test_a_full_disk_is_one_sentence(pages, monkeypatch):
    """At the start of the sweep, and later."""
    connect = sqlite3.connect

    def connect_on_full_disk(path, **options):
        connection = connect(path, **options)
        connection.execute(f"PRAGMA max_page_count = {pages}")
        return connection

    monkeypatch.setattr(sqlite3, "connect", connect_on_full_disk)
    with pytest.raises(HarnessError, match=r"^cannot use the checkpoint \S*: database or disk is full$"):
        sweep("here", masses=np.linspace(1.0, 2.0, 2000))
