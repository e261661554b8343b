"""Runs of the code in a Python FMU."""

from zipfile import ZipFile

import commands


def test_an_fmu_of_another_version_is_named(fmus, tmp_path):
    (tmp_path / "fmus").mkdir()
    with ZipFile(fmus / "smd.fmu") as archive, ZipFile(tmp_path / "fmus" / "smd.fmu", "w") as other:
        for name in archive.namelist():
            data = archive.read(name)
            other.writestr(name, data.replace(b"y_x", b"y_position") if name.endswith(".py") else data)
    # in a process of its own, because both FMUs name their package alike
    result = commands.run_process(tmp_path, "precision", "smd")
    assert result.returncode == 1
    assert result.stderr.startswith("Error: smd.fmu was built by another version of this project: build it again")
