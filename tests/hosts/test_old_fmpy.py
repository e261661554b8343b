"""An old fmpy, which other tools install, reads all FMUs."""

import json
import subprocess
import sys

import fmi3_fixtures
import native_fmus
import pytest
from models import MODELS

pytestmark = pytest.mark.campaign

VERSION = "0.3.9"  # the oldest one that knows FMI 3.0 and can be installed
SCRIPT = """
import json, sys, fmpy
print(json.dumps([fmpy.__version__, [len(fmpy.read_model_description(file).modelVariables) for file in sys.argv[1:]]]))
"""


def test_an_old_fmpy_reads_every_fmu(fmus, tmp_path):
    folders = (fmus, native_fmus.build_native_fmus(), fmi3_fixtures.build_fmi3_fmus())
    files = [str(folder / f"{name}.fmu") for folder in folders for name in MODELS]
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True)
    python = tmp_path / "venv" / "bin" / "python"
    install = [python, "-m", "pip", "install", "-q", f"fmpy=={VERSION}"]
    if (result := subprocess.run(install, capture_output=True, text=True)).returncode:
        pytest.skip(f"fmpy {VERSION} cannot be installed here: {result.stderr.splitlines()[-1]}")
    result = subprocess.run([python, "-c", SCRIPT, *files], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    version, counts = json.loads(result.stdout)
    assert version == VERSION
    assert min(counts) > 20
