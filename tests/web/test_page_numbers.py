"""Each number and each claim in the opening and the stories of the live page is true for runs of the FMUs."""

import re
from pathlib import Path

import numpy as np
import page_numbers
import pytest
from page_numbers import SCENE_STOP, closed_form, opening_run, plain, shows

from fmus.packaging.web.html_page import HERE

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
LAWS = {"true": "hybrid", "sign": "sign"}
COMPUTING_TIMES = {"true-time", "sign-time"}  # of the machine
OUTPUTS = (
    "Object.fromEntries([...document.querySelectorAll('#{} output')].map(output => [output.dataset.out,"
    "output.textContent]))"
)
SETTLED = (
    "!document.querySelector('.pending') && document.getElementById('opening-verdict').textContent.startsWith('In the')"
)
TEXTS = (  # of canvases and drawings
    "app.stories.then(({ charts }) => { const texts = []; const { prototype } = CanvasRenderingContext2D;"
    "const { fillText } = prototype;"
    "prototype.fillText = function (text, ...at) { texts.push(text); fillText.call(this, text, ...at) };"
    "charts.forEach(chart => chart.paint()); prototype.fillText = fillText;"
    "return [...texts, ...[...document.querySelectorAll('#stories .tag')].map(tag => tag.textContent)] })"
)


@pytest.fixture
def still(page):
    """The page for a visitor who prefers reduced motion, complete."""
    page.browser.size(1280)
    page.browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
    page.open(anew=True)
    page.wait(SETTLED)
    return page


def outputs(page, section):
    return page.run(OUTPUTS.format(section))


def text(page, selector):
    return plain(page.run(f"document.querySelector({selector!r}).textContent"))


def check(texts, expected):
    """Check that the texts show the expected numbers, and that no text is left out."""
    assert set(texts) - COMPUTING_TIMES == set(expected)
    for name, values in expected.items():
        assert shows(texts[name], *values), (name, texts[name], values)


def opening_numbers(exponent):
    table = {
        f"{key}-{row}": values
        for key, law in LAWS.items()
        for row, values in page_numbers.opening_table(law, exponent).items()
    }
    accuracy = {"start": [0.1], "closed-form-steps": [closed_form().statistics.steps]}
    for word, power in (("coarse", -3), ("fine", -4)):
        for key, law in LAWS.items():
            run = opening_run(law, power)
            accuracy[f"{word}-{key}-steps"] = [run.statistics.steps]
            accuracy[f"{word}-{key}-off"] = [1e3 * abs(run["x"][-1] - closed_form()["x"][-1])]  # in mm
    return table | accuracy


def check_opening(page, exponent):
    check(outputs(page, "opening"), opening_numbers(exponent))
    true, sign = (opening_run(law, exponent) for law in LAWS.values())
    for key, run in (("true", true), ("sign", sign)):
        assert text(page, f"#opening-{key}-count") == str(run.statistics.steps)
    verdict = text(page, "#opening-verdict")
    rest, creep = true.events.t[-1], page_numbers.creep(sign)
    assert shows(verdict, SCENE_STOP, true.statistics.steps, rest, sign.statistics.steps, creep), verdict


def test_each_number_of_the_opening_is_that_of_runs_of_the_fmu(still):
    check_opening(still, -3)


def test_another_tolerance_shows_the_errors_and_steps_of_both_laws(still):
    for key, exponent in (("Home", -4), ("End", -2)):
        still.run(
            f"document.querySelector('#opening .rtol').dispatchEvent(new KeyboardEvent('keydown', {{ key: '{key}' }}))"
        )
        still.wait(SETTLED)
        check_opening(still, exponent)


