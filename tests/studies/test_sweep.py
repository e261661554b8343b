"""Sweeps on the built FMUs: the runs they should do, whoever does them, and none of them twice."""

import json
import os
import signal
import subprocess
import sys
import time
import tracemalloc
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from math import sqrt
from pathlib import Path
from zipfile import ZipFile

import commands
import deadly
import foreign
import numpy as np
import pytest
from builds import ROOT
from models import MODELS

xarray = pytest.importorskip("xarray", reason="the extra 'sweep' is not installed")
distributed = pytest.importorskip("distributed", reason="the extra 'sweep' is not installed")
pandas = pytest.importorskip("pandas", reason="the extra 'sweep' is not installed")

from harness.errors import HarnessError, SceneError  # noqa: E402
from harness.results.netcdf import NetCDF, Variable  # noqa: E402
from harness.running.description import description  # noqa: E402
from harness.studies.sweep import figure, study  # noqa: E402
from harness.studies.sweep import file as writing  # noqa: E402
from harness.studies.sweep.boundaries import known  # noqa: E402
from harness.studies.sweep.journal import Block, Journal  # noqa: E402
from harness.studies.sweep.rerun import Runs, ready  # noqa: E402
from harness.studies.sweep.space import Axis, Points, axis  # noqa: E402
from harness.studies.sweep.study import DIED, Sweep  # noqa: E402

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


def folder_of(out, begin):
    """The one folder of a sweep whose name begins so."""
    (found,) = (out / "sweep").glob(f"{begin}-????????")
    return found


def test_a_grid_has_every_combination_and_a_sample_every_stratum():
    grid = Points((axis("a=1:3:3", False), axis("b=1:100:3:log", False)))
    every = np.array([[a, b] for a in (1, 2, 3) for b in (1, 10, 100)])
    assert grid.between(0, len(grid)) == pytest.approx(every)
    assert grid.between(2, 7) == pytest.approx(every[2:7])
    spread = (axis("a=1:2", True), axis("b=1:100:log", True))
    sample = Points(spread, 20, 1).between(0, 20)
    assert sorted(np.floor(20 * (sample[:, 0] - 1))) == list(range(20))
    assert sorted(np.floor(20 * np.log(sample[:, 1]) / np.log(100))) == list(range(20))
    assert (sample[5:9] == Points(spread, 20, 1).between(5, 9)).all()


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
    measures = ("final", "events", "slips", "period", "peak_speed", "stuck")
    runs = Runs("stickslip", ("mu_d", "v_driver"), (), measures)
    spots = [[0.6, 0.034], [0.95, 0.034], [0.3, 0.1], [0.6, 0.034]]
    with ready(runs, fmus / "stickslip.fmu") as rerun:
        rows = [rerun.run(spot) for spot in spots]
    assert rows[0] == rows[3]
    assert rows[1].startswith("mu_d is 0.95, above mu_s = 0.9")
    for spot, row in zip(spots, rows, strict=True):
        with ready(runs, fmus / "stickslip.fmu") as rerun:
            assert rerun.run(spot) == row
    omega, x_d = sqrt(742.5 / 12.5), 0.3 * 12.5 * 9.81 / 742.5
    peak = 0.034 + omega * sqrt(x_d**2 + (0.034 / omega) ** 2)
    assert rows[0][2:] == pytest.approx([8, 4, 3.34510449933, peak, 16 - 3 * 0.430665996656 - 0.430665996656], rel=1e-4)


def test_decay_measures_are_those_of_the_parameters(fmus):
    with ready(Runs("coulomb", ("f",), (), ("rest", "f_over_k")), fmus / "coulomb.fmu") as rerun:
        rest, ratio = rerun.run([2.0])
    assert ratio == pytest.approx(2 / 157.9, rel=1e-3)
    assert abs(rest) <= 2 / 157.9
    with ready(Runs("smd", ("c",), (), ("zeta",)), fmus / "smd.fmu") as rerun:
        assert rerun.run([1.0]) == pytest.approx([1 / (2 * sqrt(157.9))], rel=1e-5)


