"""fit: parameters of FMUs from drawn records and what a record does not determine."""

import itertools
import json
import re
from dataclasses import replace
from math import isfinite

import build_cache
import commands
import numpy as np
import pytest
from fmpy import read_model_description
from native_fmus import build_native_fmus, require_compiler
from scipy.integrate import solve_ivp
from shared_keys import check_shared_keys
from variants import campaign_after, slow_after

import harness
from benchmarks.campaigns.drawn_records import GROUPS, draw_record
from benchmarks.campaigns.fit_campaign import SOURCES
from harness import HarnessError, SceneError
from harness.analyses.fit.fit_problem import FitProblem
from harness.scenes.run_spec import RunSpec
from harness.simulation.whole_run import open_simulator

pytestmark = pytest.mark.usefixtures("in_workspace")

T = np.linspace(0.0, 16.0, 201)
TRUTH = {"mu_s": 0.8, "mu_d": 0.5, "k": 900.0, "v_driver": 0.04}


def native(model):
    """Return a native FMU of a model for Linux."""
    if model not in SOURCES:
        return build_native_fmus() / f"{model}.fmu"
    require_compiler()
    return build_cache.build_once(SOURCES[model], "--native", "--platform", "linux64") / f"{model}.fmu"


def pull(outputs=("x",), values=TRUTH, t=T, noise=0.01, seed=1):
    """Return a DataFrame with a run of stickslip and white noise, a share of the range of each column."""
    pandas = pytest.importorskip("pandas")
    run = harness.simulate(native("stickslip"), values, times=t, outputs=[*outputs])
    y, units = np.stack([run[name] for name in outputs], axis=1), {name: run.units[name] for name in outputs}
    y = y + noise * np.ptp(y, axis=0) * np.random.default_rng(seed).normal(size=y.shape)
    frame = pandas.DataFrame({"t": t, **dict(zip(outputs, y.T, strict=True))})
    frame.attrs["units"] = {"t": "s"} | units
    return frame


def holds(estimate, truth, factor=1.5):
    """Return whether an interval, widened by a factor, holds the truth."""
    return abs(estimate.value - truth) <= factor * max(estimate.high - estimate.value, estimate.value - estimate.low)


def fit_drawn(name, seed, max_samples):
    """Draw a record of a group of GROUPS and fit it; return the record and the fit."""
    pandas, group = pytest.importorskip("pandas"), GROUPS[name]
    with open_simulator(RunSpec(native(group.model))) as simulator:
        record = draw_record(group, simulator, np.random.default_rng(seed), max_samples=max_samples)
    columns = dict(zip(group.outputs, record.y.T, strict=True)) | record.inputs
    fit = harness.fit(
        native(group.model),
        pandas.DataFrame({"t [s]": record.t, **columns}),
        record.free,
        observe=group.outputs,
        inputs=[*record.inputs],
        values=record.fixed_values,
    )
    return record, fit


SLOW = {
    "force": pytest.mark.slow,
    "position, 4 free": pytest.mark.slow,
}
CAMPAIGN = dict.fromkeys(("forced", "belt", "Stribeck"), pytest.mark.campaign)


@pytest.mark.parametrize(
    "name", ["pendulum", *(pytest.param(name, marks=mark) for name, mark in (SLOW | CAMPAIGN).items())]
)
def test_the_parameters_of_a_drawn_record_are_found(name):
    """The seed was drawn once; benchmarks/campaigns/fit_campaign.py fits hundreds of others."""
    record, fit = fit_drawn(name, [20261123, len(name)], max_samples=250)
    assert fit.describes_record
    for parameter, truth in record.truth.items():
        estimate = fit[parameter]
        assert not isfinite(estimate.error) or abs(estimate.value - truth) < 5 * estimate.error
        assert estimate.low <= estimate.value <= estimate.high


@pytest.mark.campaign
def test_means_of_samples_do_not_shift_the_values_of_a_long_record():
    """Quantised, so that the noise is smaller than it seems: means across the slips shifted k by 10 standard errors."""
    record, fit = fit_drawn("force", [57721, 3, 18], max_samples=20_000)
    assert len(record.t) == 13_381
    for parameter, truth in record.truth.items():
        assert holds(fit[parameter], truth)


@pytest.mark.campaign
def test_a_long_curved_valley_does_not_hide_the_best_values():
    """Runs with the default tolerance scattered so much that fits of this record ended halfway along the valley."""
    record, fit = fit_drawn("Stribeck", [8101, 6, 65], max_samples=20_000)
    for parameter, truth in record.truth.items():
        assert isfinite(fit[parameter].error)
        assert abs(fit[parameter].value - truth) < 5 * fit[parameter].error
    assert fit.columns[0].residual < 1.01 * fit.columns[0].noise


