"""Python hosts may load several FMUs, in several versions, repeatedly, with any Python from 3.9 on."""

import json
import re
import shutil
import subprocess
import zipfile
from itertools import chain, pairwise
from pathlib import Path

import commands
import independent_solution
import pytest
from build_cache import ROOT
from fmpy import read_model_description
from independent_solution import ClosedFormMotion
from models import CASES, MODELS, declarations_of, label, outputs
from row_comparison import assert_close, assert_identical
from worker_client import Worker

PYTHONS = ["3.9", "3.10", "3.11", "3.12", "3.13"]


def test_the_running_code_is_the_code_in_the_fmu(fresh_worker, fmus):
    """Neither the sources nor the pythonfmu of the host are used."""
    before = set(fresh_worker.modules())
    for name in MODELS:
        path = fmus / f"{name}.fmu"
        instance = fresh_worker.instantiate(path).begin()
        instance.step(0.0, 0.1)
        files, own_folder = set(fresh_worker.modules()), fresh_worker.directory(path)
        assert len([file for file in files if file.startswith(own_folder)]) >= 4
        assert not [file for file in files if file.startswith(str(ROOT / "fmus"))]
        others = [file.removeprefix(str(ROOT)) for file in files - before if not file.startswith(own_folder)]
        assert not [file for file in others if "pythonfmu" in file or "friction" in file]
        before = files
        instance.free()


def test_two_versions_of_an_fmu_run_their_own_code_in_one_process(worker, fmus, tmp_path):
    """The sled is edited, rebuilt and run beside the original."""
    source = (ROOT / "fmus" / "stickslip.py").read_text()
    edited_source, number = re.subn(r"(\n    k = Parameter\()[^,]+", r"\g<1>900.0", source)
    assert number == 1
    (tmp_path / "stickslip.py").write_text(edited_source)
    result = commands.build("stickslip.py", folder=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    paths = [fmus / "stickslip.fmu", tmp_path / "stickslip.fmu"]
    assert len({read_model_description(path).guid for path in paths}) == 2
    times = [0.1 * i for i in range(161)]
    for path, k in [*zip(paths, (742.5, 900.0), strict=True)] * 2:
        fmu = worker.instantiate(path).begin(stop=16.0)
        assert fmu.get("k") == k
        motion = ClosedFormMotion([(0.0, independent_solution.stickslip(k=k))], 0.0, 0.0, 17.0)
        for t, (x,) in zip(times, fmu.run(times, ["x"]), strict=True):
            assert abs(x - motion.at(t)[0]) < 1e-12
        fmu.free()


def test_concurrent_instances_do_not_interfere(launch, worker):
    """All models, laws and methods at once, stepped in turn."""
    times = [0.02 * i for i in range(50)]
    separate = [launch(name, values, stop=stop).run(times, outputs(name)) for name, values, stop in CASES]
    fleet = [(launch(name, values, stop=stop), outputs(name)) for name, values, stop in CASES]
    rows = [[fmu.get(*names)] for fmu, names in fleet]
    for t, ahead in pairwise(times):
        turns = [[[fmu.number, "step", [t, ahead - t]], [fmu.number, "get", [names]]] for fmu, names in fleet]
        results = worker.call(None, "batch", [*chain(*turns)])
        for instance_rows, row in zip(rows, results[1::2], strict=True):
            instance_rows.append(row)
    for (_, names), instance_rows, expected in zip(fleet, rows, separate, strict=True):
        assert_identical(instance_rows, expected, names)


def interpreter(version):
    """Return an interpreter of this version, or None."""
    interpreters = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python"))
    return str(interpreters[-1]) if interpreters else shutil.which(f"python{version}")


def request(resources, name, values, stop):
    """Return the input of run_embedded.py."""
    references = {v: i for i, v in enumerate(declarations_of(name))}
    real = {v: declarations_of(name)[v].type == "Real" for v in references}
    return {
        "resources": str(resources / name / "resources"),
        "reals": {references[v]: x for v, x in values.items() if real[v]},
        "integers": {references[v]: x for v, x in values.items() if not real[v]},
        "times": [stop * i / 40 for i in range(41)],
        "outputs": [references[v] for v in outputs(name) if real[v]],
    }


TRANSLATION = """\
import sys

sys.path.insert(0, sys.argv[1])
from fmus.compiler.lowering.import_hook import lowered_model
from fmus.packaging.native.model_header import render_model_header

render_model_header(lowered_model("stickslip"), "3")
"""


def test_the_newest_python_translates_a_model_without_warnings():
    """It warns of what a later one refuses, and the tests count warnings as errors."""
    python = interpreter(PYTHONS[-1])
    if python is None:
        pytest.skip(f"there is no Python {PYTHONS[-1]} here")
    command = [python, "-I", "-W", "error", "-c", TRANSLATION, ROOT]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (result.returncode, result.stderr) == (0, "")


@pytest.fixture(scope="module")
def requests(fmus, tmp_path_factory):
    """One run of every case on the unpacked FMUs: the request, the output names, and the rows from this Python."""
    resources, worker, cases = tmp_path_factory.mktemp("resources"), Worker(), []
    for name in MODELS:
        with zipfile.ZipFile(fmus / f"{name}.fmu") as archive:
            archive.extractall(resources / name)
    for case in CASES:
        name, values, stop = case
        inputs, names = request(resources, *case), [v for v in outputs(name) if declarations_of(name)[v].type == "Real"]
        fmu = worker.instantiate(fmus / f"{name}.fmu").begin(values, stop=stop)
        cases.append((inputs, [f"{label(case)}: {v}" for v in names], fmu.run(inputs["times"], names)))
        fmu.free()
    assert worker.close() == 0
    return cases


@pytest.mark.slow
@pytest.mark.parametrize("version", [PYTHONS[0], PYTHONS[-1]])
def test_the_embedded_code_behaves_alike_on_the_oldest_and_newest_python(requests, version):
    """The other tests use a version in between."""
    python = interpreter(version)
    if python is None:
        pytest.skip(f"there is no Python {version} here")
    command, inputs = (
        [python, "-I", Path(__file__).with_name("run_embedded.py")],
        json.dumps([inputs for inputs, _, _ in requests]),
    )
    result = subprocess.run(command, input=inputs, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    for (_, names, expected), rows in zip(requests, json.loads(result.stdout), strict=True):
        assert_close(rows, expected, names, 1e-14)
