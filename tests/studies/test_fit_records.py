"""Records of a fit: samples of inputs, repeated times, no noise, and columns that the user does not name."""

import json

import commands
import numpy as np
import pytest
from native_fmus import build_native_fmus
from variants import slow_after

import harness
from harness import SceneError

pytestmark = pytest.mark.usefixtures("in_workspace")

T = np.linspace(0.0, 8.0, 401)


def native(model):
    """Return the native FMU of a model; that of a Python FMU would be built in each test."""
    return build_native_fmus() / f"{model}.fmu"


def frame(columns, units):
    """Return a DataFrame of columns with units."""
    table = pytest.importorskip("pandas").DataFrame(columns)
    table.attrs["units"] = units
    return table


def driven_record(missing_rows=()):
    """Return a record of coulomb, pushed by pulses with pauses at exactly 0; x lacks the samples `missing_rows`."""
    force = np.where(T % 2 < 0.6, np.round(20 * np.sin(np.pi * (T % 2) / 0.6) ** 2, 3), 0.0)
    run = harness.simulate(native("coulomb"), times=T, inputs={"time": T, "F_ext": force})
    x = run["x"] + 1e-5 * np.random.default_rng(1).normal(size=len(T))
    x[[*missing_rows]] = np.nan
    return frame({"t": T, "x": x, "force": force}, {"t": "s", "x": "m", "force": "N"})


@pytest.mark.campaign
def test_missing_samples_of_a_signal_take_none_of_the_input():
    """Half of a pulse lies where x is missing."""
    options = {"free": {"k": (50.0, 200.0), "f": (0.1, 2.0)}, "observe": "x", "inputs": {"F_ext": "force"}}
    complete = harness.fit(native("coulomb"), driven_record(), **options)
    record = driven_record(missing_rows=range(205, 225))
    incomplete = harness.fit(native("coulomb"), record, **options)
    assert "20 of 401 rows have a missing cell" in " ".join(incomplete.notes)
    for result in (complete, incomplete):
        assert result["k"].value == pytest.approx(157.9, rel=1e-4)
        assert result["f"].value == pytest.approx(0.5, rel=5e-2)
    record.loc[300, "force"] = np.nan
    with pytest.raises(SceneError, match=r"force, the input F_ext, has no value in row 301"):
        harness.fit(native("coulomb"), record, **options)


def test_a_sample_that_occurs_twice_does_not_shift_the_values():
    """The times of all samples were spread over the record, which moved k far outside its interval."""
    x = harness.simulate(native("smd"), times=T)["x"] + 1e-4 * np.random.default_rng(1).normal(size=len(T))
    rows = np.append(0, np.arange(len(T)))
    fits = [
        harness.fit(native("smd"), frame({"t": T[i], "x": x[i]}, {"t": "s", "x": "m"}), ["k"]) for i in (rows, rows[1:])
    ]
    assert fits[0]["k"].value == pytest.approx(fits[1]["k"].value, rel=1e-9)
    assert "The time 0 s occurs more than once" in " ".join(fits[0].notes)


@pytest.mark.parametrize(("model", "free"), [("smd", {"c": (0.1, 5.0)}), ("stickslip", ["mu_s", "mu_d"])])
def test_a_record_without_noise_is_fitted(model, free):
    """The squares are 0 if the search meets the values exactly."""
    fit = harness.fit(native(model), harness.simulate(native(model), times=T, outputs=["x"]), free, observe="x")
    truth = harness.simulate(native(model), stop=0.1).parameters
    for estimate in fit.estimates:
        assert estimate.value == pytest.approx(truth[estimate.name], rel=1e-6)
        assert estimate.low < estimate.value < estimate.high


