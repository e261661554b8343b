"""The release archive holds every kind of FMU, the page, references and checksums, and has the same bytes each time."""

from hashlib import sha256
from io import BytesIO
from zipfile import ZipFile

import pytest
from click.testing import CliRunner
from fmpy import read_model_description

import build_fmus
from fmus.compiler import __version__
from fmus.page import release


@pytest.fixture
def build_release(tmp_path_factory, monkeypatch):
    """Return a function that builds a release with two small models only, which saves minutes."""
    monkeypatch.setattr(release, "model_names", lambda: ["smd"])
    monkeypatch.setattr(release, "more_model_names", lambda: ["forced"])
    return lambda: release.build_release(tmp_path_factory.mktemp("release")).read_bytes()


@pytest.mark.campaign
def test_two_releases_are_the_same_bytes(build_release):
    """The FMUs and the page in them are compared by test_wheel.py and test_page_file.py in CI."""
    assert build_release() == build_release()


@pytest.mark.campaign
def test_the_release_holds_every_kind_and_correct_checksums(build_release, tmp_path):
    root = f"friction-fmus-{__version__}/"
    with ZipFile(BytesIO(build_release())) as archive:
        files = {name.removeprefix(root): archive.read(name) for name in archive.namelist()}
    kinds = {"fmus": "2.0", "fmus/native": "2.0", "fmus/native/fmi3": "3.0"}
    assert {f"{kind}/smd.fmu" for kind in kinds} | {"web/index.html", "references/smd.csv", "README.txt"} <= {*files}
    further_fmus = {f"{kind.replace('fmus', 'fmus/more', 1)}/forced.fmu" for kind in kinds}
    assert further_fmus | {"web/more.html", "references/forced.csv", "references/forced-events.csv"} <= {*files}
    assert {"licenses/license.txt", "licenses/pythonfmu.txt"} <= {*files}
    for kind, version in kinds.items():
        (tmp_path / "smd.fmu").write_bytes(files[f"{kind}/smd.fmu"])
        assert read_model_description(str(tmp_path / "smd.fmu")).fmiVersion == version
    sums = dict(reversed(line.split("  ")) for line in files.pop("SHA256SUMS").decode().splitlines())
    assert sums == {name: sha256(content).hexdigest() for name, content in files.items()}


def test_release_takes_no_other_options(tmp_path):
    result = CliRunner().invoke(build_fmus.main, ["smd", "--release", str(tmp_path)])
    assert result.exit_code == 2
    assert "--release builds everything" in result.output
