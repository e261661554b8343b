"""What the studies conclude, and how the report shows it."""

import json
import re
from dataclasses import asdict
from math import nan
from types import SimpleNamespace

import commands
import pytest
from build_cache import ROOT
from precision_points import make_point, make_study

from benchmarks.bench.benchmark import Baseline, Benchmark
from benchmarks.bench.study import summarize_benchmarks
from harness import StabilityResult
from harness.references.peer_solvers import FMPY
from harness.studies.precision.study import QUICK


@pytest.fixture
def report(tmp_path):
    """Return report(result, ...): the page of results, each a summary and the source of its provenance."""

    def report(*results):
        for i, (summary, source) in enumerate(results):
            folder = tmp_path / "results" / f"{i}"
            folder.mkdir(parents=True)
            content = summary if isinstance(summary, dict) else asdict(summary)
            (folder / "summary.json").write_text(json.dumps({"version": 1} | content | {"picture": ""}))
            origin = {"command": "harness", "date": "2026-11-27", "files": {}, "parameters": {}, "scene": None}
            (folder / "provenance.json").write_text(json.dumps(origin | {"source": source}))
        result = commands.harness(tmp_path, "report")
        assert (result.returncode, result.stderr) == (0, "")
        return (tmp_path / "results/report.html").read_text(encoding="utf-8")

    return report


def judged_cases(*endings):
    """Return the summary of a stability study with an outcome for each ending."""
    rows = tuple(
        SimpleNamespace(
            case=SimpleNamespace(name="sled", title=f"scene {i}", method="ode23", max_error=None),
            ended=end,
            has_passed=end == "finished",
            energy_rise=nan,
            text="it `fell` over",
        )
        for i, end in enumerate(endings)
    )
    return StabilityResult(rows, ()).summary(), ""


def precision_summary(*points, min_ratio=0.0, cases=("stickslip",)):
    """Return the summary of a precision study."""
    return make_study(*points, cases=cases, min_ratio=min_ratio).summary()


@pytest.mark.parametrize(
    ("published_value", "outcome"),
    [
        ('mean_step = [1.0, "s"]', None),
        ("f = 5.0", ("friction force, 3 cycles differs by -90 %", False)),
    ],
)
def test_steps_of_a_law_that_chatters_are_not_judged_but_its_loss_is(workspace, published_value, outcome):
    """A run time is not compared."""
    scene = (ROOT / "harness/scenes/coulomb-sign.toml").read_text().partition("[published]")[0]
    scene = re.sub("plots = .*", "plots = []\nstop = 2.2", scene).replace("repeat = 5", "repeat = 1")
    known_values = f'[published]\nsource = "a method"\nrun_time = [1e-9, "s"]\n{published_value}\n'
    citation = '[citation]\nauthor = "A. Author"\ntitle = "A title"\nyear = 2020\nlocation = "table 1"\n'
    (workspace / "mine.toml").write_text(f"{scene}{known_values}{citation}")
    assert commands.harness(workspace, "run", "mine.toml").stderr == ""
    judgement = json.loads((workspace / "results/mine/summary.json").read_text())["outcome"]
    assert (judgement and (judgement["text"], judgement["is_good"])) == outcome


POINTS = [
    make_point("exact", 1e-3, 1e-14),
    make_point("ode23", 4e-3, 1e-7),
    make_point("LSODA", 2.6e-3, 1e-4, "scipy"),
]
CLOSE = [POINTS[1], make_point("rodas", 5e-3, 1e-8)]


