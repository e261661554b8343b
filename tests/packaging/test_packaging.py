"""Contents and description of built FMUs, which do not depend on where they are built."""

import ast
import json
import re
import subprocess
import sys
from datetime import UTC, datetime
from hashlib import sha256
from io import BytesIO
from math import pi
from pathlib import Path, PurePosixPath
from types import SimpleNamespace
from xml.etree import ElementTree
from zipfile import ZipFile

import pytest
from archives import read_archive
from build_cache import ROOT
from commands import build as command
from fmpy.validation import validate_fmu
from models import declarations_of, scalar_class

from fmus.compiler import BuildError
from fmus.compiler.embedded_modules import embedded_files, installed_package
from fmus.compiler.model_lookup import model_names, more_model_names
from fmus.packaging.archive import write, zip_entries
from fmus.packaging.fmi_variables import declared_variables
from fmus.packaging.model_description import REAL_ONLY_HINT, describe
from fmus.runtime.integrator import Integrator
from fmus.runtime.oscillator import Oscillator
from fmus.runtime.run_state import RunState
from fmus.runtime.variable_declarations import Setting, variables

EVERY_MODEL = pytest.mark.parametrize("name", model_names())

# Runs built FMUs in a process that has neither the sources nor pythonfmu.
PROBE = """
import json, os, shutil, sys
sys.modules["pythonfmu"] = None
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
descriptions = []
for path in sys.argv[1:]:
    folder = str(extract(path))
    description = read_model_description(folder)
    fmu = FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier=description.modelName)
    fmu.instantiate()
    starts = {}
    for variable in description.modelVariables:
        if variable.start is not None:
            read = fmu.getReal if variable.type == "Real" else fmu.getInteger
            starts[variable.name] = repr(read([variable.valueReference])[0])
    files = [getattr(module, "__file__", None) or "" for module in sys.modules.values()]
    inside = [os.path.relpath(file, folder).replace(os.sep, "/") for file in files if file.startswith(folder)]
    descriptions.append({"starts": starts, "inside": inside, "modules": list(sys.modules)})
    fmu.freeInstance()
    shutil.rmtree(folder)
print(json.dumps(descriptions))
"""


def probe(*fmus, folder):
    """Return the self-description of FMU instances that are created one after another in one clean process."""
    call = [sys.executable, "-c", PROBE, *map(str, fmus)]
    run = subprocess.run(call, capture_output=True, text=True, cwd=folder, timeout=120)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def description_of(fmu):
    """Return the root of the model description."""
    return ElementTree.fromstring(read_archive(fmu)["modelDescription.xml"])


def modules_of(fmu):
    """Return the paths of the packed sources, without the package name."""
    paths = [PurePosixPath(path).parts for path in read_archive(fmu) if path.endswith(".py")]
    return {"/".join(parts[2:]) for parts in paths if len(parts) > 2}


@pytest.fixture(scope="module")
def build_output(fmus):
    """All FMUs, built once by the command, and its output."""
    return fmus, fmus.with_suffix(".txt").read_text()


@pytest.fixture(scope="module")
def fmu(build_output):
    return lambda name: build_output[0] / f"{name}.fmu"


def test_the_command_prints_name_size_and_digest_of_every_model(build_output):
    out, output = build_output
    for name, line in zip(model_names(), output.splitlines(), strict=True):
        content = (out / f"{name}.fmu").read_bytes()
        size, digest = f"{len(content) / 1000:.0f}", sha256(content).hexdigest()[:16]
        assert re.fullmatch(rf"{name}.fmu +{size} kB  {digest}", line)
    assert {path.name for path in out.iterdir()} == {f"{name}.fmu" for name in model_names()}


@EVERY_MODEL
def test_validation_reports_no_problems(fmu, name):
    assert validate_fmu(str(fmu(name))) == []


@EVERY_MODEL
def test_the_xml_matches_the_declarations(fmu, name):
    scalars = description_of(fmu(name)).findall("ModelVariables/ScalarVariable")
    instance = scalar_class(name)()
    declarations = variables(instance) + variables(RunState(instance))
    force = next((variable for variable, meaning in declarations if meaning.role == "contact"), "")
    for index, (scalar, (variable, meaning)) in enumerate(zip(scalars, declarations, strict=True)):
        value = scalar[0]
        text = f"mode of {force}: {meaning.text}" if variable == "mode" else meaning.text
        assert (scalar.get("name"), scalar.get("valueReference"), value.tag) == (variable, str(index), meaning.type)
        assert (scalar.get("description"), scalar.get("causality")) == (text, meaning.causality)
        assert (scalar.get("variability"), scalar.get("initial", "")) == (meaning.variability, meaning.initial)
        assert value.get("unit", "") == meaning.unit
        assert (value.get("start") is None) == (meaning.initial == "calculated")
        if value.get("start") is not None:
            assert value.get("start") == repr(meaning.start)
        if not meaning.items:
            assert float(value.get("min", "-inf")) == max(meaning.low, meaning.above)
            assert float(value.get("max", "inf")) == min(meaning.high, meaning.below)


