"""Maps of motions over one or two parameters, against closed forms."""

import re
from math import atan, pi, sqrt

import commands
import pytest
from external_fmus import edited_copy
from scipy.optimize import brentq

import harness
from tests.studies.oscillators import DELTA, STATIC, C, edge_of_stick_slip, native


@pytest.mark.slow
def test_the_map_of_the_belt_has_the_edges_of_closed_forms():
    """Also in worker processes; constant friction leaves steady sliding stable, and both motions possible."""
    over = {"c": [0.05, 0.1, 0.2], "v_belt": [0.1, 0.12, 1.5]}
    result = harness.map_motions(native("belt"), over, {"law": "coulomb"})
    bistable_label, steady_label = "steady sliding or stick-slip", "steady sliding"
    assert result.labels == (bistable_label,) * 6 + (steady_label,) * 3
    assert {(edge.below, edge.above) for edge in result.edges} == {(bistable_label, steady_label)}
    for edge, c in zip(result.edges, over["c"], strict=True):
        assert edge.point == pytest.approx((c, edge_of_stick_slip(c)), rel=1e-11)
    *_, curve = result.plot()[0].lines  # which joins the edges
    assert {tuple(point) for point in curve.get_xydata()} == {edge.point for edge in result.edges}
    parallel_result = harness.map_motions(native("belt"), over, {"law": "coulomb"}, workers=2)
    assert parallel_result.edges == result.edges


@pytest.mark.campaign
def test_a_map_of_an_fmu_of_another_tool_counts_returns_by_its_saved_states(tmp_path):
    """Without the variables that expose its steps, the belt is such an FMU."""
    rename = {"modelDescription.xml": lambda text: text.replace("solver.t_next", "solver.next")}
    fmu = edited_copy(native("belt"), tmp_path / "other.fmu", rename)
    over, values = {"v_belt": [0.1, 0.3]}, {"law": "coulomb", "c": 0.2, "solver.rtol": 1e-12}
    result = harness.map_motions(fmu, {"v_belt": [0.1, 0.2, 0.3]}, values, section="v")
    (edge,) = result.edges
    assert (edge.below, edge.above) == ("1 return in a period", "no return")
    assert edge.point[0] == pytest.approx(edge_of_stick_slip(0.2), rel=1e-10)
    with pytest.raises(harness.SceneError, match="name a section, one of its outputs, or a measure"):
        harness.map_motions(fmu, over, values)
    with pytest.raises(harness.SceneError, match="returns are counted without inputs"):
        harness.map_motions(fmu, over, values, section="v", inputs={"time": [0.0, 1.0], "F_ext": [0.0, 1.0]})
    with pytest.raises(harness.SceneError, match="unknown section 'speed'"):
        harness.map_motions(fmu, over, values, section="speed")
    without = {"modelDescription.xml": lambda text: re.sub(r'can\w+FMUstate="true"', "", text)}
    other = edited_copy(fmu, tmp_path / "none.fmu", without)
    with pytest.raises(harness.HarnessError, match="does not save its states"):
        harness.map_motions(other, over, values, section="v")


