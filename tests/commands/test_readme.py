"""README.md to the letter: its scene and its model in files, its commands typed where those files are."""

import json
import os
import re
import shlex
import shutil
import sys
import time
from math import atan2, pi, sqrt
from pathlib import Path

import external_fmus
import fmi3_fixtures
import numpy as np
import pytest
from build_cache import ROOT, run_published_cases
from commands import UNPLOTTED, build, harness
from decays import decay_record
from fmpy.validation import validate_fmu

README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = [*re.finditer(r"^```(\w*)\n(.*?)^```$", README, re.M | re.S)]
LINES = [re.split(r"  +", line)[0] for block in BLOCKS if not block[1] for line in block[2].splitlines()]
LISTED = [line for line in LINES if line.startswith(("python ", "fmpy "))]
INLINE = re.findall(r"`((?:python|fmpy) [^`]+)`", README)
ELSEWHERE = {  # what takes long, or another machine, and the tests that have it run; .ci/run has the block `sh`
    "python -m harness": "commands/test_runs.py",
    "python -m harness precision": "studies/test_precision.py",
    "python -m harness stability": "studies/test_stability.py",
    "python -m harness bench": "studies/test_bench.py",
    "python -m harness importers": "hosts/test_importers.py",
    "python -m harness couple two-masses": "studies/test_coupled.py",
    "python build_fmus.py --fmi 3": "support/fmi3_fixtures.py",
    "python build_fmus.py --native": "support/native_fmus.py",
    "python build_fmus.py --web": "support/web_page.py",
    "python build_fmus.py pacejka --method rodas --platform linux64": "packaging/test_feature_selection.py",
    "python -m build_fmus stickslip": "packaging/test_wheel.py",
    "fmpy simulate fmus/stickslip.fmu": "models/test_conformance.py",
    "fmpy compile": "native/test_native_packaging.py",
    "fmpy validate": "packaging/test_packaging.py",
}
MODEL = [line for line in LISTED if "cart" in line]  # each needs the one before
FIRST = LISTED[0]  # draws
OWN = "python -m harness run my_scene.toml"
HERE = [line for line in dict.fromkeys([*LISTED, *INLINE]) if line not in (*ELSEWHERE, *MODEL, FIRST, OWN)]
TRUTH = {"zeta": 0.01, "r": 4e-4}
SCREEN = ("BROWSER", "DISPLAY", "WAYLAND_DISPLAY")
# a browser that keeps the page it is sent to
BROWSER = "python -c 'import sys, urllib.request as web; web.urlretrieve(sys.argv[1], \"page.html\")' %s &"


(SCENE,) = (block[2] for block in BLOCKS if block[1] == "toml")
(MODEL_FILE,) = (block[2] for block in BLOCKS if block[1] == "python" and "(Model)" in block[2])
SCRIPTS = [block[2] for block in BLOCKS if block[1] == "python" and block[2] != MODEL_FILE]


@pytest.fixture
def workspace(fmus, tmp_path):
    """A folder with all that the commands name."""
    (tmp_path / "fmus").mkdir()
    for file in fmus.glob("*.fmu"):
        (tmp_path / "fmus" / file.name).symlink_to(file)
    for name, file in (("a.fmu", "smd.fmu"), ("b.fmu", "coulomb.fmu")):
        shutil.copy(fmus / file, tmp_path / name)
    (tmp_path / "build_fmus.py").symlink_to(ROOT / "build_fmus.py")
    (tmp_path / "theirs.fmu").symlink_to(external_fmus.build_external_fmus() / "Midpoint.fmu")
    (tmp_path / "my_scene.toml").write_text(SCENE)
    (tmp_path / "cart.py").write_text(MODEL_FILE)
    return tmp_path


def recorded(head, size, **how):
    """The rows of a record of a known decay, under a heading, in a unit of that size."""
    record = decay_record(**TRUTH, noise=1e-5 * (12.566**2 if how.get("order") else 1), **how)
    return [head, *zip(record.t.tolist(), (record.x / size).tolist(), strict=True)]


def my_record(path):
    np.savetxt(path, recorded((), 1e-3)[1:], header="t [s],x [mm]", delimiter=",", comments="")


def raw_data(path):
    rows = recorded(("Time (s)", "Linear Acceleration z (m/s^2)"), 1.0, order=2)
    path.write_text("\n".join(",".join(json.dumps(cell) for cell in row) for row in rows))


def swing(path):
    openpyxl = pytest.importorskip("openpyxl", reason="only tests write spreadsheets")
    book = openpyxl.Workbook()
    for row in recorded(("time [s]", "angle [deg]"), pi / 180, sine=True):
        book.active.append(row)
    book.save(path)


RECORDS = {"my_record.csv": my_record, "Raw Data.csv": raw_data, "swing.xlsx": swing}


