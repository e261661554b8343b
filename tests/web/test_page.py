"""The page as a visitor uses it: actions have visible effects, nothing is loaded or logged, every control has a
name."""

import json
import re
from dataclasses import replace
from html import escape
from math import pi, sqrt
from urllib.parse import parse_qsl, urlencode

import native_fmus
import pytest
import web_page
from build_cache import ROOT
from commands import build
from models import EXAMPLE_MODELS, LARGER_MODELS, MODELS, declared, parameters

from fmus.packaging.model_lookup import find_model
from fmus.packaging.web.html_page import HERE, MODULES
from fmus.packaging.web.model_json import list_bodies
from harness.running.fmi2 import simulate
from harness.scenes.scene import load_scene, shipped_scenes
from harness.studies.run.study import ANALYSES

WIDTHS = (360, 768, 1280)
CONTROLS = {"button", "checkbox", "combobox", "radio", "slider", "spinbutton", "textbox", "link", "DisclosureTriangle"}


@pytest.fixture(autouse=True)
def quiet(browser):
    """No test may write to the console or request anything but the page itself."""
    browser.console.clear()
    yield
    assert browser.console == []
    assert {
        address.split("#")[0] for address in browser.requested_urls if not address.startswith(("data:", "blob:"))
    } <= {address.split("#")[0] for address in browser.requested_urls[:1]}


# ---- the file


def test_five_models_take_less_than_600_kb_and_load_nothing(page):
    text = page.file.read_text(encoding="utf-8")
    assert len(text.encode()) < 600_000
    assert "default-src 'none'" in text
    assert not re.findall(r"(?:src|href)\s*=\s*[\"'](?!data:|#)", text)
    page.open(anew=True)
    refused = "fetch('data:text/plain,x').then(() => 'came', () => 'refused')"
    assert page.run(refused) == "refused"
    assert page.browser.console.pop()  # reported by the content security policy
    assert len(page.browser.console) <= 1
    page.browser.console.clear()


def test_a_model_unsuitable_for_the_page_is_reported_in_one_sentence(tmp_path):
    for words, sentence in (
        (("--web", "--native"), "--web writes a page, not FMUs: remove --native, --platform and --fmi 3."),
        (("--web", "nobody"), "There is no model 'nobody'"),
        (("--web", "smd", "--law", "sign"), "smd has no friction law 'sign'"),
    ):
        done = build(*words, "--out", str(tmp_path))
        assert done.returncode
        assert sentence in done.stderr
        assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_every_module_imports_existing_names_from_earlier_modules_only():
    exports = {}
    assert {path.stem for path in (HERE / "script").glob("*.js")} == set(MODULES)
    for name in MODULES:
        text = (HERE / "script" / f"{name}.js").read_text(encoding="utf-8")
        for names, source in re.findall(r'^import \{ ([^}]+) \} from "\./(\w+)\.js";$', text, re.M):
            assert set(names.split(", ")) <= exports[source], (name, source)
            body = re.sub(r"^import .*$", "", text, flags=re.M)
            assert all(re.search(rf"\b{item}\b", body) for item in names.split(", ")), (name, names)
        exports[name] = set(re.findall(r"^export (?:async )?(?:function|class|const) (\w+)", text, re.M))


# ---- content


@pytest.mark.parametrize("name", MODELS)
def test_no_width_makes_it_scroll_sideways_and_every_control_has_a_name(page, name):
    page.open(f".model={name}")
    for width in WIDTHS:
        page.browser.size(width)
        assert page.run("document.documentElement.scrollWidth") <= width
    tree = page.browser.call("Accessibility.getFullAXTree")["nodes"]
    controls = [node for node in tree if node.get("role", {}).get("value") in CONTROLS and not node["ignored"]]
    nameless = [node for node in controls if not node.get("name", {}).get("value", "").strip()]
    assert nameless == []
    names = " ".join(node["name"]["value"] for node in controls)
    for variable, meaning in parameters(name).items():
        if "." not in variable:
            assert meaning.text in names
    assert "Mechanism:" in json.dumps(tree)


@pytest.mark.parametrize("name", MODELS)
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


@pytest.mark.parametrize("name", MODELS)
def test_the_default_run_shows_a_rest_that_begins_soon_after_the_default_stop_time(page, name):
    page.open(f".model={name}")
    stop = page.run("app.session.models.get(app.state().model).stop")
    shown, rest = page.run("[app.state().stop, app.session.runs.main.restTime() ?? null]")
    assert stop <= shown <= 1.2 * stop
    if name == "coulomb":  # at rest after eight full swings
        assert rest == pytest.approx(8 * 2 * pi / sqrt(157.9), abs=1e-9)
        assert stop == 4 < rest < shown - 0.1
    page.open(".preset=coulomb")
    assert page.run("app.state().stop") == 4


SHIFTS = (
    "globalThis.shift = 0; new PerformanceObserver(list => { for (const entry of list.getEntries())"
    "if (!entry.hadRecentInput) shift += entry.value }).observe({ type: 'layout-shift', buffered: true })"
)


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_shifts_while_the_page_appears(page, width):
    page.browser.size(width)
    script = page.browser.call("Page.addScriptToEvaluateOnNewDocument", source=SHIFTS)
    page.open(".model=pendulum&.compare=pendulum", anew=True)
    page.browser.call("Page.removeScriptToEvaluateOnNewDocument", **script)
    page.wait("document.querySelector('#tables caption')")
    page.run("new Promise(done => setTimeout(done, 100))")
    assert page.run("shift") < 0.1


