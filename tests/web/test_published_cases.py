"""Published cases on the live page."""

import csv
import json
import re
import tomllib

import commands
import native_fmus
import pytest
import web_page
from build_cache import ROOT

pytestmark = pytest.mark.slow

SCENES = {file.stem: file.read_text() for file in sorted((ROOT / "harness/scenes").glob("*.toml"))}
KINDS = ("published", "reference", "parameter")


def known_values(scene):
    """Return the known values of a scene, by name."""
    return {name: value for kind in KINDS for name, value in scene.get(kind, {}).items() if name != "source"}


def measure(folder, name):
    """Return measured value and unit of each quantity of a published case, by name, from a run of the native FMU."""
    fmu = native_fmus.build_native_fmus() / f"{tomllib.loads(SCENES[name])['model']}.fmu"
    text = re.sub("^model = .*", f'fmu = "{fmu}"', SCENES[name], flags=re.M)
    (folder / f"{name}.toml").write_text(re.sub("repeat = .*", "", text))
    done = commands.harness(folder, "run", f"{name}.toml", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    texts = {item["name"]: item["text"] for item in json.loads(done.stdout)["quantities"]}
    with (folder / f"results/{name}/quantities.csv").open(encoding="utf-8", newline="") as file:
        rows = {row[""]: (float(row["measured"]), row["unit"]) for row in csv.DictReader(file)}
    return {quantity: rows[text] for quantity, text in texts.items()}


def test_every_published_case_measures_the_same_as_the_terminal(page, tmp_path):
    """Within 0.1 %, except where chatter makes the steps depend on rounding; the published values are shown as well."""
    page.open()
    scenes = {name: scene for name, text in SCENES.items() if known_values(scene := tomllib.loads(text))}
    assert sorted(page.run("[...app.session.presets.keys()]")) == sorted(scenes)
    for name, scene in scenes.items():
        page.choose("preset", name)
        quantities = measure(tmp_path, name)  # runs while the page waits for more work
        page.wait(
            f"app.state().preset === {name!r} && document.querySelector('#tables caption')?.textContent === "
            "app.session.presets.get(app.state().preset).title"
        )
        rows = iter(page.table(scene["title"]).values())
        for figure, published in known_values(scene).items():
            measured, published_values, _ = next(rows)
            number = published[0] if isinstance(published, list) else published
            assert (
                published_values == number if isinstance(number, str) else float(published_values.split()[0]) == number
            ), (name, figure)
            if figure != "run_time" and not (name == "stickslip-threshold" and "step" in figure):
                size, *words = measured.split()
                value, unit = quantities[figure]
                assert " ".join(words).replace("\N{MIDDLE DOT}", ".").replace("²", "2") == unit, (name, figure)
                assert web_page.number(size) == pytest.approx(value, rel=1e-3), (name, figure)
    page.choose("preset", "")  # custom: values unchanged, but no published case any more
    assert page.run("[app.state().preset, app.state().model]") == ["", scene["model"]]