@pytest.mark.parametrize(
    ("points", "accuracy", "is_quick", "method", "notes"),
    [
        (POINTS, 1e-3, False, "exact", ("1 ms", "2.6 times faster than scipy LSODA")),
        (POINTS, 1e-6, False, "exact", ("1 ms", "4 times faster than ode23")),
        (POINTS, 1e-9, False, "exact", ("1 ms", "no other solver reaches it")),
        (POINTS[1:], 1e-3, False, "ode23", ("4 ms", "scipy LSODA is 1.5 times faster")),
        (POINTS[1:], 1e-3, True, "ode23", ("4 ms", "scipy LSODA is 1.5 times faster")),
        (CLOSE, 1e-6, False, "ode23", ("4 ms", "1.2 times faster than rodas")),
        (CLOSE, 1e-6, True, "ode23", ("4 ms", "rodas is about as fast (quick run)")),
        (POINTS[1:], 1e-9, False, "", ("none of the measured methods", "smallest error: 1e-07, with ode23")),
        (POINTS[2:], 1e-3, False, "", ("no method has been measured successfully",)),
    ],
)
def test_a_method_is_chosen_by_time_and_compared_with_the_runner_up(points, accuracy, is_quick, method, notes):
    *_, table = precision_summary(*points, min_ratio=QUICK.min_ratio if is_quick else 0.0).tables
    column = table.headings.index(f"error up to {accuracy:.0e}".replace("e-0", "e-"))
    assert table.rows[0][column].splitlines() == [method, *notes]


def test_failed_runs_and_importers_are_not_compared_and_a_chattering_law_with_true_sticking():
    summary = precision_summary(
        make_point("ode23", 3e-3, 1e-7),
        make_point("ode23", 1e-3, 1e-7, FMPY),
        make_point("rodas", nan, nan, failure="too slow"),
        make_point("ode23", 1e-3, 1e-7, case="stickslip-threshold", beside_dry=0.02),
        cases=("stickslip", "stickslip-threshold"),
    )
    hybrid, threshold = summary.tables[-1].rows
    assert hybrid[:3] == ("stickslip", *["ode23\n3 ms\nno other solver reaches it"] * 2)
    assert threshold[0] == "stickslip-threshold\nerror against true stick and slip"
    assert threshold[1:] == ("\nnone of the measured methods\nsmallest error: 0.02, with ode23",) * 3
    assert summary.outcome.value == "ode23"


def test_failed_stability_cases_are_shown_first_with_their_reason(report):
    page = report(judged_cases("finished", "wrong"))
    part = page[page.index('<section id="stability">') :]
    assert part.index("1 of 2 ended") < part.index("scene 1") < part.index("it <code>fell</code> over")
    assert part.index("it <code>fell</code> over") < part.index("Number of outcomes")
    assert "scene 0" not in part


def test_missed_benchmarks_are_shown_and_others_folded(report):
    benchmarks = [
        Benchmark("fast", 0.0012345, "s", 0.00125, (Baseline("a peer", 1.5),)),
        Benchmark("slow", 0.0034567, "s", 0.00125, (Baseline("a peer", 1.5678), Baseline("another", 2.5))),
        Benchmark("skipped", nan, "1", nan, (Baseline("not found: a tool"),)),
    ]
    page = report((summarize_benchmarks(benchmarks), ""))
    parts = re.split("<summary>(?:Targets that are met|Not measured)</summary>", page[page.index("1 of 2 targets") :])
    missed_cells, met_cells, skipped_cells = (re.findall(r"<td[^>]*>([^<]*)<", part) for part in parts)
    assert missed_cells == ["slow", "0.0035", "0.00125", "s", "a peer 1.6; another 2.5"]
    assert met_cells == ["fast", "0.0012", "0.00125", "s", "a peer 1.5"]
    assert skipped_cells == ["skipped", "", "", "", "not found: a tool"]


def test_code_and_powers_are_typeset(report):
    texts = {
        "run `a < 1e-3` now": "run <code>a &lt; 1e-3</code> now",
        "`a` and `b`": "<code>a</code> and <code>b</code>",
        "a lone ` stays": "a lone ` stays",
        "1e-06, 2.5e+10, 0e+00, x1e-3, 1e6": "10⁻⁶, 2.5·10¹⁰, 0, x1e-3, 1e6",
        "+3.3 % of": "+3.3\N{NO-BREAK SPACE}% of",
        "<b>": "&lt;b&gt;",
    }
    page = report(({"study": "decay", "title": "mine", "sentences": [*texts]}, ""))
    assert [html for html in texts.values() if f">{html}</p>" not in page] == []


def test_a_solver_that_did_not_run_has_no_row_in_the_printed_table():
    points = *POINTS, make_point("LSODA", nan, nan, "cvode", failure="too slow")
    table = make_study(*points)._tabulate()[0]
    assert [row[0] for row in table.rows()] == [f"{point.tool}: {point.method}" for point in POINTS]