def test_a_position_determines_the_ratio_of_stiffness_and_mass():
    fit = harness.fit(native("stickslip"), pull(), ["k", "m"], observe="x", values={"mu_s": 0.8} | DRIVE_VALUES)
    assert {*fit.undetermined} == {"k", "m"}
    assert [combination.name for combination in fit.combinations] == ["k/m"]
    assert holds(fit["k/m"], 900.0 / 12.5)
    assert any("does not determine k, m" in remark for remark in fit.remarks)


DRIVE_VALUES = {"mu_d": 0.5, "v_driver": 0.04}


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("displacement", "undetermined_names", "is_remarked"),
    slow_after(
        1,
        [(0.0, {"mu_s", "mu_d", "v_driver"}, False), (1e-4, {"mu_s", "mu_d", "v_driver"}, False), (2e-4, set(), True)],
    ),
)
def test_values_that_the_last_samples_alone_exclude_are_remarked(displacement, undetermined_names, is_remarked):
    """The block slips once. Whether it begins to slip a second time decides about all values but k."""
    values, t = {"mu_s": 0.37, "mu_d": 0.14, "k": 400.0, "v_driver": 0.0157}, np.linspace(0.0, 15.9, 2000)
    record = pull(values=values, t=t, noise=0.004)
    record.loc[len(t) - 5 :, "x"] += displacement * np.arange(1, 6)
    fit = harness.fit(native("stickslip"), record, ["mu_s", "mu_d", "k", "v_driver"], observe=["x"])
    remarks = [remark for remark in fit.remarks if "a small part of the record" in remark]
    assert {*fit.undetermined} == undetermined_names
    assert bool(remarks) == is_remarked


def test_several_records_share_parameters_and_have_some_of_their_own():
    speeds = (0.03, 0.05)
    frames = [pull(values=TRUTH | {"v_driver": speed}, seed=i) for i, speed in enumerate(speeds)]
    fit = harness.fit(
        native("stickslip"),
        frames,
        ["mu_s", "v_driver"],
        observe="x",
        each=["v_driver"],
        values={"k": 900.0, "mu_d": 0.5},
    )
    assert [estimate.name for estimate in fit.estimates] == ["mu_s", "v_driver[1]", "v_driver[2]"]
    for number, speed in enumerate(speeds, 1):
        assert holds(fit[f"v_driver[{number}]"], speed)


def read_method(fmu):
    """Return the variable of the solver's method."""
    variables = read_model_description(str(fmu)).modelVariables
    return next(variable for variable in variables if variable.name == "solver.method")


class SearchBeganError(Exception):
    """A fit has checked its request and its records."""


@pytest.fixture
def search_of(monkeypatch):
    """Return search_of(argument, ...): the specification of the runs, the unknowns and the fixed values of a fit that
    would begin to search."""

    def begin_search(simulator, records, unknowns, fixed_values, *options):
        raise SearchBeganError(simulator.spec, {unknown.name: unknown for unknown in unknowns}, fixed_values)

    def search_of(*arguments, **options):
        with pytest.raises(SearchBeganError) as error:
            harness.fit(*arguments, **options)
        return error.value.args

    monkeypatch.setattr("harness.studies.fit.study.fit_records", begin_search)
    monkeypatch.setattr("harness.studies.fit.study.native_equivalent", lambda fmu: fmu)
    return search_of


@pytest.mark.parametrize(
    ("free", "separate_names", "start_names"),
    [
        (("mu_s", "v_driver"), ("v_driver",), ("mu_s", "v_driver[1]", "v_driver[2]")),
        (("mu_s", "mu_d"), (), ("mu_s",)),
    ],
)
def test_a_fit_starts_from_an_earlier_one(tmp_path, search_of, free, separate_names, start_names):
    """From its folder, its file or the result, from Python and in the command; an assignment takes precedence."""
    values = {"mu_s": 0.7, "v_driver[1]": 0.031, "v_driver[2]": 0.052}
    estimates = [{"name": name, "value": value} for name, value in values.items()]
    (tmp_path / "fit.json").write_text(json.dumps({"fit": estimates}))
    frames = [pull(), pull(seed=2)]

    def starts_of(unknowns):
        return {name: unknown.start for name, unknown in unknowns.items() if unknown.start is not None}

    expected = {name: values[name] for name in start_names}
    _, unknowns, _ = search_of("stickslip", frames, free, observe="x", each=separate_names, start=tmp_path)
    assert starts_of(unknowns) == expected
    for i, frame in enumerate(frames):
        frame.rename(columns={"t": "t [s]", "x": "x [m]"}).to_csv(f"{i}.csv", index=False)
    words = [
        "fit",
        "stickslip",
        "0.csv",
        "1.csv",
        "--free",
        ",".join(free),
        *(f"--each={name}" for name in separate_names),
    ]
    for paths in ([tmp_path], [tmp_path / "fit.json"], [tmp_path, "mu_s=0.6"]):
        with pytest.raises(SearchBeganError) as error:
            commands.harness(tmp_path, *words, *(word for path in paths for word in ("--start", path)))
        assert starts_of(error.value.args[1]) == (expected | {"mu_s": 0.6} if len(paths) > 1 else expected)