@EVERY_MODEL
def test_every_real_has_a_unit_and_every_angle_is_displayed_in_degrees(fmu, name):
    root = description_of(fmu(name))
    display_units = {unit.get("name"): unit.find("DisplayUnit") for unit in root.findall("UnitDefinitions/Unit")}
    for real in root.iterfind("ModelVariables/ScalarVariable/Real"):
        assert real.get("unit") in display_units
        if real.get("unit") == "rad":
            assert real.get("displayUnit") == display_units["rad"].get("name") == "deg"
            assert float(display_units["rad"].get("factor")) * pi == pytest.approx(180.0, rel=1e-15)


@EVERY_MODEL
def test_enumerations_list_their_items(fmu, name):
    root = description_of(fmu(name))
    types = {kind.get("name"): kind for kind in root.findall("TypeDefinitions/SimpleType")}
    choices = {variable: meaning for variable, meaning in declarations_of(name).items() if meaning.items}
    assert "solver.method" in choices
    for variable, meaning in choices.items():
        value = root.find(f"ModelVariables/ScalarVariable[@name='{variable}']/Enumeration")
        items = types[value.get("declaredType")].findall("Enumeration/Item")
        assert [(i.get("name"), int(i.get("value")), i.get("description")) for i in items] == list(meaning.items)


@EVERY_MODEL
def test_direct_outputs_depend_on_the_input_and_the_others_on_nothing(fmu, name):
    root = description_of(fmu(name))
    meanings = [meaning for _, meaning in declared_variables(scalar_class(name))]
    (force,) = [index for index, meaning in enumerate(meanings, 1) if meaning.causality == "input"]
    outputs = {int(u.get("index")): u.get("dependencies") for u in root.findall("ModelStructure/Outputs/Unknown")}
    assert outputs == {
        index: str(force) if meaning.direct else ""
        for index, meaning in enumerate(meanings, 1)
        if meaning.causality == "output"
    }
    unknowns = root.findall("ModelStructure/InitialUnknowns/Unknown")
    assert [int(u.get("index")) for u in unknowns] == sorted(outputs)


@EVERY_MODEL
def test_capabilities_and_experiment_match_the_contract(fmu, name):
    root, model = description_of(fmu(name)), scalar_class(name)
    able = root.find("CoSimulation").attrib
    assert able["modelIdentifier"] == root.get("modelName") == name
    for flag in ("canHandleVariableCommunicationStepSize", "canGetAndSetFMUstate", "canSerializeFMUstate"):
        assert able[flag] == "true"
    assert able["needsExecutionTool"] == able["canBeInstantiatedOnlyOncePerProcess"] == "false"
    experiment = root.find("DefaultExperiment")
    times = [float(experiment.get(key)) for key in ("startTime", "stopTime", "tolerance", "stepSize")]
    assert times == [0.0, model.stop_time, model.tolerance, model.step_size]


@pytest.fixture(scope="module")
def self_descriptions(fmu, tmp_path_factory):
    """The self-description of each of them."""
    return dict(
        zip(model_names(), probe(*map(fmu, model_names()), folder=tmp_path_factory.mktemp("probed")), strict=True)
    )


@EVERY_MODEL
def test_an_instance_starts_with_the_values_of_the_xml_and_imports_every_packed_module(fmu, name, self_descriptions):
    self_description = self_descriptions[name]
    scalars = description_of(fmu(name)).findall("ModelVariables/ScalarVariable")
    assert self_description["starts"] == {
        s.get("name"): s[0].get("start") for s in scalars if s[0].get("start") is not None
    }
    # The list is obtained twice: from the imports in the sources, and from the modules that Python loads.
    assert set(self_description["inside"]) == {path for path in read_archive(fmu(name)) if path.endswith(".py")}
    assert not [module for module in self_description["modules"] if module.startswith(("fmus", "pythonfmu."))]


@EVERY_MODEL
def test_packed_code_needs_the_standard_library_only(fmu, name):
    for path, content in read_archive(fmu(name)).items():
        if path.count("/") > 1 and path.endswith(".py"):
            for node in ast.walk(ast.parse(content)):
                modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                if isinstance(node, ast.ImportFrom) and not node.level:
                    modules = [node.module]
                assert {module.split(".")[0] for module in modules} <= sys.stdlib_module_names, path