@pytest.mark.parametrize("name", MODELS)
def test_the_legend_explains_every_line_shading_and_mark(page, name):
    page.open(f".model={name}&.compare={name}&.change=1 {'k' if 'k' in declared(name) else 'm'} 1")
    page.check("envelopes", True)
    page.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    legend = page.run("document.getElementById('legend').innerText")
    drawn = page.run(
        "[...app.plots.values()].filter(({ figure }) => !figure.hidden).flatMap(({ panel }) => panel.content.curves)"
        ".filter(({ x }) => x.length).map(({ legend }) => legend ?? null)"
    )
    page.check("envelopes", False)
    assert {"run", "second run", "without the changes"} <= {*drawn}
    assert all(text in legend for text in drawn)
    assert "change of a value" in legend
    has_modes = page.run("app.session.models.get(app.state().model).contacts.length > 0")
    assert ("sticks" in legend) == has_modes


def test_friction_has_one_sign_in_diagram_arrow_and_titles(page):
    """The arrow is the friction on the body, opposing the motion; the diagram shows its negative, and both say so."""
    page.open(".model=coulomb")
    page.seek(0.1)
    page.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    force, speed = page.run("['F_friction', 'v'].map(name => app.session.runs.main.at(name, 0.1))")
    arrow = page.run("document.querySelector('#mechanism .force').getAttribute('d')")
    length = float(re.match(r"M\S+ \S+h(\S+)m", arrow)[1])
    assert speed < 0
    assert force == -0.5
    assert length > 0
    assert "the arrow is \N{MINUS SIGN}F_friction" in page.run("document.getElementById('panel-F_friction').innerText")
    assert "\N{MINUS SIGN}F_friction" in page.run("document.getElementById('legend').innerText")


def test_sticking_has_one_colour_and_slipping_another_in_mechanism_and_diagrams(page):
    style = "getComputedStyle(document.documentElement).getPropertyValue({!r})"
    body = "getComputedStyle(document.querySelector('#mechanism .body rect')).fill"
    page.open(".model=coulomb")
    for t, name in ((0.1, "--slip"), (4.2, "--stick")):
        page.seek(t)
        page.run("new Promise(done => setTimeout(done, 300))")  # the colour has a transition
        colour = page.run(style.format(name)).lstrip("#")
        assert page.run(body) == f"rgb({', '.join(str(int(colour[i : i + 2], 16)) for i in (0, 2, 4))})"


@pytest.mark.parametrize("width", [360, 1280])
def test_headings_of_tables_have_text_and_regions_that_scroll_take_the_focus(page, width):
    """These two kinds were found by axe-core 4; its other rules found nothing."""
    page.browser.size(width)
    page.open(".model=coulomb&.compare=pacejka")
    page.wait("document.querySelector('#tables caption')")
    assert page.run("[...document.querySelectorAll('th')].filter(cell => !cell.textContent).length") == 0
    regions = page.run(
        "[...document.querySelectorAll('body *')].filter(e => /auto|scroll/.test(getComputedStyle(e).overflowX)"
        " && e.scrollWidth > e.clientWidth + 1 && e.tabIndex < 0).map(e => e.id || e.className || e.tagName)"
    )
    page.browser.size(1280)
    assert regions == []


# ---- interaction


def test_a_slider_changes_the_run_and_shows_the_value_used(page):
    page.open(".model=stickslip")
    page.run(
        "(() => { const e = document.querySelector('#field-mu_d').closest('.field').querySelector('input[type=range]');"
        "e.value = 100; e.dispatchEvent(new Event('input')) })()"
    )
    mu = page.when_done("app.state().values.mu_d")
    assert 0 < mu < 0.6
    assert page.run("Number(document.getElementById('field-mu_d').value)") == mu
    d = {name: meaning.start for name, meaning in declared("stickslip").items()}
    omega = sqrt(d["k"] / d["m"])
    peak = d["v_driver"] + sqrt(((d["mu_s"] - mu) * d["m"] * d["g"] / d["k"] * omega) ** 2 + d["v_driver"] ** 2)
    assert page.run("Math.max(...app.session.runs.main.columns.v)") == pytest.approx(peak, rel=1e-3)


def test_the_next_frame_shows_a_changed_parameter(page):
    page.open(".model=coulomb")
    shown = page.run(
        "new Promise(done => { const before = app.plots.get('x').plot.paints;"
        "const e = document.querySelector('#field-x0').closest('.field').querySelector('input[type=range]');"
        "e.value = 390; e.dispatchEvent(new Event('input'));"
        "requestAnimationFrame(() => { const { plot, panel } = app.plots.get('x');"
        "done([plot.paints - before, panel.content.curves.at(-1).y[0], app.state().values.x0]) }) })"
    )
    assert shown[0] == 1
    assert shown[1] == shown[2] > 0.1


def test_a_slow_method_is_previewed_with_a_fast_one(page):
    """For any run time: dragging a slider shows the last value up to the end of the run."""
    page.open(".model=pacejka&x_m=0.001&solver.method=2&solver.rtol=0.001")
    values = page.run(
        "new Promise(done => { const e = document.querySelector('.field:has(#field-k) [type=range]');"
        "for (const at of [100, 200, 300]) { e.value = at; e.dispatchEvent(new Event('input')) }"
        "requestAnimationFrame(() => { const { main, preview } = app.session.runs;"
        "const [ghost, own] = app.plots.get('x').panel.content.curves.slice(-2);"
        "done([main.done, main.setting.values.k, preview.setting.values, ghost.x.at(-1), own.x.at(-1)]) }) })"
    )
    done, k, quick, reached, full = values
    assert (done, quick) == (False, {"x_m": 0.001, "k": k})
    assert full < reached <= 16
    assert page.when_done("app.plots.get('x').panel.content.curves.slice(-2).map(curve => curve.x.at(-1))") == [
        16,
        16,
    ]
    assert page.run("app.session.runs.main.setting.values.k") == k