def test_a_range_that_is_not_given_lies_around_the_start_value(search_of):
    """Otherwise around that of the FMU, which is 742.5."""
    t = np.linspace(0.0, 1.0, 50)
    for start, middle in (({"k": 5000.0}, 5000.0), ({}, 742.5)):
        _, unknowns, _ = search_of("stickslip", {"t": t, "x": np.sin(t)}, ["k"], observe="x", start=start)
        assert (unknowns["k"].low, unknowns["k"].high) == (middle / 4.0, middle * 4.0)


def test_a_sensor_with_offset_and_gain_is_identified():
    frame = pull()
    frame["x"] = 1.1 * frame["x"] + 0.02
    free = ["mu_s", "offset(x)", "gain(x)"]
    fit = harness.fit(native("stickslip"), frame, free, observe="x", values=DRIVE_VALUES | {"k": 900.0})
    for name, truth in {"mu_s": 0.8, "offset(x)": 0.02, "gain(x)": 1.1}.items():
        assert holds(fit[name], truth)


EXACT = {  # record, and what is free, observed and fixed
    "slips": ("stickslip", {}, ["mu_s", "k"], {"mu_d": 0.5, "v_driver": 0.04}, {}),
    "sensor": ("stickslip", {}, ["mu_s", "offset(x)", "gain(x)"], {"mu_d": 0.5, "k": 900.0, "v_driver": 0.04}, {}),
    "robust": ("stickslip", {}, ["mu_s", "mu_d", "k"], {"v_driver": 0.04}, {"robust": True}),
    "start": ("pendulum", {"theta0": 0.9}, ["mu", "J_G", "theta0"], {}, {}),
    "belt": ("belt", {}, ["k", "f_s", "f_d"], {}, {}),
}


@pytest.mark.campaign
@pytest.mark.parametrize("name", EXACT)
def test_exact_derivatives_find_what_differences_find_with_fewer_runs(monkeypatch, name):
    """Where every second derivative does not exist, differences replace it."""
    model, values, free, fixed_values, options = EXACT[name]
    output = "theta" if model == "pendulum" else "x"
    if model == "stickslip":
        record = pull()
    else:
        t = np.linspace(0.0, 6.0, 201)
        y = harness.simulate(native(model), values, times=t, outputs=[output])[output]
        record = {"t": t, output: y + 0.01 * np.ptp(y) * np.random.default_rng(1).normal(size=len(t))}
    exact_jacobian, count = FitProblem.exact_jacobian, itertools.count()

    def fit():
        return harness.fit(native(model), record, free, observe=output, values=fixed_values, **options)

    def every_second(problem, *arguments):
        return None if next(count) % 2 else exact_jacobian(problem, *arguments)

    exact = fit()
    monkeypatch.setattr(FitProblem, "exact_jacobian", every_second)
    half = fit()
    monkeypatch.setattr(FitProblem, "exact_jacobian", lambda *arguments: None)
    by_differences = fit()
    assert exact.n_runs < by_differences.n_runs
    for other in (half, by_differences):
        for exact_estimate, estimate in zip(exact.estimates, other.estimates, strict=True):
            ends = [
                exact_estimate.value - estimate.value,
                exact_estimate.low - estimate.low,
                exact_estimate.high - estimate.high,
            ]
            assert np.abs(ends).max() <= 1e-3 * (estimate.high - estimate.low)
    assert next(count) > 2  # derivatives were wanted


@pytest.mark.campaign
@pytest.mark.parametrize("delay", [0.084, pytest.param(-0.1, marks=pytest.mark.campaign)])
def test_the_delay_of_a_sensor_is_identified(delay):
    """The delayed signal is interpolated from a run with 20 times as many samples."""
    fine = np.linspace(0.0, 8.0, 4001)
    inputs = {"time": fine, "F_ext": shaker(fine)}
    x = harness.simulate(native("coulomb"), {"x0": 0.0, "f": 2.0}, times=fine, inputs=inputs, outputs=["x"])["x"]
    t = fine[:-200:20]
    y = np.interp(t - delay, fine, x) + 0.003 * np.ptp(x) * np.random.default_rng(3).normal(size=len(t))
    frame = pytest.importorskip("pandas").DataFrame({"t [s]": t, "x [m]": y, "F": shaker(t)})
    free = {"f": None, "delay(x)": (-0.3, 0.3)}
    fit = harness.fit(native("coulomb"), frame, free, observe="x", inputs={"F_ext": "F"}, values={"x0": 0.0})
    assert holds(fit["delay(x)"], delay)
    assert holds(fit["f"], 2.0)
    assert fit["delay(x)"].high - fit["delay(x)"].low < 0.005


