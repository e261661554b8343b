"""The first picture of the pages and what they say about it are true for runs of the FMU."""

import re

import numpy as np
import pytest
from commands import ROOT
from native_fmus import build_native_fmus

import harness

pytestmark = pytest.mark.slow

PICTURES = [ROOT / "docs" / "images" / f"stick-{name}.svg" for name in ("light", "dark")]
PAGES = [ROOT / "README.md", ROOT / "docs" / "index.md", ROOT / "docs" / "explanation" / "accuracy.md"]


@pytest.fixture(scope="module")
def runs():
    """The run of the picture under each law, by the same solver with the same tolerance, and the closed form.

    The million steps under sign take the native FMU a tenth of the time; it takes the same steps as the Python FMU.
    """
    fmu = build_native_fmus() / "coulomb.fmu"
    options = {"method": "ode23", "rtol": 1e-3, "stop": 6.0}
    laws = {law: harness.simulate(fmu, {"friction": law, "solver.atol": 1e-6}, **options) for law in ("sign", "hybrid")}
    return laws | {"closed form": harness.simulate(fmu, stop=6.0)}


def find_step_counts(text):
    """Return the numbers of steps in the picture, or beside it and in the paragraph on it."""
    paragraphs = [" ".join(paragraph.split()) for paragraph in text.split("\n\n")]
    if "<svg" not in text:
        paragraphs = [paragraph for paragraph in paragraphs if "ode23" in paragraph]
    numbers = re.findall(r"about (\d+(?: \d{3})*)", " ".join(paragraphs))
    return [int(number.replace(" ", "")) for number in numbers]


def test_the_pictures_and_the_pages_state_the_steps_of_both_laws(runs):
    """With two digits; `python docs/make_images.py stick` draws the pictures."""
    counts = sorted(float(f"{runs[law].statistics.steps:.1e}") for law in ("sign", "hybrid"))
    for file in (*PICTURES, *PAGES):
        assert sorted(find_step_counts(file.read_text(encoding="utf-8"))) == counts, file.name


def test_the_pictures_state_that_both_laws_are_equally_far_from_the_closed_form(runs):
    errors = [f"{1e3 * abs(runs[law]['x'][-1] - runs['closed form']['x'][-1]):.1f} mm" for law in ("sign", "hybrid")]
    for file in PICTURES:
        text = " ".join(re.findall(r"<!-- (.*?) -->", file.read_text(encoding="utf-8"), re.S))
        assert "ode23, tolerance 0.001, absolute 1e-6 (MATLAB's defaults)" in text
        assert re.findall(r"\d\.\d mm", text) == errors
    assert errors[0] == errors[1]
    assert f"end {errors[0]} from the closed form" in " ".join(PAGES[2].read_text(encoding="utf-8").split())


def test_the_speed_is_never_zero_under_sign_and_exactly_zero_at_rest(runs):
    assert np.all(runs["sign"]["v"][1:] != 0.0)
    hybrid = runs["hybrid"]
    assert np.all(hybrid["v"][hybrid.time > hybrid.events.t[-1]] == 0.0)