def test_only_one_model_is_compiled_before_the_first_picture(page):
    count = "const { instantiate } = WebAssembly; globalThis.compiled = 0;"
    count += "WebAssembly.instantiate = (...all) => (compiled++, instantiate(...all))"
    script = page.browser.call("Page.addScriptToEvaluateOnNewDocument", source=count)
    page.open(anew=True)
    page.browser.call("Page.removeScriptToEvaluateOnNewDocument", **script)
    assert page.run("compiled") == 1
    assert page.run("app.plots.get('x').plot.paints") > 0


def test_the_last_of_two_models_chosen_at_once_is_shown(page):
    page.open(".model=coulomb")
    for first, last in (("pacejka", "smd"), ("smd", "pendulum"), ("stickslip", "smd")):  # known, but not yet compiled
        page.run(f"for (const name of [{first!r}, {last!r}]) document.querySelector(`input[value=${{name}}]`).click()")
        page.wait(f"app.state().model === {last!r}")
        page.run("new Promise(done => setTimeout(done, 100))")
        assert page.when_done("app.state().model") == last == page.run("document.querySelector(':checked').value")


def test_comparing_two_laws_shows_the_difference_and_the_counters(page):
    page.open(".model=coulomb")
    page.choose("comparison", "coulomb")
    assert page.run("app.session.runs.comparison.setting.values.friction") == 2
    page.wait("document.getElementById('tables').textContent.includes('largest difference in x')")
    apart = page.run(
        "(() => { const { main, comparison } = app.session.runs; return Math.max(...main.grid.map((row, i) => "
        "Math.abs(main.columns.x[row] - comparison.columns.x[comparison.grid[i]]))) })()"
    )
    assert 1e-6 < apart < 1e-2
    rows = page.table("Cost and accuracy")
    assert web_page.number(rows["largest difference in x"][1]) == pytest.approx(apart, rel=1e-2)
    assert rows["largest error of x against the closed form"][0] == "closed form"
    one, other = (int(cell) for cell in rows["right-hand side evaluations"])
    assert other > 20 * one
    assert not page.run("document.getElementById('panel-.error').hidden")


@pytest.mark.parametrize(
    ("link", "role"),
    [
        (".model=stickslip&mu_d=0.9&.compare=pacejka", "second run (pacejka"),  # which needs mu_d below mu_s
        (
            ".model=coulomb&.compare=coulomb&.compare.friction=2&.compare.solver.method=2&.stop=20",
            "second run (coulomb",
        ),
        (".model=coulomb&friction=2&solver.method=2&.stop=20&.compare=coulomb", "run (coulomb"),
    ],
)
def test_a_failed_run_of_a_comparison_is_named_and_has_no_error(page, link, role):
    page.open(link)
    page.wait("document.getElementById('tables').textContent.includes('fails')")
    assert page.run("document.getElementById('alert').textContent").startswith(f"The {role}")
    assert not any("difference" in row or "error" in row for row in page.table("Cost and accuracy"))
    assert page.run("app.plots.get('.error')?.figure.hidden ?? true")
    failed = "comparison" if "second" in role else "main"
    *_, ends = page.run(f"[0, ...app.session.runs.{failed}.time]")
    curve = "app.plots.get('x').panel.content.curves.find(curve => curve.colour === {!r})"
    shown = page.run(f"{curve.format('b' if 'second' in role else 'a')}?.x.at(-1) ?? 0")
    assert shown == ends < page.run("app.state().stop")


def test_another_model_keeps_values_of_the_same_names(page):
    page.open(".model=stickslip&k=500&.compare=pacejka&.compare.x_m=0.005")
    assert page.run("app.session.runs.comparison.setting.values.k") == 500
    assert page.run("app.session.runs.comparison.setting.values.x_m") == 0.005
    assert page.run("app.session.runs.comparison.columns.v.some((v, i) => i > 99 && v > 0 && v < 0.01)")  # it creeps


def test_a_change_during_playback_acts_from_then_on_only(page):
    page.open(".model=smd")
    positions = page.run("[...app.session.runs.main.columns.x]")
    page.click("#play")
    page.wait("app.state().t > 0.2")
    page.type_number("c", "20")
    page.click("#play")
    (change,) = page.run("app.state().changes")
    assert change["name"] == "c"
    assert 0.2 < change["t"] < 4
    assert page.run("app.state().values") == {}
    now = page.when_done("({ t: app.session.runs.main.time, x: app.session.runs.main.columns.x })")
    before = [x for t, x in zip(now["t"], now["x"], strict=True) if t < change["t"]]
    assert before == positions[: len(before)]
    assert max(map(abs, now["x"][-200:])) < 0.1 * max(map(abs, positions[-200:]))
    assert page.run("app.session.runs.unchanged.columns.x.length") == len(positions)


