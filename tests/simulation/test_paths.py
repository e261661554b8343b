"""The harness works in any folder: neither special characters in a path nor missing files in an FMU make it crash."""

import tempfile
from pathlib import Path
from zipfile import ZipFile

import pytest
from commands import harness, run_process
from external_fmus import build_external_fmus

from harness import HarnessError, simulate
from harness.process import temporary_directory

ODD = "a#b'+(,&@[{;=!$^%20 é\u3042`~)"


@pytest.fixture
def odd_folder(tmp_path, fmus):
    """A user's folder with the built FMUs, whose path contains every special character."""
    folder = tmp_path / ODD
    folder.mkdir()
    (folder / "fmus").symlink_to(fmus)
    return folder


@pytest.mark.campaign
@pytest.mark.parametrize(
    "command",
    [
        ("run", "coulomb"),
        ("sweep", "smd", "--vary", "m=1:2:2", "--workers", "1"),
    ],
)
def test_paths_of_temporary_files_fmus_and_results_may_contain_any_character(odd_folder, command):
    temporary = odd_folder / "temporary"
    temporary.mkdir()
    result = run_process(odd_folder, *command, "--out", odd_folder / "out", TMPDIR=str(temporary))
    assert (result.returncode, result.stderr) == (0, "")
    assert list(temporary.iterdir()) == []
    assert any((odd_folder / "out").rglob("*.svg")) or any((odd_folder / "out").rglob("*.csv"))


def test_without_a_plain_folder_a_python_fmu_is_refused_and_others_run(odd_folder, fmus, monkeypatch):
    monkeypatch.setattr(temporary_directory, "FALLBACK_DIRECTORIES", ())
    monkeypatch.setattr(tempfile, "tempdir", str(odd_folder))
    with pytest.raises(HarnessError, match=r"smd\.fmu is a Python FMU, which cannot be run from .*TMPDIR"):
        simulate(fmus / "smd.fmu")
    assert simulate(build_external_fmus() / "Bouncing.fmu", stop=0.1, rtol=1e-3).time[-1] == 0.1
    assert [file.name for file in odd_folder.iterdir()] == ["fmus"]


@pytest.mark.parametrize("part", ["resources/", "resources/slavemodule.txt", "_fmu.py"])
def test_a_python_fmu_without_the_files_of_its_library_is_refused(fmus, tmp_path, part):
    broken_fmu = copy_without(fmus / "smd.fmu", tmp_path / "broken.fmu", lambda name: part in name)
    result = harness(tmp_path, "run", broken_fmu)
    assert result.returncode == 1
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("Error: ")
    assert "broken.fmu lacks resources/" in result.stderr


def test_an_unwritable_temporary_folder_is_reported(fmus, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "gone"))
    with pytest.raises(HarnessError, match="cannot write to the temporary directory"):
        simulate(fmus / "smd.fmu")


@pytest.mark.parametrize(
    ("path", "expected"), [("/a b/c-d.e_~", True), ("/a/%20", False), ("/é", False), ("/+", False)]
)
def test_a_plain_path_is_one_whose_uri_escapes_only_blanks(path, expected):
    assert temporary_directory.has_plain_uri(Path(path)) is expected


def copy_without(fmu, copy, left_out):
    """Return a copy of an FMU without some of its files."""
    with ZipFile(fmu) as source, ZipFile(copy, "w") as part:
        for name in source.namelist():
            if not left_out(name):
                part.writestr(name, source.read(name))
    return copy