def shaker(t):
    """Return a force of two frequencies."""
    return 8.0 * np.sin(7.0 * t) + 3.0 * np.sin(3.1 * t)


def test_the_values_predict_a_record_that_was_not_fitted():
    arguments = {"free": ["mu_s"], "observe": "x", "values": DRIVE_VALUES | {"k": 900.0}}
    similar_record, other_record = pull(seed=2, t=T[:150]), pull(values=TRUTH | {"mu_d": 0.7}, seed=3)
    fit = harness.fit(native("stickslip"), pull(), validate=[similar_record, other_record], **arguments)
    good, bad = fit.validation.columns
    assert good.residual < 1.3 * good.noise
    assert bad.residual > 5.0 * bad.noise
    assert [len(record.t) for record in fit.validation.records] == [150, len(T)]
    (remark,) = (remark for remark in fit.remarks if "do not predict" in remark)
    assert "do not predict x in the validation record 2" in remark
    rest = harness.fit(native("stickslip"), pull(), validate=similar_record.assign(x=0.05), **arguments)
    (column,) = rest.validation.columns
    assert column.residual == pytest.approx(np.sqrt(np.mean((0.05 - rest.validation.predictions[0]) ** 2)))
    assert column.noise == fit.columns[0].noise  # a record at rest has none of its own
    spikes = np.where(np.arange(150) % 50 == 25, 20.0 * good.noise, 0.0)
    spiked_fit = harness.fit(
        native("stickslip"),
        pull(),
        validate=similar_record.assign(x=similar_record["x"] + spikes),
        robust=True,
        **arguments,
    )
    assert spiked_fit.validation.columns[0].residual > 2.5 * spiked_fit.validation.columns[0].noise
    assert not any("do not predict" in remark for remark in spiked_fit.remarks)
    arguments |= {"free": {"mu_s": None, "x0": (-0.1, 0.1)}}
    with pytest.raises(SceneError, match="x0 has a value of its own for each record, and none for the validation"):
        harness.fit(
            native("stickslip"), [similar_record, similar_record], validate=similar_record, each=["x0"], **arguments
        )


def test_a_validation_record_is_averaged_only_where_its_means_are_those_of_the_outputs():
    """Means of two samples hold an oscillation of 2 Hz where they are 1 ms apart, and smooth it where they are 10 ms
    apart."""
    noise, frames = 4e-5, []
    for stop in (6.0, 60.0):
        t = np.linspace(0.0, stop, 6001)
        x = harness.simulate(native("smd"), {"c": 0.0}, times=t, outputs=["x"])["x"]
        frames.append({"t [s]": t, "x [m]": x + noise * np.random.default_rng(1).normal(size=len(t))})
    fit = harness.fit(native("smd"), frames[0], {"k": (100.0, 200.0)}, values={"c": 0.0}, observe="x", validate=frames)
    assert fit.records[0].width == 2
    assert [record.width for record in fit.validation.records] == [2, 1]
    separate_fit = harness.fit(
        native("smd"), frames[0], {"k": (100.0, 200.0)}, values={"c": 0.0}, observe="x", validate=frames[1]
    )
    assert separate_fit.validation.columns[0].residual == pytest.approx(noise, rel=0.1)
    assert separate_fit.validation.remarks == ()


def test_a_driven_record_that_is_fitted_and_validated_has_one_prediction():
    """Its inputs are as fine between the samples in both."""
    t = np.linspace(0.0, 4.0, 201)
    run = harness.simulate(native("coulomb"), {"f": 2.0}, times=t, inputs={"time": t, "F_ext": shaker(t)})
    x = run["x"] + 1e-5 * np.random.default_rng(1).normal(size=len(t))
    frame = {"t [s]": t, "x [m]": x, "F [N]": shaker(t)}
    fit = harness.fit(native("coulomb"), frame, ["f"], observe="x", inputs={"F_ext": "F"}, validate=frame)
    np.testing.assert_allclose(fit.validation.predictions[0], fit.predictions[0], rtol=0, atol=1e-12)


def test_a_profile_crosses_its_limit_where_the_interval_ends():
    """Between the points, the root of the squares is nearly linear."""
    fit = harness.fit(native("stickslip"), pull(), ["mu_s", "mu_d"], observe="x", values={"k": 900.0, "v_driver": 0.04})
    for profile, estimate in zip(fit.profiles, fit.estimates, strict=True):
        value, excess = np.array(profile.value), np.array(profile.excess)
        assert excess[value == estimate.value] == 0.0
        root = np.sqrt(excess) * np.sign(value - estimate.value)
        assert np.interp([estimate.low, estimate.high], value, root) == pytest.approx([-1.0, 1.0], abs=0.05)


