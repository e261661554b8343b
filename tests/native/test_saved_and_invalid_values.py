"""Native instances: digits and categories of messages, and saved states byte by byte."""

import subprocess
from contextlib import closing
from ctypes import string_at
from struct import pack
from zipfile import ZipFile

import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from models import MODELS, declarations_of, model_class
from native_fmus import build_native_fmus
from native_host import compiler
from variants import slow_after
from worker_client import Worker

CHECKSUM_SIZE = 8
PLACES = """
#include "fmi2.c"
int main(void)
{
    for (int i = 0; i < MEMBERS; i++) {
        if (members[i].is_bool) printf("%zu\\n", offsetof(SavedState, state) + members[i].offset);
    }
}
"""


@pytest.fixture(scope="module")
def unpacked_fmu(tmp_path_factory):
    path = build_native_fmus() / "smd.fmu"
    folder = str(fmpy.extract(path, tmp_path_factory.mktemp("smd")))
    return fmpy.read_model_description(path), folder


@pytest.fixture
def fmu(unpacked_fmu):
    """An initialised instance."""
    description, folder = unpacked_fmu
    fmu = FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier="smd", instanceName="smd")
    fmu.instantiate()
    fmu.setupExperiment(stopTime=1.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    yield fmu
    fmu.freeInstance()


def checksum(content):
    """Return the checksum of saved_state.h."""
    total = len(content)
    for i in range(0, len(content), 8):
        word = int.from_bytes(content[i : i + 8].ljust(8, b"\0"), "little")
        total = (total ^ word) * 0x9E3779B97F4A7C15 % 2**64
        total ^= total >> 32
    return total


@pytest.mark.parametrize("exponent", [-1017, -921, -808])
def test_a_power_of_two_has_as_few_digits_as_in_python(unpacked_fmu, fmu, capfd, exponent):
    """The nearest decimal of 16 digits does not read back, but the next one does."""
    (mass,) = (v.valueReference for v in unpacked_fmu[0].modelVariables if v.name == "m")
    with pytest.raises(FMICallException, match="fmi2SetReal failed with status 3"):
        fmu.setReal([mass], [-(2.0**exponent)])
    assert f"m = {-(2.0**exponent)!r} kg is refused" in capfd.readouterr().err


@pytest.mark.parametrize("name", slow_after(2, MODELS))
def test_values_do_not_depend_on_the_order_in_which_a_call_reads_them(name):
    """Some are calculated only when they are read."""
    names = [v for v, declaration in declarations_of(name).items() if declaration.type == "Real"]
    rows = []
    with closing(Worker()) as worker:
        for order in names, names[::-1]:
            fmu = worker.instantiate(build_native_fmus() / f"{name}.fmu").begin()
            fmu.step(0.0, 0.8 * model_class(name).stop_time)
            rows.append(dict(zip(order, fmu.get(*order), strict=True)))
            fmu.free()
    assert rows[0] == rows[1]


def test_no_value_of_a_refused_call_is_set(unpacked_fmu, fmu, capfd):
    references = [v.valueReference for v in unpacked_fmu[0].modelVariables if v.name in ("k", "c", "m")]
    before = fmu.getReal(references)
    for i in range(3):
        values = [7.0, 7.0, 7.0]
        values[i] = -1.0
        with pytest.raises(FMICallException):
            fmu.setReal(references, values)
        assert fmu.getReal(references) == before
    assert capfd.readouterr().err.count("is refused") == 3


def test_a_saved_state_with_a_boolean_of_2_is_refused_though_its_checksum_is_right(fmu, tmp_path, capfd):
    """A C program that includes the sources prints the places of all Booleans."""
    with ZipFile(build_native_fmus() / "smd.fmu") as archive:
        archive.extractall(tmp_path, [name for name in archive.namelist() if name.startswith("sources/")])
    (tmp_path / "sources" / "places.c").write_text(PLACES)
    subprocess.run([compiler(), "-o", "places", "places.c", "-lm"], cwd=tmp_path / "sources", check=True)
    output = subprocess.run([tmp_path / "sources" / "places"], capture_output=True, text=True, check=True).stdout
    state = fmu.getFMUstate()
    content = string_at(state.value, len(fmu.serializeFMUstate(state)))
    assert checksum(content[CHECKSUM_SIZE:]).to_bytes(8, "little") == content[:CHECKSUM_SIZE]
    assert output
    for offset in map(int, output.split()):
        changed_content = content[CHECKSUM_SIZE:offset] + b"\2" + content[offset + 1 :]
        with pytest.raises(FMICallException):
            fmu.deSerializeFMUstate(pack("<Q", checksum(changed_content)) + changed_content)
    assert "a saved state is refused" in capfd.readouterr().err
    fmu.freeFMUstate(state)


@pytest.mark.parametrize(
    ("logging_on", "categories", "is_logged"),
    [
        *((True, [], True), (True, ["logAll"], True), (True, ["logStatusError"], True)),
        *((True, ["logStatusFatal"], False), (False, [], False), (False, ["logStatusError"], False)),
    ],
)
def test_errors_are_logged_in_their_categories_only(unpacked_fmu, capfd, logging_on, categories, is_logged):
    description, folder = unpacked_fmu
    lines = []
    fmu = FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier="smd", instanceName="smd")
    callbacks = fmpy.fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(lambda *message: lines.append(message[-1]))
    callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    fmu.instantiate(callbacks=callbacks)
    fmu.setDebugLogging(logging_on, categories)
    with pytest.raises(FMICallException):
        fmu.doStep(0.0, 0.1)
    assert bool(lines) == is_logged
    capfd.readouterr()
    fmu.freeInstance()
