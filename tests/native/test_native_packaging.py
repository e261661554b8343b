"""Contents of native FMUs: complete, reproducible, and compilable by other tools."""

import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from struct import unpack_from

import fmi3_fixtures
import pytest
from archives import read_archive
from commands import build
from fmpy import read_model_description, simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.model_description import read_build_description
from fmpy.validation import validate_fmu
from models import MODELS, ROOT, model_class
from native_fmus import build_for_all_platforms, build_native_fmus
from native_host import compiler, unpack_cached

from fmus.compiler import BuildError
from fmus.packaging import native
from fmus.packaging.native import native_fmu
from fmus.packaging.native.binaries import (
    DEFAULT_PLATFORMS,
    LARGE_SOURCE,
    PLATFORMS,
    STRICT,
    compile_and_link,
    compile_libraries,
)
from fmus.packaging.native.native_fmu import FMI_HEADERS, MAIN_SOURCE, OWN_HEADERS

pytestmark = pytest.mark.slow

SYSTEM = {
    "linux64": {"libc.so.6", "libm.so.6"},
    "aarch64-linux": {"libc.so.6", "libm.so.6"},
    "win64": {"kernel32.dll"},  # and the C runtime, api-ms-win-crt-*
    "darwin64": {"@rpath/smd.dylib", "/usr/lib/libSystem.B.dylib"},
}


@pytest.fixture(scope="module")
def smd():
    """smd, with one method, for every platform, and the output of the build."""
    out = build_for_all_platforms()
    return out / "smd.fmu", out.with_suffix(".txt").read_text()


def test_tcc_gives_the_same_bits(tmp_path):
    tcc = shutil.which("tcc") or pytest.skip("apt-get install tcc")
    for name in MODELS:
        fmu = build_native_fmus() / f"{name}.fmu"
        folder = tmp_path / name
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)
        binary = folder / "binaries" / "linux64" / f"{name}.so"
        subprocess.run([tcc, "-shared", "-o", binary, folder / "sources" / MAIN_SOURCE["2"], "-lm"], check=True)
        for kind in ("CoSimulation", "ModelExchange"):
            results, tcc_results = (
                simulate_fmu(path, fmi_type=kind, stop_time=1.0).tobytes() for path in (fmu, folder)
            )
            assert results == tcc_results, (name, kind)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_the_sources_compile_without_warnings(name, fmi, tmp_path):
    """With the compiler of the system. A build stops at any warning of its own compiler, too, as STRICT
    leaves none out but one of the headers of FMI 3.0. Users' models are built by other tests."""
    folder = build_native_fmus() if fmi == "2" else fmi3_fixtures.build_fmi3_fmus()
    for file, content in read_archive(folder / f"{name}.fmu").items():
        if file.startswith("sources/"):
            (tmp_path / file.split("/")[-1]).write_bytes(content)
    assert [option for option in STRICT if option.startswith("-Wno-")] == ["-Wno-strict-prototypes"]
    options = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-fsyntax-only")
    result = subprocess.run([compiler(), *options, MAIN_SOURCE[fmi]], cwd=tmp_path, capture_output=True, text=True)
    assert (result.returncode, result.stderr) == (0, "")


@pytest.mark.parametrize("name", MODELS)
def test_fmpy_reports_no_problems(name):
    assert validate_fmu(str(build_native_fmus() / f"{name}.fmu")) == []


