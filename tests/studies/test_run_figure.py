"""The figure of a run, for the published scenes that differ in it and do not take seconds."""

import re
import shutil
import tomllib
from functools import cache
from unittest.mock import patch

import commands
import numpy as np
import pytest
from build_cache import ROOT, build_user_model
from matplotlib.figure import Figure
from matplotlib.text import Text
from variants import campaign_after, slow_after

import harness

SCENES = {path.stem: tomllib.loads(path.read_text()) for path in sorted((ROOT / "harness/scenes").glob("*.toml"))}
for name in "coulomb-stop", "pacejka-0.001":  # its figure is that of coulomb; it takes seconds
    SCENES.pop(name)
MODAL = [name for name, scene in SCENES.items() if scene.get("law") == "hybrid"]


@pytest.fixture(scope="module")
def draw(fmus, tmp_path_factory):
    """Return draw(scene): its run, and the axes of its figure by their titles; each scene is run once."""
    folder = tmp_path_factory.mktemp("drawn")
    (folder / "fmus").symlink_to(fmus)

    @cache
    def draw(name):
        figures = []
        scene = (ROOT / f"harness/scenes/{name}.toml").read_text()
        (folder / f"{name}.toml").write_text(re.sub("repeat = .*", "", scene))
        with patch.object(Figure, "savefig", lambda figure, *_, **__: figures.append(figure)):
            result = commands.harness(folder, "run", f"{name}.toml", figures=True)
        assert (result.returncode, result.stderr) == (0, "")
        figures[0].draw_without_rendering()
        run = harness.load_result(folder / "results" / name)
        return run, {axes.get_title(loc="left"): axes for axes in figures[0].get_axes()}

    return draw


def curves(panels):
    """Return the times and values of the curve in each panel over time: its longest line."""
    over_time = {title: axes for title, axes in panels.items() if title[:4] not in ("phas", "step")}
    lines = {title: max(axes.lines, key=lambda line: len(line.get_xdata())) for title, axes in over_time.items()}
    return {title: line.get_data() for title, line in lines.items()}


def is_title_covered(axes):
    """Return whether the legend overlaps the title."""
    (title,) = (text for text in axes.findobj(Text) if text.get_text() == axes.get_title(loc="left"))
    legend = axes.get_legend()
    return bool(legend and legend.get_window_extent().overlaps(title.get_window_extent()))


@pytest.mark.parametrize("name", campaign_after(2, SCENES))
def test_a_curve_is_smooth_despite_large_steps(draw, name):
    _, panels = draw(name)
    for t, _ in curves(panels).values():
        assert np.diff(t).max() < 2.01 * (t[-1] - t[0]) / 1000


def test_the_plotted_steps_are_those_of_the_solver(draw):
    """The steps are those of the measured run, and the curve has more points."""
    run, panels = draw("smd")
    t = panels["step size of the solver"].lines[0].get_xdata()
    assert len(t) + 1 == len(run.time) < 300 < len(curves(panels)["position of the mass"][0])


@pytest.mark.parametrize("name", slow_after(1, MODAL))
def test_every_stick_phase_is_shaded_from_its_start(draw, name):
    run, panels = draw(name)
    sticks = [] if run.events is None else run.events.t[run.events.mode == 0]
    for title in curves(panels):
        shaded_starts = [patch.get_x() for patch in panels[title].patches if patch.get_label() == "stuck"]
        assert shaded_starts == pytest.approx(sticks[: len(shaded_starts)])
        assert len(sticks) - len(shaded_starts) <= (name == "coulomb")  # whose last one begins after the end


@pytest.mark.parametrize("name", slow_after(2, SCENES))
def test_no_legend_covers_a_title(draw, name):
    _, panels = draw(name)
    assert [title for title, axes in panels.items() if is_title_covered(axes)] == []


@pytest.mark.parametrize("name", slow_after(1, MODAL))
def test_a_figure_explains_each_label_once(draw, name):
    _, panels = draw(name)
    legends = filter(None, (axes.get_legend() for axes in panels.values()))
    labels = [text.get_text() for legend in legends for text in legend.get_texts()]
    assert sorted(labels) == sorted({*labels}) != []