def test_a_map_is_labelled_for_xarray_and_pandas_the_same_for_any_number_of_workers(harness, tmp_path):
    for workers in (1, 4):
        done = harness(*MAP, "--workers", workers, "--out", f"out{workers}", blank=workers == 1)
        assert (done.returncode, done.stderr) == (0, "")
        assert "12 runs, 0 of them done before, 0 failed" in done.stdout
    one, four = (folder_of(tmp_path / f"out{workers}", "stickslip-mu_d-v_driver") for workers in (1, 4))
    for file in ("sweep.nc", "sweep.csv"):
        assert (one / file).read_bytes() == (four / file).read_bytes()
    assert {file.name for file in four.iterdir()} == {"sweep.nc", "sweep.csv", "figure.svg", "provenance.json"}
    assert [file.name for file in one.parent.iterdir()] == [one.name]
    data = opened(one)
    assert data["slips"].dims == ("mu_d", "v_driver")
    assert data["v_driver"].attrs["units"] == data["final_v"].attrs["units"] == "m/s"
    assert len(data.attrs["fmu_sha256"]) == 64
    assert json.loads(data.attrs["parameters"])["m"] == 12.5
    table = pandas.read_csv(one / "sweep.csv")
    assert list(table.columns) == ["mu_d", "v_driver [m/s]", "final_x [m]", "final_v [m/s]", "slips", "error"]
    assert (table["slips"].to_numpy().reshape(4, 3) == data["slips"].to_numpy()).all()


def test_failed_runs_leave_their_sentence_on_the_screen_in_the_files_and_in_the_exit_status(harness, tmp_path):
    vary = ("--vary", "mu_d=0.5:1:5", "--vary", "m=-1,2")
    done = harness("sweep", "stickslip", *vary, "--set", "k=100", "--workers", 1, "--name", "mine")
    assert done.returncode == 1
    assert "10 runs, 0 of them done before, 6 failed" in done.stdout
    first, *kinds = done.stderr.splitlines()
    assert first.startswith("Error: 6 of 10 runs failed; each has its sentence in ")
    assert [kind.partition(":")[0] for kind in kinds] == ["5 like mu_d = 0.5, m = -1.0", "1 like mu_d = 1.0, m = 2.0"]
    assert "m = -1.0" in kinds[0].partition(":")[2]
    assert kinds[1].endswith("lower mu_d or raise mu_s")
    data = opened(tmp_path / "results/sweep/mine")
    assert [bool(text) for text in data["error"].sel(m=2).to_numpy()] == [False, False, False, False, True]
    assert "above mu_s = 0.9" in str(data["error"].to_numpy()[4, 1])
    assert np.isnan(data["final_x"].to_numpy()[4, 1])
    assert json.loads(data.attrs["parameters"])["k"] == 100.0
    assert pandas.read_csv(tmp_path / "results/sweep/mine/sweep.csv")["final_x [m]"].isna().sum() == 6


TOLD = {  # why some have no run to show
    "Falling": "it ends itself: fmi2DoStep answered Discard",
    "Breaking": "breaks the FMI standard in 2 places",
}


@pytest.mark.parametrize("name", foreign.VARY)
def test_an_fmu_of_anyone_is_swept_or_says_why_not(harness, tmp_path, name):
    """Numbers alone are measured: of arrays each element, of texts nothing."""
    fmu, vary = foreign.built() / f"{name}.fmu", foreign.VARY[name].replace(":3", ":2")
    done = harness(
        "sweep", fmu, "--vary", vary, "--measure", "final,largest", "--name", "a", "--tolerance", 1e-3, blank=True
    )
    if name in TOLD:
        assert (done.returncode, TOLD[name] in done.stderr) == (1, True)
        return
    assert (done.returncode, done.stderr) == (0, "")
    data = opened(tmp_path / "results/sweep/a").drop_vars("error")
    assert len(data.data_vars) >= 2
    for measured in data.data_vars.values():
        assert np.isfinite(measured.to_numpy()).all()
    assert any(len(set(measured.to_numpy().tolist())) == 2 for measured in data.data_vars.values())


