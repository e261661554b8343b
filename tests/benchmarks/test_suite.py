"""The friction suite: its files, the verdicts of check.py, and importers that are wrong on purpose."""

import json
import re
import subprocess
import sys
from xml.etree import ElementTree
from zipfile import ZipFile

import commands
import fmpy.validation
import numpy as np
import pytest
from native_fmus import require_compiler

from benchmarks.suite import importers
from benchmarks.suite.cases import CASES
from benchmarks.suite.check import check_case, read_columns

CASE_NAMES = ("rest", "jump_of_load", "late_start", "tie", "short_sticks", "stick_slip")


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    require_compiler()
    folder = tmp_path_factory.mktemp("suite")
    words = [word for name in CASE_NAMES for word in ("--case", name)]
    result = commands.benchmarks(folder, "suite", folder, "--platform", "linux64", "--archive", *words)
    assert (result.returncode, result.stderr) == (0, "")
    return folder


@pytest.mark.campaign
def test_the_archive_of_a_release_has_all_files(suite):
    files = {file.relative_to(suite.parent).as_posix() for file in suite.rglob("*") if file.is_file()}
    with ZipFile(f"{suite}.zip") as archive:
        assert {name for name in archive.namelist() if not name.endswith("/")} == files
        assert f"{suite.name}/rest/rest_ref.csv" in files


@pytest.mark.slow
@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
def test_an_fmu_contains_the_files_of_its_case_and_is_valid(suite, version):
    fmu = suite / "jump_of_load" / version / "coulomb.fmu"
    assert fmpy.validation.validate_fmu(fmu) == []
    with ZipFile(fmu) as archive:
        names = [name for name in archive.namelist() if name.startswith("extra/org.fmi-standard.fmi-ls-ref/")]
        files = {name.rpartition("/")[2]: archive.read(name) for name in names}
    elements = ElementTree.fromstring(files.pop("fmi-ls-manifest.xml")).findall("Related")
    assert [item.get("source") for item in elements] == list(files)
    assert [item.get("role") for item in elements] == [
        "result",  # of the default run
        "experiment/validation",
        "parameter",
        "experiment/validation",
        "result",
        "result",
    ]
    for name, content in list(files.items())[1:]:
        assert content == (suite / "jump_of_load" / name).read_bytes()


def verdict(suite, runner, name, tmp_path):
    return importers.run_case(runner, suite / name, tmp_path, json.loads((suite / "cases.json").read_text())[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", CASE_NAMES)
def test_fmpy_passes_each_case_and_check_py_says_so(suite, name, tmp_path):
    assert verdict(suite, importers.run_fmpy, name, tmp_path) == "passed"
    command = [sys.executable, "-I", suite / "check.py", tmp_path, name]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stdout.splitlines()[-1]) == (0, "0 of 1 cases failed")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("runner", "name"),
    [
        (importers.interpolate_across_events, "stick_slip"),
        (importers.interpolate_across_events, "short_sticks"),
        (importers.ignore_event_mode, "rest"),
        (importers.ignore_event_mode, "stick_slip"),
        (importers.ignore_start_time, "late_start"),
    ],
)
def test_an_importer_that_is_wrong_on_purpose_fails(suite, runner, name, tmp_path):
    assert re.match(r"failed: \d", verdict(suite, runner, name, tmp_path))


def break_result(columns, name):
    """Return a result with one mistake."""
    at_rest = columns["mode"] == 0
    match name:
        case "creep":
            return columns | {"x": columns["x"] + np.where(at_rest, 1e-10 * columns["time"], 0.0)}
        case "late outputs":
            return columns | {"F_friction": np.roll(columns["F_friction"], 1)}
        case "late mode":
            return columns | {"mode": np.roll(columns["mode"], 1)}
        case "wrong motion":
            return columns | {"x": columns["x"] * (1.0 + 1e-5)}
        case "times in single precision":
            return columns | {"time": (columns["time"] + 1e5).astype(np.float32) - 1e5}
        case "no mode":
            return {key: y for key, y in columns.items() if key != "mode"}
    return columns


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mistake", "failures"),
    [
        ("none", set()),
        ("creep", {"rest"}),
        ("late outputs", {"outputs"}),
        ("late mode", {"events"}),
        ("wrong motion", {"motion"}),
        ("times in single precision", {"motion"}),
        ("no mode", {"events"}),
    ],
)
def test_each_verdict_finds_its_mistake(suite, mistake, failures, tmp_path):
    columns = break_result(read_columns(suite / "rest" / "rest_ref.csv"), mistake)
    rows = np.column_stack([*columns.values()])
    np.savetxt(tmp_path / "rest_out.csv", rows, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
    verdicts = check_case(suite, tmp_path, "rest", json.loads((suite / "cases.json").read_text())["rest"])
    assert {key for key, text in verdicts.items() if text.startswith("-")} == failures


def test_the_suite_has_21_cases_and_each_says_what_it_catches():
    assert len({case.name for case in CASES}) == 21
    assert len({case.catches for case in CASES}) == 21
