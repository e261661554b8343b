"""Thirteen FMUs that do not come from this project: pythonfmu (FMI 2.0), pythonfmu3 (FMI 3.0) and C. Sources:
tests/external_fmus."""

import os
import subprocess
import sys
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import build_cache

UNUSED_PARAMETERS_ALLOWED = '#pragma GCC diagnostic ignored "-Wunused-parameter"\n'  # of functions that do nothing
SOURCES = Path(__file__).parents[1] / "external_fmus"
SWEEP_AXES = {
    "Midpoint": "k=30:50:3",  # FMI 2.0: converges as its communication steps become shorter; no units
    "FixedStep": "k=0.5:1:3",  # has a fixed internal step
    "Fmi3FixedStep": "k=0.5:1:3",  # FMI 3.0, has the same fixed internal step
    "Switching": "loss=0.1:0.2:3",  # Boolean, Integer and String outputs and parameters
    "Gain": "k=1:2:3",  # FMI 2.0: without states, the part of a system
    "Falling": "height=1:4:3",  # terminates the simulation
    "NonConforming": "k=30:50:3",  # violates the standard, but runs
    "Faulty": "k=1:2:3",  # with kind=1 to 7 it hangs, crashes, raises, prints, returns NaN, fails, stops its process
    "Fmi3Midpoint": "k=30:50:3",  # FMI 3.0, with units; terminates at `limit`
    "Arrays": "omega=1:3:3",  # FMI 3.0: arrays, an enumeration, a string
    "ModelExchangeOnly": "k=30:50:3",  # FMI 3.0, model exchange only
    "Ticking": "k=1:3:3",  # FMI 3.0, both interfaces, in C: clocks of all kinds that one FMU can have
    "Bouncing": "e=0.7:0.9:3",  # FMI 2.0, model exchange only, in C: events that change states; with units
}


def build_external_fmus():
    """Return the folder of all thirteen FMUs."""

    def make(folder):
        path = os.environ | {"PYTHONPATH": str(build_cache.ROOT)}
        subprocess.run([sys.executable, __file__, str(folder)], check=True, capture_output=True, timeout=120, env=path)

    return build_cache.cached_folder("foreign", make)


def edited_copy(fmu, copy, changes):
    """Write a copy of an FMU with changed, added or (None) removed files; a function is applied to the old text."""
    with ZipFile(fmu) as old, ZipFile(copy, "w", ZIP_DEFLATED) as new:
        content = {name: old.read(name) for name in old.namelist()}
        for name, change in changes.items():
            content[name] = change(content[name].decode()) if callable(change) else change
        for name, data in content.items():
            if data is not None:
                new.writestr(name, data)
    return copy


def main(out):
    """Build all FMUs."""
    import pythonfmu
    import pythonfmu3

    from benchmarks.c_host import HEADERS
    from fmus.packaging.native.binaries import compile_binaries

    for source in sorted(SOURCES.glob("*.py")):
        package = pythonfmu3 if "pythonfmu3" in source.read_text() else pythonfmu
        package.FmuBuilder.build_FMU(source, out)
    for source in SOURCES.glob("*/*.c"):
        description = source.with_name("modelDescription.xml")
        version = "3" if 'fmiVersion="3.0"' in description.read_text() else "2"
        files = {file.name: file.read_text() for file in HEADERS.glob(f"fmi{version}*.h")}
        files[source.name] = UNUSED_PARAMETERS_ALLOWED + source.read_text()
        with ZipFile(Path(out) / f"{source.stem}.fmu", "w", ZIP_DEFLATED) as archive:
            archive.write(description, "modelDescription.xml")
            for path, content in compile_binaries(source.stem, files, source.name, "linux64", version).items():
                archive.writestr(path, content)


if __name__ == "__main__":
    main(sys.argv[1])