def test_a_model_carries_no_unavailable_method_or_mode(fmu):
    assert "runtime/stick_slip.py" not in modules_of(fmu("smd")) | modules_of(fmu("pacejka"))
    assert "runtime/linear_closed_form.py" not in modules_of(fmu("pacejka")) | modules_of(fmu("pendulum"))
    assert modules_of(fmu("stickslip")) >= {"stickslip.py", "runtime/stick_slip.py", "runtime/linear_closed_form.py"}


@EVERY_MODEL
def test_entry_script_and_package_carry_the_digest_of_their_content(fmu, name):
    content = read_archive(fmu(name))
    entry = content["resources/slavemodule.txt"].decode()
    assert re.fullmatch(rf"{name}_[0-9a-f]{{12}}_fmu", entry)
    assert content[f"resources/{entry}.py"].decode().startswith(f"from {entry.removesuffix('_fmu')} import ")
    top = {path.split("/")[1] for path in content if path.startswith("resources/")}
    assert top == {"model_data.json", "slavemodule.txt", f"{entry}.py", entry.removesuffix("_fmu")}


@EVERY_MODEL
def test_no_file_reveals_where_it_was_built(fmu, name):
    folders = [str(location).encode() for location in (ROOT, fmu(name).parents[1], installed_package("pythonfmu"))]
    for path, content in read_archive(fmu(name)).items():
        assert not [location for location in folders if location in content], path


@EVERY_MODEL
def test_both_licences_are_packed(fmu, name):
    content = read_archive(fmu(name))
    assert content["documentation/licenses/license.txt"].decode() == (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert b"NTNU" in content["documentation/licenses/pythonfmu.txt"]


def test_the_source_date_changes_only_the_date(fmu, tmp_path):
    name, moment = model_names()[0], datetime(2024, 2, 29, 12, 30, 14, tzinfo=UTC)
    assert command(name, "--out", tmp_path, SOURCE_DATE_EPOCH=str(int(moment.timestamp()))).returncode == 0
    dated_fmu, original = tmp_path / f"{name}.fmu", fmu(name)
    with ZipFile(dated_fmu) as archive:
        assert {info.date_time for info in archive.infolist()} == {(2024, 2, 29, 12, 30, 14)}
    stamp = description_of(original).get("generationDateAndTime")
    dated_description = read_archive(original)["modelDescription.xml"].replace(stamp.encode(), b"2024-02-29T12:30:14Z")
    assert read_archive(dated_fmu) == read_archive(original) | {"modelDescription.xml": dated_description}


@pytest.mark.parametrize("arguments", [("bogus",), ("smd", "bogus")])
def test_an_unknown_name_is_refused_with_the_known_ones_before_any_build(arguments, tmp_path):
    run = command(*arguments, "--out", tmp_path)
    assert (run.returncode, run.stdout) == (2, "")
    names = ", ".join(model_names() + more_model_names())
    assert run.stderr == f"Error: There is no model 'bogus'; choose one of {names}, or give the path of a .py file.\n"
    assert list(tmp_path.iterdir()) == []


def test_two_models_of_one_name_are_refused_before_any_build(tmp_path):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "smd.py").write_bytes((ROOT / "fmus/smd.py").read_bytes())
    files = [tmp_path / folder / "smd.py" for folder in ("one", "two")]
    run = command(*files, "--out", tmp_path / "out")
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr == f"Error: {files[0]} and {files[1]} have the same name: build them into separate folders.\n"
    assert not (tmp_path / "out").exists()


def test_an_unwritable_folder_is_named_in_one_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    run = command("smd", "--out", tmp_path / "file")
    assert (run.returncode, run.stdout) == (1, "")
    assert run.stderr.startswith(f"Error: Cannot write {tmp_path / 'file' / 'smd.fmu'}: ")
    assert run.stderr.endswith("; try another folder with --out.\n")


@pytest.mark.parametrize("epoch", ["yesterday", "-1", "1e9", "", "99999999999"])
def test_an_invalid_source_date_is_refused(epoch, tmp_path):
    run = command("smd", "--out", tmp_path, SOURCE_DATE_EPOCH=epoch)
    assert run.returncode == 1
    assert (
        run.stderr
        == f"Error: SOURCE_DATE_EPOCH must be a whole number of seconds from 0 to 4354732800, got {epoch!r}.\n"
    )


def test_a_missing_pythonfmu_error_says_what_to_install(tmp_path):
    script = "import runpy, sys; sys.modules['pythonfmu'] = None; runpy.run_path(sys.argv.pop(1), run_name='__main__')"
    call = [sys.executable, "-c", script, str(ROOT / "build_fmus.py"), "smd", "--out", str(tmp_path)]
    run = subprocess.run(call, capture_output=True, text=True, cwd=ROOT, timeout=60)
    assert run.returncode == 1
    assert run.stderr.startswith("Error: pythonfmu is not installed")
    assert "pip install pythonfmu" in run.stderr
    assert run.stderr.count("\n") == 1