@pytest.mark.parametrize("name", MODELS)
def test_the_description_is_that_of_the_python_fmu_except_sources_guid_and_model_exchange(fmus, name):
    """Differences: states and derivatives, dependencies on states, and the variables after the declared ones."""
    roots = [
        ET.fromstring(read_archive(folder / f"{name}.fmu")["modelDescription.xml"])
        for folder in (fmus, build_native_fmus())
    ]
    guids = [root.attrib.pop("guid") for root in roots]
    python, native = roots
    assert native.attrib.pop("numberOfEventIndicators") == str(2 * len(model_class(name).contacts))
    native.remove(native.find("ModelExchange"))
    interface = native.find("CoSimulation")
    interface.remove(interface.find("SourceFiles"))
    for ability in ("providesDirectionalDerivative", "canInterpolateInputs"):
        assert interface.attrib.pop(ability) == "true"
    assert interface.attrib.pop("maxOutputDerivativeOrder") == "1"
    scalars, declared_scalars = native.find("ModelVariables"), python.find("ModelVariables")
    for scalar in list(scalars)[len(declared_scalars) :]:
        assert scalar.get("causality") in ("independent", "local")
        scalars.remove(scalar)
    for real in scalars.iterfind("ScalarVariable/Real"):
        for key in ("nominal", "reinit"):
            real.attrib.pop(key, None)
    for root in roots:
        root.remove(root.find("ModelStructure"))
        ET.indent(root)
        root.find("CoSimulation").text = None
    assert ET.tostring(python) == ET.tostring(native)
    assert guids[0] != guids[1]


@pytest.mark.parametrize("name", MODELS)
def test_fmpy_simulates_a_native_fmu_to_the_same_digits(fmus, name):
    results = [simulate_fmu(str(folder / f"{name}.fmu")) for folder in (fmus, build_native_fmus())]
    assert results[0].tobytes() == results[1].tobytes()


def test_the_archive_contents_are_complete(smd):
    fmu, output = smd
    binaries = {f"binaries/{name}/smd{platform.suffix}" for name, platform in PLATFORMS.items()}
    assert {name for name in read_archive(fmu) if name.startswith("binaries/")} == binaries
    sources = {f"sources/{file}" for file in (*OWN_HEADERS, *FMI_HEADERS["2"], "fmi2.c", "model.h", "guid.h")}
    sources.add("sources/buildDescription.xml")
    files = read_archive(fmu)
    documentation = {path for path in files if path.split("/")[0] in ("documentation", "extra", "model.png")}
    assert set(files) - documentation == binaries | sources | {"modelDescription.xml", "resources/model_data.json"}
    assert "documentation/licenses/license.txt" in documentation
    digest = sha256(fmu.read_bytes()).hexdigest()
    assert output == f"smd.fmu  {len(fmu.read_bytes()) / 1000:4.0f} kB  {digest[:16]}\n"


def test_only_required_code_is_compiled():
    text = read_archive(build_native_fmus() / "smd.fmu")["sources/model.h"].decode()
    assert "LinearClosedForm_overdamped" in text
    assert "DryFriction" not in text
    text = read_archive(build_native_fmus() / "pacejka.fmu")["sources/model.h"].decode()
    assert "LinearClosedForm" not in text


@pytest.mark.campaign
def test_methods_and_laws_can_be_selected_as_for_the_python_fmu(tmp_path):
    build_native_fmus()
    arguments = ("stickslip", "--method", "exact", "--law", "hybrid", "--platform", "linux64")
    for folder, kind in (("python", ()), ("native", ("--native",))):
        result = build(*arguments, *kind, "--out", tmp_path / folder)
        assert result.returncode == 0, result.stderr
    lean = read_archive(tmp_path / "native" / "stickslip.fmu")
    text = lean["sources/model.h"].decode()
    complete = read_archive(build_native_fmus() / "stickslip.fmu")["sources/model.h"].decode()
    others = ("Ode23_", "Ode45_", "Dop853_", "Rodas_")
    assert [name for name in others if name not in complete or name in text] == []
    assert b'name="ode45"' not in lean["modelDescription.xml"]
    results = [simulate_fmu(str(tmp_path / folder / "stickslip.fmu")) for folder in ("python", "native")]
    assert results[0].tobytes() == results[1].tobytes()


# ---- binaries


@pytest.fixture(scope="module")
def lief():
    """The package that parses libraries; importing it takes half a second."""
    return import_module("lief")