def test_runs_of_anyone_s_fmu_that_crash_or_fail_are_sentences_among_many(harness, tmp_path):
    """With kind 0 it does well, with 2 it crashes, with 6 it fails."""
    trouble = foreign.built() / "Trouble.fmu"
    done = harness("sweep", trouble, "--vary", "kind=2,6,0", "--name", "a", "--workers", 2, blank=True)
    assert done.returncode == 1
    assert done.stderr.startswith("Error: 2 of 3 runs failed")
    assert "its binary has crashed" in done.stderr
    error = opened(tmp_path / "results/sweep/a")["error"].to_numpy().tolist()
    assert [bool(sentence) for sentence in error] == [True, True, False]


def test_sweeps_of_different_ranges_have_folders_of_their_own(harness, tmp_path):
    for vary in ("m=1:2:2", "m=1:3:2"):
        assert harness("sweep", "smd", "--vary", vary, "--workers", 1, blank=True).returncode == 0
    found = [opened(folder)["m"].to_numpy().tolist() for folder in (tmp_path / "results/sweep").iterdir()]
    assert sorted(found) == [[1.0, 2.0], [1.0, 3.0]]


def test_a_sample_has_a_row_for_each_run(harness, tmp_path):
    done = harness("sweep", "coulomb", "--vary", "f=0.1:2", "--vary", "k=50:500:log", "--random", 7, "--workers", 1)
    assert (done.returncode, done.stderr) == (0, "")
    data = opened(folder_of(tmp_path / "results", "coulomb-f-k"))
    assert data.sizes == {"run": 7}
    assert data["k"].dims == ("run",)
    assert set(data.coords) == {"f", "k"}


def begun(tmp_path, *arguments):
    """A sweep in a process of its own, once it has finished two blocks of runs, and its journal."""
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a test run in the background ignores it
    process = subprocess.Popen(
        [sys.executable, "-m", "harness", *map(str, arguments)],
        cwd=tmp_path,
        env=ENVIRONMENT,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=heard,
    )
    while process.poll() is None:
        for journal in (tmp_path / "results/sweep").glob(".*.journal"):
            if journal.read_bytes().count(b"\n") > 1:
                return process, journal
        time.sleep(0.02)
    raise AssertionError(process.communicate()[1])


LONG = ("sweep", "stickslip", "--vary", "mu_d=0.3:0.8:100", "--measure", "peak_speed", "--workers", "1")


@pytest.fixture(scope="module")
def whole(place):
    """The files of that sweep, by their name, when nothing happens to it."""
    assert commands.harness(place, *LONG, blank=True).returncode == 0
    return files(place)


def files(place):
    return {file.name: file.read_bytes() for file in folder_of(place / "results", "stickslip-mu_d").glob("sweep.*")}


@pytest.mark.parametrize(("stop", "status"), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)])
def test_what_a_kill_left_is_kept_and_only_the_rest_is_run(harness, whole, tmp_path, stop, status):
    """The signal reaches the workers as well, as one from a terminal does."""
    process, journal = begun(tmp_path, *LONG)
    os.killpg(process.pid, stop)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == status
    if stop == signal.SIGINT:
        assert said.startswith("Error: interrupted: ")
        assert said.count("\n") == 1
    kept = Journal(journal, 100, 1).done
    assert 0 < kept < 100
    with journal.open("a") as file:
        file.write("[299, [0.1")  # cut off in the middle of a line
    done = harness(*LONG, blank=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"100 runs, {kept} of them done before" in done.stdout
    assert files(tmp_path) == whole
    assert list((tmp_path / "results/sweep").glob(".*")) == []


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="processes are found in /proc")
def test_no_worker_outlives_a_sweep_that_is_killed(harness, tmp_path):
    """The kill reaches the sweep alone; what it started is known by its environment."""
    mark = f"SWEEP_OF={tmp_path}".encode()

    def left():
        found = []
        for file in Path("/proc").glob("[0-9]*/environ"):
            try:
                found += [file.parent.name] if mark in file.read_bytes() else []
            except OSError:  # another's, or gone
                continue
        return found

    os.environ["SWEEP_OF"] = ENVIRONMENT["SWEEP_OF"] = str(tmp_path)
    try:
        process, _ = begun(tmp_path, "sweep", "pacejka", "--vary", "x_m=0.001:0.1:30000", "--workers", "2")
    finally:
        del os.environ["SWEEP_OF"], ENVIRONMENT["SWEEP_OF"]
    assert len(left()) >= 3
    process.kill()
    process.communicate(timeout=60)
    late = time.monotonic() + 60
    while left() and time.monotonic() < late:
        time.sleep(0.05)
    assert left() == []


