"""What the studies conclude and the report shows: verdicts, the table of methods, and what comes first."""

import re
from dataclasses import replace
from math import nan
from pathlib import Path
from types import SimpleNamespace

import pytest
from precision_points import make_point

from benchmarks.bench.benchmark import Baseline, Benchmark
from benchmarks.bench.table import summarize_benchmarks
from harness.references.models import CASES
from harness.report.page import write_report
from harness.report.sections import STEPS, ComparedScene, ResultItem, build_sections
from harness.report.typeset import typeset
from harness.report.verdicts import build_verdicts
from harness.results.provenance import write_provenance
from harness.results.quantity import Quantity
from harness.results.summary import STEPS_TABLE, Summary, make_table, write_summary
from harness.scenes.scene import Citation, KnownValues
from harness.studies.precision.method_choice import choose_method, tabulate_choices
from harness.studies.precision.study import FMPY, QUICK, Study
from harness.studies.run.table import judge_deviations
from harness.studies.stability.table import summarize_outcomes

CASE = {case.name: case for case in CASES}
CITATION = Citation("A. Author", "A title", 2020, "table 1")


def summarize(study, title, outcome):
    return Summary(study, title, outcome=outcome)


def published(title, *deviations, table="published", **parameters):
    """The summary of a case with quantities: name and difference in percent from a known value."""
    known = KnownValues(
        table, "a method", dict.fromkeys(dict(deviations), 1.0), CITATION if table == "published" else None
    )
    run = SimpleNamespace(parameters=parameters)
    quantities = [Quantity(name, 1 + percent / 100, "s", name.replace("_", " ")) for name, percent in deviations]
    return summarize("run", title, judge_deviations(quantities, known, run))


def summarize_stability(*endings):
    """The summary of a stability study with an outcome for each ending."""
    return summarize_outcomes(
        [
            SimpleNamespace(
                case=SimpleNamespace(name="sled", title=f"scene {i}", method="ode23"),
                ended=ending,
                text="it `fell` over",
            )
            for i, ending in enumerate(endings)
        ]
    )


def make_study(*points, cases=("stickslip",)):
    return Study("stickslip", tuple(CASE[name] for name in cases), points)


def report_on(tmp_path, summary):
    """The page of one result."""
    folder = tmp_path / summary.study
    folder.mkdir()
    write_provenance(folder, [])
    write_summary(folder, summary)
    return write_report(tmp_path, []).path.read_text(encoding="utf-8")


def test_the_verdicts_are_the_number_reproduced_the_fastest_methods_and_the_cases_passed():
    summaries = [
        published("sled", ("period", 0.5), ("peak", -2.0)),
        published("sled-rough", ("steps", -50.0), ("run_time", 80.0)),
        published("pendulum", ("period", 1.0)),
        published("spring", ("period", 9.0), table="reference"),
        published("belt", ("period", 0.1), table="reference"),
        published("wheel", ("period", 0.2), table="parameter"),
        summarize("precision", "sled", tabulate_choices(make_study(*POINTS), 0.0)[1]),
        summarize_stability("finished", "refused", "wrong"),
    ]
    reproduced, others, methods, stability = build_verdicts(summaries)
    assert (reproduced.value, reproduced.is_good) == ("2 of 3", False)
    assert reproduced.details[:2] == (
        "sled-rough: steps differs by -50 %",
        "largest deviation of the others: sled: peak differs by -2 %",
    )
    assert (others.value, others.is_good) == ("2 of 3", False)
    assert others.details == (
        "spring: period differs by +9 %",
        "largest deviation of the others: wheel: period differs by +0.2 %",
        "compared with a closed form or certified result: spring, belt",
        "compared with the parameter that was set: wheel",
    )
    assert methods.details[0] == "sled: exact"
    assert (stability.value, stability.is_good, stability.details) == ("2 of 3", False, ("1 failed",))


def test_a_law_that_chatters_is_the_reason_why_its_steps_differ_but_not_its_period():
    outcomes = [published("sled", (name, 40.0), friction="sign").outcome for name in ("mean_step", "period")]
    assert outcomes[0].text == "mean step differs by +40 %; its friction chatters, so its steps depend on rounding"
    assert outcomes[1].text == "period differs by +40 %"


def test_a_model_without_an_accurate_method_says_that_none_of_the_measured_ones_reached_the_accuracy():
    study = make_study(make_point("ode23", 1e-3, 2e-6), make_point("rodas", 1e-3, 5e-6))
    (methods,) = build_verdicts([summarize("precision", "sled", tabulate_choices(study, QUICK.min_ratio)[1])])
    assert methods.details[0] == "sled: none of the measured methods reached it"


def test_without_results_there_is_no_verdict():
    assert build_verdicts([]) == []


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
    ratio = QUICK.min_ratio if is_quick else 0.0
    assert choose_method(make_study(*points), CASE["stickslip"], accuracy, ratio) == (method, *notes)