def test_playback_repaints_no_curve_and_a_curve_is_limited_by_the_pixels(page):
    page.open(".model=pacejka&x_m=0.001&solver.method=2&solver.rtol=0.001&.t=1")
    assert page.run("app.session.runs.main.time.length") > 60000
    painted = "[...app.plots.values()].reduce((sum, { plot }) => sum + plot.paints, 0)"
    before = page.run(painted)
    page.click("#play")
    page.wait("app.state().t > 1.2")
    page.click("#play")
    assert page.run(painted) == before
    width = page.run("app.plots.get('.step').plot.host.clientWidth")
    count = (
        "(() => { const { plot, panel } = app.plots.get('.step'); const [curve] = panel.content.curves;"
        "let points = 0; const context = { lineTo: () => points++ };"
        "const all = new Proxy(context, { get: (it, key) => it[key] ?? (() => ({ width: 0 })) });"
        "plot.curve(all, curve, plot.scales(plot.host.clientWidth, plot.host.clientHeight)); return points })()"
    )
    assert width < page.run(count) < 4 * width


@pytest.mark.parametrize("name", MODELS)
def test_a_dragged_body_starts_where_it_is_released(page, name):
    page.browser.size(1280)
    page.open(f".model={name}")
    body = page.run("app.session.models.get(app.state().model).bodies[0]")
    x, y = page.middle("#mechanism .body")
    page.browser.mouse("Pressed", x, y)
    page.browser.mouse("Moved", x + 30, y)
    page.browser.mouse("Moved", x + 60, y)
    page.wait(f"app.state().values[{body['start']!r}] !== undefined")
    start = page.run(f"app.state().values[{body['start']!r}]")
    page.browser.mouse("Released", x + 60, y, buttons=0)
    page.wait("app.state().t > 0")
    page.click("#play")
    assert start > declared(name)[body["start"]].start
    assert page.when_done(f"app.session.runs.main.columns[{body['position']!r}][0]") == start


@pytest.mark.parametrize("name", MODELS)
def test_dragging_a_moving_body_applies_a_force_until_release(page, name):
    page.browser.size(1280)
    page.open(f".model={name}&.t=0.3")
    body = page.run("app.session.models.get(app.state().model).bodies[0]")
    x, y = page.middle("#mechanism .body")
    page.browser.mouse("Pressed", x, y)
    page.browser.mouse("Moved", x + 80, y)
    page.wait("app.state().changes.length > 0")
    page.browser.mouse("Released", x + 80, y, buttons=0)
    page.click("#play")
    changes = page.when_done("app.state().changes")
    assert {change["name"] for change in changes} == {body["input"]}
    assert any(change["value"] for change in changes)
    assert changes[-1]["value"] == 0
    apart = "app.session.runs.main.columns[p].at(-1) !== app.session.runs.unchanged.columns[p].at(-1)"
    assert page.run(f"(p => {apart})({body['position']!r})")


def test_dragging_with_a_slow_method_never_goes_back_in_time(page):
    """The next force waits for the previous run."""
    page.browser.size(1280)
    page.open(".model=pacejka&x_m=0.001&solver.method=2&solver.rtol=0.001&.t=8")
    x, y = page.middle("#mechanism .body")
    page.browser.mouse("Pressed", x, y)
    for way in (40, 80, 120):
        page.browser.mouse("Moved", x + way, y)
    page.wait("app.state().changes.length > 1")
    page.browser.mouse("Released", x + 120, y, buttons=0)
    page.click("#play")
    first, *_, last = page.when_done("app.state().changes")
    assert 8 <= first["t"] < last["t"] <= page.run("app.state().t") + 0.1
    assert (first["name"], last["value"]) == ("F_ext", 0)


def test_a_kick_is_a_push_of_finite_duration(page):
    page.open(".model=stickslip&.t=1")
    page.click("#kick")
    first, last = page.when_done("app.state().changes")
    assert (first["name"], first["t"], last["value"]) == ("F_ext", 1, 0)
    assert 1 < last["t"] < 2
    assert page.run("Math.max(...app.session.runs.main.columns.v.slice(100, 300))") > 0


def test_a_link_stores_the_complete_setup(page):
    page.open(".model=stickslip")
    page.type_number("mu_d", "0.45")
    page.choose("comparison", "pacejka")
    page.seek(5.0)
    page.check("live", True)
    page.type_number("v_driver", "0.05")
    page.wait("location.hash.includes('v_driver')")
    hash, state = page.run("location.hash.slice(1)"), page.run("app.state()")
    end = page.run("Object.values(app.session.runs).map(run => run.columns.x.at(-1))")
    page.open(hash, anew=True)
    assert page.run("app.state()") == state
    assert page.run("Object.values(app.session.runs).map(run => run.columns.x.at(-1))") == end
    page.open(".preset=pacejka-0.001")
    assert page.run("app.state().values.x_m") == 0.001
    wrong = "mu_d=0.3&solver.method=7&friction=1.5&c=&.stop=&.change=1 nothing 2&.change=x k 2"
    page.open(f".model=coulomb&k=100&{wrong}")
    assert page.run("app.state()") | {"values": {"k": 100}, "changes": [], "stop": 4.3} == page.run("app.state()")
    result = "document.getElementById('status').textContent"
    page.wait(f"{result}.includes('unknown settings: mu_d, solver.method, friction, c, 1 nothing 2, x k 2. coulomb')")
    page.open(".model=nobody")
    page.wait(f"{result}.includes('unknown settings: nobody. coulomb')")
    page.run("Object.defineProperty(navigator, 'clipboard', { value: undefined })")
    page.click("#link")
    page.wait(f"{result}.includes('The link is in the address bar')")
    assert "works on this computer only" in page.run(result)  # a local file


