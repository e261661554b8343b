"""What an FMU costs its host: the time that a fresh Python takes to import its code."""

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
    """Seconds of its processor; the standard library's part included, nothing compiled before."""
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