def test_an_archive_does_not_depend_on_the_order_of_its_entries():
    entries = {"model.png": b"an icon", "binaries/linux64/a.so": b"a library"}
    archive, other_archive = (
        zip_entries(dict(order), datetime(2026, 1, 1, tzinfo=UTC))
        for order in (entries.items(), reversed(entries.items()))
    )
    assert archive == other_archive


def test_a_failed_write_leaves_the_previous_fmu_and_nothing_else(tmp_path, monkeypatch):
    older = tmp_path / "smd.fmu"
    older.write_bytes(b"older")

    def fail(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(BuildError, match="No space left on device"):
        write(older, b"newer")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"smd.fmu": b"older"}


ODD = SimpleNamespace(name="odd", class_name="Odd")


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("from pythonfmu import Fmi2Slave", "imports Fmi2Slave from pythonfmu, which FMUs do not include"),
        ("from . import __version__", "imports __version__ from the package itself, which FMUs do not include"),
        ("from .nowhere import thing", "imports thing from nowhere, which FMUs do not include"),
    ],
)
def test_an_import_that_no_fmu_can_provide_stops_the_build(line, sentence, tmp_path):
    with pytest.raises(BuildError, match=re.escape(f"odd.py {sentence}")):
        embedded_files(ODD, {"odd.py": line}, tmp_path)


def test_imports_are_followed_through_packages_for_any_line_ends(tmp_path):
    (tmp_path / "runtime/deep").mkdir(parents=True)
    files = {
        "odd.py": b"from .runtime import helper\r\nfrom .runtime.deep.well import water\r\n",
        "runtime/__init__.py": b"",
        "runtime/helper.py": b"import math\n",
        "runtime/idle.py": b"import numpy\n",
        "runtime/slave.py": b"from pythonfmu.logmsg import LogMsg\n",
        "runtime/deep/__init__.py": b"",
        "runtime/deep/well.py": b"from ..helper import math as water\n",
    }
    for path, content in files.items():
        (tmp_path / path).write_bytes(content)
    results = embedded_files(ODD, {}, tmp_path)
    assert set(results) == set(files) - {"runtime/idle.py"} | {
        "__init__.py",
        "pythonfmu/__init__.py",
        "pythonfmu/logmsg.py",
    }
    assert results["runtime/slave.py"] == "from ..pythonfmu.logmsg import LogMsg\n"
    assert "\r" not in "".join(results.values())


class Sketch(Oscillator):
    """A model that only has a description.

    x' = -x
    """

    solver_class = Integrator


def sketch(**declarations):
    """Return the description of a model with these variables."""
    model_class = type("Sketch", (Sketch,), {"__doc__": Sketch.__doc__} | declarations)
    for name, meaning in declarations.items():
        meaning.__set_name__(model_class, name)
    return describe(model_class, "sketch", "code", datetime(2024, 1, 1, tzinfo=UTC)).decode()


def test_start_values_survive_the_xml_bit_for_bit():
    text = sketch(m=Setting(0.1 + 0.2, "kg", "A sum <&> 'more'."))
    root = ElementTree.parse(BytesIO(text.encode())).getroot()
    assert root.find("ModelVariables/ScalarVariable/Real").get("start") == "0.30000000000000004"
    assert root.find("ModelVariables/ScalarVariable").get("description") == "A sum <&> 'more'."
    assert root.get("description") == f"A model that only has a description. {REAL_ONLY_HINT}"


def test_the_guid_follows_the_content():
    def guid(text):
        return ElementTree.fromstring(text).get("guid")

    first, second = sketch(m=Setting(1.0, "kg", "Mass.")), sketch(m=Setting(1.0, "kg", "Mass."))
    assert first == second
    assert guid(first) != guid(sketch(m=Setting(2.0, "kg", "Mass.")))
    date = datetime(2024, 1, 1, tzinfo=UTC)
    codes = [guid(describe(Sketch, "sketch", code, date)) for code in ("a", "b")]
    assert codes[0] != codes[1]


def test_an_unknown_unit_is_refused_by_the_name_of_its_variable():
    with pytest.raises(BuildError, match=r"w has the unit 'furlong'; allowed units are 1, s, kg"):
        sketch(w=Setting(1.0, "furlong", "Width."))
    with pytest.raises(BuildError, match=r"phi has the display unit 'turn'; allowed for rad: 'rad' or 'deg'"):
        sketch(phi=Setting(1.0, "rad", "Angle.", display="turn"))
