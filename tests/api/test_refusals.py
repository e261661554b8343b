"""Arguments that a function of the public API cannot use are refused in one sentence."""

import numpy as np
import pytest

import harness

RECORD = {"t": np.linspace(0.0, 16.0, 201), "x": np.sin(np.linspace(0.0, 16.0, 201))}
SIMULATE = [  # changes of harness.simulate("smd"), and words of the sentence
    ({"source": "stickslp"}, "unknown model or scene 'stickslp' (nearest: 'stickslip')"),
    ({"source": "nowhere.fmu"}, "nowhere.fmu"),
    ({"source": "fmus"}, "fmus is a folder: give a model, a scene or an FMU"),
    ({"values": {"kk": 1.0}}, "'kk' (nearest: 'k')"),
    ({"values": {"m": -1.0}}, "m = -1.0 is outside its range"),
    ({"values": {"m": float("nan")}}, "m = nan"),
    ({"stop": -1.0}, "stop = -1.0 s is not after start"),
    (
        {"interval": 1e-12},
        "interval = 1e-12 s makes 4e+12 points from 0.0 s to 4.0 s; the limit is 10000000: "
        "choose a larger interval or a shorter run",
    ),
    ({"times": [0.0, 2.0, 1.0]}, "times: 1.0 at index 2 is not after 2.0"),
    ({"times": [0.0, float("nan")]}, "times: nan at index 1 is not a finite number"),
    ({"times": [-1.0, 1.0]}, "times has -1.0 s, outside the run from 0.0 s to 1.0 s"),
    ({"times": [1.0, 2.0], "stop": 1.5}, "times has 2.0 s, outside the run from 0.0 s to 1.5 s"),
    ({"times": [1.0, 2.0], "interval": 0.5}, "times and interval exclude each other"),
    ({"method": "rk4"}, "'rk4'"),
    ({"interface": "ModelExchange"}, "model exchange is not among them"),
    ({"outputs": ["y"]}, "unknown output 'y'"),
    ({"inputs": {"F_ext": [1.0]}}, "inputs has no column 'time'"),
    ({"inputs": {"time": [0.0], "F": [1.0]}}, "unknown input 'F'"),
    ({"inputs": {"time": [0.0, 1.0], "F_ext": [1.0]}}, "F_ext has 1 values for 2 times"),
    ({"inputs": {"time": [1.0, 0.0], "F_ext": [1.0, 1.0]}}, "the time falls"),
    ({"inputs": {"time": [0.0], "F_ext": [float("nan")]}}, "inputs: F_ext holds nan at index 0"),
    (
        {"inputs": {"time": [0.0], "F_ext": [2.0]}, "values": {"F_ext": 1.0}},
        "F_ext = 1.0 and inputs has a column F_ext: remove one",
    ),
    ({"inputs": [1.0, 2.0]}, "inputs must be a mapping, a DataFrame or a Dataset"),
]
DECAY = np.linspace(0.0, 10.0, 101), np.exp(-0.1 * np.linspace(0.0, 10.0, 101)) * np.cos(6.0 * np.linspace(0, 10, 101))
SWING = np.cos(DECAY[0])
IDENTIFY_DECAY = [
    ({"record": [0.0, 1.0]}, "x is missing"),
    ({"record": [0.0, 1.0], "x": [1.0, 2.0]}, "unit is missing"),
    ({"record": [0.0, 1.0], "x": [1.0], "unit": "m"}, "rows of the same length"),
    ({"record": "nowhere.csv"}, "cannot read nowhere.csv"),
    ({"record": np.arange(20.0), "x": np.arange(20.0), "unit": "m", "k": 1.0, "mass": 1.0}, "leave one out"),
    ({"record": DECAY[0], "x": DECAY[1], "unit": "m", "column": "x"}, "column = 'x' has no effect on arrays"),
    ({"record": "nowhere.csv", "x": DECAY[1]}, "x has no effect, because the record has columns"),
    ({"record": "nowhere.csv", "begin": 2.0, "end": 1.0}, "begin = 2.0 s must be before end = 1.0 s"),
    ({"record": {"t": range(20), "x [m]": range(20)}}, "as in t [ms], or as in time='t [ms]'"),
    ({"record": {"y": SWING, "x [m]": SWING}}, "or set the sampling rate in Hz, as in rate="),
    (
        {"record": {"x [m]": SWING, "y [m]": SWING}},
        "name it, as in time='x [m]', or set the sampling rate in Hz, as in rate=",
    ),
    (
        {"record": {"v [m/s]": SWING, "F [N]": SWING}},
        "use harness.identify_curve, or name the column of times, as in time='t'",
    ),
    ({"record": {"t [s]": DECAY[0], "n [counts]": DECAY[1]}}, "as in unit='0.36deg'"),
    (
        {"record": {"t [s]": DECAY[0], "x [m]": DECAY[1]}, "quantity": "velocity"},
        "quantity='velocity': m, the unit of x",
    ),
    ({"record": {"t [s]": DECAY[0], "x [m]": 0.0 * DECAY[0], "y [m]": DECAY[1]}}, "by `column`: y [m]"),
    ({"record": DECAY[0], "x": DECAY[1], "unit": "m", "pendulum": True}, "pendulum=True needs an angle"),
    (
        {"record": DECAY[0], "x": DECAY[0] % 3.0, "unit": "m"},
        "use harness.fit('stickslip', ...) for a driven motion",
    ),
]
CURVE = [  # changes of harness.identify_curve of forces over velocities
    ({"record": (range(1, 9), range(2, 10))}, "as in bias=0"),
    ({"record": {"v [m/s]": SWING, "i [A]": SWING}, "current": "i [A]"}, "as in constant='0.12 N.m/A'"),
    ({"record": {"F [N]": SWING}}, "no column of velocities (it has F [N]): name it, as in velocity='v'"),
    ({"record": {"v [m/s]": SWING}}, "no column of forces (it has v [m/s]): name it, as in force='F'"),
    *(
        ({"record": {"v [m/s]": v * SWING, "F [N]": F * SWING}}, "outside 1e-100 to 1e+100: check its unit")
        for v, F in ((1.0, 1e-200), (1.0, 1e160), (1e-160, 1.0), (1e300, 1.0))
    ),
    ({"record": {"v [m/s]": SWING, "F [N.m]": SWING}}, "or set the right unit, as in force='F [N]'"),
]
SWEEP = [  # changes of harness.sweep("smd", {"k": [1.0]})
    ({"grid": {}}, "grid is empty"),
    ({"grid": {"k": []}}, "k has no values"),
    ({"grid": {"k": ["stiff"]}}, "must be numbers"),
    ({"grid": {"kk": [1.0]}}, "'kk' (nearest: 'k')"),
    ({"grid": {"k": [1.0, 2.0, 3.0]}, "samples": 4}, "its lower and its upper bound"),
    ({"grid": {"k": [[1.0, 2.0], [3.0, 4.0]]}}, "grid: k = [[1.0, 2.0], [3.0, 4.0]] must be numbers, one or a row"),
    ({"values": {"k": 2.0}}, "k is both varied and set; remove one of them"),
]
FIT = [  # changes of a fit of mu_s of the sled to its position
    ({"free": ["mu_z"]}, "unknown parameter 'mu_z' (nearest: 'mu_s')"),
    ({"free": []}, "nothing is free: name the parameters to fit, as in free=["),
    ({"free": {"mu_s": (-1.0, 1.0)}}, "mu_s = -1.0:1.0 is outside the range of the FMU; allowed: at least 0.0"),
    ({"free": {"mu_s": (1.0, 0.5)}}, "mu_s = 1.0:0.5 is not a range"),
    ({"free": ["x0"]}, "x0 has no start value other than 0: give the range to search, as in free={'x0': (-1.0, 1.0)}"),
    ({"observe": {"y": "x"}}, "unknown output 'y'"),
    ({"observe": {"x": "laser"}}, "laser"),
    ({"observe": {"F_spring": "x"}}, "quantity, or the right unit, as in observe={'F_spring': 'x [N]'}"),
    ({"inputs": {"F_ext": "x"}}, "quantity, or the right unit, as in inputs={'F_ext': 'x [N]'}"),
    ({"inputs": {"x0": "x"}}, "unknown input 'x0'; allowed: F_ext"),
    ({"values": {"mu_s": 0.5}}, "mu_s is fixed, and free: remove one"),
    ({"values": {"m": -1.0}}, "m = -1.0 is outside its range"),
    ({"start": {"m": 1.0}}, "unknown free parameter 'm'; allowed: mu_s"),
    ({"free": {"mu_s": (0.1, 2.0)}, "start": {"mu_s": 99.0}}, "the start value 99.0 of mu_s is outside its range"),
    *(
        ({"sigma": {"x": sigma}}, "give the standard deviation of the noise, from 2e-50 to 2e+50")
        for sigma in (5e-324, 1e160)
    ),
    ({"free": {"delay(x)": (0.0, 20.0)}}, "delay(x) = 0.0:20.0 reaches beyond the record, which lasts 16 s"),
    ({"free": ["delay(x)"], "start": {"delay(x)": 5.0}}, "the start value 5.0 of delay(x) is outside its range"),
    ({"free": ["delay(y)"]}, "unknown parameter 'delay(y)' (nearest: 'delay(x)')"),
    ({"validate": "missing.csv"}, "missing.csv"),
    ({"begin": 15.8}, "at least 12 are required"),
    ({"begin": 100.0}, "has 0 samples in this interval; at least 12 are required"),
    (
        {"begin": 14.6, "free": ["mu_s", "mu_d", "k", "v_driver", "m", "g"]},
        "6 unknowns need at least 24 samples, and there are",
    ),
    ({"records": "missing.csv"}, "missing.csv"),
    ({"against": "stickslip"}, "stickslip is to be compared with itself: give another FMU"),
    ({"against": "pendulum", "free": ["m"]}, "unknown output of pendulum 'x'"),
    (
        {"against": "coulomb"},
        "coulomb has none of the free parameters mu_s: free some of its own as well, as in free=['mu_s', ",
    ),
    ({"against": "coulomb", "free": ["mu_s", "mu_z"]}, "unknown parameter 'mu_z' (nearest: 'mu_s')"),
    ({"against": ["coulomb", "coulomb"]}, "coulomb is to be compared with itself"),
    ({"against": "missing.fmu"}, "missing.fmu"),
]
CALLS = [
    *((harness.simulate, {"source": "smd"}, *row) for row in SIMULATE),
    *((harness.identify_decay, {}, *row) for row in IDENTIFY_DECAY),
    *((harness.identify_curve, {}, *row) for row in CURVE),
    *((harness.sweep, {"source": "smd", "grid": {"k": [1.0]}}, *row) for row in SWEEP),
    *((harness.fit, {"source": "stickslip", "free": ["mu_s"], "observe": "x"}, *row) for row in FIT),
    (harness.map_motions, {"over": {"k": [1.0, 2.0]}}, {"source": "nowhere.fmu"}, "there is no nowhere.fmu: specify"),
]


