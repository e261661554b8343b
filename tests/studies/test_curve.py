"""The command curve, its files, and the FMU of its model file."""

import json

import commands
import numpy as np
import pytest
from matplotlib.figure import Figure
from variants import campaign_after, slow_after

import harness

SPEEDS = np.geomspace(1e-3, 0.3, 10)
V = np.concatenate([SPEEDS, -SPEEDS])
FORWARD, BACKWARD = (10.0, 16.0, 0.02, 20.0), (8.0, 11.0, 0.03, 30.0)


def friction(v, constants):
    F_c, F_s, v_s, F_v = constants
    return np.sign(v) * (F_c + (F_s - F_c) * np.exp(-((v / v_s) ** 2))) + F_v * v


def write_points(file, headings, backward, v=V):
    force = np.where(v > 0, friction(v, FORWARD), friction(v, backward)) + 0.05 * np.sin(1e4 * v)
    np.savetxt(file, np.column_stack([v, force]), delimiter=",", header=headings, comments="")


@pytest.mark.parametrize(
    ("headings", "backward", "speed", "force"),
    campaign_after(
        1, [("v [m/s],F [N]", FORWARD, "v", "F_friction"), ("w [rad/s],T [N.m]", BACKWARD, "omega", "T_friction")]
    ),
)
def test_the_fmu_of_the_model_file_has_the_friction_of_the_best_law(tmp_path, headings, backward, speed, force):
    write_points(tmp_path / "bench.csv", headings, backward)
    result = commands.harness(tmp_path, "curve", "bench.csv", "--velocity", headings[:1])
    assert result.returncode == 0, result.stderr
    curve = harness.load_result(tmp_path / "results" / "curve" / "bench")
    assert curve.best.law.is_symmetric == (backward is FORWARD)
    build_result = commands.build("results/curve/bench/measured.py", folder=tmp_path)
    assert build_result.returncode == 0, build_result.stderr
    fmu = tmp_path / "results" / "curve" / "bench" / "measured.fmu"
    for v_driver in (0.2, -0.2):
        run = harness.simulate(fmu, {"k": 1e4, "v_driver": v_driver}, stop=1.0)
        slides = np.abs(run[speed]) > 1e-3
        assert slides.sum() > 10
        np.testing.assert_allclose(run[force][slides], curve.best.friction(run[speed][slides]), rtol=1e-6)


def test_a_result_goes_on_to_models_and_tables(tmp_path):
    write_points(tmp_path / "bench.csv", "v [m/s],F [N]", FORWARD)
    process = commands.harness(tmp_path, "curve", "bench.csv", "--mass", "2", "--json")
    result = json.loads(process.stdout)
    values = {item["name"]: item["value"] for item in result["fit"]}
    assert values["F_s"] == pytest.approx(16.0, rel=0.02)
    belt, lugre, sled = (result["models"][name] for name in ("belt", "lugre", "stickslip"))
    assert (belt["law"], belt["m"]) == ("stribeck", 2.0)
    expected = [values[name] for name in ("F_s", "F_c", "v_s", "F_v")]
    np.testing.assert_allclose([belt[name] for name in ("F_s", "F_c", "v_s", "b")], expected, rtol=1e-5)
    np.testing.assert_allclose([lugre[name] for name in ("F_s", "F_c", "v_s", "sigma_2")], expected, rtol=1e-5)
    assert sled["mu_s"] * 2.0 * 9.81 == pytest.approx(values["F_s"], rel=1e-5)
    folder = tmp_path / "results" / "curve" / "bench"
    for file in ("table.csv", "table-forward.csv", "table-backward.csv"):
        heading, *rows = (folder / file).read_text().splitlines()
        assert heading == "speed [m/s],friction [N]"
        speed, force = np.array([[float(cell) for cell in row.split(",")] for row in rows]).T
        assert (np.diff(speed) > 0).all()
        np.testing.assert_allclose(force, friction(speed, FORWARD), atol=0.1)