@pytest.fixture(params=PLATFORMS)
def binary(request, smd, lief):
    """A platform, the bytes of its binary, and every library in it, parsed."""
    fmu, _ = smd
    content = read_archive(fmu)[f"binaries/{request.param}/smd{PLATFORMS[request.param].suffix}"]
    libraries = lief.MachO.parse(content) if request.param == "darwin64" else [lief.parse(content)]
    return request.param, content, libraries


def test_every_binary_exports_only_fmi_and_needs_only_the_system(binary):
    platform, _, libraries = binary
    assert len(libraries) == len(PLATFORMS[platform].targets)
    for index in range(len(libraries)):
        library = libraries[index] if platform != "darwin64" else libraries.at(index)
        libraries_needed = {getattr(library_name, "name", library_name) for library_name in library.libraries}
        if platform == "win64":
            libraries_needed = {name.lower() for name in libraries_needed if not name.startswith("api-ms-win-crt-")}
        assert libraries_needed == SYSTEM[platform]
        exported_functions = {function.name.lstrip("_") for function in library.exported_functions}
        assert exported_functions - {"mh_dylib_header", "dso_handle"} == functions()
        imported_functions = {function.name.lstrip("_") for function in library.imported_functions}
        assert {"sin", "cos", "exp"} <= imported_functions  # from the system, like Python, and not from the compiler


def functions():
    """The functions of FMI 2.0."""
    text = (unpack_cached(build_native_fmus() / "smd.fmu") / "sources/fmi2Functions.h").read_text()
    return {line.split()[-1].rstrip(";") for line in text.splitlines() if "FMI2_Export fmi2" in line}


def test_no_binary_reveals_where_it_was_built(binary):
    _, content, _ = binary
    for text in (str(ROOT), os.path.expanduser("~"), "/tmp", "fmi2.c", "ziglang"):
        assert text.encode() not in content


def test_macos_libraries_cover_both_processors_and_are_validly_signed(smd, lief):
    content = read_archive(smd[0])["binaries/darwin64/smd.dylib"]
    magic, count = unpack_from(">II", content)
    assert (magic, count) == (0xCAFEBABE, 2)
    intel, arm = (
        content[offset : offset + size]
        for _, _, offset, size, _ in (unpack_from(">IIIII", content, 8 + 20 * i) for i in range(count))
    )
    assert [unpack_from("<I", library, 4)[0] for library in (intel, arm)] == [0x01000007, 0x0100000C]
    fat_binary = lief.MachO.parse(arm)  # which owns the objects taken from it
    check_signature(arm, fat_binary.at(0).code_signature.data_offset)


def check_signature(library, signature_offset):
    """The page hashes of the code directory (Apple, xnu, bsd/sys/codesign.h)."""
    magic, _, count = unpack_from(">III", library, signature_offset)
    assert magic == 0xFADE0CC0
    blobs = [unpack_from(">II", library, signature_offset + 12 + 8 * i)[1] for i in range(count)]
    directory = next(
        signature_offset + blob
        for blob in blobs
        if unpack_from(">I", library, signature_offset + blob)[0] == 0xFADE0C02
    )
    hashes, _, _, pages, limit = unpack_from(">IIIII", library, directory + 16)
    size, kind, _, bits = unpack_from(">BBBB", library, directory + 36)
    assert (size, kind, limit) == (32, 2, signature_offset)  # sha256 over everything before the signature
    for page in range(pages):
        code = library[page << bits : min((page + 1) << bits, limit)]
        start = directory + hashes + size * page
        assert library[start : start + size] == sha256(code).digest()


# ---- builds


def test_without_a_platform_the_usual_three_are_built():
    assert DEFAULT_PLATFORMS == ("linux64", "win64", "darwin64")


@pytest.mark.campaign
@pytest.mark.parametrize("platform", ["linux64", "x86_64-linux"])
def test_fmpy_and_cmake_compile_the_sources_to_the_same_results(tmp_path, platform):
    """Of both versions of FMI, whose layers are the same for every model; one model has no contact."""
    pytest.importorskip("cmake", reason="fmpy compiles with CMake: pip install cmake")
    fmu = (
        build_native_fmus() / "stickslip.fmu"
        if platform == "linux64"
        else fmi3_fixtures.build_fmi3_fmus() / "pacejka.fmu"
    )
    (tmp_path / "cmake").mkdir()
    assert_same_results(
        fmu, platform, tmp_path / "unpacked", lambda folder: build_platform_binary(folder, tmp_path / "cmake")
    )


