"""Sweeps on the built FMUs: the runs they should do, whoever does them, and none of them twice."""

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from math import sqrt

import commands
import numpy as np
import pytest
from builds import ROOT

xarray = pytest.importorskip("xarray", reason="the extra 'sweep' is not installed")
pytest.importorskip("distributed", reason="the extra 'sweep' is not installed")
pandas = pytest.importorskip("pandas", reason="the extra 'sweep' is not installed")

from harness.errors import HarnessError, SceneError  # noqa: E402
from harness.studies.sweep.rerun import Runs, ready  # noqa: E402
from harness.studies.sweep.space import Axis, axis, points  # noqa: E402
from harness.studies.sweep.study import Journal, Sweep  # noqa: E402

ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT)}
MAP = ("sweep", "stickslip", "--vary", "mu_d=0.5:0.8:4", "--vary", "v_driver=0.02,0.05,0.1", "--measure", "final,slips")


@pytest.fixture
def harness(fmus, tmp_path):
    """harness(argument, ...): the finished process, in a folder with the built FMUs."""
    (tmp_path / "fmus").symlink_to(fmus)

    return partial(commands.harness, tmp_path)


def opened(folder):
    with xarray.open_dataset(folder / "sweep.nc") as data:
        return data.load()


def test_a_grid_has_every_combination_and_a_sample_every_stratum():
    grid = points((axis("a=1:3:3", False), axis("b=1:100:3:log", False)), None, 1)
    assert grid == pytest.approx(np.array([[a, b] for a in (1, 2, 3) for b in (1, 10, 100)]))
    sample = points((axis("a=1:2", True), axis("b=1:100:log", True)), 20, 1)
    assert sorted(np.floor(20 * (sample[:, 0] - 1))) == list(range(20))
    assert sorted(np.floor(20 * np.log(sample[:, 1]) / np.log(100))) == list(range(20))
    assert (sample == points((axis("a=1:2", True), axis("b=1:100:log", True)), 20, 1)).all()


@pytest.mark.parametrize(
    ("text", "random"),
    [
        ("a", False),
        ("a=1:2", False),
        ("a=1:2:x", False),
        ("a=1:2:0", False),
        ("a=1:nan:3", False),
        ("=1:2:3", False),
        ("a=-1:2:3:log", False),
        ("a=1,1", False),
        ("a=2:1", True),
        ("a=1:2:3", True),
        ("a=1,2", True),
    ],
)
def test_an_axis_that_is_none_is_refused(text, random):
    with pytest.raises(SceneError):
        axis(text, random)


def test_the_instance_that_is_reset_gives_what_a_fresh_one_gives(fmus):
    """Also after a run that failed."""
    runs = Runs(
        "stickslip", ("mu_d", "v_driver"), {}, None, ("final", "events", "slips", "period", "peak_speed", "stuck")
    )
    spots = [[0.6, 0.034], [0.95, 0.034], [0.3, 0.1], [0.6, 0.034]]
    with ready(runs, fmus / "stickslip.fmu") as rerun:
        rows = [rerun.run(spot) for spot in spots]
    assert rows[0] == rows[3]
    assert rows[1][0] == []
    assert "mu_d is 0.95, above mu_s = 0.9" in rows[1][1]
    for spot, row in zip(spots, rows, strict=True):
        with ready(runs, fmus / "stickslip.fmu") as rerun:
            assert rerun.run(spot) == row
    omega, x_d = sqrt(742.5 / 12.5), 0.3 * 12.5 * 9.81 / 742.5
    peak = 0.034 + omega * sqrt(x_d**2 + (0.034 / omega) ** 2)
    assert rows[0][0][2:] == pytest.approx(
        [8, 4, 3.34510449933, peak, 16 - 3 * 0.430665996656 - 0.430665996656], rel=1e-4
    )


def test_decay_measures_are_those_of_the_parameters(fmus):
    with ready(Runs("coulomb", ("f",), {}, None, ("rest", "f_over_k")), fmus / "coulomb.fmu") as rerun:
        (rest, ratio), _ = rerun.run([2.0])
    assert ratio == pytest.approx(2 / 157.9, rel=1e-3)
    assert abs(rest) <= 2 / 157.9
    with ready(Runs("smd", ("c",), {}, None, ("zeta",)), fmus / "smd.fmu") as rerun:
        assert rerun.run([1.0])[0] == pytest.approx([1 / (2 * sqrt(157.9))], rel=1e-5)


