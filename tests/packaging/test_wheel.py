"""The wheel, installed in a separate environment and used in an empty folder, is complete and stays unchanged."""

from hashlib import sha256
from pathlib import Path
from zipfile import ZipFile

import pytest
from archives import read_archive
from environments import build_wheel, call, install, make_environment
from models import ROOT
from native_fmus import build_for_all_platforms

from fmus.compiler import __date__
from fmus.packaging.native.binaries import DEFAULT_PLATFORMS, PLATFORMS

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return build_wheel(tmp_path_factory.mktemp("source"))


@pytest.fixture(scope="module")
def installation(wheel, tmp_path_factory):
    """A Python with the wheel, and its site-packages, which are read-only."""
    folder = tmp_path_factory.mktemp("environment")
    site_packages = make_environment(folder, "native")
    install([wheel], folder)
    folders = [path for path in (site_packages, *site_packages.rglob("*")) if path.is_dir()]
    for path in folders:
        path.chmod(0o555)
    yield folder / "bin" / "python", site_packages
    for path in folders:
        path.chmod(0o755)


@pytest.fixture
def run(installation, tmp_path):
    """Return run(words, ...): the output of `python -m words` in an empty folder; the installation must not change."""
    python, site_packages = installation
    before = content(site_packages)
    yield lambda words, **environment: call(python, "-m", *words.split(), cwd=tmp_path, **environment)
    assert content(site_packages) == before  # root may write read-only files


def content(folder):
    """Return the digest of every file."""
    return {path: sha256(path.read_bytes()).digest() for path in folder.rglob("*") if path.is_file()}


def test_the_wheel_holds_sources_and_data_and_no_fmu(wheel):
    with ZipFile(wheel) as archive:
        files = {path for path in archive.namelist() if ".dist-info/" not in path}
    folders = [path for part in ("fmus", "harness") for path in (ROOT / part).rglob("*") if path.is_file()]
    sources = [path.relative_to(ROOT).as_posix() for path in folders if path.suffix not in (".pyc", ".fmu")]
    builds = ("fmus/native/", "fmus/web/")
    assert files == {"build_fmus.py", *(path for path in sources if not path.startswith(builds))}


def test_the_licence_is_in_the_wheel(wheel):
    with ZipFile(wheel) as archive:
        (licence,) = [path for path in archive.namelist() if Path(path).name == "LICENSE"]
        assert archive.read(licence) == (ROOT / "LICENSE").read_bytes()


def test_the_wheel_builds_the_same_bytes_as_the_sources_and_runs_them_in_an_empty_folder(run, fmus, tmp_path):
    """From files with another location and time; one model without a contact and one with a contact."""
    output = run("build_fmus pacejka stickslip", PYTHONHASHSEED="7", TZ="Pacific/Auckland")
    assert [line.split()[0] for line in output.splitlines()] == ["pacejka.fmu", "stickslip.fmu"]
    built_files = {path.relative_to(tmp_path).as_posix(): path.read_bytes() for path in tmp_path.rglob("*.fmu")}
    assert built_files == {f"fmus/{name}.fmu": (fmus / f"{name}.fmu").read_bytes() for name in ("pacejka", "stickslip")}
    assert "stickslip" in run("harness run stickslip")
    assert {path.name for path in tmp_path.iterdir()} == {"fmus", "results"}
    assert (tmp_path / "results" / "stickslip" / "trajectory.csv").is_file()


def test_native_builds_differ_from_those_of_the_sources_only_in_the_date(run, tmp_path):
    """For the default platforms. The date only affects the description and the zip. The compiler's own files, such
    as the stubs of the C libraries, are not rebuilt, which would take long."""
    expected = read_archive(build_for_all_platforms() / "smd.fmu")
    run("build_fmus --native smd --method exact", ZIG_LOCAL_CACHE_DIR=tmp_path / "own", SOURCE_DATE_EPOCH="1700000000")
    rebuilt = read_archive(tmp_path / "fmus" / "native" / "smd.fmu")
    assert {f"binaries/{platform}/smd{PLATFORMS[platform].suffix}" for platform in DEFAULT_PLATFORMS} <= set(rebuilt)
    description = rebuilt["modelDescription.xml"]
    original_description = description.replace(b"2023-11-14T22:13:20Z", f"{__date__}T00:00:00Z".encode())
    assert description != original_description
    assert rebuilt | {"modelDescription.xml": original_description} == {name: expected[name] for name in rebuilt}