@pytest.mark.campaign
@pytest.mark.parametrize("name", MODELS)
def test_any_compiler_builds_the_sources_to_the_same_results(tmp_path, name):
    """The system's compiler, with no options except for a shared library."""

    def make(folder):
        command = [compiler(), "-shared", "-fPIC", "fmi2.c", "-o", f"../binaries/linux64/{name}.so", "-lm"]
        subprocess.run(command, cwd=folder / "sources", check=True)

    assert_same_results(build_native_fmus() / f"{name}.fmu", "linux64", tmp_path / "unpacked", make)


def assert_same_results(fmu, platform, folder, make):
    """The unpacked FMU gives the same results with its library and with one compiled from its sources."""
    compiler()
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    before = simulations(folder)
    (folder / "binaries" / platform / f"{fmu.stem}.so").unlink()
    make(folder)
    assert simulations(folder) == before


def simulations(folder):
    """Return runs in co-simulation and in model exchange."""
    return [simulate_fmu(str(folder), fmi_type=interface).tobytes() for interface in ("CoSimulation", "ModelExchange")]


def test_the_build_description_names_the_existing_files(smd):
    fmu, _ = smd
    (configuration,) = read_build_description(fmu)
    assert configuration.modelIdentifier == "smd"
    description = read_model_description(fmu).buildConfigurations[0]
    for item in (configuration, description):
        assert [file for files in item.sourceFileSets for file in files.sourceFiles] == ["fmi2.c"]


@pytest.mark.parametrize("platform", PLATFORMS)
def test_large_sources_compile_for_every_platform(platform):
    """With options of their own: in the headers for Windows, isfinite and isnan are inline functions."""
    checks = {"checks.c": CHECKS, "padding.h": " " * LARGE_SOURCE}
    assert all(compile_libraries("checks", checks, "checks.c", platform).values())


CHECKS = """\
#include <math.h>
int check(double x);
int check(double x) { return isfinite(x) + isnan(x) + signbit(x); }
"""


# ---- mistakes on the command line


def test_a_mistake_is_reported_in_one_sentence():
    for arguments, words in (
        (("--native", "--platform", "amiga"), "There is no platform 'amiga'; choose from linux64, win64, darwin64"),
        (("--native", "unheard"), "There is no model 'unheard'"),
    ):
        result = build(*arguments)
        assert result.returncode != 0
        assert words in result.stderr
        assert "Traceback" not in result.stderr


def test_a_missing_compiler_error_says_what_to_install(tmp_path, monkeypatch):
    """As an error that the command prints like that of an unknown platform."""
    monkeypatch.setitem(sys.modules, "ziglang", None)
    with pytest.raises(BuildError, match=r"pip install 'friction-fmus\[native\]'"):
        native_fmu.build("smd", tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_the_c_files_are_part_of_the_package():
    assert all((Path(native.__file__).parent / file).is_file() for file in (*OWN_HEADERS, *MAIN_SOURCE.values()))


def test_the_compiler_cache_works_without_a_home_and_stays_clean(monkeypatch):
    outputs = {}

    def start(command, **options):
        outputs.update(options["env"])
        return start_process([sys.executable, "-c", "raise SystemExit(1)"], **options)

    start_process = subprocess.Popen

    for name in ("HOME", "ZIG_LOCAL_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("fmus.packaging.native.binaries.subprocess.Popen", start)
    with pytest.raises(BuildError, match=r"a.so does not compile"):
        compile_and_link({}, "a.c", "x86_64-linux-gnu.2.17", "a.so", ())
    assert Path(outputs["HOME"]).is_dir()
    assert not Path(outputs["ZIG_LOCAL_CACHE_DIR"]).parent.exists()
