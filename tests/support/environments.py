"""Virtual environments with some of the packages that are installed here, made without a download."""

import os
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import distribution
from pathlib import Path

from build_cache import ROOT
from packaging.requirements import Requirement

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def call(*command, cwd, status=0, **environment):
    """Run a command, which must exit with this status, and return both of its outputs."""
    others = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    environment = others | {key: str(value) for key, value in environment.items()}
    result = subprocess.run([*map(str, command)], cwd=cwd, env=environment, capture_output=True, text=True, timeout=300)
    assert result.returncode == status, result.stdout + result.stderr
    return result.stdout + result.stderr


def required_distributions(*extras):
    """Return the distributions that the project and these of its extras require, and those that they require."""
    distributions, pending_requirements = {}, [(PROJECT["dependencies"], "")]
    pending_requirements += [(PROJECT["optional-dependencies"][extra], "") for extra in extras]
    visited_requirements = set()
    while pending_requirements:
        texts, active_extra = pending_requirements.pop()
        for requirement in map(Requirement, texts):
            if requirement.marker and not requirement.marker.evaluate({"extra": active_extra}):
                continue
            for extra in ("", *requirement.extras):
                if (requirement.name, extra) not in visited_requirements:
                    visited_requirements.add((requirement.name, extra))
                    distributions[requirement.name] = package = distribution(requirement.name)
                    pending_requirements.append((package.requires or [], extra))
    return list(distributions.values())


def make_environment(folder, *extras):
    """Make an environment in a folder, with what the project and its extras require, and return its site-packages.

    Links lead to the packages that are installed here. Any other package that is installed here is missing there.
    """
    folder.mkdir(exist_ok=True)
    call(sys.executable, "-m", "venv", "--without-pip", folder, cwd=folder)
    libraries = folder / "libraries"
    libraries.mkdir()
    for package in required_distributions(*extras):
        for name in {file.parts[0] for file in package.files} - {"..", "__pycache__"}:
            if not name.endswith(".pth") and not (libraries / name).exists():
                (libraries / name).symlink_to(Path(package.locate_file(name)).resolve())
    (site_packages,) = folder.glob("lib/python*/site-packages")
    (site_packages / "libraries.pth").write_text(f"{libraries}\n")
    return site_packages


def build_wheel(folder):
    """Build the wheel like pip does, from a copy of the sources in a folder, without network access."""
    for part in ("fmus", "harness"):
        shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ("build_fmus.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / file, folder)
    call(sys.executable, "-c", "from hatchling.build import build_wheel as build; build('out')", cwd=folder)
    (file,) = (folder / "out").iterdir()
    return file


def install(target, folder):
    """Install a wheel or, with -e, a folder in the environment of a folder, without network access."""
    pip = (sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index", "--no-build-isolation")
    call(*pip, "--ignore-installed", "--prefix", folder, *target, cwd=folder)