def test_a_map_is_labelled_for_xarray_and_pandas_the_same_for_any_number_of_workers(harness, tmp_path):
    for workers in (1, 2):
        done = harness(*MAP, "--workers", workers, "--out", f"out{workers}")
        assert (done.returncode, done.stderr) == (0, "")
        assert "12 runs, 0 of them done before, 0 failed" in done.stdout
    one, two = (tmp_path / f"out{workers}/sweep/stickslip-mu_d-v_driver" for workers in (1, 2))
    for file in ("sweep.nc", "sweep.csv"):
        assert (one / file).read_bytes() == (two / file).read_bytes()
    assert {file.name for file in one.iterdir()} == {"sweep.nc", "sweep.csv", "figure.png", "provenance.json"}
    assert [file.name for file in one.parent.iterdir()] == [one.name]
    data = opened(one)
    assert data["slips"].dims == ("mu_d", "v_driver")
    assert data["v_driver"].attrs["units"] == data["final_v"].attrs["units"] == "m/s"
    assert len(data.attrs["fmu_sha256"]) == 64
    assert json.loads(data.attrs["parameters"])["m"] == 12.5
    table = pandas.read_csv(one / "sweep.csv")
    assert list(table.columns) == ["mu_d", "v_driver [m/s]", "final_x [m]", "final_v [m/s]", "slips", "error"]
    assert (table["slips"].to_numpy().reshape(4, 3) == data["slips"].to_numpy()).all()


def test_failed_runs_are_recorded_with_their_sentence(harness, tmp_path):
    done = harness("sweep", "stickslip", "--vary", "mu_d=0.5:1:3", "--set", "k=100", "--workers", 1, "--name", "mine")
    assert (done.returncode, done.stderr) == (0, "")
    assert "3 runs, 0 of them done before, 1 failed" in done.stdout
    data = opened(tmp_path / "results/sweep/mine")
    assert [bool(text) for text in data["error"].to_numpy()] == [False, False, True]
    assert "above mu_s = 0.9" in str(data["error"].to_numpy()[2])
    assert np.isnan(data["final_x"].to_numpy()[2])
    assert json.loads(data.attrs["parameters"])["k"] == 100.0


def test_a_sample_has_a_row_for_each_run(harness, tmp_path):
    done = harness("sweep", "coulomb", "--vary", "f=0.1:2", "--vary", "k=50:500:log", "--random", 7, "--workers", 1)
    assert (done.returncode, done.stderr) == (0, "")
    data = opened(tmp_path / "results/sweep/coulomb-f-k")
    assert data.sizes == {"run": 7}
    assert data["k"].dims == ("run",)


