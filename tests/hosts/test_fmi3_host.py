"""The FMI 3.0 FMUs in a host written in C, without Python: fmi3_host.c, by the system's compiler."""

import os
import subprocess
import zipfile
from xml.etree.ElementTree import fromstring

import fmi3_hosts
import pytest
from builds import SUPPORT
from models import MODELS, declared, model_class, outputs
from native_host import HEADERS, compiler

from fmus.packaging.native.compiler import STRICT

LIVES, STEPS = 100, 20
fmus, worker, _workers = fmi3_hosts.FIXTURES


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    """The host, as a program."""
    out = tmp_path_factory.mktemp("host") / "host"
    source = SUPPORT / "fmi3_host.c"
    subprocess.run([compiler(), *STRICT, "-g", f"-I{HEADERS}", str(source), "-o", str(out), "-ldl", "-lm"], check=True)
    return out


@pytest.mark.parametrize("name", MODELS)
def test_a_hundred_lives_in_a_host_that_is_not_python(host, worker, fmus, tmp_path, name):
    """Its last values are those that fmpy gets, to the last bit."""
    with zipfile.ZipFile(fmus / f"{name}.fmu") as archive:
        archive.extractall(tmp_path)
    token = fromstring((tmp_path / "modelDescription.xml").read_bytes()).attrib["instantiationToken"]
    references = {variable: place for place, variable in enumerate(declared(name))}
    library, resources = tmp_path / "binaries" / "x86_64-linux" / f"{name}.so", f"{tmp_path / 'resources'}{os.sep}"
    stop, (x, v, *_) = model_class(name).stop_time, outputs(name)
    numbers = LIVES, stop, STEPS, references[x], references[v], references["m"]
    command = [str(host), str(library), token, resources, *map(str, numbers)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    solving, solved = ([float.fromhex(word) for word in line.split()] for line in done.stdout.splitlines())

    h = stop / STEPS
    times = [i * h for i in range(STEPS)]
    fmu = worker.instantiate(fmus / f"{name}.fmu").begin()
    for t in times:
        fmu.step(t, h)
    assert fmu.get(x, v) == solving
    fmu.free()
    fmu = worker.exchange(fmus / f"{name}.fmu").begin()
    fmu.update()
    fmu.go_on()
    for t in times:
        states = [a + h * rate for a, rate in zip(fmu.where(), fmu.rates(), strict=True)]
        fmu.place(t + h, states)
        fmu.event()
        fmu.update()
        fmu.go_on()
    assert fmu.get(x, v) == solved
    fmu.free()

    said = done.stderr.splitlines()
    assert [line for line in said if not line.startswith("log")] != []
    assert all("m = -1.0" in line for line in said)
    assert len(said) == 2  # in the log and on standard error