def typed(line, folder, **environment):
    """What a command says; it must end well, with nothing on standard error."""
    words = shlex.split(line)
    if words[:3] == ["python", "-m", "harness"]:
        done = harness(folder, *words[3:], blank=UNPLOTTED, **environment)
    elif words[:2] == ["python", "build_fmus.py"]:
        done = build(*words[2:], folder=folder)
    else:
        module, words = ("fmpy", words[1:]) if words[0] == "fmpy" else (Path(words[1]).stem, words[2:])
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])  # of the browser
        usual = {name: value for name, value in os.environ.items() if name not in SCREEN} | {"PATH": path}
        done = harness(folder, *words, base=usual, module=module, **environment)
    assert (done.returncode, done.stderr) == (0, ""), f"{line}\n{done.stdout}{done.stderr}"
    return done.stdout


def test_commands_tested_elsewhere_are_in_the_readme_and_all_others_run_here():
    assert len(HERE) > 10
    assert len(MODEL) == 3
    for line, file in ELSEWHERE.items():
        assert line in (*LISTED, *INLINE), f"{line} has gone from the README"
        assert (ROOT / "tests" / file).is_file()


@pytest.mark.parametrize("line", HERE)
def test_a_command_does_what_the_readme_says(workspace, line):
    for name in shlex.split(line):
        if name in RECORDS:
            RECORDS[name](workspace / name)
        elif name.startswith("fmus/native/fmi3/"):
            (workspace / "fmus" / "native").mkdir()
            (workspace / "fmus" / "native" / "fmi3").symlink_to(fmi3_fixtures.build_fmi3_fmus())
    if line.endswith(("report", "results/stickslip")):
        shutil.copytree(run_published_cases() / "results/stickslip", workspace / "results/stickslip")
    said = typed(line, workspace)
    if " -m harness " in line and not line.endswith(" list"):
        place = workspace / said.split("Report in " if line.endswith("report") else "Results in ")[1].strip()
        assert place.is_file() or (place / "provenance.json").is_file()
    if " decay " in line:
        found = json.loads((place / "decay.json").read_text())
        for each in found["fit"]:
            if each["name"] in TRUTH:
                assert each["value"] == pytest.approx(TRUTH[each["name"]], abs=5 * each["error"]), each["name"]


def test_the_first_line_renders_in_a_browser(workspace):
    page = workspace / "page.html"
    assert typed(FIRST, workspace, BROWSER=BROWSER) == ""
    for _ in range(600):
        text = page.read_text(encoding="utf-8") if page.exists() else ""
        if text.rstrip().endswith("</html>"):
            break
        time.sleep(0.05)
    assert "F_friction [N]" in text


def test_the_model_is_built_run_and_certified(workspace):
    for line in MODEL:
        typed(line, workspace)
    assert validate_fmu(str(workspace / "cart.fmu")) == []
    assert (workspace / "cart.csv").is_file()
    heads, (_, first), *_, (_, last) = (
        line.split(",") for line in (workspace / "cart-events.csv").read_text().splitlines()
    )
    assert (heads, first, last) == (["t [s]", "mode"], "-1", "0")  # it is let go in front, and comes to rest
    assert (workspace / "results/cart/trajectory.csv").is_file()


@pytest.mark.parametrize("script", SCRIPTS)
def test_the_python_lines_run(workspace, script):
    pytest.importorskip("xarray", reason="extra sweep")
    names = set(re.findall(r"results/sweep/(\w+)/", script))
    for name in names:
        typed(f"python -m harness sweep smd --vary c=1,2 --workers 1 --name {name}", workspace)
    (workspace / "lines.py").write_text(script)
    typed("python lines.py", workspace, MPLBACKEND="agg")


def test_the_scene_is_measured_and_drawn(workspace):
    """Against its closed form: break-away, then the arc of a circle about where friction and spring balance."""
    m, k, mu_s, mu_d, g, driver = 12.5, 742.5, 0.3, 0.2, 9.81, 0.034
    omega, d = sqrt(k / m), (mu_s - mu_d) * 12.5 * g / k
    amplitude, slip = sqrt(d * d + (driver / omega) ** 2), 2 * (pi - atan2(d * omega, driver)) / omega
    assert OWN in LISTED
    done = harness(workspace, *shlex.split(OWN)[3:], "--json")
    found = {each["name"]: each["value"] for each in json.loads(done.stdout)["quantities"]}
    assert found["first_slip"] == pytest.approx(mu_s * m * g / (k * driver), rel=1e-12)
    assert found["slip_time"] == pytest.approx(slip, rel=1e-9)
    assert found["period"] == pytest.approx(slip + 2 * d / driver, rel=1e-9)
    assert found["peak_speed"] == pytest.approx(driver + omega * amplitude, rel=1e-5)
    table = np.loadtxt(workspace / "results/my_scene/trajectory.csv", delimiter=",", skiprows=1)
    assert np.diff(table[:, 0]).max() < 0.02 * found["slip_time"]
    assert (workspace / "results/my_scene/figure.svg").stat().st_size > 10_000