@pytest.mark.parametrize(("stop", "status"), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)])
def test_what_a_kill_left_is_kept_and_only_the_rest_is_run(harness, tmp_path, stop, status):
    """The signal reaches the workers as well, as one from a terminal does."""
    arguments = ["sweep", "stickslip", "--vary", "mu_d=0.3:0.8:300", "--measure", "peak_speed", "--workers", "1"]
    command = [sys.executable, "-m", "harness", *arguments]
    options = {"cwd": tmp_path, "env": ENVIRONMENT, "stderr": subprocess.PIPE, "text": True}
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a test run in the background ignores it
    process = subprocess.Popen(command, start_new_session=True, preexec_fn=heard, **options)
    folder = tmp_path / "results/sweep"
    for _ in range(1000):
        journals = list(folder.glob(".*.jsonl")) if folder.exists() else []
        if journals and journals[0].stat().st_size > 2000:
            break
        time.sleep(0.02)
    os.killpg(process.pid, stop)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == status
    if stop == signal.SIGINT:
        assert said.startswith("Error: interrupted: ")
        assert said.count("\n") == 1
    kept = len(Journal(journals[0], 300, 1).rows)
    assert 0 < kept < 300
    with journals[0].open("a") as file:
        file.write("[299, [0.1")  # cut off in the middle of a line
    done = harness(*arguments)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"300 runs, {kept} of them done before" in done.stdout
    assert harness(*arguments, "--out", "whole").returncode == 0
    for file in ("sweep.nc", "sweep.csv"):
        name = f"sweep/stickslip-mu_d/{file}"
        assert (tmp_path / "results" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert list(folder.glob(".*")) == []


def test_an_existing_scheduler_and_its_worker_do_the_same(harness, tmp_path):
    options = {"cwd": tmp_path, "env": ENVIRONMENT, "stderr": subprocess.PIPE, "text": True}
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    command += ["--no-dashboard", "--dashboard-address", "127.0.0.1:0"]
    with subprocess.Popen(command, **options) as scheduler:
        try:
            address = next(found[0] for line in scheduler.stderr if (found := re.findall(r"tcp://\S+", line)))
            command = [
                sys.executable,
                "-m",
                "distributed.cli.dask_worker",
                address,
                "--no-dashboard",
                "--nthreads",
                "2",
            ]
            with subprocess.Popen(command, **options) as worker:
                try:
                    next(line for line in worker.stderr if "Registered to" in line)
                    done = harness(*MAP, "--scheduler", address, "--out", "far")
                finally:
                    worker.terminate()
        finally:
            scheduler.terminate()
    assert (done.returncode, done.stderr) == (0, "")
    assert harness(*MAP, "--workers", 1, "--out", "near").returncode == 0
    near, far = (tmp_path / place / "sweep/stickslip-mu_d-v_driver/sweep.nc" for place in ("near", "far"))
    assert near.read_bytes() == far.read_bytes()


def test_a_sweep_asks_for_no_port_of_its_own_and_listens_to_this_machine_only(harness, tmp_path):
    """Dask's own, 8787, is taken."""
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "def note(event, arguments):\n"
        "    if event == 'socket.bind':\n"
        "        print(*arguments[1][:2], file=open('bound', 'a'))\n"
        "sys.addaudithook(note)\n"
    )
    with socket.socket() as taken:
        with contextlib.suppress(OSError):  # taken already: so much the better
            taken.bind(("127.0.0.1", 8787))
            taken.listen()
        patched = f"{tmp_path}{os.pathsep}{ROOT}"
        done = harness(*MAP, "--workers", 2, "--quiet", fresh=True, PYTHONPATH=patched)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert set((tmp_path / "bound").read_text().splitlines()) == {"127.0.0.1 0"}


def test_the_magic_formula_slides_steadily_below_the_peak_of_its_curve(harness, tmp_path):
    """Its slope is positive there, so that it damps; beyond it the sled sticks and slips."""
    arguments = ("--vary", "x_m=0.03,0.06", "--vary", "v_driver=0.02,0.04,0.08", "--measure", "unsteady", "--stop", 40)
    assert harness("sweep", "pacejka", *arguments, "--workers", 2).returncode == 0
    steady = opened(tmp_path / "results/sweep/pacejka-x_m-v_driver")["unsteady"].to_numpy() < 0.1
    assert steady.tolist() == [[True, False, False], [True, True, False]]


@pytest.mark.parametrize(
    ("arguments", "status", "sentence"),
    [
        (["nosuch", "--vary", "m=1:2:3"], 2, "unknown model 'nosuch'"),
        (["smd"], 2, "--vary"),
        (["smd", "--vary", "mm=1:2:3"], 2, "unknown parameter to vary 'mm' (nearest: 'm')"),
        (["smd", "--vary", "m=1:2:3", "--vary", "m=1,2"], 2, "names a parameter twice"),
        (["smd", "--vary", "m=1:2:3", "--set", "m=1"], 2, "both varied and set"),
        (["smd", "--vary", "m=1:2:3", "--set", "k"], 2, "--set k is not understood"),
        (["smd", "--vary", "m=1:2:3", "--set", "k=-1"], 2, "k = -1.0 is outside its range"),
        (["smd", "--vary", "m=1:2:3", "--set", "solver.method=euler"], 2, "unknown value of solver.method 'euler'"),
        (["smd", "--vary", "m=1:2:3", "--measure", "stuck"], 2, "unknown measure 'stuck'"),
        (["smd", "--vary", "m=1:2:3", "--stop", "-1"], 1, "stop time = -1.0 s is refused"),
        (["stickslip", "--vary", "friction=1.5,2"], 2, "friction is a choice"),
        (
            ["smd", "--vary", "m=1:2:3", "--scheduler", "tcp://127.0.0.1:1"],
            1,
            "no scheduler answers at tcp://127.0.0.1:1",
        ),
    ],
)
def test_what_a_sweep_gets_wrong_is_one_sentence(harness, tmp_path, arguments, status, sentence):
    done = harness("sweep", *arguments)
    assert done.returncode == status
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "results/sweep").exists() or list((tmp_path / "results/sweep").iterdir()) == []


