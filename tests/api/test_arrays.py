"""Arrays and columns of any type hold the numbers that their library shows: none that a mask hides."""

import tracemalloc
from decimal import Decimal

import numpy as np
import pytest
from native_fmus import build_native_fmus
from variants import slow_after

import harness

pandas = pytest.importorskip("pandas")

T = np.linspace(0.0, 0.25, 5)
F = 3.0 * np.sin(9.0 * T)
KINDS = {
    "big-endian and strided": lambda x: np.repeat(x.astype(">f4"), 2)[::2],
    "objects": lambda x: [Decimal(x[0]), *x[1:].astype(object)],
    "masked": lambda x: np.ma.array(x, mask=False),
    "nullable": lambda x: pandas.array(x, dtype="Float64"),
    "another index": lambda x: pandas.Series(x, index=range(len(x), 0, -1)),
}


def each_function(convert):
    """Return numbers from each function that takes rows of numbers, which `convert` makes of arrays."""
    run = harness.simulate("coulomb", times=convert(T), inputs={"time": convert(T), "F_ext": convert(F)})
    difference = harness.compare(run, {"t": convert(T), "x": convert(F)}).to_pandas()
    frame = harness.compare(run, pandas.DataFrame({"t": convert(T), "x": convert(F)})).to_pandas()
    return run["x"].tolist(), difference.to_csv(), frame.to_csv()


@pytest.mark.parametrize("kind", slow_after(1, KINDS))
def test_numbers_of_any_type_are_taken_as_they_are(user_folder, monkeypatch, kind):
    monkeypatch.chdir(user_folder)
    convert = KINDS[kind]
    assert each_function(convert) == each_function(lambda x: np.array([float(number) for number in convert(x)]))


def test_numbers_that_a_mask_hides_are_missing(user_folder, monkeypatch):
    monkeypatch.chdir(user_folder)
    masked_values = np.ma.array([0.0, 0.1, 9e36], mask=[False, False, True])
    for function, arguments in (
        (harness.simulate, {"times": masked_values}),
        (harness.simulate, {"inputs": {"time": [0.0, 0.1, 0.2], "F_ext": masked_values}}),
        (harness.sweep, {"grid": {"f": masked_values}}),
    ):
        with pytest.raises(harness.SceneError, match=r"nan at index 2|not a finite number"):
            function("coulomb", **arguments)
    run = harness.simulate("coulomb", times=[0.0, 0.1, 0.2])
    result = harness.compare(run, {"t": [0.0, 0.1, 0.2], "x": masked_values})
    assert "x is not a finite number at t = 0.2 s" in str(result)
    t = np.linspace(0.0, 6.0, 121)
    x = np.ma.array(np.exp(-0.1 * t) * np.cos(6.0 * t), mask=np.arange(121) % 20 == 7)
    x.data[x.mask] = 0.5
    assert "6 of 121 rows have a missing cell" in str(harness.identify_decay((t, x), unit="m", drag=False))


@pytest.mark.campaign
def test_time_deltas_are_seconds_and_labels_may_be_an_array(user_folder, monkeypatch):
    monkeypatch.chdir(user_folder)
    delta = pandas.to_timedelta(T, unit="s")
    expected = harness.simulate("coulomb", times=T, inputs={"time": T, "F_ext": F})
    frame = pandas.DataFrame({"F_ext": F}, index=delta.rename("time"))
    dataset = frame.to_xarray()
    for inputs in ({"time": delta, "F_ext": F}, frame, dataset, dataset["F_ext"], dataset.assign(time=T)):
        run = harness.simulate("coulomb", times=delta.to_numpy(), inputs=inputs)
        assert run["x"].tolist() == expected["x"].tolist()
    for heading in ("t", "t [s]", "t [ms]"):
        table = pandas.DataFrame({heading: delta, "x": expected["x"]})
        assert "Compared at 5 times (common to both)" in str(harness.compare(expected, table))
    assert harness.sweep("coulomb", {"friction": np.array(["hybrid"])}, stop=0.1)["friction"].values.tolist() == [1.0]