def test_a_map_of_the_number_of_slips_has_the_edges_of_the_closed_form():
    m, k, mu_s, g, speed, stop = 12.5, 742.5, 0.9, 9.81, 0.034, 16.0
    frequency = sqrt(k / m)

    def start_of_slip(mu_d, number):
        fall = (mu_s - mu_d) * m * g / k
        period = 2 * fall / speed + 2 / frequency * (pi - atan(fall * frequency / speed))
        return mu_s * m * g / (k * speed) + (number - 1) * period

    result = harness.map_motions(native("stickslip"), {"mu_d": [0.3, 0.5, 0.7]}, measure="slips")
    assert result.labels == ("slips 2", "slips 3", "slips 5")
    assert "[]" not in str(result)  # of a parameter without a unit
    for edge, number in zip(result.edges, (3, 4, 5), strict=True):
        exact = brentq(lambda mu_d, n=number: start_of_slip(mu_d, n) - stop, 0.3, 0.8, xtol=1e-15)
        assert edge.point[0] == pytest.approx(exact, rel=1e-11)
    assert "more edges than were located" not in str(result)
    coarse = harness.map_motions(native("stickslip"), {"mu_d": [0.3, 0.87, 0.88]}, measure="slips")
    assert (coarse.n_gaps > 0, "more edges than were located" in " ".join(str(coarse).split())) == (True, True)
    for edge in coarse.edges:  # not all, but each is between neighbours
        below, number = (int(label.split()[1]) for label in (edge.below, edge.above))
        assert number == below + 1
        assert start_of_slip(edge.point[0], number) == pytest.approx(stop, rel=1e-10)
    for options, message in (
        ({"levels": [1.0]}, "`levels` has no effect without `measure`"),
        ({"measure": "slips", "section": "v"}, "`section` has no effect with `measure`"),
        ({"measure": "speed"}, "unknown measure of stickslip 'speed'"),
    ):
        with pytest.raises(harness.SceneError, match=message):
            harness.map_motions(native("stickslip"), {"mu_d": [0.3, 0.7]}, **options)
    with pytest.raises(harness.SceneError, match="is not a whole number: give the levels"):
        harness.map_motions(native("stickslip"), {"mu_d": [0.3, 0.7]}, measure="peak_speed")
    levels = harness.map_motions(
        native("stickslip"), {"mu_d": [0.3, 0.5, 0.7]}, measure="peak_speed", levels=[0.3, 0.5]
    )
    assert levels.labels == ("0.5 <= peak_speed", "0.5 <= peak_speed", "peak_speed < 0.3")
    for edge, level in zip(levels.edges, (0.5, 0.3), strict=True):  # in closed form
        assert speed + sqrt((frequency * (mu_s - edge.point[0]) * m * g / k) ** 2 + speed**2) == pytest.approx(
            level, rel=1e-4
        )


@pytest.mark.slow
def test_points_at_which_runs_fail_are_a_region(in_workspace):
    result = harness.map_motions(native("coulomb"), {"f": [-0.25, 0.25, 0.5]}, measure="events", levels=[-1.0])
    assert result.labels == ("run failed", "-1 <= events", "-1 <= events")
    assert result.edges[0].point[0] == pytest.approx(0.0, abs=1e-15)  # the smallest friction force
    assert "of these runs failed, such as f = -0.25: f = -0.25 N is refused" in " ".join(str(result).split())
    words = ("--over", "f=-0.25:0.5:4", "--measure", "events", "--workers", "1")
    process = commands.harness(in_workspace, "map", "coulomb", *words)
    assert process.returncode == 1
    assert re.fullmatch(r"Error: \d+ of \d+ runs failed\n", process.stderr)
    with pytest.raises(harness.HarnessError, match=r"^all runs of the map failed, such as f = -2: f = -2\.0 N is ref"):
        harness.map_motions(native("coulomb"), {"f": [-2.0, -1.5, -1.0]}, measure="events", workers=1)


@pytest.mark.campaign
def test_the_map_of_a_forced_mass_counts_its_stops():
    result = harness.map_motions(native("forced"), {"Omega": [5.0, 6.0, 7.0]})
    assert result.labels == (*["2 sticks in a period"] * 2, "0 sticks in a period")
    value = result.edges[-1].point[0]
    assert value == pytest.approx(
        harness.orbit(native("forced"), over={"Omega": [6.0, 6.5, 7.0]}).points[0].value, rel=1e-9
    )


def test_the_command_map_saves_what_the_function_returns(tmp_path):
    arguments = ("--over", "v_belt=0.4:6:3", "--over", "c=0.1:0.2:3", "--workers", "1", "--json")
    result = commands.harness(tmp_path, "map", native("belt"), *arguments)
    loaded_result = harness.load_result(tmp_path / "results" / "map" / "belt-v_belt-c")
    stable = [edge.point for edge in loaded_result.edges if edge.below == "stick-slip"]
    assert stable[0][0] == pytest.approx((sqrt(DELTA * STATIC / C) - 1) / DELTA, rel=1e-11)
    assert result.returncode == 0
