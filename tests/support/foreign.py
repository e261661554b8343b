"""Nine FMUs that are not ours, of plain pythonfmu (FMI 2.0) and pythonfmu3 (FMI 3.0); their sources are tests/foreign.

built() / "Midpoint.fmu"       built once a run
VARY["Midpoint"]               what a sweep may vary in it, as --vary takes it
edited(fmu, copy, {name: new}) a copy with files changed, added, or (None) left out; a function gets the old text
"""

import subprocess
import sys
from fcntl import LOCK_EX, flock
from pathlib import Path
from tempfile import mkdtemp
from zipfile import ZIP_DEFLATED, ZipFile

import builds

SOURCES = Path(__file__).parents[1] / "foreign"
VARY = {
    "Midpoint": "k=30:50:3",  # FMI 2.0: converges as its communication steps become shorter; no units
    "FixedStep": "k=0.5:1:3",  # has a step of its own
    "Switching": "loss=0.1:0.2:3",  # Boolean, Integer and String, as outputs and as parameters
    "Falling": "height=1:4:3",  # ends itself
    "Breaking": "k=30:50:3",  # breaks the standard, and would run
    "Trouble": "k=1:2:3",  # with kind=1 to 6 it hangs, crashes, raises, prints, gives NaN, fails
    "Third": "k=30:50:3",  # FMI 3.0, with units; ends itself at `limit`
    "Arrays": "omega=1:3:3",  # FMI 3.0: arrays, an enumeration, a text
    "Exchange": "k=30:50:3",  # FMI 3.0, model exchange alone
}


def built():
    """The folder of all nine."""
    folder = builds.room / "foreign"
    with (builds.room / "foreign.lock").open("w") as lock:
        flock(lock, LOCK_EX)
        if not folder.exists():
            fresh = mkdtemp(dir=builds.room)
            subprocess.run([sys.executable, __file__, fresh], check=True, capture_output=True, timeout=120)
            Path(fresh).rename(folder)
    return folder


def edited(fmu, copy, changes):
    """A copy of an FMU with files changed."""
    with ZipFile(fmu) as old, ZipFile(copy, "w", ZIP_DEFLATED) as new:
        content = {name: old.read(name) for name in old.namelist()}
        for name, change in changes.items():
            content[name] = change(content[name].decode()) if callable(change) else change
        for name, data in content.items():
            if data is not None:
                new.writestr(name, data)
    return copy


def main(out):
    """Build them all."""
    import pythonfmu
    import pythonfmu3

    for name in VARY:
        source = SOURCES / f"{name}.py"
        package = pythonfmu3 if "pythonfmu3" in source.read_text() else pythonfmu
        package.FmuBuilder.build_FMU(source, out)


if __name__ == "__main__":
    main(sys.argv[1])