def test_a_link_shows_the_same_when_defaults_have_changed_and_names_another_version(page):
    page.open(".model=coulomb&f=0.25&.compare=pacejka")
    page.wait("location.hash.includes('.version')")
    link = dict(parse_qsl(page.run("location.hash.slice(1)")))
    assert link[".version"] == page.run("app.session.version")
    assert {*parameters("coulomb"), "F_ext", ".stop"} <= {*link}
    assert {f".compare.{name}" for name in parameters("pacejka")} <= {*link}
    page.run("for (const v of app.session.models.get('coulomb').variables) if (v.name === 'k') v.start = 1")
    page.open(urlencode(link | {".version": "0.0.1"}))
    assert page.run("app.session.runs.main.setting.values.k") == 157.9
    page.wait("document.getElementById('status').textContent.includes('was made with version 0.0.1')")
    page.open(anew=True)


def test_a_link_opened_while_the_address_is_written_is_not_lost(page):
    page.open(".model=smd")
    page.wait("location.hash.includes('stop')")
    page.run("(own => { location.hash = '.model=coulomb'; history.replaceState(null, '', own) })(location.href)")
    page.wait("app.state().model === 'coulomb'")


def test_an_embedded_page_runs_without_an_address(page, tmp_path):
    outer = tmp_path / "outer.html"
    outer.write_text(f'<iframe srcdoc="{escape(page.file.read_text(encoding="utf-8"))}"></iframe>', encoding="utf-8")
    page.browser.open(outer.as_uri())
    page.wait("frames[0].app?.session.done && frames[0].document.querySelector('#status').textContent")
    assert page.run("[frames[0].location.hash, frames[0].document.getElementById('link').hidden]") == ["", True]
    page.run("frames[0].document.querySelector('#to-explore').click()")  # its links lead to parts of itself
    page.run("new Promise(done => setTimeout(done, 300))")
    assert page.run("frames[0].app.state().model") == "coulomb"
    assert page.run("frames[0].location.href") == "about:srcdoc"


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
    stopped = int(page.run(SLIDE.format(400, "mu_d")))
    mu_d = page.when_done("app.state().values.mu_d")
    assert 0.85 < mu_d <= 0.9
    assert float(page.run("document.getElementById('field-mu_d').value")) == mu_d
    text = page.run(f"{alert}.textContent")
    for part in ("above mu_s = 0.9", "lower mu_d or raise mu_s", f"the slider stops at mu_d = {mu_d:.4g}"):
        assert part in text
    assert page.run("app.session.runs.main.failure") == ""
    assert page.run(SLIDE.format(stopped - 20, "mu_d")) == str(stopped - 20)
    assert page.when_done(f"{alert}.hidden")
    page.run(SLIDE.format(0, "mu_s"))  # the other parameter of the condition stops likewise
    assert page.when_done("app.state().values.mu_s >= app.state().values.mu_d")
    page.open(".model=stickslip&mu_d=0.95")  # a refused state from a link is reported, and can be left
    assert "above mu_s = 0.9" in page.run(f"{alert}.textContent")
    page.type_number("mu_d", "0.94")
    page.type_number("mu_s", "0.96")
    assert page.run(f"{alert}.hidden")


def test_pausing_keeps_the_values_in_force_and_changes_edit_those(page):
    page.open(".model=smd")
    page.click("#play")
    page.wait("app.state().t > 0.1")
    page.type_number("c", "20")
    page.click("#play")
    shown = "([field, slider]) => [Number(field.value), slider.getAttribute('aria-valuetext')]"
    find = "[...document.querySelectorAll('.field:has(#field-c) input')]"
    assert page.run(f"({shown})({find})") == [20, "20 N·s/m"]
    page.type_number("c", "30")
    assert page.run("[app.state().values, app.state().changes.map(({ value }) => value)]") == [{}, [30]]
    page.seek(0)
    page.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.run(f"({shown})({find})")[0] == declared("smd")["c"].start


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


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0,25", 0.25),
        ("0.25", 0.25),
        ("2,5e-1", 0.25),
        ("1.000,5", None),
        ("1,000.5", None),
        ("1,2,3", None),
        ("2x", None),
    ],
)
def test_a_decimal_comma_is_accepted_or_refused_but_never_read_as_another_number(page, text, value):
    page.open(".model=coulomb&f=0.75", anew=True)
    page.run("(e => { e.focus(); e.select() })(document.getElementById('field-f'))")
    page.browser.call("Input.insertText", text=text)  # as typed, not as set by a script
    page.run("document.getElementById('field-f').blur()")
    assert page.when_done("app.state().values.f") == (value or 0.75)
    assert page.run("document.getElementById('alert').hidden") == (value is not None)


def test_numbers_have_the_digits_of_the_computation_and_typeset_powers(page):
    page.open(".preset=stickslip&.compare=stickslip")
    page.wait("document.querySelectorAll('#tables caption').length > 2")
    text = page.run("document.body.innerText")
    published = str(page.run("app.session.presets.get('stickslip').published"))  # shown as published
    assert [number for number in re.findall(r"\d+\.\d{10,}", text) if number not in published] == []
    assert not re.findall("\\de[-\N{MINUS SIGN}]\\d", text)
    page.open(".model=coulomb&solver.method=2&solver.rtol=1e-5")
    page.wait("document.getElementById('tables').textContent.includes('10⁻⁵')")
    times = [cells[0] for cells in page.table("Events").values()]
    assert max(len(t.replace(".", "").lstrip("0")) for t in times) == 5