@pytest.mark.campaign
def test_outliers_count_little_in_a_robust_fit():
    frame = pull()
    frame.loc[::25, "x"] += 0.3
    fit = harness.fit(
        native("stickslip"), frame, ["mu_s"], observe="x", values=DRIVE_VALUES | {"k": 900.0}, robust=True
    )
    assert holds(fit["mu_s"], 0.8)  # without `robust`, the interval is four times as wide
    assert fit["mu_s"].high - fit["mu_s"].low < 0.004


def test_a_record_of_another_motion_is_remarked():
    frame = pull()
    frame["x"] += 0.2 * np.sin(T)
    fit = harness.fit(native("stickslip"), frame, ["mu_s"], observe="x", values=DRIVE_VALUES | {"k": 900.0})
    assert not fit.describes_record
    assert "do not rely on these values" in fit.remarks[0]
    assert not any(isfinite(estimate.error) for estimate in fit.estimates)


def test_the_command_writes_what_it_prints(tmp_path):
    frame = pull()
    frame = frame.assign(x=1e3 * frame["x"]).rename(columns={"t": "t [s]", "x": "laser [mm]"})
    frame.to_csv("pull.csv", index=False)
    words = ("fit", native("stickslip"), "pull.csv", "--free", "mu_s=0.3:1.5,k", "--set", "mu_d=0.5,v_driver=0.04")
    result = commands.harness(tmp_path, *words, "--observe", "x=laser", "--json")
    assert (result.returncode, result.stderr) == (0, "")
    output = json.loads(result.stdout)
    folder = tmp_path / "results" / "fit" / "pull"
    content = json.loads((folder / "fit.json").read_text())
    assert content == output
    assert {file.name for file in folder.iterdir()} == {
        "data.npz",
        "fit.json",
        "fit.csv",
        "figure.svg",
        "provenance.json",
        "summary.json",
    }
    estimates = {estimate["name"]: estimate for estimate in content["fit"]}
    check_shared_keys(content)
    assert estimates["k"]["low"] < 900.0 < estimates["k"]["high"]
    assert estimates["mu_s"]["low"] < 0.8 < estimates["mu_s"]["high"]
    harness.load_result(folder).save(tmp_path / "again")
    assert json.loads((tmp_path / "again/fit.json").read_text()) == content


@pytest.mark.parametrize(
    ("fixed_values", "rtol", "method"),
    [
        ({}, 1e-8, "dop853"),
        ({"solver.rtol": 1e-5}, 1e-5, "dop853"),
        ({"solver.method": "ode45"}, 1e-8, "ode45"),
    ],
)
def test_runs_are_accurate_and_fast_unless_the_user_fixes_other_settings(search_of, fixed_values, rtol, method):
    fmu, t = native("stribeck_sled"), np.linspace(0.0, 1.0, 50)
    spec, _, values = search_of(fmu, {"t": t, "x": np.sin(t)}, {"k": (1.0, 2.0)}, observe="x", values=fixed_values)
    assert harness.describe(fmu)["solver.method"].start == "ode45"
    assert values["solver.rtol"] == rtol
    labels = {int(item.value): item.name for item in read_method(fmu).declaredType.items}
    assert labels[int(spec.values["solver.method"])] == method


@pytest.mark.parametrize("model", ["stickslip", "pacejka"])
def test_fast_and_stiff_methods_are_kept(search_of, model):
    t = np.linspace(0.0, 1.0, 50)
    spec, _, _ = search_of(model, {"t": t, "x": np.sin(t)}, ["k"], observe="x")
    assert "solver.method" not in spec.values


@pytest.mark.parametrize(("motion", "is_described"), [(0.0, True), (1e-3, False)])
def test_a_column_at_rest_with_coloured_noise_is_described(motion, is_described):
    """Before the sled breaks away, the force of the spring determines k; a drift of the sled contradicts the model."""
    frame = pull(("x", "F_spring"), t=np.linspace(0.0, 2.0, 2000))
    white = np.random.default_rng(2).normal(size=len(frame) + 19)
    frame["x"] = 1e-4 * np.convolve(white, 0.8 ** np.arange(20), "valid") + motion * frame["t"]
    observe = ["x", "F_spring"]
    fit = harness.fit(native("stickslip"), frame, {"k": (500.0, 2000.0)}, observe=observe, values=DRIVE_VALUES)
    assert fit.describes_record == is_described
    assert not is_described or holds(fit["k"], TRUTH["k"])


def test_times_in_another_unit_are_named():
    frame = pull(t=np.linspace(0.0, 16.0, 400))
    frame["t"] *= 1e-3
    with pytest.raises(HarnessError, match=r"lasts 0\.016 s, about a thousandth of a run of the FMU \(16 s\)"):
        harness.fit(native("stickslip"), frame, ["mu_s", "k"], observe="x", values=DRIVE_VALUES)