@pytest.mark.campaign
def test_a_run_without_named_plots_has_no_panel_of_its_mode(fmus, tmp_path):
    figures = []
    with patch.object(Figure, "savefig", lambda figure, *_, **__: figures.append(figure)):
        result = commands.harness(tmp_path, "run", str(fmus / "stickslip.fmu"), figures=True)
    assert result.returncode == 0, result.stderr
    labels = {axes.get_ylabel() for axes in figures[0].get_axes()}
    assert "F_friction [N]" in labels
    assert "mode" not in labels


def test_angles_are_in_degrees(draw):
    _, panels = draw("pendulum")
    assert panels["angle, zero when hanging down"].get_ylabel() == "theta [deg]"
    assert panels["angular speed"].get_ylabel() == "omega [deg/s]"
    assert curves(panels)["angle, zero when hanging down"][1][0] == pytest.approx(10.02)


@pytest.mark.parametrize(
    ("name", "title", "figures"),
    slow_after(
        2,
        [
            ("smd", "position of the mass", ["sample_0", "sample_n"]),
            ("stickslip", "speed of the sled", ["peak_speed"]),
            ("coulomb-sign", "position of the mass", ["sample_0", "sample_n"]),
            ("pendulum", "angle, zero when hanging down", ["x_0", "x_n"]),
            ("stickslip", "acceleration of the sled", ["peak_acceleration"]),
            ("stickslip-threshold", "speed of the sled", ["peak_speed"]),
        ],
    ),
)
def test_a_known_value_is_shown_with_its_kind(draw, name, title, figures):
    kind = "reference" if name == "stickslip" else "published"
    known_values = [SCENES[name][kind][figure] for figure in figures]
    _, panels = draw(name)
    lines = [line.get_ydata() for line in panels[title].lines if line.get_label().startswith(kind)]
    levels = [y[0] for y in lines if len(set(y)) == 1]
    assert levels == pytest.approx([value[0] if isinstance(value, list) else value for value in known_values])


@pytest.mark.parametrize("name", ["smd", "stickslip-threshold", "pacejka-0.01"])
def test_the_published_mean_step_is_shown_for_comparison(draw, name):
    value, unit = SCENES[name]["published"]["mean_step"]
    _, panels = draw(name)
    levels = {line.get_label(): line.get_ydata()[0] for line in panels["step size of the solver"].lines}
    assert levels[f"published {value:.5g} {unit}"] == pytest.approx(1e-3 * value)


@pytest.mark.parametrize("name", ["smd", "coulomb", "pendulum"])
def test_the_envelope_of_the_known_loss_passes_through_the_turning_points(draw, name):
    """Within the difference between the known value and the measured one."""
    _, panels = draw(name)
    lines = [(line.get_label(), np.asarray(line.get_ydata())) for line in next(iter(panels.values())).lines]
    turning_points = next(np.abs(y) for text, y in lines if text == "turning points")
    kind = "parameter" if name == "coulomb" else "published"
    upper = next(y for text, y in lines if text == kind and len(y) > 1)
    assert upper == pytest.approx(turning_points, abs=0.02 * turning_points[0])


CONTACTS = ROOT / "fmus/more"


def build_fmu(path):
    """Return the FMU of a model file."""
    return build_user_model(path) / f"{path.stem}.fmu"


@pytest.fixture(scope="module")
def blocks_run(tmp_path_factory):
    """The run of a model of two contacts, by itself, with its result folder."""
    folder = tmp_path_factory.mktemp("blocks")
    fmu = build_fmu(CONTACTS / "stacked.py")
    result = commands.harness(folder, "run", str(fmu), figures=True)
    assert result.returncode == 0, result.stderr
    return result.stdout, folder / "results/stacked"


def test_several_contacts_are_named_in_the_events_and_in_the_figure(blocks_run):
    """The modes in the event list are those of the recorded modes; each contact has a row in each column."""
    output, folder = blocks_run
    events = np.genfromtxt(folder / "events.csv", delimiter=",", names=True, deletechars="")
    assert events.dtype.names == ("t_[s]", "F_1", "F_2")
    columns = np.genfromtxt(folder / "trajectory.csv", delimiter=",", names=True, deletechars="")
    for contact, mode in (("F_1", "mode_1"), ("F_2", "mode_2")):
        after = np.searchsorted(columns["t_[s]"], events["t_[s]"], side="right") - 1
        assert (columns[mode][after] == events[contact]).mean() > 0.9  # an event may lie within rounding of its row
        assert f"{contact}: {np.count_nonzero(np.diff(events[contact]))} change" in output
    figure = (folder / "figure.svg").read_text(encoding="utf-8")
    for text in (
        "friction force of the ground on the lower block",
        "friction force of the lower block on the upper one",
    ):
        assert f">{text}<" in figure
    assert figure.count(">sticking of each contact<") == 2