@pytest.mark.parametrize("backward", slow_after(1, [(BACKWARD,), (FORWARD,)]))
def test_the_fmu_of_the_table_has_the_friction_of_the_points(tmp_path, backward):
    """It sticks and slips in both directions, and slides with the friction of the points, less their mean bias."""
    write_points(tmp_path / "bench.csv", "v [m/s],F [N]", backward)
    result = commands.harness(tmp_path, "curve", "bench.csv")
    assert result.returncode == 0, result.stderr
    folder = tmp_path / "results" / "curve" / "bench"
    build_result = commands.build("results/curve/bench/measured_table.py", folder=tmp_path)
    assert build_result.returncode == 0, build_result.stderr
    force = np.loadtxt(tmp_path / "bench.csv", delimiter=",", skiprows=1)[:, 1].reshape(2, -1)
    bias = harness.load_result(folder).best.bias
    forward, reverse = force[0] - bias, bias - force[1]
    if backward is FORWARD:
        forward = reverse = 0.5 * (forward + reverse)
    for sign, expected in (1.0, forward), (-1.0, reverse):
        run = harness.simulate(folder / "measured_table.fmu", {"v_driver": sign * 5e-3, "k": 2e3})
        assert (np.diff(sign * run["mode"]) > 0).sum() > 3
        speed = sign * run["v"]
        slides = speed > 1e-6
        assert speed[slides].max() > 5.0 * SPEEDS[0]
        friction = sign * run["F_friction"]
        np.testing.assert_allclose(friction[slides], np.interp(speed[slides], SPEEDS, expected), rtol=1e-12)
        assert friction[~slides].max() == pytest.approx(expected[0], rel=0.05)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--velocity", "v", "--position", "v"], "velocity and position are both given"),
        (["--current", "F"], "a current needs the constant of the motor, as in --constant '0.12 N.m/A'"),
        (["--mass", "-1"], "'-1' is not a finite number above 0"),
        (["--force", "G"], "unknown column 'G'; allowed: F [N], v [m/s]"),
    ],
)
def test_options_that_do_not_fit_are_refused_in_a_sentence(tmp_path, options, message):
    write_points(tmp_path / "bench.csv", "v [m/s],F [N]", FORWARD)
    result = commands.harness(tmp_path, "curve", "bench.csv", *options)
    assert result.returncode == 2
    assert message in result.stderr
    assert not (tmp_path / "results" / "curve" / "bench").exists()


@pytest.mark.parametrize(
    ("headings", "constant", "units", "reason"),
    [
        ("t,u,i,omega", "0.042N.m/A", ("rad/s", "N.m"), "because the constant is in N.m/A"),
        ("t,u,i,v", "0.042 N.m/A", ("rad/s", "N.m"), "because the constant is in N.m/A"),
        ("t,u,i,omega", "35 N/A", ("m/s", "N"), "a velocity in m/s is assumed."),
        ("t,u,F [N.m],speed", None, ("rad/s", "N.m"), "because F [N.m] is in N.m"),
        ("t,u,F [N],omega", None, ("m/s", "N"), "a velocity in m/s is assumed."),
        ("t,u,F,omega", None, ("rad/s", "N.m"), "because its name is that of a rotation"),
        ("t,u,torque,v", None, ("rad/s", "N.m"), "because torque is a torque"),
        ("t,u,F,v", None, ("m/s", "N"), "a velocity in m/s is assumed."),
        ("t,u,i,omega [rpm]", "0.042 N.m/A", ("rad/s", "N.m"), "i has no unit: A is assumed."),
    ],
)
def test_a_known_unit_outranks_names_and_names_outrank_a_default_unit(tmp_path, headings, constant, units, reason):
    """Of a table whose columns are times, a voltage, a force or a current, and a velocity."""
    speed = np.array([s * w for w in SPEEDS for s in (1, -1)])
    rows = np.column_stack(
        [0.5 + np.arange(len(speed)), np.full(len(speed), 12.0), np.sign(speed) + 0.1 * speed, speed]
    )
    np.savetxt(tmp_path / "motor.csv", rows, delimiter=",")
    record = harness.read_record(tmp_path / "motor.csv", headings=headings)
    curve = harness.identify_curve(record, constant=constant, points=True)
    assert (curve.points.velocity_unit, curve.points.force_unit) == units
    assert reason in " ".join(curve.points.notes)


def test_the_drawn_laws_span_the_measured_speeds_of_both_directions():
    v = np.array([sign * speed for speed in np.geomspace(0.01, 0.3, 12) for sign in (1.0, -1.0)])
    axes = Figure().subplots()
    harness.identify_curve((v, np.sign(v) * 1.2 + 2.0 * v)).plot(ax=axes)
    laws = [np.array(line.get_xydata()) for line in axes.lines if line.get_linestyle() == "-"]  # the best one, twice
    ends = sorted(tuple(law[i]) for law in laws for i in (0, -1))
    expected = [(-0.3, -1.8), (-0.01, -1.22), (0.01, 1.22), (0.3, 1.8)]
    assert np.array(ends) == pytest.approx(np.array(expected), rel=1e-9)