def test_failed_runs_and_importers_are_not_compared_and_a_chattering_law_with_true_sticking():
    study = make_study(
        make_point("ode23", 3e-3, 1e-7),
        make_point("ode23", 1e-3, 1e-7, FMPY),
        make_point("rodas", nan, nan, failure="too slow"),
        make_point("ode23", 1e-3, 1e-7, case="stickslip-threshold", beside_dry=0.02),
        cases=("stickslip", "stickslip-threshold"),
    )
    ((table,), outcome) = tabulate_choices(study, 0.0)
    hybrid, threshold = table.rows
    assert hybrid[:3] == ("stickslip", *["ode23\n3 ms\nno other solver reaches it"] * 2)
    assert threshold[0] == "stickslip-threshold\nerror against true stick and slip"
    assert threshold[1:] == ("\nnone of the measured methods\nsmallest error: 0.02, with ode23",) * 3
    assert outcome.value == "ode23"


def test_the_table_of_methods_has_the_rows_of_all_models(tmp_path):
    tables, outcome = tabulate_choices(make_study(*POINTS), QUICK.min_ratio)
    for model in ("one", "two"):
        folder = tmp_path / "precision" / model
        folder.mkdir(parents=True)
        write_provenance(folder, [])
        rows = tuple((f"{model}\nquick run", *row[1:]) for row in tables[0].rows)
        write_summary(folder, Summary("precision", model, tables=(replace(tables[0], rows=rows),), outcome=outcome))
    page = write_report(tmp_path, []).path.read_text(encoding="utf-8")
    (table,) = re.findall(r'<table class="choices">.*?</table>', page, re.S)
    cells = [re.findall("<p[^>]*>([^<]*)</p>", cell) for cell in re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", table, re.S)]
    assert cells[4:6] == [["one", "quick run"], ["exact", "1 ms", "2.6 times faster than scipy LSODA"]]
    assert cells[8] == ["two", "quick run"]


def test_the_table_of_steps_has_the_rows_of_published_cases_only():
    sled, mine = (make_table(("case", "steps"), [(title, 5)], STEPS_TABLE) for title in ("sled", "mine"))
    summaries = replace(published("sled", ("period", 0.5)), tables=sled), Summary("run", "mine", tables=mine)
    sections = build_sections([ResultItem(Path(), summary) for summary in summaries], [])
    (item,) = next(section.items for section in sections if section.study == STEPS)
    assert item.summary.tables[0].rows == sled[0].rows


def test_failed_stability_cases_are_shown_first_with_their_reason(tmp_path):
    page = report_on(tmp_path, summarize_stability("finished", "wrong"))
    part = page[page.index('<section id="stability">') :]
    assert part.index("1 of 2 stiff") < part.index("scene 1") < part.index("it <code>fell</code> over")
    assert part.index("it <code>fell</code> over") < part.index("Number of outcomes")
    assert "scene 0" not in part


def test_missed_benchmarks_are_shown_and_others_folded(tmp_path):
    benchmarks = [
        Benchmark("fast", 0.0012345, "s", 0.00125, (Baseline("a peer", 1.5),)),
        Benchmark("slow", 0.0034567, "s", 0.00125, (Baseline("a peer", 1.5678), Baseline("another", 2.5))),
        Benchmark("skipped", nan, "1", nan, (Baseline("not found: a tool"),)),
    ]
    page = report_on(tmp_path, summarize_benchmarks(benchmarks))
    parts = re.split("<summary>(?:Targets that are met|Not measured)</summary>", page[page.index("1 of 2 targets") :])
    missed, met, skipped = (re.findall(r"<td[^>]*>([^<]*)<", part) for part in parts)
    assert missed == ["slow", "0.0035", "0.00125", "s", "a peer 1.6; another 2.5"]
    assert met == ["fast", "0.0012", "0.00125", "s", "a peer 1.5"]
    assert skipped == ["skipped", "", "", "", "not found: a tool"]


def test_results_of_the_user_come_first_in_the_page_and_in_each_section():
    """A run of the user is one of his runs even if it agrees with published values."""
    scenes = [ComparedScene(name, "sled", "") for name in ("sled", "spring")]
    items = [
        ResultItem(Path(), published("sled", ("period", 0.5)), "sled"),
        ResultItem(Path(), published("spring", ("period", 0.5), table="reference"), "spring"),
        ResultItem(Path(), Summary("decay", "ours"), "sled"),
        ResultItem(Path(), Summary("decay", "mine"), "/records/mine.csv"),
        ResultItem(Path(), published("sled", ("period", 0.5)), "/scenes/sled.toml"),
        ResultItem(Path(), Summary("stability", "stability")),
        ResultItem(Path(), Summary("sweep", "a sweep")),
    ]
    sections = [
        (section.study, [item.summary.title for item in section.items]) for section in build_sections(items, scenes)
    ]
    assert sections == [
        ("run", ["sled"]),
        ("decay", ["mine", "ours"]),
        ("sweep", ["a sweep"]),
        ("published", ["sled"]),
        ("reference", ["spring"]),
        ("stability", ["stability"]),
    ]


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