@pytest.mark.parametrize(
    ("columns", "units", "sentence"),
    slow_after(
        1,
        [
            (
                {"laser": 0.5, "x": 1.0},
                {"x": "m", "laser": "m"},
                "x is observed, because a column has its name; `observe`",
            ),
            ({"v": 1.0, "x": 1.0}, {"x": "m", "v": "m/s"}, "x is observed, because a column has its name, and v not;"),
            (
                {"laser": 1e3, "load": 1.0},
                {"laser": "mm", "load": "kg"},
                "x is observed in laser [mm], the only column",
            ),
        ],
    ),
)
def test_a_column_that_fits_is_observed_and_named(tmp_path, columns, units, sentence):
    x = harness.simulate(native("smd"), times=T)["x"]
    record = frame({"t": T, **{name: factor * x for name, factor in columns.items()}}, {"t": "s"} | units)
    fit = harness.fit(native("smd"), record, {"k": (50.0, 400.0)})
    assert fit["k"].value == pytest.approx(harness.simulate(native("smd"), stop=0.1).parameters["k"], rel=1e-6)
    assert fit.notes[0].startswith(sentence)
    record.columns = ["t [s]", *(f"{name} [{units[name]}]" for name in columns)]
    record.to_csv(tmp_path / "pull.csv", index=False)
    result = commands.harness(tmp_path, "fit", native("smd"), "pull.csv", "--free", "k=50:400", "--json")
    assert (result.returncode, result.stderr) == (0, "")
    assert json.loads(result.stdout)["notes"][0] == fit.notes[0].replace("`observe`", "--observe")


@pytest.mark.campaign
def test_a_column_with_the_name_of_an_input_drives_the_runs():
    """Without it, the fit would explain the motion by other parameters."""
    push = {"time": T, "F_ext": 3.0 * np.sin(11.0 * T)}
    run = harness.simulate(native("coulomb"), {"f": 0.2}, times=T, inputs=push)
    records = [{**push, "x": run["x"]}] * 2
    automatic_fit = harness.fit(native("coulomb"), records, ["f", "k"])
    explicit_fit = harness.fit(native("coulomb"), records, ["f", "k"], inputs=["F_ext"])
    assert [estimate.value for estimate in automatic_fit.estimates] == [
        estimate.value for estimate in explicit_fit.estimates
    ]
    assert (
        "the runs are driven by F_ext, because a column has its name; `inputs` selects others." in automatic_fit.notes
    )
    incomplete_fit = harness.fit(native("coulomb"), [records[0], {"time": T, "x": run["x"]}], ["f", "k"])
    assert not any("driven by" in note for note in incomplete_fit.notes)


@pytest.mark.parametrize(
    ("model", "units", "words"),
    [
        ("stickslip", {"laser": "mm"}, ["several units fit", "observe={'x': 'laser [mm]'}"]),  # x and x_driver
        ("smd", {"laser": "mm", "camera": "mm"}, ["several units fit", "observe={'x': 'laser [mm]'}"]),
        ("smd", {"laser": "V"}, ["no unit fits", "name an output and its column"]),
    ],
)
def test_a_choice_between_columns_is_left_to_the_user(model, units, words):
    record = frame({"t": T, **{name: np.sin(T) for name in units}}, {"t": "s"} | units)
    with pytest.raises(SceneError) as refusal:
        harness.fit(native(model), record, {"k": (1.0, 2.0)})
    for text in ("nothing is observed", *words):
        assert text in str(refusal.value)


@pytest.mark.campaign
def test_the_noise_of_an_input_is_named_as_the_cause_and_in_the_intervals():
    push = 5.0 * np.sin(2.7 * T) + 3.0 * np.sin(7.0 * T)
    truth = {"f": 0.7, "c": 0.4}
    x = harness.simulate(native("coulomb"), truth | {"x0": 0.0}, times=T, inputs={"time": T, "F_ext": push})["x"]
    rng = np.random.default_rng(0)
    noisy = push + 0.02 * np.ptp(push) * rng.normal(size=len(T))
    columns = {"t": T, "x": x + 1e-6 * rng.normal(size=len(T)), "F_ext": noisy}
    record = frame(columns, {"t": "s", "x": "m", "F_ext": "N"})
    fit = harness.fit(native("coulomb"), record, {"f": (0.1, 4.0), "c": (0.0, 4.0)}, values={"x0": 0.0})
    assert any("the noise of the input F_ext" in text for text in fit.remarks)
    for name, value in truth.items():  # nearly: the noise shifts the estimates, too
        assert abs(fit[name].value - value) < 0.75 * (fit[name].high - fit[name].low)
