"""Coupled FMUs by the scripts of the page: their error is proportional to the step, and friction holds."""

import importlib.util
import os
import re
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from build_cache import ROOT, build_user_model
from prescribed_motion import solve_block

import harness

BLOCKS = dict(re.findall(r'```python title="([^"]+)"\n(.*?)```', (ROOT / "docs/how-to/coupled.md").read_text(), re.S))


@pytest.fixture(scope="module")
def folder(fmus, tmp_path_factory):
    """A folder with the scripts of the page, the built FMUs and `spring.fmu`."""
    folder = tmp_path_factory.mktemp("coupled")
    for name, text in BLOCKS.items():
        (folder / name).write_text(text)
    (folder / "fmus").symlink_to(fmus)
    for model in (ROOT / "fmus/more/spring.py", ROOT / "fmus/more/servo.py"):
        link(folder, model)
    return folder


def link(folder, model):
    """Build the FMU of a model file and return its path in the folder."""
    fmu = folder / f"{model.stem}.fmu"
    fmu.symlink_to(build_user_model(model) / fmu.name)
    return fmu


@pytest.fixture
def couple(folder, monkeypatch):
    """The function of the page, in the folder."""
    monkeypatch.chdir(folder)
    specification = importlib.util.spec_from_file_location("couple_fmpy", folder / "couple_fmpy.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module.couple


@pytest.mark.campaign
def test_two_equal_masses_converge_to_their_closed_form_in_proportion_to_the_step(couple):
    """From x and -x both have the stiffness k + 2 k_spring."""
    errors = []
    for step in (0.004, 0.002):
        rows = couple(
            {"a": "fmus/smd.fmu", "b": "fmus/smd.fmu", "spring": "spring.fmu"},
            {"a.c": 0.0, "b.c": 0.0, "b.x0": -0.1, "spring.x0_a": 0.1, "spring.x0_b": -0.1},
            {"spring.v_a": "a.v", "spring.v_b": "b.v", "a.F_ext": "spring.F_a", "b.F_ext": "spring.F_b"},
            step,
            0.5,
            ["a.x", "b.x"],
        )
        expected = 0.1 * np.cos(np.sqrt(157.9 + 80.0) * step * np.arange(len(rows)))
        errors.append(np.abs(np.array(rows) - np.transpose([expected, -expected])).max())
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)
    assert errors[1] < 5e-3


@pytest.mark.campaign
@pytest.mark.parametrize("tool", ["libcosim", "ecos", "omsimulator"])
def test_another_tool_gives_the_motion_of_the_page(folder, tool):
    if not find_spec({"libcosim": "libcosimpy", "ecos": "ecospy", "omsimulator": "OMSimulator"}[tool]):
        pytest.skip(f"{tool} is not installed")
    environment = os.environ | {"PYTHONPATH": str(folder)}
    command = [sys.executable, f"couple_{tool}.py"]
    result = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[-2:] == ["left.x 0.01141", "right.x -0.00802"]


@pytest.mark.campaign
def test_a_belt_carries_a_block_of_another_fmu(couple, folder):
    """Position, speed and acceleration are connected; the reference is scipy with events."""
    for name in ("belt.py", "block.py"):
        link(folder, folder / name)
    step = 0.0025
    rows = couple(
        {"belt": "belt.fmu", "block": "block.fmu"},
        {},
        {"block.x_belt": "belt.x", "block.v_belt": "belt.v", "block.a_belt": "belt.a"},
        step,
        5.0,
        ["block.x"],
    )

    def belt(t):
        return 0.3 * (1.0 - np.cos(1.7 * t)), 0.51 * np.sin(1.7 * t), 0.867 * np.cos(1.7 * t)

    events, motion = solve_block(belt, 5.0, k=30.0, hold=12.0, slide=8.0)
    assert [mode for _, mode in events] == [-1, 0, 1, 0]
    expected = [motion(step * i)[0] for i in range(len(rows))]
    assert np.abs(np.array(rows)[:, 0] - expected).max() < 6e-4


@pytest.mark.campaign
def test_a_controller_of_another_fmu_lets_the_axis_hunt(couple, folder):
    """It sticks where the axis with the same gains in one model sticks; both overshoot the set point in turn."""
    link(folder, folder / "controller.py")
    step = 0.001
    rows = couple(
        {"axis": "servo.fmu", "controller": "controller.fmu"},
        {"axis.K_p": 0.0, "axis.K_i": 0.0, "axis.K_d": 0.0},
        {"controller.x": "axis.x", "controller.v": "axis.v", "axis.F_ext": "controller.F_c"},
        step,
        2.0,
        ["axis.x"],
    )
    single = harness.simulate("servo.fmu", {"K_i": 2e5}, stop=2.0, rtol=1e-8)
    events = single.events
    middles = [
        0.5 * (begin + end)
        for begin, end, mode in zip(events.t, events.t[1:], events.modes["F_friction"], strict=False)
        if mode == 0
    ]
    expected = np.interp(middles, single.time, single["x"])
    assert len(expected) >= 4
    assert (np.diff(np.sign(expected[1:] - 0.01)) != 0).all()
    np.testing.assert_allclose(
        np.interp(middles, step * np.arange(len(rows)), np.array(rows)[:, 0]), expected, atol=5e-5
    )
