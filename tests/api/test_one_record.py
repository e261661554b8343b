"""What `read_record` returns, a path, tables and arrays of other libraries are the same record to every function."""

import numpy as np
import pytest
from decays import decay_record
from native_fmus import build_native_fmus
from variants import slow_after

import harness
from harness import identify_curve, identify_decay, read_record

pandas = pytest.importorskip("pandas")
xarray = pytest.importorskip("xarray")

T = np.linspace(0.0, 6.0, 601)
X = decay_record(0.02, 0.002, t=T).x
V = np.concatenate([np.linspace(-0.3, -0.01, 12), np.linspace(0.01, 0.3, 12)])
F = np.sign(V) * (1.3 + 0.001 * np.cos(9.0 * V)) + 2.0 * V


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The folder of a decay `decay.csv` and of a friction curve `bench.csv`."""
    folder = tmp_path_factory.mktemp("records")
    decay = pandas.DataFrame({"t [s]": T, "laser [mm]": 1e3 * X})
    decay.to_csv(folder / "decay.csv", index=False)
    pandas.DataFrame({"v [mm/s]": 1e3 * V, "F [N]": F}).to_csv(folder / "bench.csv", index=False)
    return folder


def frame(path):
    return pandas.read_csv(path)


KINDS = {
    "record": read_record,
    "frame": frame,
    "dataset": lambda path: xarray.Dataset.from_dataframe(frame(path)),
    "mapping": lambda path: {name: column.to_numpy() for name, column in frame(path).items()},
}
EVERY_KIND = pytest.mark.parametrize("kind", KINDS)


def numbers(result):
    return {estimate.name: (estimate.low, estimate.value, estimate.high) for estimate in result.estimates}


@pytest.mark.parametrize("kind", slow_after(1, KINDS))
def test_a_decay_is_that_of_its_file(files, kind):
    path = files / "decay.csv"
    assert numbers(identify_decay(KINDS[kind](path))) == numbers(identify_decay(path))


@EVERY_KIND
def test_a_friction_curve_is_that_of_its_file(files, kind):
    path = files / "bench.csv"
    assert numbers(identify_curve(KINDS[kind](path))) == numbers(identify_curve(path))


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
def test_a_fit_is_that_of_its_file(files, kind):
    def fit(record):
        return numbers(
            harness.fit(build_native_fmus() / "smd.fmu", record, {"k": (50, 500)}, observe={"x": "laser"}, end=1.0)
        )

    assert fit(KINDS[kind](files / "decay.csv")) == fit(files / "decay.csv")


@EVERY_KIND
def test_a_comparison_is_that_of_its_file(files, kind):
    path = files / "decay.csv"
    result = harness.compare(KINDS[kind](path), path)
    assert result.to_pandas()["largest"].tolist() == [0.0]


@pytest.mark.campaign
def test_options_of_a_record_hold_in_every_function(files, tmp_path):
    """Unit, interval and column are those given to `read_record`, unless the call replaces them."""
    path = tmp_path / "bare.csv"
    pandas.DataFrame({"t [s]": T, "other": T, "laser": 1e3 * X}).to_csv(path, index=False)
    record = read_record(path, column="laser", unit="mm", begin=0.5, end=4.0)
    assert (record.t[0], record.t[-1], record.unit) == (0.5, 4.0, "m")
    selection = read_record(files / "decay.csv").select(0.5, 4.0)
    assert np.array_equal(record.x, selection.x)
    assert numbers(identify_decay(record)) == numbers(identify_decay(files / "decay.csv", begin=0.5, end=4.0))
    free = {"k": (50, 500), "x0": (-1, 1), "v0": (-5, 5)}
    fits = [harness.fit(build_native_fmus() / "smd.fmu", part, free) for part in (record, record.select(0.5, 1.5))]
    assert [(fit.records[0].t[0], fit.records[0].t[-1]) for fit in fits] == [(0.5, 4.0), (0.5, 1.5)]
    assert np.ptp(fits[0].records[0].y) == pytest.approx(np.ptp(record.x))
    assert identify_decay(record, end=3.0).record.t[-1] <= 3.0
    comparison = harness.compare(record, harness.Signals(T, {"laser": 1e3 * X}, {"laser": ""}))
    assert comparison.to_pandas()["largest"].tolist() == [0.0]


def test_a_record_that_nothing_can_be_read_from_is_refused_at_once(tmp_path):
    path = tmp_path / "names.csv"
    path.write_text("x [mm],y [mm]\n" + "1,2\n" * 30)
    with pytest.raises(harness.SceneError, match="no column of times"):
        read_record(path)
