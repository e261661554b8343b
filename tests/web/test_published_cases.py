"""Published cases on the live page."""

from dataclasses import replace

import native_fmus
import pytest
import web_page

from harness.running.runner import run_own_fmu
from harness.scenes.scene import load_scene, shipped_scenes
from harness.studies.run.study import ANALYSES

pytestmark = pytest.mark.slow


def test_every_published_case_measures_the_same_as_the_terminal(page):
    """Within 0.1 %, except where chatter makes the steps depend on rounding; the published values are shown as well."""
    page.open()
    names = page.run("[...app.session.presets.keys()]")
    scenes = {scene.name: scene for scene in map(load_scene, shipped_scenes()) if scene.known}
    assert sorted(names) == sorted(scenes)
    for name, scene in scenes.items():
        page.choose("preset", name)
        native = native_fmus.build_native_fmus() / f"{scene.run.model}.fmu"  # runs while the page waits for more work
        run = run_own_fmu(replace(scene.run, fmu=native, repeat=1))
        page.wait(
            f"app.state().preset === {name!r} && document.querySelector('#tables caption')?.textContent === "
            "app.session.presets.get(app.state().preset).title"
        )
        rows = iter(page.table(scene.title).values())
        quantities = {item.name: item for kind in scene.analyses for item in ANALYSES[kind](run, scene).quantities}
        for figure, published in scene.known.values.items():
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
    assert page.run("[app.state().preset, app.state().model]") == ["", scene.run.model]