@contextmanager
def worker(address, cwd):
    """A process of Dask's that works for the scheduler at an address."""
    words = (address, "--no-dashboard", "--nthreads", "2", "--no-nanny")
    command = [sys.executable, "-m", "distributed.cli.dask_worker", *words]
    with subprocess.Popen(command, cwd=cwd, env=ENVIRONMENT, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.terminate()


def test_a_cluster_one_of_whose_workers_is_killed_does_the_same(harness, whole, tmp_path):
    with ExitStack() as held:
        cluster = distributed.LocalCluster("127.0.0.1", n_workers=0, dashboard_address=None)
        address = held.enter_context(cluster).scheduler_address
        workers = [held.enter_context(worker(address, tmp_path)) for _ in range(2)]
        for each in workers:
            next(line for line in each.stderr if "Registered to" in line)
        process, journal = begun(tmp_path, *LONG, "--scheduler", address)
        before = Journal(journal, 100, 1).done
        workers[0].kill()
        said = process.communicate(timeout=120)[1]
    assert (process.returncode, said) == (0, "")
    assert before < 100
    assert files(tmp_path) == whole


def test_a_sweep_listens_at_no_port(harness, tmp_path):
    """Workers are reached through pipes; a socket that has a file for an address is no port."""
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "def note(event, arguments):\n"
        "    if event in ('socket.bind', 'socket.connect'):\n"
        "        print(event, type(arguments[1]).__name__, file=open('bound', 'a'))\n"
        "sys.addaudithook(note)\n"
    )
    small = ("sweep", "smd", "--vary", "m=1:2:4", "--workers", 2, "--quiet")
    done = harness(*small, fresh=True, PYTHONPATH=f"{tmp_path}{os.pathsep}{ROOT}")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    file = tmp_path / "bound"
    assert "tuple" not in (file.read_text() if file.exists() else "")


def test_the_magic_formula_slides_steadily_below_the_peak_of_its_curve(harness, tmp_path):
    """Its slope is positive there, so that it damps; beyond it the sled sticks and slips."""
    arguments = ("--vary", "x_m=0.03,0.06", "--vary", "v_driver=0.02,0.04,0.08", "--measure", "unsteady", "--stop", 40)
    assert harness("sweep", "pacejka", *arguments, "--workers", 2, blank=True).returncode == 0
    steady = opened(folder_of(tmp_path / "results", "pacejka-x_m-v_driver"))["unsteady"].to_numpy() < 0.1
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
        (["smd", "--vary", "m=1:2:3", "--measure", "stuck"], 2, "unknown measure of smd 'stuck'"),
        (["stickslip", "--vary", "m=1:2:3", "--measure", "zeta"], 2, "unknown measure of stickslip 'zeta'"),
        (
            ["stickslip", "--vary", "m=1:2:3", "--set", "friction=threshold", "--measure", "rest"],
            2,
            "unknown measure of stickslip 'rest'",
        ),
        (["smd", "--vary", "m=1:2:3", "--stop", "-1"], 2, "stop = -1.0 s is not after start = 0.0 s"),
        (
            ["stickslip", "--vary", "mu_d=1:2:3"],
            1,
            "none of three runs of the sweep comes to its end: mu_d is 1.0, above",
        ),
        (["stickslip", "--vary", "friction=1.5,2"], 2, "friction is a choice"),
    ],
)
def test_what_a_sweep_gets_wrong_is_one_sentence(harness, tmp_path, arguments, status, sentence):
    done = harness("sweep", *arguments)
    assert done.returncode == status
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "results/sweep").exists() or list((tmp_path / "results/sweep").iterdir()) == []


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch):
    """After 10 s, of which a test waits for one."""
    client, address = distributed.Client, "tcp://127.0.0.1:1"
    monkeypatch.setattr(distributed, "Client", lambda address, timeout: client(address, timeout=timeout / 10))
    with pytest.raises(HarnessError, match=f"no scheduler answers at {address}"), study.crew(address, 1, 1):
        pass