@pytest.mark.parametrize("name", MODELS)
def test_summaries_of_diagrams_state_the_extremes_of_the_run(page, name):
    page.open(f".model={name}")
    x = page.run("app.session.models.get(app.state().model).bodies[0].position")
    label, values, factor = page.run(
        f"[app.plots.get('{x}').panel.content.description, app.session.runs.main.columns.{x},"
        f"app.session.runs.main.fmu.variables.get('{x}').factor]"
    )
    low, high = re.search(r"from (\S+) to (\S+),", label).groups()
    assert web_page.number(low) == pytest.approx(min(values) * factor, rel=5e-3)
    assert web_page.number(high) == pytest.approx(max(values) * factor, rel=5e-3)


@pytest.mark.parametrize("name", MODELS)
def test_extreme_numbers_are_reported_or_drawn_and_never_shown_as_nan(page, name):
    page.open(f".model={name}")
    body = page.run("app.session.models.get(app.state().model).bodies[0]")
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


# ---- published cases


def test_every_published_case_measures_the_same_as_the_terminal(page):
    """Within 0.1 %, except where chatter makes the steps depend on rounding; the published values are shown as well."""
    page.open()
    names = page.run("[...app.session.presets.keys()]")
    scenes = {scene.name: scene for scene in map(load_scene, shipped_scenes()) if scene.published}
    assert sorted(names) == sorted(scenes)
    for name, scene in scenes.items():
        page.choose("preset", name)
        native = native_fmus.build_native_fmus() / f"{scene.run.model}.fmu"  # runs while the page waits for more work
        run = simulate(replace(scene.run, fmu=native, repeat=1))
        page.wait(
            f"app.state().preset === {name!r} && document.querySelector('#tables caption')?.textContent === "
            "app.session.presets.get(app.state().preset).title"
        )
        rows = iter(page.table(scene.title).values())
        quantities = {item.name: item for kind in scene.analyses for item in ANALYSES[kind](run, scene).quantities}
        for figure, published in scene.published.items():
            if figure == "source":
                continue
            measured, published_values, _ = next(rows)
            number = published[0] if isinstance(published, tuple) else published
            assert (
                published_values == number if isinstance(number, str) else float(published_values.split()[0]) == number
            ), (name, figure)
            if figure != "run_time" and not (name == "stickslip-threshold" and "step" in figure):
                size, *unit = measured.split()
                unit = [text.replace("\N{MIDDLE DOT}", ".").replace("²", "2") for text in unit]
                expected = quantities[figure]
                value = expected.to_unit(*unit) if unit and unit != [expected.unit] else expected.value
                assert web_page.number(size) == pytest.approx(value, rel=1e-3), (name, figure)
    page.choose("preset", "")  # custom: values unchanged, but no published case any more
    assert page.run("[app.state().preset, app.state().model]") == ["", scene.model]


# ---- exports


def test_the_csv_file_holds_the_run_and_the_picture_is_a_png(page):
    page.open(".model=coulomb&.stop=4&.compare=coulomb&.compare.friction=2&.compare.solver.method=2")
    page.run("HTMLAnchorElement.prototype.click = function () { globalThis.taken = fetched(this.href, this.download) }")
    page.run("URL.createObjectURL = blob => { globalThis.blob = blob; return 'blob:x' }; URL.revokeObjectURL = () => 0")
    page.run("globalThis.fetched = (href, name) => name")
    page.click("#csv")
    lines = page.run("blob.text()").splitlines()
    settings = [line for line in lines if line.startswith("# ")]
    assert any("k = 157.9 N/m" in line and "f = 0.5 N" in line for line in settings)
    assert any("solver.method = exact" in line for line in settings)
    assert any(line.startswith("# Second run, coulomb") and "friction = sign" in line for line in settings)
    head, *rows = lines[len(settings) :]
    assert head.startswith("t [s],x [m],v [m/s],a [m/s2]")
    assert "compare.x [m]" in head
    assert len(rows) == 1601
    assert float(rows[-1].split(",")[1]) == page.run("app.session.runs.main.columns.x.at(-1)")
    page.run("globalThis.drawn = []; globalThis.fill = CanvasRenderingContext2D.prototype.fillText")
    page.run(
        "CanvasRenderingContext2D.prototype.fillText = function (t, ...at) { drawn.push(t); fill.call(this, t, ...at) }"
    )
    page.click("#png")
    page.wait("taken === 'coulomb.png'")
    assert page.run("blob.slice(1, 4).text()") == "PNG"
    assert page.run("blob.size") > 20000
    drawn = page.run("drawn.join(' ')")
    assert all(line.removeprefix("# ") in drawn for line in settings)
    page.open(anew=True)  # with the methods of the browser


def test_a_printout_is_white_and_complete(page):
    """Except the cursor, whose canvas would cover the curves in a PDF file."""
    page.browser.dark()
    page.open(".model=stickslip")
    page.run(
        "addEventListener('beforeprint', () => { globalThis.seen = [...document.querySelectorAll('.plot')].map(plot =>"
        "getComputedStyle(plot).getPropertyValue('--a').trim()) })"
    )
    assert page.browser.pdf().startswith(b"%PDF")
    assert set(page.run("seen")) == {"#1c2126"}
    page.browser.call("Emulation.setEmulatedMedia", media="print")
    shown = "[...document.querySelectorAll('.plot canvas')].map(canvas => getComputedStyle(canvas).display)"
    assert page.run(shown) == ["block" if i % 2 == 0 else "none" for i in range(page.run(f"{shown}.length"))]
    page.browser.call("Emulation.setEmulatedMedia", media="")
    page.browser.dark(False)


