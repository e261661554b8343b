"""Sliders, fields and lists of the live page: what they set, and what they refuse."""

import re
from math import pi, sqrt

import pytest
from models import STICKSLIP_IN_CI, declarations_of, parameters


@pytest.mark.parametrize("name", STICKSLIP_IN_CI)
def test_every_parameter_has_a_slider_and_a_field_with_its_start_value_and_unit(page, name):
    page.open(f".model={name}")
    for variable, meaning in parameters(name).items():
        if variable == "solver.rtol":  # a list
            continue
        field = f"document.getElementById('field-{variable}')"
        factor = 180 / pi if meaning.display else 1.0
        assert page.run(f"Number({field}.value)") == pytest.approx(meaning.start * factor, rel=1e-6)
        unit = meaning.display or meaning.unit_suffix.strip()
        assert page.run(f"{field}.closest('.field').querySelector('.unit').textContent") == (
            unit.replace("2", "²").replace(".", "·")
        )
        assert page.run(f"{field}.closest('.field').querySelector('input[type=range]').max") == "400"
        if meaning.display:
            page.type_number(variable, "10.0")
            assert page.run(f"app.state().values[{variable!r}]") == pytest.approx(10.0 / factor)


def test_a_slider_changes_the_run_and_shows_the_value_used(page):
    page.open(".model=stickslip")
    page.run(
        "(() => { const e = document.querySelector('#field-mu_d').closest('.field').querySelector('input[type=range]');"
        "e.value = 100; e.dispatchEvent(new Event('input')) })()"
    )
    mu = page.when_done("app.state().values.mu_d")
    assert 0 < mu < 0.6
    assert page.run("Number(document.getElementById('field-mu_d').value)") == mu
    d = {name: meaning.start for name, meaning in declarations_of("stickslip").items()}
    omega = sqrt(d["k"] / d["m"])
    peak = d["v_driver"] + sqrt(((d["mu_s"] - mu) * d["m"] * d["g"] / d["k"] * omega) ** 2 + d["v_driver"] ** 2)
    assert page.run("Math.max(...app.runs.main.columns.v)") == pytest.approx(peak, rel=1e-3)


def test_the_next_frame_shows_a_changed_parameter(page):
    page.open(".model=coulomb")
    values = page.run(
        "new Promise(done => { const e = document.querySelector('.field:has(#field-x0) input[type=range]');"
        "e.value = 390; e.dispatchEvent(new Event('input')); requestAnimationFrame(() =>"
        "done([app.plots.get('x').plot.content.curves.at(-1).y[0], app.state().values.x0])) })"
    )
    assert values[0] == values[1] > 0.1


def test_the_last_of_two_models_chosen_at_once_is_shown(page):
    page.open(".model=coulomb")
    for first, last in (("pacejka", "smd"), ("smd", "pendulum"), ("stickslip", "smd")):  # known, but not yet compiled
        page.run(f"for (const name of [{first!r}, {last!r}]) document.querySelector(`input[value=${{name}}]`).click()")
        assert page.when_done("app.state().model") == last == page.run("document.querySelector(':checked').value")


def test_a_refused_value_shows_the_message_of_the_fmu(page):
    page.open(".model=stickslip")
    page.type_number("mu_d", "0.95")
    alert = "document.getElementById('alert')"
    assert "mu_d is 0.95, above mu_s = 0.9" in page.run(f"{alert}.textContent")
    page.type_number("mu_d", "0.5")
    assert page.run(f"{alert}.hidden")
    page.type_number("m", "-1")
    assert "m = -1.0 kg is refused: mass of the sled must be above 0.0 kg" in page.run(f"{alert}.textContent")


SLIDE = (
    "(e => {{ e.value = {}; e.dispatchEvent(new Event('input')); return e.value }})"
    "(document.querySelector('.field:has(#field-{}) input[type=range]'))"
)


def test_a_slider_stops_where_the_model_would_refuse_its_value_and_says_why(page):
    page.open(".model=stickslip")
    alert = "document.getElementById('alert')"
    stop_position = int(page.run(SLIDE.format(400, "mu_d")))
    mu_d = page.when_done("app.state().values.mu_d")
    assert 0.85 < mu_d <= 0.9
    assert float(page.run("document.getElementById('field-mu_d').value")) == mu_d
    text = page.run(f"{alert}.textContent")
    for part in ("above mu_s = 0.9", "lower mu_d or raise mu_s", f"the slider stops at mu_d = {mu_d:.4g}"):
        assert part in text
    assert page.run("app.runs.main.failure") == ""
    assert page.run(SLIDE.format(stop_position - 20, "mu_d")) == str(stop_position - 20)
    assert page.when_done(f"{alert}.hidden")
    page.run(SLIDE.format(0, "mu_s"))  # the other parameter of the condition stops likewise
    assert page.when_done("app.state().values.mu_s >= app.state().values.mu_d")
    page.open(".model=stickslip&mu_d=0.95")  # a refused state from a link is reported, and can be left
    assert "above mu_s = 0.9" in page.run(f"{alert}.textContent")
    page.type_number("mu_d", "0.94")
    page.type_number("mu_s", "0.96")
    assert page.run(f"{alert}.hidden")


def test_an_invalid_number_is_reported_and_changes_nothing(page):
    page.open(".model=stickslip&m=20")
    field, alert = "document.getElementById('field-m').value", "document.getElementById('alert')"
    for name, text, sentence in (
        ("m", "", "m must be a number; it remains 20 kg."),
        (".stop", "-1", "it remains 16 s"),
    ):
        page.type_number(name, text)
        assert sentence in page.run(f"{alert}.textContent")
        assert page.run(f"[{field}, app.state().values, app.state().stop]") == ["20", {"m": 20}, 16]
    page.type_number("m", "21")
    assert page.run(f"{alert}.hidden")


def test_a_decimal_comma_is_accepted_or_refused_but_never_read_as_another_number(page):
    page.open(".model=coulomb&f=0.75")
    for text, value in (
        ("0,25", 0.25),
        ("1.000,5", None),
        ("0.6", 0.6),
        ("1,000.5", None),
        ("2,5e-1", 0.25),
        ("1,2,3", None),
        ("0.75", 0.75),
        ("2x", None),
    ):
        before = page.run("app.state().values.f")
        page.run("(e => { e.focus(); e.select() })(document.getElementById('field-f'))")
        page.browser.call("Input.insertText", text=text)  # as typed, not as set by a script
        page.run("document.getElementById('field-f').blur()")
        assert page.when_done("app.state().values.f") == (value or before), text
        assert page.run("document.getElementById('alert').hidden") == (value is not None), text


@pytest.mark.parametrize("name", STICKSLIP_IN_CI)
def test_extreme_numbers_are_reported_or_drawn_and_never_shown_as_nan(page, name):
    page.open(f".model={name}")
    body = page.run("app.library.models.get(app.state().model).bodies[0]")
    figures = "document.getElementById('mechanism').innerHTML + document.querySelector('#panels').textContent"
    for variable, text in (
        ("start", "1e308"),
        ("start", "1e-320"),
        ("start", "0"),
        ("input", "-1e308"),
        ("input", "0"),
    ):
        page.type_number(body[variable], text)
        assert not re.search("NaN|Infinity|undefined", page.when_done(figures)), (variable, text)
    assert page.run("document.getElementById('alert').hidden")