def test_the_fmu_belongs_to_what_tells_a_sweep_from_any_other():
    runs = Runs("smd", ("m",), (), ("final",))
    one, two = (Sweep(runs, Points((Axis("m", (1.0, 2.0)),)), fmu, 2) for fmu in (b"a", b"b"))
    assert one.key != two.key
    assert one.key == replace(two, fmu=b"a").key


def line(first, values, sentences):
    return Block(first, np.array(values), sentences).line()


GOOD = line(3, [[0.5, np.nan], [1.0, 2.0]], {0: "failed"})
DAMAGED = (
    *(b"", b"7", b"null", b"[]", b"00000000 []", b"\xff\xfe", b"\0", b"[" * 5000, b"9" * 5000),
    *(GOOD[:-1].replace(b"failed", b"fooled"), GOOD[:-4], GOOD[1:-1]),
    *(line(9, [[0.5, 1.5]] * 2, {})[:-1], line(-1, [[0.5, 1.5]], {})[:-1]),  # runs that there are not
    line(2, [[0.5, 1.5]] * 2, {})[:-1],  # one of them a second time
    line(0, [[0.5]], {})[:-1],  # of another number of columns
)


@pytest.mark.parametrize("damaged", DAMAGED)
def test_a_damaged_line_of_a_journal_is_left_out_and_counted(tmp_path, damaged):
    file = tmp_path / "journal"
    file.write_bytes(GOOD + damaged + b"\n" + line(7, [[3.0, 4.0]], {}))
    kept = Journal(file, 10, 2)
    assert (kept.done, kept.damaged, kept.left) == (3, 1, [(0, 3), (5, 7), (8, 10)])
    with kept.open():
        kept.add(Block(0, np.zeros((3, 2)), {}))
    again = Journal(file, 10, 2)
    assert (again.done, again.damaged) == (6, 1)
    assert [(block.first, block.sentences) for block in again.blocks()] == [(0, {}), (3, {0: "failed"}), (7, {})]
    file.write_bytes(GOOD + line(7, [[3.0, 4.0]], {})[:-5])
    kept = Journal(file, 10, 2)
    assert (kept.done, kept.damaged) == (2, 0)  # a kill cut it off