@pytest.mark.parametrize("zone", [None, "UTC"])
def test_time_stamps_are_refused_with_what_to_do(user_folder, monkeypatch, zone):
    """Where a run or a pair of arrays needs times; the columns of a table may hold time stamps."""
    monkeypatch.chdir(user_folder)
    index = pandas.date_range("2026-01-01", periods=5, freq="s", tz=zone)
    for stamps in (index, index.to_numpy(), list(index), pandas.Series(index)):
        for call in (
            lambda stamps=stamps: harness.simulate("coulomb", inputs={"time": stamps, "F_ext": F}),
            lambda stamps=stamps: harness.simulate("coulomb", times=stamps),
            lambda stamps=stamps: harness.identify_decay((stamps, F), unit="m"),
        ):
            with pytest.raises(harness.SceneError, match=r"time stamps are no numbers: subtract the first one"):
                call()


@pytest.mark.campaign
def test_an_index_without_a_name_is_the_time_if_no_column_is(user_folder, monkeypatch):
    monkeypatch.chdir(user_folder)
    run = harness.simulate("smd", times=np.linspace(0.0, 4.0, 401), outputs=["x"])
    table = pandas.DataFrame({"t": run.time, "x": run["x"]})
    frame, series = (table.set_index(run.time)["x"].to_frame(), table.set_index(run.time)["x"])
    functions = (
        lambda record: harness.identify_decay(record, unit="m", column="x").as_json()["fit"],
        lambda record: harness.fit(build_native_fmus() / "smd.fmu", record, "k")["k"],
        lambda record: str(harness.compare(run, record)),
    )
    for function in functions:
        assert function(frame) == function(series) == function(table) == function(table.set_index(run.time + 1.0))
    assert "The index of the table is taken as the column t in s." in str(harness.identify_decay(frame))
    for index in (range(401), run.time[::-1]):
        with pytest.raises(harness.SceneError, match="the record has one column of numbers, x, and no times"):
            harness.identify_decay(frame.set_index(pandas.Index(index)))


def test_a_long_text_takes_the_memory_of_one_text():
    """Not that of one in each row."""
    notes = ["a" * 100_000, *["ok"] * 1999]
    table = {"t": np.arange(2000.0), "x": np.arange(2000.0), "note": notes}
    tracemalloc.start()
    with pytest.raises(harness.SceneError, match="the column note of the record holds texts, as 'aaa"):
        harness.compare(table, table)
    assert tracemalloc.get_traced_memory()[1] < 5e6
    tracemalloc.stop()


@pytest.mark.campaign
def test_tables_of_xarray_are_records(user_folder, monkeypatch):
    pytest.importorskip("xarray")
    monkeypatch.chdir(user_folder)
    run = harness.simulate("smd")
    dataset = run.to_xarray()
    assert {row["largest"] for row in harness.compare(run, dataset)["variables"]} == {0.0}
    expected = harness.identify_decay(run).as_json()["fit"]  # which takes k from the model
    for record in (dataset, dataset["x"]):
        assert harness.identify_decay(record, k=157.9).as_json()["fit"] == expected
    with pytest.raises(harness.SceneError, match="the table has the dimensions time, case: select one, the time"):
        harness.identify_decay(dataset["x"].expand_dims("case", 1))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: harness.simulate("coulomb", times=[0.2, 0.1]), "0.1 at index 1 is not after 0.2"),
        (lambda: harness.simulate("coulomb", inputs={"time": [], "F_ext": []}), "inputs has no rows"),
        (lambda: harness.simulate("coulomb", {"m": [1.1]}), r"m = \[1.1\] must be one number"),
        (lambda: harness.identify_decay((T, ["a"] * 5)), r"record: x = \['a', .* must be a row of numbers"),
        (lambda: harness.identify_decay({"t": [], "x": []}), "the record has no rows"),
        (
            lambda: harness.compare("coulomb", pandas.DataFrame({"t": T, "x": T, "note": "a"})),
            "the column note of the record holds texts, as 'a'",
        ),
    ],
)
def test_a_refusal_names_what_is_wrong(user_folder, monkeypatch, call, message):
    monkeypatch.chdir(user_folder)
    with pytest.raises(harness.SceneError, match=message):
        call()