def test_the_fmu_belongs_to_what_tells_a_sweep_from_any_other():
    runs = Runs("smd", ("m",), {}, None, ("final",))
    one, two = (
        Sweep(runs, (Axis("m", (1.0, 2.0)),), np.array([[1.0], [2.0]]), None, 1, fmu, 2) for fmu in (b"a", b"b")
    )
    assert one.key != two.key
    assert one.key == replace(two, fmu=b"a").key


DAMAGED = (
    *(
        b"",
        b"7",
        b"null",
        b"[]",
        b'[1, [0.5], ""',
        b'{"a": 1}',
        b"\xff\xfe",
        b"\0",
        b"[" * 5000,
        b'[0, [0.5, 1.5], "x"]',
    ),
    *(b'[0, [0.5], ""]', b'[-1, [0.5, 1.5], ""]', b'[99, [0.5, 1.5], ""]', b'[0.5, [0.5, 1.5], ""]'),
    b'[true, [0.5, 1.5], ""]',
    *(b'[0, ["a", 1.5], ""]', b"[0, [0.5, 1.5], 3]", b'[0, [0.5, 1.5], "", 4]', b"9" * 5000),
)


@pytest.mark.parametrize("line", DAMAGED)
def test_a_damaged_line_of_a_journal_is_left_out_and_counted(tmp_path, line):
    good = b'[3, [0.5, NaN], ""]\n'
    (tmp_path / "journal").write_bytes(good + line + b"\n" + b'[4, [], "failed"]\n')
    kept = Journal(tmp_path / "journal", 10, 2)
    assert sorted(kept.rows) == [3, 4]
    assert kept.damaged == 1
    (tmp_path / "journal").write_bytes(good + b'[4, [], "fai')
    kept = Journal(tmp_path / "journal", 10, 2)
    assert (sorted(kept.rows), kept.damaged) == ([3], 0)  # a kill cut it off


def test_a_damaged_journal_is_told_and_the_runs_are_done_again(harness, tmp_path):
    arguments = ("sweep", "smd", "--vary", "m=1:2:4", "--workers", 1)
    assert harness(*arguments, "--out", "whole").returncode == 0
    (tmp_path / "results/sweep").mkdir(parents=True)
    fmu = (tmp_path / "fmus/smd.fmu").read_bytes()
    runs, values = Runs("smd", ("m",), {}, None, ("final", "events")), (1.0, 4 / 3, 5 / 3, 2.0)
    varied = Axis("m", tuple(np.linspace(1, 2, 4).tolist()))
    key = Sweep(runs, (varied,), np.array(values)[:, None], None, 1, fmu, 3).key
    (tmp_path / f"results/sweep/.{key}.jsonl").write_bytes(b'garbage\n[0, [1.0], ""]\n')
    done = harness(*arguments)
    assert (done.returncode, done.stderr) == (0, "")
    assert "4 runs, 0 of them done before, 0 failed" in done.stdout
    assert "2 damaged lines" in done.stdout
    name = "sweep/smd-m/sweep.csv"
    assert (tmp_path / "results" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_a_journal_that_cannot_be_used_is_told(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(HarnessError, match=r"journal .*folder cannot be used: Is a directory"):
        Journal(tmp_path / "folder", 1, 1)
    (tmp_path / "file").write_text("")
    below = Journal(tmp_path / "file/journal", 1, 1)
    with pytest.raises(HarnessError, match=r"journal .* cannot be used"), below.open():
        pass


def test_a_full_disk_is_told_and_what_was_kept_stays(tmp_path):
    kept = Journal(tmp_path / "journal", 3, 1)

    def fill():
        with open("/dev/full", "w") as full, kept.open():
            kept.add([(0, ([0.5], ""))])
            kept.file.close()
            kept.file = full
            kept.add([(1, ([0.5], ""))])

    with pytest.raises(HarnessError, match=r"journal .* cannot be used: No space left on device"):
        fill()
    assert sorted(Journal(tmp_path / "journal", 3, 1).rows) == [0]


def test_a_place_that_cannot_be_written_is_told_before_the_runs(harness, tmp_path):
    (tmp_path / "results/sweep").mkdir(parents=True)
    (tmp_path / "results/sweep/smd-m").write_text("a file")
    done = harness("sweep", "smd", "--vary", "m=1:2:4", "--workers", 1)
    assert done.returncode == 1
    assert "smd-m holds a file of that name" in done.stderr
    assert [file.name for file in (tmp_path / "results/sweep").iterdir()] == ["smd-m"]