def test_a_damaged_journal_is_told_and_the_runs_are_done_again(harness, tmp_path):
    arguments = ("sweep", "smd", "--vary", "m=1:2:4", "--workers", 1, "--name", "mine")
    assert harness(*arguments, "--out", "whole", blank=True).returncode == 0
    (tmp_path / "results/sweep").mkdir(parents=True)
    points = Points((axis("m=1:2:4", False),))
    usual = ("exchange", False), ("lenient", False), ("patience", 60.0), ("stop", None), ("tolerance", 1e-6)
    sweep = Sweep(Runs("smd", ("m",), (), (), usual), points, (tmp_path / "fmus/smd.fmu").read_bytes(), 3)
    sweep.journal(tmp_path / "results/sweep").path.write_bytes(b"garbage\n" + line(0, [[1.0]], {}))
    done = harness(*arguments, blank=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "4 runs, 0 of them done before, 0 failed" in done.stdout
    assert "2 damaged lines" in done.stdout
    name = "sweep/mine/sweep.csv"
    assert (tmp_path / "results" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_a_journal_that_cannot_be_used_is_told(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(HarnessError, match=r"journal .*folder cannot be used: Is a directory"):
        Journal(tmp_path / "folder", 1, 1)


def test_a_run_that_kills_its_worker_is_found_and_told_and_the_others_are_done(monkeypatch):
    """Whatever block it is in, and whatever else was under way meanwhile."""
    monkeypatch.setattr(study, "work", deadly.work)
    sweep = Sweep(Runs("deadly", ("a",), (), ()), Points((axis("a=0:39:40", False),)), b"", 1)
    found = {}
    with study.crew(None, 2, 40) as hands:
        for block in study.Shift(sweep, hands, [(0, 40)]).finished():
            for i, value in enumerate(block.values[:, 0]):
                assert block.first + i not in found
                found[block.first + i] = block.sentences.get(i, value)
    assert found == {i: DIED if i in (7, 30) else 2.0 * i for i in range(40)}


def test_what_is_held_in_memory_does_not_grow_with_the_runs(monkeypatch, tmp_path):
    """The parts of a sweep that touch every run, on ten times as many of them."""
    monkeypatch.setattr(figure, "draw", lambda *arguments: None)
    peaks = []
    for many in (20, 200):
        axes = axis(f"a=0:1:{many}", False), axis("b=0:1:100", False)
        sweep = Sweep(Runs("many", ("a", "b"), (), ()), Points(axes), b"", 1)
        labels = dict.fromkeys(("a", "b"), ("m", ""))
        about = writing.About(labels, (writing.Column("c", "s", "some"),), {}, 1.0, ())
        folder = tmp_path / str(many)
        folder.mkdir()
        tracemalloc.start()
        kept = sweep.journal(folder)
        with kept.open():
            for first in range(0, len(sweep.points), 200):
                kept.add(Block(first, sweep.points.between(first, first + 200)[:, :1], {3: f"failed at {first}"}))
        (failure,) = writing.save(sweep, kept, about, folder)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert failure.runs == len(sweep.points) // 200
        data = opened(folder)
        assert (data["c"] == data["a"]).all()
        assert (data["error"] != "").sum() == failure.runs
    assert peaks[1] < 1.5 * peaks[0]


def test_a_netcdf_file_written_piece_by_piece_is_read_as_it_was_meant(tmp_path):
    values = np.arange(12.0).reshape(3, 4) / 7
    texts = np.array(["", "a", "four", "\u00e9\u00e9", "b"])
    with (tmp_path / "a.nc").open("wb") as stream:
        said = {"units": "m/s2", "size": 0.1}
        text = Variable("text", ("n", "letters"), {"_Encoding": "utf-8"}, 4)
        sizes = {"y": 3, "x": 4, "n": 5, "letters": 4}
        whole = NetCDF(stream, sizes, [Variable("a", ("y", "x"), said), text], {"b": "c"})
        for first in (8, 0, 4):
            whole.put("a", first, values.ravel()[first : first + 4])
        whole.put("text", 0, np.char.encode(texts))
    with xarray.open_dataset(tmp_path / "a.nc") as data:
        assert data["a"].dims == ("y", "x")
        assert (data["a"].to_numpy() == values).all()
        assert data["a"].attrs == said
        assert data.attrs == {"b": "c"}
        assert (data["text"].to_numpy() == texts).all()


@pytest.mark.parametrize(
    ("values", "spread", "kind"),
    [
        ((0.001, 0.01, 0.1), "linear", "log"),
        ((1.0, 2.0, 4.0), "log", "log"),
        ((1.0, 50.0, 99.0), "linear", "linear"),
        ((0.0, 1.0, 1000.0), "linear", "linear"),
        ((np.nan, 1.0, 1000.0), "linear", "log"),
        ((np.nan, np.nan), "linear", "linear"),
    ],
)
def test_an_axis_is_logarithmic_where_its_values_lie_over_decades(values, spread, kind):
    data = xarray.Dataset({"a": ("n", np.array(values), {"scale": spread})})
    assert figure.scale(data, "a") == kind


@pytest.mark.parametrize("name", MODELS)
def test_known_boundaries_travel_in_the_fmu_and_depend_on_its_parameters(fmus, name):
    """At its own values each quantity is a number; what it depends on is declared."""
    values = {
        variable.name: float(variable.start)
        for variable in description(fmus / f"{name}.fmu").modelVariables
        if variable.causality == "parameter" and variable.type == "Real"
    }
    found = known(fmus / f"{name}.fmu", tuple(values), {})
    assert found
    for each in found:
        assert each.parameters <= set(values)
        assert np.isfinite(each.at(values, 1.0))


@pytest.mark.parametrize(
    "quantity", ["m.real", "__import__('os')", "9**9**9", "(lambda: m)()", "m[0]", "'m'", "(", "abs(x=m)"]
)
def test_a_boundary_that_is_more_than_arithmetic_is_refused(tmp_path, quantity):
    with ZipFile(tmp_path / "odd.fmu", "w") as archive:
        table = f'[[boundaries]]\ntext = "a"\nbelow = "b"\nquantity = "{quantity}"\n'
        archive.writestr("documentation/boundaries.toml", table)
    with pytest.raises(HarnessError, match=r"odd\.fmu: documentation/boundaries\.toml is not understood"):
        known(tmp_path / "odd.fmu", ("m",), {})