def test_a_record_without_such_a_motion_is_refused():
    frame = pull()
    frame["x"] = 0.0
    with pytest.raises(HarnessError, match="shows no motion"):
        harness.fit(native("stickslip"), frame, ["mu_s"], observe="x")
    frame["x"] = np.cos(7.0 * T)  # free oscillations
    with pytest.raises(HarnessError, match="no values describe the record better than a constant does"):
        harness.fit(native("stickslip"), frame, ["mu_s", "k"], observe="x", values=DRIVE_VALUES)
    frame["x"] = 1e-4 * np.random.default_rng(1).normal(size=len(T))
    with pytest.raises(HarnessError, match="shows no motion beyond its noise"):
        harness.fit(native("stickslip"), frame, {"mu_s": (2.0, 8.0)}, observe="x")


def test_the_campaign_summarizes_its_log(tmp_path, capsys):
    from benchmarks.campaigns.fit_campaign import print_summary

    row = {
        "group": "force",
        "noise": "white, n = 300",
        "truth": {"k": 2.0},
        "seconds": 1.0,
        "remarks": [],
        "errors": {"k": 0.1},
        "deviation": {"k": 6.0},
        "covered": {"k": False},
        "describes_record": True,
    }
    print_summary([row, row | {"deviation": {"k": 1.0}, "covered": {"k": True}}])
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("force"))
    assert line.split()[1:6] == ["2", "0", "0", "1/2", "1"]


LAWS = {"free": ["k", "mu_s", "mu_d", "f_s", "f_d"], "values": {"v_driver": 0.04, "v_s": 0.2}}


@pytest.mark.campaign
@pytest.mark.parametrize(("record_of", "v_s"), [("stickslip", None), ("stribeck_sled", 0.2)])
def test_the_law_that_made_the_record_has_the_lowest_bic(record_of, v_s):
    fmus = [native("stickslip"), native("stribeck_sled")]
    frame = pull(noise=0.003)
    if v_s:
        values = {"f_s": 100.0, "f_d": 40.0, "k": 900.0, "v_driver": 0.04, "v_s": v_s}
        x = harness.simulate(fmus[1], values, times=T, outputs=["x"])["x"]
        frame["x"] = x + 0.003 * np.ptp(x) * np.random.default_rng(2).normal(size=len(T))
    fit = harness.fit(fmus[0], frame, observe="x", against=fmus[1], **LAWS)
    assert fit.comparison.laws[0].fmu == record_of
    assert fit.comparison.is_clear
    assert (fit.comparison.verdict in fit.remarks) == (record_of != "stickslip")
    assert [estimate.name for estimate in fit.estimates] == ["k", "mu_s", "mu_d"]
    assert [estimate.name for estimate in fit.against[0].estimates] == ["k", "f_s", "f_d"]
    assert "stickslip has no f_s, f_d, v_s: its fit leaves them out." in fit.notes
    assert "stribeck_sled has no mu_s, mu_d: its fit leaves them out." in fit.against[0].notes


@pytest.fixture(scope="module")
def compared_fits():
    """Fits of the law that made a record and of a wrong one, each of them first."""
    frame, fmus = pull(t=T[:81]), (native("stickslip"), native("stribeck_sled"))
    options = {"observe": "x", "values": {"k": 900.0, "v_driver": 0.04, "mu_d": 0.5}, "start": {"mu_s": 0.7}}
    return [
        harness.fit(fmu, frame, ["mu_s", "f_s"], against=other_fmu, **options) for fmu, other_fmu in (fmus, fmus[::-1])
    ]


@pytest.mark.campaign
def test_a_bic_is_that_of_white_residuals_of_a_linear_model(compared_fits):
    """For n residuals of variance s2 and k unknowns, BIC = n ln(s2) + k ln(n)."""
    fit = compared_fits[0]
    assert (fit.n_samples, len(fit.estimates)) == (81, 1)
    assert replace(fit, squares=162.0).bic == pytest.approx(81 * np.log(2.0) + np.log(81))


def test_residuals_count_as_those_of_the_law_with_the_smallest(compared_fits):
    """Those of a wrong law are correlated because it is wrong; each law starts from the values that it has."""
    for fit in compared_fits:
        right, wrong = sorted((fit, *fit.against), key=lambda law: law.squares)
        assert [law.fmu for law in fit.comparison.laws] == [right.fmu, wrong.fmu] == ["stickslip", "stribeck_sled"]
        assert wrong.n_independent < 0.5 * right.n_independent
        for law, compared_law in zip((right, wrong), fit.comparison.laws, strict=True):
            n = right.n_independent
            assert compared_law.bic == pytest.approx(n * np.log(law.squares / 81) + len(law.estimates) * np.log(n))