def test_each_contact_force_is_shaded_where_its_own_contact_sticks(blocks_run):
    run = harness.load_result(blocks_run[1])
    for contact, speed in (("F_1", run["v_1"]), ("F_2", run["v_2"] - run["v_1"])):
        for begin, end in run.sticking[contact]:
            is_inside = (run.time > begin + 1e-6) & (run.time < end - 1e-6)
            assert np.abs(speed[is_inside]).max(initial=0.0) < 1e-12
    with pytest.raises(harness.HarnessError, match=r"2 contacts \(F_1, F_2\)"):
        _ = run.events.mode


@pytest.mark.campaign
def test_the_order_of_declaration_does_not_exchange_the_contacts(tmp_path):
    """Modes declared in another order than the contacts belong to the contacts that name them."""
    source = (CONTACTS / "sleds.py").read_text(encoding="utf-8").replace("mode_1, mode_2 =", "mode_2, mode_1 =")
    (tmp_path / "exchanged.py").write_text(source, encoding="utf-8")
    plain, other = (harness.simulate(build_fmu(path)) for path in (CONTACTS / "sleds.py", tmp_path / "exchanged.py"))
    assert {contact: modes.tolist() for contact, modes in other.events.modes.items()} == {
        contact: plain.events.modes[contact].tolist() for contact in ("F_2", "F_1")
    }


@pytest.mark.campaign
def test_input_signals_are_plotted_with_the_outputs():
    run = harness.simulate(
        build_fmu(CONTACTS / "stacked.py"), inputs={"time": [0.0, 4.0, 8.0], "F_ext": [0.0, 5.0, 0.0]}
    )
    labels = [axes.get_ylabel() for axes in run.plot()]
    assert labels[-2:] == ["F_ext [N]", "sticking"]
    assert {"F_1 [N]", "F_2 [N]"} <= {*labels}


OUTPUTS_NAMED_LIKE_PANELS = """
from fmus import Model, Output, Parameter, State


class Named(Model):
    \"\"\"Rotor whose outputs have the names of panels: phase' = speed.\"\"\"

    x = State("m", "a length", start=1.0)
    v = State("m/s", "its rate", rate_of=x)
    a = Output("m/s2", "the rate of v", -x * rate, rate_of=v)
    phase = Output("rad", "phase angle", 2.0 * x * turn)
    position = Output("m", "another length", 3.0 * x)
    steps = Output("m", "a length of steps", 4.0 * x)
"""


@pytest.mark.campaign
def test_an_output_takes_precedence_over_the_panel_of_its_name(tmp_path):
    """Each is drawn as a curve over time, also by a scene, and no panel is drawn in its place."""
    text = OUTPUTS_NAMED_LIKE_PANELS.replace(
        "    x = State",
        '    rate = Parameter(4.0, "1/s2", "rate")\n    turn = Parameter(1.0, "rad/m", "turn")\n    x = State',
    )
    (tmp_path / "named.py").write_text(text, encoding="utf-8")
    fmu = build_fmu(tmp_path / "named.py")
    plots = '["position", "phase", "steps", "velocity"]'
    outputs = '["x", "v", "position", "phase", "steps"]'
    (tmp_path / "named.toml").write_text(
        f'title = "Names"\nfmu = "{fmu.as_posix()}"\noutputs = {outputs}\nplots = {plots}\ngrid = 0.1\n'
    )
    for words, titles in (
        (("named.toml",), {"another length", "phase angle", "a length of steps", "its rate"}),
        ((str(fmu),), {"another length", "phase angle", "a length of steps", "its rate", "a length"}),
    ):
        result = commands.harness(tmp_path, "run", *words, figures=True)
        assert result.returncode == 0, result.stderr
        figure = (tmp_path / "results/named/figure.svg").read_text(encoding="utf-8")
        labels = {*re.findall(r">([^<>]+)</text>", figure)}
        assert titles <= labels
        assert not {"phase plane", "step size of the solver"} & labels
        shutil.rmtree(tmp_path / "results")
