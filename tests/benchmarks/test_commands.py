"""Commands of `python -m benchmarks`: tables fit the terminal, help is complete, wrong input ends in one sentence."""

from pathlib import Path

import commands
import pytest
from models import MODELS
from rich.console import Console

from benchmarks.__main__ import main
from benchmarks.bench.benchmark import Baseline, Benchmark
from benchmarks.bench.study import benchmark_table
from benchmarks.importers import table
from benchmarks.importers.checks import CHECKS
from benchmarks.literature.study import LiteratureRun, literature_table
from benchmarks.rivals.catalogue import RIVALS
from benchmarks.rivals.comparison import Comparison, Result, rivals_table
from benchmarks.rivals.measures import Measures
from benchmarks.rivals.scenes import SCENES
from harness import HarnessError

WIDTH = 80
RIVAL_MEASURES = Measures(1.2e-16, 2e-13, 12, 34, 5e-12, 500000, 0.001)
TABLES = {  # filled with long words, and a heading
    "bench": (
        [
            benchmark_table(
                [Benchmark("16 s of " + 9 * "words ", 0.0123, "s", 0.02, (Baseline("an empty FMU in Python", 0.1),))]
            )
        ],
        "target",
    ),
    "importers": (
        [
            table.importer_table(
                [table.CheckResult("libcosim 0.0.6", check, ("1.23e-16",) * 5, fmus=tuple(MODELS)) for check in CHECKS]
            )
        ],
        "pendulum",
    ),
    "literature": (
        [literature_table([LiteratureRun("block on a belt", "scipy, arctan(1e6 v)", "DOP853", 1e-10, 123456, 1.2e-5)])],
        "error [SI]",
    ),
    "rivals": (
        [
            rivals_table(
                Comparison(
                    tuple(RIVALS.values()),
                    tuple(
                        Result(rival.title, "1.2.3", setting, {}, scene, 100, RIVAL_MEASURES)
                        for rival in RIVALS.values()
                        for setting in rival.settings
                        for scene in SCENES
                    ),
                )
            )
        ],
        "lost/extra",
    ),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_fit_into_80_columns(name):
    tables, heading = TABLES[name]
    for item in tables:
        console = Console(width=WIDTH, markup=False, highlight=False)
        with console.capture() as output:
            console.print(item)
        lines = output.get().splitlines()
        assert max(map(len, lines)) <= WIDTH
        assert "\u2026" not in output.get()
        assert heading in output.get()


@pytest.mark.parametrize("command", ["", *main.commands])
def test_help_text_is_complete(tmp_path, command):
    result = commands.benchmarks(tmp_path, *command.split(), "--help", COLUMNS=str(WIDTH))
    assert (result.returncode, result.stderr) == (0, "")
    assert "Example" in result.stdout
    _, text = result.stdout.split("\n\n", 1)  # the first paragraph is the usage, with repeatable arguments
    assert "..." not in text


def test_an_unknown_rival_ends_in_one_sentence(workspace):
    result = commands.benchmarks(workspace, "rivals", "mujocco")
    assert (result.returncode, result.stdout, result.stderr.count("\n")) == (2, "", 1)
    assert "unknown rival 'mujocco' (nearest: 'mujoco'); allowed: " in result.stderr


@pytest.mark.parametrize("command", ["bench", "importers"])
def test_a_command_without_its_fmus_explains_how_to_build_them(tmp_path, monkeypatch, command):
    (tmp_path / "fmus").mkdir()
    for name in MODELS:
        (tmp_path / f"fmus/{name}.py").write_text("")
    monkeypatch.setattr("harness.scenes.fmu_files.FOLDERS", (Path("fmus"),))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(HarnessError, match=r"there is no .*fmus.*: build .* with `friction-fmus build`"):
        main.main([command], standalone_mode=False)