@pytest.fixture
def record():
    """A DataFrame with a record in m, which needs pandas."""
    frame = pytest.importorskip("pandas").DataFrame(RECORD)
    frame.attrs["units"] = {"t": "s", "x": "m"}
    return frame


@pytest.mark.parametrize(("function", "arguments", "changes", "message"), CALLS)
def test_an_invalid_argument_is_one_sentence(user_folder, record, monkeypatch, function, arguments, changes, message):
    pytest.importorskip("xarray")
    monkeypatch.chdir(user_folder)
    records = {"records": record} if function is harness.fit else {}
    with pytest.raises(harness.HarnessError) as refusal:
        function(**(arguments | records | changes))
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert "--" not in str(refusal.value)


def test_remarks_name_arguments_of_the_function(tmp_path):
    """The options of the command line have other names."""
    times = np.linspace(0.0, 20.0, 2001)
    swing = np.exp(-0.05 * times) * np.cos(6.0 * times) + 0.0005 * times
    decay = harness.identify_decay({"t [s]": times, "x": swing})
    speeds = np.repeat(np.linspace(0.01, 0.3, 8), 2) * np.tile([1.0, -1.0], 8)
    curve = harness.identify_curve((speeds, np.sign(speeds) * 1.2 + 2.0 * speeds))
    for words, text in (("drift=True fits", str(decay)), ("unit='mm'", str(decay)), ("values={'", str(curve))):
        assert words in text
        assert "--" not in text
    (tmp_path / "notes.txt").touch()
    with pytest.raises(harness.HarnessError, match="move it or choose another `folder`"):
        decay.save(tmp_path)
