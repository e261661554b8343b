"""Measures how long a fresh Python process takes to import the code of an FMU."""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import ZipFile

TIMING_SCRIPT = """
import sys, time
sys.path.insert(0, sys.argv[1])
begin = time.process_time()
__import__(sys.argv[2])
print(time.process_time() - begin)
"""


def measure_import_time(fmu: Path) -> float:
    """Return the CPU time of the import in s, including the standard library and without cached bytecode."""
    with TemporaryDirectory() as folder:
        with ZipFile(fmu) as archive:
            archive.extractall(folder, [path for path in archive.namelist() if path.startswith("resources/")])
        resources = Path(folder, "resources")
        command = [
            sys.executable,
            "-IB",
            "-c",
            TIMING_SCRIPT,
            str(resources),
            (resources / "slavemodule.txt").read_text(),
        ]
        return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