@pytest.mark.campaign
def test_the_command_writes_the_compared_laws(tmp_path):
    frame = pull(t=T[:81]).rename(columns={"t": "t [s]", "x": "x [m]"})
    frame.to_csv("pull.csv", index=False)
    frame.iloc[:60].to_csv("later.csv", index=False)
    words = ("fit", native("stickslip"), "pull.csv", "--free", "mu_s,f_s", "--set", "k=900,v_driver=0.04")
    words += ("--observe", "x=x", "--against", native("stribeck_sled"), "--validate", "later.csv")
    result = commands.harness(tmp_path, *words, "--json")
    assert (result.returncode, result.stderr) == (0, "")
    output = json.loads(result.stdout)
    assert [law["fmu"] for law in output["against"]] == ["stribeck_sled"]
    assert {law["fmu"] for law in output["comparison"]["laws"]} == {"stickslip", "stribeck_sled"}
    assert [column["record"] for column in output["validation"]] == ["later"]
    for name, count in (("fit.csv", 81), ("validation.csv", 60)):
        lines = (tmp_path / "results" / "fit" / "pull" / name).read_text().splitlines()
        assert lines[0].split(",")[2:5] == ["x [m]", "x fit [m]", "x residual [m]"]
        assert lines[0].split(",")[5:] == ["x fit stribeck_sled [m]", "x residual stribeck_sled [m]"]
        assert len(lines) == 1 + count
    table = commands.harness(tmp_path, *words).stdout
    assert "above the best" in table
    assert output["comparison"]["verdict"] in " ".join(table.split())


@pytest.mark.campaign
def test_a_peer_that_fails_has_its_reason_in_the_table(capsys):
    pytest.importorskip("pandas")
    from benchmarks.campaigns import fit_peers

    def fail(*arguments):
        raise AttributeError("no such thing")

    def know(t, x, free, known_values, force):
        record, _ = fit_peers.draw_even_record(fit_peers.KINDS[0], 0, build_native_fmus())
        return record.truth

    peers = {"broken": fit_peers.Peer("numpy", fail, (), True), "exact": fit_peers.Peer("numpy", know, ())}
    attempts = fit_peers.fit_record(0, build_native_fmus(), peers)
    assert {tool: (attempt.is_found, attempt.failure) for tool, attempt in attempts.items()} == {
        "harness.fit": (True, ""),
        "broken": (False, "AttributeError: no such thing"),
        "exact": (True, ""),
    }
    fit_peers.print_table([attempts], dict.fromkeys(attempts, 1), dict.fromkeys(attempts, "1.0"))
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:5] for line in lines[1:3]] == [
        ["harness.fit", "1.0", "1/1", "0", "0"],
        ["broken", "1.0", "0/1", "0", "1"],
    ]
    assert lines[3].strip() == "failed: AttributeError: no such thing"


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("model", "omega", "free"),
    [
        ("smd", 6.0, {"k": (1.0, 100.0)}),
        ("smd", 2.0, {"k": (1.0, 100.0)}),
        ("coulomb", 5.0, {"k": None, "f": None}),
    ],
)
def test_one_noise_of_all_samples_does_not_move_the_fit(model, omega, free):
    """Of models that describe the record well and poorly; where the noise is large, nothing is determined."""
    t = np.linspace(0.0, 5.0 if model == "coulomb" else 2.5, 26)
    record = {"t [s]": t, "x [m]": np.cos(omega * t)}
    options = {"observe": "x", "values": {"x0": 1.0}}
    fits = [harness.fit(native(model), record, free, sigma={"x": 2.0**power}, **options) for power in (-60, 0, 20)]
    assert all(fit.values == fits[0].values for fit in fits)
    assert fits[-1].undetermined == tuple(free)
    assert fits[-1]._headline == ", ".join(f"{name} not determined" for name in free)


@pytest.mark.campaign
@pytest.mark.parametrize("kind", ["long", "quantised"])
def test_one_noise_of_all_samples_moves_no_values_of_a_long_or_quantised_record(kind):
    """A long record is averaged where its own scatter allows it, whatever noise is stated."""
    t = np.linspace(0.0, 4.0, 12001 if kind == "long" else 401)
    x = harness.simulate(native("coulomb"), {"f": 0.3}, times=t)["x"]
    noisy = x + np.random.default_rng(3).normal(0.0, 1e-4, len(t))
    record = {"t [s]": t, "x [m]": noisy if kind == "long" else np.round(noisy / 2e-3) * 2e-3}
    fits = [
        harness.fit(native("coulomb"), record, ["f", "k"], observe="x", sigma={"x": 2.0**power})
        for power in (-14, -9, -4)
    ]
    assert all(fit.values == fits[0].values for fit in fits)
    assert fits[0].values["f"] == pytest.approx(0.3, rel=0.01)