def test_the_claims_of_the_opening_hold():
    """Title: under sign(v) the speed is never zero. Accuracy: the tolerance sets the error, the law sets the work."""
    stop = closed_form().events.t[-1]
    assert abs(stop + 0.3 - SCENE_STOP) < 0.05  # "in the 0.3 s after that"
    errors = {}
    for exponent in (-2, -3, -4):
        true, sign = (opening_run(law, exponent) for law in LAWS.values())
        assert np.all(sign["v"][1:] != 0.0)
        assert np.all(np.asarray(sign["mode"][1:]) != 0)
        at_rest = true.time > true.events.t[-1]
        assert np.all(true["v"][at_rest] == 0.0)
        assert np.all(true["F_friction"][at_rest] == true["F_spring"][at_rest])
        assert np.all(np.abs(sign["F_friction"][1:]) == closed_form().parameters["f"])
        assert sign.statistics.steps > 10 * true.statistics.steps
        errors[exponent] = [abs(run["x"][-1] - closed_form()["x"][-1]) for run in (true, sign)]
    for exponent in (-3, -4):
        assert errors[exponent][1] == pytest.approx(errors[exponent][0], rel=0.1)
    assert max(errors[-4]) < 0.2 * min(errors[-3])
    x0, band = 0.1, closed_form().parameters["f"] / closed_form().parameters["k"]
    half_swings = np.ceil((x0 - band) / (2 * band))
    assert abs(closed_form()["x"][-1]) == pytest.approx(
        abs(x0 - 2 * band * half_swings), abs=1e-16
    )  # exact to rounding


def test_the_tools_that_the_opening_names_hold_exactly_in_the_comparison_of_engines(page):
    row = r"^\| ([^|]+?) \| ([^|/]+) / ([^|]+?) \| [^|]+ \| [^|]+ \| [^|]+ \| \d+ \|$"  # engine, both creeps
    rows = re.findall(row, (DOCS / "explanation" / "rivals.md").read_text(encoding="utf-8"), re.M)
    exact = {engine for engine, *creeps in rows if {*map(str.strip, creeps)} == {"0"}}
    assert {"scipy", "PathSim", "Drake, witness functions", "FMU"} <= exact
    assert "scipy, PathSim and Drake do" in text(page, "#opening-others")


def test_each_number_of_the_stories_is_that_of_runs_of_the_fmus(still):
    chatter = {
        f"{key}-{name}": values
        for key, law in LAWS.items()
        for name, values in page_numbers.chatter_numbers(law, -3).items()
    }
    table = page_numbers.opening_table("sign", -3)
    check(outputs(still, "chatters"), chatter | {name: table[name] for name in ("friction", "spring")})
    for story in ("stops", "squeaks", "creeps", "swings"):
        check(outputs(still, story), getattr(page_numbers, f"{story}_numbers")())


def test_a_steeper_curve_creeps_less_and_costs_more(still):
    numbers = {x_m: page_numbers.creeps_numbers(x_m) for x_m in (0.01, 0.001)}
    assert numbers[0.001]["creep"][0] < 0.3 * numbers[0.01]["creep"][0]
    assert numbers[0.001]["steps"][0] > 3 * numbers[0.01]["steps"][0]
    still.run(
        "(element => { element.dispatchEvent(new KeyboardEvent('keydown', { key: 'Home' })) })"
        "(document.querySelector('#creeps .pull[data-key=x_m]'))"
    )
    expected = numbers[0.001]
    shown = r"document.querySelector('#creeps [data-out=steps]').textContent.replace(/\D/g, '')"
    still.wait(f"{shown} === '{expected['steps'][0]}'")
    check(outputs(still, "creeps"), expected)


