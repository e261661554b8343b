"""The files that name the versions of all dependencies agree with pyproject.toml."""

import re
import tomllib
from itertools import chain

from build_cache import ROOT
from packaging.requirements import Requirement

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OWN_NAME = PROJECT["name"]


def normalize(name):
    """Return the name of a package as in PEP 503."""
    return re.sub(r"[-_.]+", "-", name).lower()


def test_the_constraints_name_an_allowed_version_of_every_dependency_with_hashes():
    entries = {}
    text = (ROOT / ".ci" / "constraints.txt").read_text(encoding="utf-8").replace("\\\n", "")
    for line in text.splitlines():
        specification, *hashes = re.split(r"\s+--hash=", line)
        assert hashes
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", digest) for digest in hashes)
        name, version = specification.partition(";")[0].strip().split("==")
        entries.setdefault(normalize(name), []).append(version)
    for text in chain(PROJECT["dependencies"], *PROJECT["optional-dependencies"].values()):
        requirement = Requirement(text)
        if requirement.name != OWN_NAME:
            versions = entries[normalize(requirement.name)]
            assert all(requirement.specifier.contains(version, prereleases=True) for version in versions), text


def test_the_job_of_the_lowest_versions_runs_tests_that_exist():
    script = (ROOT / ".ci/floors").read_text(encoding="utf-8")
    names = " ".join(re.findall(r"^fast\+?=\((.*)\)$", script, re.M)).split()
    assert names
    assert [name for name in names if not (ROOT / "tests" / name).exists()] == []
    assert "bash .ci/floors" in (ROOT / ".ci/run").read_text(encoding="utf-8")