@pytest.mark.parametrize(("paper", "width"), [("A5", 483), ("A4", 718), ("Letter", 740)])  # without margins
def test_a_printout_of_any_size_holds_all_diagrams_and_settings(page, paper, width):
    page.browser.size(360)
    page.open(".model=coulomb&.compare=pacejka")
    page.run("dispatchEvent(new Event('beforeprint'))")
    page.browser.size(width)
    page.browser.call("Emulation.setEmulatedMedia", media="print")
    boxes = page.run(
        "[...document.querySelectorAll('figure')].filter(figure => !figure.hidden).map(figure => {"
        "const { left, right, height } = figure.getBoundingClientRect(); return [left, right, height] })"
    )
    text = page.run("document.body.innerText")
    page.browser.call("Emulation.setEmulatedMedia", media="")
    page.run("dispatchEvent(new Event('afterprint'))")
    page.browser.size(1280)
    assert len(boxes) == page.run("[...app.plots.values()].filter(({ figure }) => !figure.hidden).length")
    for left, right, height in boxes:
        assert 0 <= left < right <= width
        assert height > 60
    for part in ("k = 157.9 N/m", "solver.method = exact", "Second run, pacejka"):
        assert part in text


# ---- user models


def test_moving_bodies_of_any_model_are_read_from_its_declaration():
    """For models that users might write: the kind of each body, and what acts on it."""
    bodies_by_model = {path.stem: list_bodies(find_model(path).analysis) for path in (*EXAMPLE_MODELS, *LARGER_MODELS)}
    kinds = {name: [body["kind"] for body in bodies_of_model] for name, bodies_of_model in bodies_by_model.items()}
    assert kinds["viscous_pendulum"] == ["pendulum"]
    assert kinds["rotor_brake"] == ["rotor"]
    assert kinds["blocks"] == kinds["sleds"] == ["block", "block"]
    assert kinds["clutch"] == ["none"]  # it has no position
    assert {bodies_by_model[name][0]["friction"] for name in ("bumper", "lugre")} == {"F_drag", "F_friction"}  # smooth
    assert bodies_by_model["sleds"][0]["linked"] == ["x2"]
    assert bodies_by_model["viscous_pendulum"][0]["dampers"] == ["d"]


def test_user_models_run_on_a_page_of_their_own(browser):
    files = [ROOT / "tests" / "example_models" / name for name in ("rotor_brake.py", "larger/blocks.py")]
    page = web_page.Page(browser, web_page.build_page("users", *map(str, files), "--method", "ode45"))
    for path, count in zip(files, (1, 2), strict=True):
        page.open(f".model={path.stem}")
        assert page.run("[...document.getElementById('method').options].map(each => each.text)") == ["ode45"]
        assert page.run("app.session.runs.main.failure") == ""
        assert page.run("app.session.runs.main.events.length") > 2
        assert page.run("document.querySelectorAll('#mechanism .body').length") == count
        assert page.run("document.getElementById('body').parentElement.hidden") == (count == 1)
    page.choose("body", 1)  # the plots of the motion come first here too
    shown = "[...document.querySelectorAll('figure')].filter(each => !each.hidden).map(each => each.id).slice(0, 3)"
    second = page.run("app.session.models.get('blocks').bodies[1]")
    assert page.when_done(shown) == [f"panel-{second[name]}" for name in ("position", "speed", "acceleration")]


def test_several_contacts_are_shaded_and_named_each(browser):
    """Bands, force panels and events of the lower block, on which two contacts act; its input is plotted if it acts."""
    files = [ROOT / "tests" / "example_models" / name for name in ("rotor_brake.py", "larger/blocks.py")]
    page = web_page.Page(browser, web_page.build_page("users", *map(str, files), "--method", "ode45"))
    page.open(".model=blocks&F_ext=3")
    content = "app.plots.get({!r}).panel.content"
    for key, rows in ((".sticking", ["F1", "F2"]), ("x1", ["F1", "F2"]), ("F1", ["F1"]), ("F2", ["F2"])):
        assert page.run(f"{content.format(key)}.rows") == rows
    sticks = page.run(f"{content.format('F2')}.bands")
    speeds = "(({ time, columns: { v1, v2 } }) => time.map((t, i) => [t, v2[i] - v1[i]]))(app.session.runs.main)"
    for t, slip in page.run(speeds):
        if any(band["from"] < t < band["to"] for band in sticks):
            assert abs(slip) < 1e-12
    assert set(page.run(f"{content.format('F_ext')}.curves.at(-1).y")) == {3.0}
    page.wait("[...document.querySelectorAll('caption')].some(each => each.textContent === 'Events')")
    named = [cells[-1] for cells in page.table("Events").values()]
    assert named[:2] == ["F1 slides forward", "F2 slides forward"]
    assert {"F1 sticks", "F2 sticks"} <= {*named}


# ---- friction law and events