@pytest.mark.campaign
def test_irregular_slips_are_described_one_by_one():
    """Of a real surface each slip starts at another force, which no fit of one static friction describes."""
    random, t = np.random.default_rng(0), np.linspace(0.0, 40.0, 801)
    force, level, record, slips = 0.1, 0.2, [], []
    for time in t:
        if force >= level:
            slips.append((time - 0.05, force - 0.004))
            force, level = random.normal(0.12, 0.01), random.normal(0.2, 0.02)
        record.append(force)
        force += 0.004
    frame = pytest.importorskip("pandas").DataFrame(
        {"t [s]": t, "F_spring [N]": record + 3e-4 * random.normal(size=len(t))}
    )
    known_values, free = {"m": 0.03, "mu_d": 0.4, "v_driver": 1e-3, "k": 80.0}, {"mu_s": (0.5, 1.0)}
    with pytest.raises(HarnessError, match=r"no values describe .* slips of F_spring in the record are irregular"):
        harness.fit(native("stickslip"), frame, free, observe="F_spring", values=known_values)
    fit = harness.fit(native("stickslip"), frame, free, observe="F_spring", values=known_values, robust=True)
    (fitted_slips,) = fit.slips
    times, before = np.array(slips).T
    assert fitted_slips.t == pytest.approx(times, abs=0.051)
    assert fitted_slips.before == pytest.approx(before, abs=2e-3)
    assert fitted_slips.drop == pytest.approx(fitted_slips.before - fitted_slips.after)
    assert f"The {len(fitted_slips.t)} slips of F_spring in the record are irregular" in fit.remarks[0]
    assert fit["slips"][0]["before"] == fitted_slips.before.tolist()


def test_regular_slips_are_described_by_the_fit_alone():
    fit = harness.fit(
        native("stickslip"),
        pull(("F_spring",), t=np.linspace(0.0, 30.0, 1000)),
        {"mu_s": (0.5, 1.0)},
        observe="F_spring",
        values=DRIVE_VALUES | {"k": 900.0},
    )
    assert fit.slips == ()


@pytest.mark.slow
def test_slips_that_an_input_makes_irregular_are_described_by_the_fit_alone():
    random, t = np.random.default_rng(1), np.linspace(0.0, 30.0, 3001)
    force = np.interp(t, np.arange(0.0, 31.0, 1.5), random.uniform(-45.0, 45.0, 21))
    run = harness.simulate(native("stickslip"), times=t, inputs={"time": t, "F_ext": force})
    frame = {"t [s]": t, "F_spring [N]": run["F_spring"] + random.normal(size=len(t))}
    fit_without_input, fit_with_input = (
        harness.fit(native("stickslip"), table, {"mu_s": (0.85, 0.95)}, observe="F_spring")
        for table in (frame, frame | {"F_ext [N]": force})
    )
    assert "slips of F_spring in the record are irregular" in " ".join(fit_without_input.remarks)
    assert (fit_with_input.slips, [text for text in fit_with_input.remarks if "irregular" in text]) == ((), [])
    assert fit_with_input["mu_s"].value == pytest.approx(0.9, rel=1e-3)


@pytest.mark.parametrize(
    ("kind", "words"),
    campaign_after(
        0,
        [
            ("lag", "x lags by 0.02"),
            ("warming", "c rises during the record"),
            ("sensor", "x drifts by +4.* % of its range"),
            ("offset", "x is off by +"),
            ("none", ""),
        ],
    ),
)
def test_residuals_name_what_the_model_lacks(kind, words):
    """The motion of a linear oscillator from another solver, with 40 % more damping at the end, or a wrong sensor."""
    t = np.linspace(0.0, 20.0, 1001)
    change = 0.4 if kind == "warming" else 0.0

    def force(t):
        return 5.0 * np.sin(2.8 * t) + 3.0 * np.sin(7.5 * t)

    def rates(t, y):
        return y[1], force(t) - 100.0 * y[0] - 0.5 * (1 + change * (t / 20.0 - 0.5)) * y[1]

    x = solve_ivp(rates, (0.0, 20.0), (0.0, 0.0), "DOP853", t, rtol=1e-10, atol=1e-12).y[0]
    size = float(np.ptp(x))
    x = {"lag": np.interp(t - 0.02, t, x), "sensor": x + 0.05 * size * t / 20.0, "offset": x + 0.04 * size}.get(kind, x)
    x += 1e-4 * size * np.random.default_rng(1).standard_normal(len(t))
    frame = {"t [s]": t, "x [m]": x, "F_ext [N]": force(t)}
    free = {"c": (0.05, 4.0), "k": (50.0, 200.0)}
    fit = harness.fit(native("coulomb"), frame, free, values={"x0": 0.0, "f": 0.0})
    assert re.search(words.replace("+", r"\+"), " ".join(fit.remarks))
    assert bool(fit.remarks) == bool(words)
    assert holds(fit["k"], 100.0)
    if kind != "warming":
        assert holds(fit["c"], 0.5)
