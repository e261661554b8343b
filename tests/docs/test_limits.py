"""The Jenkins elements of the page on limits, against a solution by scipy that changes the equations at events."""

import commands
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import harness
from tests.docs.test_docs import DOCS, scripts

M, K, X0, STOP = 1.0, 40.0, 0.3, 4.0
ELEMENTS = ((100.0, 2.0, 1.2), (60.0, 3.0, 3.0))  # stiffness, limits forward and backward
SHORT = 1e-9  # s, by which a turning point is left


def rates(y, slides):
    force = K * y[0] + sum(k * z for (k, _, _), z in zip(ELEMENTS, y[2:], strict=True))
    return np.array([y[1], -force / M, *(0.0 if slide else y[1] for slide in slides)])


def event(function, direction=0.0):
    function.terminal, function.direction = True, direction
    return function


def solve_by_events(times):
    """Return the positions at times, all above SHORT: each element follows the motion or slides at a limit."""
    t, y, slides, positions = 0.0, np.array([X0, 0.0, 0.0, 0.0]), [False, False], {}
    while True:
        start = rates(y, slides)  # leave the turning point by a short step of constant acceleration
        stretch = 0.5 * start[1] * SHORT**2
        y = y + np.array([stretch, start[1] * SHORT, *(0.0 if slide else stretch for slide in slides)])
        t += SHORT
        while True:
            events = [event(lambda t, y: y[1])]
            for i, (k, up, down) in enumerate(ELEMENTS):
                limit = up if y[1] > 0.0 else -down
                events.append(event(lambda t, y, i=i, k=k, limit=limit: k * y[2 + i] - limit, np.sign(y[1])))
            part = solve_ivp(
                lambda t, y, s=tuple(slides): rates(y, s), (t, STOP), y, "DOP853", rtol=1e-13, atol=1e-15,
                events=[e for e, slide in zip(events, [False, *slides], strict=True) if not slide], dense_output=True,
            )  # fmt: skip
            positions |= {s: part.sol(s)[0] for s in times if t <= s <= part.t[-1]}
            t, y = part.t[-1], part.y[:, -1].copy()
            if part.status == 0:
                return np.array([positions[s] for s in times])
            if abs(y[1]) < 1e-9:
                y[1], slides = 0.0, [False, False]
                break
            slides = [slide or abs(e(t, y)) < 1e-9 for e, slide in zip(events[1:], slides, strict=True)]


@pytest.fixture
def build_model(tmp_path):
    """Return build_model(name): the FMU of a model file of the page."""

    def build_model(name):
        page = (DOCS / "explanation" / "limits.md").read_text(encoding="utf-8")
        (block,) = [block for block in scripts.find_blocks(page) if block.title == f"{name}.py"]
        (tmp_path / f"{name}.py").write_text(block.text)
        result = commands.build(f"{name}.py", folder=tmp_path)
        assert (result.returncode, result.stderr) == (0, "")
        return tmp_path / f"{name}.fmu"

    return build_model


@pytest.mark.slow
def test_jenkins_elements_agree_with_a_solution_by_events(build_model):
    times = np.linspace(0.0, STOP, 41)
    run = harness.simulate(build_model("iwan"), times=times, rtol=1e-10)
    expected = solve_by_events(times[1:])
    assert np.abs(run.columns["x"][1:] - expected).max() < 1e-8
    up, down = run.columns["F_elements"].max(), run.columns["F_elements"].min()
    assert 4.9 < up < 5.0 + 1e-9  # both slide: 2 N + 3 N
    assert -4.2 - 1e-9 < down < -4.1
