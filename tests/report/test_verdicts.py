"""What the report concludes from stored results: verdicts, the table of methods, and what it shows first."""

import re
from dataclasses import astuple
from math import nan

import pytest

from harness.report.method_choice import SolverPoint, choose_method, read_method_choices
from harness.report.page import write_report
from harness.report.sections import PublishedScene
from harness.report.typeset import typeset
from harness.report.verdicts import build_verdicts
from harness.results.files import to_json, write_csv_rows
from harness.studies.precision.study import FMPY, FMU, Point
from harness.studies.precision.survey import csv_headings, write_table
from harness.studies.stability.study import write_table as write_stability

QUANTITIES = ["", "measured", "unit", "published (elsewhere)", "difference"]
SCENES = [PublishedScene(name, "sled", "") for name in ("sled", "sled-rough")]


def write_precision(results, points, source="", values=None):
    """Write the points of a study of the model sled, as the command precision does."""
    folder = results / "precision"
    folder.mkdir(parents=True)
    cases = {point.case: (values or {}).get(point.case, {}) for point in points}
    (folder / "sled.json").write_text(to_json({"source": source, "scene": cases}))
    write_table(folder / "sled.csv", csv_headings(Point), map(astuple, points))


def write_quantities(results, case, *rows):
    (results / case).mkdir(parents=True)
    write_csv_rows(results / case / "quantities.csv", QUANTITIES, rows)


def write_stability_outcomes(results, *outcomes):
    """Write stability.csv with the headings of the command and a line for each outcome."""
    file = results / "stability/stability.csv"
    file.parent.mkdir(parents=True)
    write_stability([], file)
    lines = [f"sled,scene {i},ode23,finished,{outcome},,,,,,,,it `fell` over" for i, outcome in enumerate(outcomes)]
    with file.open("a") as text:
        text.write("\n".join([*lines, ""]))


def point(tool, method, seconds, error, case="sled", **others):
    return Point(case, tool, method, 1e-6, 1e-9, seconds=seconds, evaluations=1, largest=error, **others)


def test_the_verdicts_are_the_number_reproduced_the_fastest_methods_and_the_cases_passed(tmp_path):
    write_quantities(tmp_path, "sled", ("period", 3.3, "s", 3.3, "+0.5 %"), ("peak", 0.4, "m", 0.41, "-2 %"))
    write_quantities(tmp_path, "sled-rough", ("steps", 5, "", 10, "-50 %"), ("run time", 8, "ms", 9, "other CPU"))
    write_precision(tmp_path, [point(FMU, "exact", 1e-3, 1e-14), point(FMU, "ode23", 2e-3, 1e-7)])
    write_stability_outcomes(tmp_path, "finished", "refused", "wrong")
    published, methods, stability = build_verdicts(tmp_path, SCENES, read_method_choices(tmp_path))
    assert (published.value, published.is_good) == ("1 of 2", False)
    assert published.details == (
        "sled-rough: steps differs by -50 %",
        "worst deviation of the others: -2 %, peak of sled",
    )
    assert methods.details == ("sled: exact",)
    assert (stability.value, stability.is_good, stability.details) == ("2 of 3", False, ("1 failed",))


def test_a_model_without_an_accurate_method_says_that_none_of_the_measured_ones_reached_the_accuracy(tmp_path):
    write_precision(tmp_path, [point(FMU, "ode23", 1e-3, 2e-6), point(FMU, "rodas", 1e-3, 5e-6)], source="a quick run")
    (methods,) = build_verdicts(tmp_path, [], read_method_choices(tmp_path))
    assert methods.details == ("sled: none of the measured methods reached it",)


def test_without_results_there_is_no_verdict(tmp_path):
    assert build_verdicts(tmp_path, SCENES, read_method_choices(tmp_path)) == []


POINTS = [
    SolverPoint(FMU, "exact", 1e-3, 1e-14),
    SolverPoint(FMU, "ode23", 4e-3, 1e-7),
    SolverPoint("scipy", "LSODA", 2.6e-3, 1e-4),
]
CLOSE = [POINTS[1], SolverPoint(FMU, "rodas", 5e-3, 1e-8)]