@pytest.mark.parametrize("name", sorted({*MODELS} - {"smd"}))
def test_the_friction_law_is_drawn_over_the_slip_speed_with_the_point_at_the_cursor(page, name):
    page.open(f".model={name}&.t=0.3")
    body = page.run("app.session.models.get(app.state().model).bodies[0]")
    curves = page.run("app.plots.get('.law').panel.content.curves")
    held = [curve for curve in curves if curve["colour"] == "stick"]
    for curve in held:  # one vertical line
        assert max(map(abs, curve["x"])) == 0
    if name in ("coulomb", "stickslip"):  # level lines
        d = {variable: meaning.start for variable, meaning in declared(name).items()}
        force = d["f"] if name == "coulomb" else d["mu_d"] * d["m"] * d["g"]
        assert held
        for curve in curves:
            if curve["colour"] == "slip":
                assert {round(abs(value) / force, 9) for value in curve["y"]} == {1}
    (point,) = page.run("app.plots.get('.law').plot.cursor.points")
    at = "app.session.runs.main.at({!r}, 0.3) * app.session.runs.main.fmu.variables.get({!r}).factor"
    assert [point["x"], point["y"]] == page.run(
        f"[{at.format(body['slip'], body['slip'])}, {at.format(body['friction'], body['friction'])}]"
    )


def test_the_buttons_jump_to_the_next_and_the_previous_event(page):
    page.open(".model=coulomb")
    times = page.run("app.session.runs.main.events.map(({ t }) => t)")
    seen = []
    for _ in times:
        page.click("#next-event")
        seen.append(page.run("app.state().t"))
    assert seen == times
    page.wait("document.getElementById('next-event').disabled")
    page.click("#previous-event")
    assert page.run("app.state().t") == times[-2]


def test_the_arrow_of_friction_has_its_value(page):
    page.open(".model=coulomb&.t=0.1")
    page.wait("document.querySelector('#mechanism .value').textContent === 'friction 0.5 N'")


@pytest.mark.parametrize("name", ["coulomb", "pendulum"])
def test_the_value_of_a_force_that_jumps_is_never_between_its_values(page, name):
    page.open(f".model={name}")
    (friction,) = page.run("app.session.models.get(app.state().model).contacts.map(({ name }) => name)")
    before = "app.session.runs.main.events.slice(1, -1).map(({ t }) => Math.abs(app.session.runs.main.at(F, t - 1e-5)))"
    sizes = page.run(f"(F => {before})({friction!r})")
    assert sizes
    largest = page.run(f"app.session.runs.main.largestMagnitude({friction!r})")
    assert all(size > 0.9 * largest for size in sizes)


def test_the_projector_mode_shows_one_large_diagram_with_large_text(page):
    page.browser.size(1280)
    page.open(".model=coulomb")
    fonts = (
        "(() => { const { plot } = app.plots.get('x'); const sizes = new Set();"
        "const context = document.createElement('canvas').getContext('2d');"
        "context.fillText = () => sizes.add(parseFloat(context.font));"
        "plot.draw(context, 900, 500); return [...sizes] })()"
    )
    shown = "[...document.querySelectorAll('figure')].filter(figure => figure.getBoundingClientRect().height).length"
    height = "document.querySelector('.plot').getBoundingClientRect().height"
    before = page.run(f"[{shown}, {height}]")
    page.click("#projector")
    page.wait(f"{shown} === 1")
    assert page.run(height) > 1.5 * before[1]
    assert page.run(fonts) == [18]
    assert page.run("getComputedStyle(document.querySelector('figcaption')).fontSize") == "18px"
    page.click("#projector")
    page.wait(f"{shown} === {before[0]}")
    assert page.run(fonts) == [11]


# ---- measurements of the visitor

DROP = (
    "(() => {{ const transfer = new DataTransfer(); transfer.items.add(new File([{}], 'bench.csv'));"
    "dispatchEvent(new DragEvent('drop', {{ dataTransfer: transfer, cancelable: true }})) }})()"
)
MEASURED = "app.plots.get('{}').panel.content.curves.find(({{ legend }}) => legend === 'bench.csv')"


@pytest.mark.parametrize(
    ("model", "name", "text"),
    [
        ("coulomb", "x", "t [ms],x [mm]\n0,100\n500,87.5\n1000,75\n"),
        ("coulomb", "x", "# bench 3\ntime (s);force (N);position (cm)\n0;9;10\n0,5;9;8,75\n1;9;7,5\n"),
        ("coulomb", "x", "0\t0.1\n0.5\t0.0875\n1\t0.075\n"),
        ("pendulum", "theta", "t [s],theta [deg]\n0,100\n0.5,87.5\n1,75\n"),
    ],
)
def test_a_dropped_measurement_is_drawn_over_the_run_in_the_units_of_its_heading(page, model, name, text):
    page.open(f".model={model}")
    page.run(DROP.format(json.dumps(text)))
    page.wait(f"{MEASURED.format(name)} !== undefined")
    curve = page.run(MEASURED.format(name))
    factor = 1 if model == "pendulum" else 1e-3  # the diagram of theta is in degrees
    assert curve["x"] == pytest.approx([0, 0.5, 1])
    assert curve["y"] == pytest.approx([100 * factor, 87.5 * factor, 75 * factor])
    assert "bench.csv" in page.run("document.getElementById('legend').innerText")
    page.click("#remove-measurement")
    page.wait(f"{MEASURED.format(name)} === undefined")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("t [s],x [furlong]\n0,1\n1,2\n", 'the unit of "x [furlong]" is furlong; give one of m, mm'),
        ("hello", "has no two columns"),
        ("t,x\na,b\n", "fewer than two rows"),
    ],
)
def test_a_measurement_that_cannot_be_read_is_refused_with_the_reason(page, text, sentence):
    page.open(".model=coulomb", anew=True)
    page.run(DROP.format(json.dumps(text)))
    page.wait("!document.getElementById('alert').hidden")
    assert sentence in page.run("document.getElementById('alert').textContent")
    assert page.run(f"{MEASURED.format('x')} === undefined")
