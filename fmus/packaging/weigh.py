"""What an FMU costs its host: the time that a fresh Python takes to import its code."""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import ZipFile

TRIES = 2
CLOCK = """
import sys, time
sys.path.insert(0, sys.argv[1])
begin = time.perf_counter()
__import__(sys.argv[2])
print(time.perf_counter() - begin)
"""


def import_time(fmu: Path) -> float:
    """Seconds, the better of two; the standard library's part included, nothing compiled before."""
    with TemporaryDirectory() as folder:
        with ZipFile(fmu) as archive:
            archive.extractall(folder, [path for path in archive.namelist() if path.startswith("resources/")])
        resources = Path(folder, "resources")
        command = [sys.executable, "-IB", "-c", CLOCK, str(resources), (resources / "slavemodule.txt").read_text()]
        runs = [subprocess.run(command, capture_output=True, text=True, check=True) for _ in range(TRIES)]
        return min(float(run.stdout) for run in runs)
