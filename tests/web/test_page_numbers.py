"""Each number and each claim in the opening and the stories of the live page is true for runs of the FMUs."""

import re
from pathlib import Path

import numpy as np
import page_numbers
import pytest
from page_numbers import SCENE_STOP, closed_form, opening_run, plain, shows

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
LAWS = ("hybrid", "sign")


def text(page, section):
    """Return the text of a story, with a space between two cells of a table."""
    cells = "[...document.querySelectorAll('#{} .text :is(p, th, td)')].map(each => each.textContent).join(' ')"
    return plain(page.run(cells.format(section)))


def type_number(page, section, name, value):
    page.type_number(name, value, prefix=f"{section}-", scene=f"#{section}")


def test_each_number_of_the_opening_is_that_of_runs_of_the_fmu(still):
    for exponent in (-3, -2, -4):
        if exponent != -3:
            type_number(still, "opening", "solver.rtol", f"1e{exponent}")
        assert shows(text(still, "opening"), *page_numbers.opening_numbers(exponent)), text(still, "opening")
        counts = still.run("[...document.querySelectorAll('#opening .count')].map(each => each.textContent)")
        assert [int(plain(count)) for count in counts] == [opening_run(law, exponent).statistics.steps for law in LAWS]


def test_each_number_of_the_stories_is_that_of_runs_of_the_fmus(still):
    for story in ("stops", "chatters", "squeaks", "creeps", "swings"):
        assert shows(text(still, story), *getattr(page_numbers, f"{story}_numbers")()), text(still, story)


def test_a_steeper_curve_creeps_less_and_costs_more(still):
    type_number(still, "creeps", "x_m", "0.001")
    steep, smooth = page_numbers.creeps_numbers(0.001), page_numbers.creeps_numbers(0.01)
    assert steep[1] < 0.3 * smooth[1]
    assert steep[4] > 3 * smooth[4]
    assert shows(text(still, "creeps"), *steep)


def test_the_claims_of_the_opening_hold():
    """Title: under sign(v) the speed is never zero. Accuracy: the tolerance sets the error, the law sets the work."""
    stop = closed_form().events.t[-1]
    assert abs(stop + 0.3 - SCENE_STOP) < 0.05  # "in the 0.3 s after that"
    errors = {}
    for exponent in (-2, -3, -4):
        true, sign = (opening_run(law, exponent) for law in LAWS)
        assert np.all(sign["v"][1:] != 0.0)
        assert np.all(np.asarray(sign["mode"][1:]) != 0)
        at_rest = true.time > true.events.t[-1]
        assert np.all(true["v"][at_rest] == 0.0)
        assert np.all(true["F_friction"][at_rest] == true["F_spring"][at_rest])
        assert np.all(np.abs(sign["F_friction"][1:]) == closed_form().parameters["f"])
        assert sign.statistics.steps > 10 * true.statistics.steps
        errors[exponent] = page_numbers.errors(true, sign)
    for exponent in (-3, -4):
        assert errors[exponent][1] == pytest.approx(errors[exponent][0], rel=0.1)
    assert max(errors[-4]) < 0.2 * min(errors[-3])
    x0, band = 0.1, closed_form().parameters["f"] / closed_form().parameters["k"]
    half_swings = np.ceil((x0 - band) / (2 * band))
    expected = abs(x0 - 2 * band * half_swings)
    assert abs(closed_form()["x"][-1]) == pytest.approx(expected, abs=1e-16)  # exact to rounding


def test_the_tools_that_the_opening_names_hold_exactly_in_the_comparison_of_engines(still):
    row = r"^\| ([^|]+?) \| ([^|/]+) / ([^|]+?) \| [^|]+ \| [^|]+ \| [^|]+ \| \d+ \|$"  # engine, both creeps
    rows = re.findall(row, (DOCS / "explanation" / "rivals.md").read_text(encoding="utf-8"), re.M)
    exact = {engine for engine, *creeps in rows if {*map(str.strip, creeps)} == {"0"}}
    assert {"scipy", "PathSim", "Drake, witness functions", "FMU"} <= exact
    assert "scipy, PathSim and Drake do" in text(still, "opening")


ENDS_OF_RANGES = (
    ("stops", {"x0": 0}, "The mass stays where it is, 0 m off centre."),
    ("stops", {"x0": 0.1, "f": 2}, "half-swing"),
    ("squeaks", {"v_driver": 0.01}, "so it overshoots: no slip in the first 12 s."),
    ("squeaks", {"v_driver": 0.2, "mu_d": 0.1}, "lasting"),
    ("squeaks", {"v_driver": 0.034, "mu_d": 0.88}, "lasting"),
    ("creeps", {"v_driver": 0.02}, "mm"),
    ("swings", {"theta0": 0}, "it stays where it is, 0° off the vertical;"),
    ("swings", {"theta0": 25, "mu": 0.08}, "it still swings when the picture ends;"),
    ("swings", {"theta0": 10, "mu": 0.5}, "off the vertical;"),
)


def test_the_sentences_are_complete_at_the_ends_of_all_ranges(still):
    for story, values, sentence in ENDS_OF_RANGES:
        for name, value in values.items():
            type_number(still, story, name, str(value))
        assert sentence in text(still, story)
        assert not re.search(r"NaN|undefined|\N{EN DASH}|\b1 (half-swings|slips)|  |\( | ,| \.", text(still, story))