def test_each_number_in_the_drawings_is_that_of_runs_of_the_fmus(still):
    texts = [plain(item) for item in still.run(TEXTS)]
    true, sign = (opening_run(law, -3) for law in LAWS.values())
    swing = page_numbers.swings_numbers()
    sled = page_numbers.simulate("stickslip", stop=page_numbers.BELT_STOP)
    smooth = page_numbers.simulate("pacejka", stop=page_numbers.BELT_STOP)
    pendulum = page_numbers.simulate("pendulum", {"theta0": np.radians(10)}, stop=page_numbers.SWING_STOP)
    parameters = sled.parameters
    band = closed_form().parameters["f"] / closed_form().parameters["k"]
    belt_band = parameters["mu_s"] * parameters["m"] * parameters["g"] / parameters["k"]
    row = int(np.argmax(sign.time >= page_numbers.CLOSE_UP_FROM))
    for beginning, values in {
        "true sticking: 2": [true.statistics.steps],
        "sign(v): 3": [sign.statistics.steps],
        "true: ": [true["F_friction"][-1]],
        "sign(v): 0": [sign["F_friction"][-1]],
        "needed: ": [sign["F_spring"][row]],
        "a straight line": [4 * band],
        "holds with 0": [abs(closed_form()["F_friction"][-1])],
        "holds with 5": [abs(sled["F_friction"][-1])],
        "holds 0": [abs(pendulum["T_friction"][-1])],
        "creeps at": [smooth["v"][-1]],
        "friction can hold the spring within": [band],
        "friction can hold the spring: ±3": [band],
        "friction can hold the spring: ±1": [belt_band],
        "±0": swing["band"],
    }.items():
        (shown,) = {item for item in texts if item.startswith(beginning)}
        assert shows(shown, *values), (shown, values)


def test_no_number_is_written_in_the_source_of_the_text_except_settings():
    """Settings: ode23, the tolerances, 0.3 s after the stop, and 12 s, the length of two stories."""
    source = re.sub(
        r"<svg.*?</svg>|<[^>]*>", " ", (HERE / "stories.html").read_text(encoding="utf-8").replace("&nbsp;", " ")
    )
    assert set(re.findall(r"\d+(?:\.\d+)?", plain(source))) == {"23", "10", "3", "4", "0.3", "12", "0", "0.00"}
    assert page_numbers.BELT_STOP == 12.0


@pytest.mark.parametrize(
    ("story", "keys", "sentence"),
    [
        ("stops", {"x0": "Home"}, "the mass stays where it is, 0.0 mm off centre."),
        ("stops", {"f": "End"}, "half-swing"),
        ("squeaks", {"v_driver": "Home"}, "so it overshoots: no slip in the first 12 s."),
        ("squeaks", {"v_driver": "End", "mu_d": "Home"}, "lasting"),
        ("squeaks", {"mu_d": "End"}, "lasting"),
        ("creeps", {"v_driver": "Home"}, "mm"),
        ("swings", {"theta0": "Home"}, "it stays where it is, 0.00° off the vertical;"),
        ("swings", {"theta0": "End", "mu": "Home"}, "it still swings when the picture ends;"),
        ("swings", {"mu": "End"}, "off the vertical;"),
    ],
)
def test_the_sentences_are_complete_at_the_ends_of_all_ranges(still, story, keys, sentence):
    for key, name in keys.items():
        still.run(
            f"document.querySelector('#{story} .pull[data-key={key}]')"
            f".dispatchEvent(new KeyboardEvent('keydown', {{ key: '{name}' }}))"
        )
    shown = text(still, f"#{story} .prose p")
    assert sentence in shown
    assert not re.search(r"NaN|undefined|\N{EN DASH}|\b1 (half-swings|slips)|  |\( | ,| \.", shown)


def test_sentences_wait_for_their_numbers(page):
    """From the first frame on, a paragraph is shown only if all of its numbers are there."""
    page.browser.size(1280)
    watch = (
        "globalThis.unfinished = []; const isShown = output => output.checkVisibility({ visibilityProperty: true });"
        "const look = () => { for (const output of document.querySelectorAll('#stories p output'))"
        "if (!output.textContent && isShown(output)) unfinished.push(output.dataset.out);"
        "requestAnimationFrame(look) }; requestAnimationFrame(look)"
    )
    script = page.browser.call("Page.addScriptToEvaluateOnNewDocument", source=watch)
    page.open(anew=True)
    page.browser.call("Page.removeScriptToEvaluateOnNewDocument", **script)
    page.wait("!document.querySelector('.pending')")
    assert page.run("unfinished") == []
    assert page.run("[...document.querySelectorAll('#stories p output')].every(output => output.textContent)")