@pytest.mark.parametrize(
    ("points", "accuracy", "is_quick", "method", "notes"),
    [
        (POINTS, 1e-3, False, "exact", ("1 ms", "2.6 times faster than scipy LSODA")),
        (POINTS, 1e-6, False, "exact", ("1 ms", "4 times faster than ode23")),
        (POINTS, 1e-9, False, "exact", ("1 ms", "no other solver reaches it")),
        (POINTS[1:], 1e-3, False, "ode23", ("4 ms", "scipy LSODA is 1.5 times faster")),
        (POINTS[1:], 1e-3, True, "ode23", ("4 ms", "scipy LSODA is 1.5 times faster")),
        (
            [*POINTS[1:2], SolverPoint(FMU, "rodas", 5e-3, 1e-8)],
            1e-6,
            False,
            "ode23",
            ("4 ms", "1.2 times faster than rodas"),
        ),
        (
            [*POINTS[1:2], SolverPoint(FMU, "rodas", 5e-3, 1e-8)],
            1e-6,
            True,
            "ode23",
            ("4 ms", "rodas is about as fast (quick run)"),
        ),
        (POINTS[1:], 1e-9, False, "", ("none of the measured methods", "smallest error: 1e-07, with ode23")),
        (POINTS[2:], 1e-3, False, "", ("no method has been measured successfully",)),
    ],
)
def test_a_method_is_chosen_by_time_and_compared_with_the_runner_up(points, accuracy, is_quick, method, notes):
    choice = choose_method(points, accuracy, is_quick)
    assert (choice.method, choice.notes) == (method, notes)


def test_failed_runs_and_importers_are_not_compared_and_a_chattering_law_with_true_sticking(tmp_path):
    points = [
        point(FMU, "ode23", 3e-3, 1e-7),
        point(FMPY, "ode23", 1e-3, 1e-7),
        point(FMU, "rodas", nan, nan, failure="too slow"),
        point(FMU, "ode23", 1e-3, 1e-7, case="sled-sign", beside_dry=0.02),
    ]
    write_precision(tmp_path, points, values={"sled-sign": {"friction": 2}})
    sled, sign = read_method_choices(tmp_path)
    assert [choice.notes for choice in sled.choices[:2]] == [("3 ms", "no other solver reaches it")] * 2
    assert [choice.notes for choice in sign.choices] == [
        ("none of the measured methods", "smallest error: 0.02, with ode23")
    ] * 3
    assert [sled.is_chattering, sign.is_chattering] == [False, True]


def test_failed_stability_cases_are_shown_first_with_their_reason(tmp_path):
    write_stability_outcomes(tmp_path, "finished", "wrong")
    page = write_report(tmp_path, []).path.read_text(encoding="utf-8")
    part = page[page.index('<section id="stability">') :]
    assert part.index("1 of 2 stiff") < part.index("scene 1") < part.index("it <code>fell</code> over")
    assert part.index("it <code>fell</code> over") < part.index("Number of outcomes")
    assert "scene 0" not in part


def test_missed_benchmarks_are_shown_and_others_folded(tmp_path):
    (tmp_path / "bench").mkdir()
    heads = ["benchmark", "measured", "unit", "target", "met", "baseline", "baseline value"]
    rows = [
        ("fast", 0.0012345, "s", 0.00125, True, "a peer", 1.5),
        ("slow", 0.0034567, "s", 0.00125, False, "a peer", 1.5678),
        ("slow", 0.0034567, "s", 0.00125, False, "another", 2.5),
        ("skipped", "nan", "1", "nan", False, "not found: a tool", ""),
    ]
    write_csv_rows(tmp_path / "bench/bench.csv", heads, rows)
    page = write_report(tmp_path, []).path.read_text(encoding="utf-8")
    parts = re.split("<summary>(?:Targets that are met|Not measured)</summary>", page[page.index("1 of 2 targets") :])
    shown, met, skipped = (re.findall(r"<td[^>]*>([^<]*)<", part) for part in parts)
    assert shown == ["slow", "0.0035", "0.00125", "s", "a peer 1.6; another 2.5"]
    assert met == ["fast", "0.0012", "0.00125", "s", "a peer 1.5"]
    assert skipped == ["skipped", "", "", "", "not found: a tool"]


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("run `a < 1e-3` now", "run <code>a &lt; 1e-3</code> now"),
        ("`a` and `b`", "<code>a</code> and <code>b</code>"),
        ("a lone ` stays", "a lone ` stays"),
        ("1e-06, 2.5e+10, 0e+00, x1e-3, 1e6", "10⁻⁶, 2.5·10¹⁰, 0, x1e-3, 1e6"),
        ("+3.3 % of", "+3.3\N{NO-BREAK SPACE}% of"),
        ("<b>", "&lt;b&gt;"),
    ],
)
def test_code_and_powers_are_typeset(text, html):
    assert str(typeset(text)) == html
