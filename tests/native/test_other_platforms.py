"""The binaries for other platforms, where an emulator is available: Wine for Windows, qemu for Linux on ARM.

On Debian: apt-get install wine64 wine qemu-user libc6-arm64-cross.  Only the last digits of libm may differ.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import build_cache
import fmi3_fixtures
import pytest
from fmpy import read_model_description
from models import CASES, HYBRID, MODELS, RADAU9, RODAS, STICKSLIP_IN_CI, declarations_of, label, model_class, outputs
from native_fmus import build_native_fmus, require_compiler
from native_host import (
    HEADERS,
    HOST_SOURCE,
    VERSION_OPTIONS,
    begin,
    life_cycle,
    read_values,
    run_host,
    run_host_script,
    unpack_cached,
    value_references,
    version_and_guid,
)
from variants import campaign_after

from fmus.packaging import native
from fmus.packaging.native.binaries import PLATFORMS, compile_binaries, find_compiler
from fmus.packaging.native.native_fmu import MAIN_SOURCE

pytestmark = pytest.mark.slow

ROWS = 50
ARM = "/usr/aarch64-linux-gnu"  # where Debian installs the C library
PLACES = ("usr/lib*/wine", "usr/lib/*/wine", "opt/wine*/lib*/wine")
WINE = [
    path for place in PLACES for path in Path("/").glob(f"{place}/x86_64-windows")
]  # and others the libraries of Wine
MACHINES = {"win64": ["wine"], "aarch64-linux": ["qemu-aarch64", "-L", ARM]}  # and the command that runs their programs
PROGRAM = {  # additional source of a program, and options; no libraries of the compiler
    "win64": (
        [Path(__file__).with_name("windows_runtime.c")],
        [
            "-nostdlib",
            "-Wl,-e,mainCRTStartup",
            *(f"-lapi-ms-win-crt-{part}-l1-1-0" for part in ("runtime", "time", "utility")),
        ],
    ),
    "aarch64-linux": ([], ["-rtlib=none"]),
}
# Relative to the largest value of an output; breakaways amplify.  At rtol 1e-5, one last digit of k changes whether
# radau9 rejects a step: the acceleration moves by up to 3e-5, a third of the error of the method.
CLOSE = dict.fromkeys(MODELS, 1e-11) | {"pacejka": 1e-8}
CLOSE_BY_RADAU9 = 1e-4


def is_steady(case):
    """Return whether last digits stay small: not with a law that chatters, nor with an explicit method on a stiff
    model."""
    name, values, _ = case
    return values.get("friction", HYBRID) == HYBRID and (
        name != "pacejka" or values["solver.method"] in (RODAS, RADAU9)
    )


STEADY = [case for case in CASES if is_steady(case)]


@pytest.fixture(scope="module", params=campaign_after(1, MACHINES))
def machine(request):
    """A platform, a function that returns the command to start a host there, and its environment."""
    emulator, *words = MACHINES[request.param]
    if not shutil.which(emulator) or not (os.path.isdir(ARM) if words else WINE):
        pytest.skip(f"{emulator} is not here: apt-get install wine64 wine qemu-user libc6-arm64-cross")
    require_compiler()
    (target,) = PLATFORMS[request.param].targets.values()

    def program(version):
        def make(folder):
            platform, (more_sources, options) = PLATFORMS[request.param], PROGRAM[request.param]
            options = [*(option.format(compiler=find_compiler()) for option in platform.options), *options]
            options += VERSION_OPTIONS[version]
            sources = [
                HOST_SOURCE,
                *more_sources,
                *(Path(native.__file__).with_name(file) for file in platform.sources),
            ]
            command = [sys.executable, "-m", "ziglang", "cc", "-target", target, "-O1", "-s", *options, f"-I{HEADERS}"]
            subprocess.run([*command, *map(str, sources), "-o", str(folder / "host.exe")], check=True)

        return [emulator, *words, str(build_cache.keep_build(f"host-{version}-{request.param}", make) / "host.exe")]

    return request.param, program, os.environ | (windows() if emulator == "wine" else {})


def windows():
    """The environment of a Windows that consists of Wine's libraries in a folder; a complete prefix takes too long
    to set up."""

    def make(folder):
        system = {"system32": WINE[0], "syswow64": WINE[0].with_name("i386-windows")}
        links = {"dosdevices/c:": "../drive_c", "dosdevices/z:": "/"}
        for link, target in (links | {f"drive_c/windows/{name}": path for name, path in system.items()}).items():
            (folder / link).parent.mkdir(parents=True, exist_ok=True)
            (folder / link).symlink_to(target)

    prefix = str(build_cache.cached_folder("windows", make))
    return {"WINEDEBUG": "-all", "WINEDLLOVERRIDES": "wineboot.exe=d", "WINEPREFIX": prefix, "HOME": prefix}


def library(fmu, platform):
    """Return the library for a platform, built from the sources in the FMU."""
    version, _ = version_and_guid(fmu)

    def make(folder):
        sources = {path.name: path.read_text() for path in (unpack_cached(fmu) / "sources").iterdir()}
        for path, content in compile_binaries(fmu.stem, sources, MAIN_SOURCE[version], platform, version).items():
            (folder / Path(path).name).write_bytes(content)

    return build_cache.keep_build(f"{fmu.stem}-{version}-{platform}", make) / f"{fmu.stem}{PLATFORMS[platform].suffix}"


def run_host_script_there(machine, fmu, script):
    """Run a script in the host on another platform."""
    platform, program, environment = machine
    version, _ = version_and_guid(fmu)
    answers, _ = run_host(program(version), library(fmu, platform), fmu, script, environment=environment)
    return answers


def runs(name):
    """Return a script with every case of a model, each in its own instance, and the number of rows of each."""
    ref, script = value_references(name), []
    reals = " ".join(str(ref[v]) for v in outputs(name) if declarations_of(name)[v].type == "Real")
    for i, (_, values, stop) in enumerate(case for case in STEADY if case[0] == name):
        sets = [f"{i} {'seti' if declarations_of(name)[v].items else 'setr'} {ref[v]} {x!r}" for v, x in values.items()]
        script += [f"{i} new", *sets, *begin(i, stop=stop)[1:]]
        script += [f"{i} run {stop * k / ROWS!r} {stop * (k + 1) / ROWS!r} 1 {reals}" for k in range(ROWS)]
    return script


def exchange(name):
    """Return a script with Euler steps in model exchange and an event at each step; a sled starts far behind its
    driver."""
    ref, has_driver = value_references(name), "x_driver" in declarations_of(name)
    states, behind = len(model_class(name).states) + has_driver, [(ref["x0"], -0.2)] if has_driver else []
    reals = " ".join(str(ref[v]) for v in outputs(name) if declarations_of(name)[v].type == "Real")
    spans = [f"0 euler {states} {k / ROWS!r} {(k + 1) / ROWS!r} 40 {reals}" for k in range(ROWS)]
    return ["0 new exchange", *begin(0, behind)[1:], *spans]


def tables(answers):
    """Return the rows of every case, column by column."""
    rows = [[float.fromhex(word) for word in line.split()[1:]] for line in answers if line.count(" ") > 2]
    return [list(zip(*rows[k : k + ROWS], strict=True)) for k in range(0, len(rows), ROWS)]


@pytest.mark.campaign
@pytest.mark.parametrize("name", STICKSLIP_IN_CI)
def test_results_agree_with_linux_on_x86(machine, name):
    script = runs(name)
    expected, actual = (
        tables(run_host_script(build_native_fmus() / f"{name}.fmu", script)[0]),
        tables(run_host_script_there(machine, build_native_fmus() / f"{name}.fmu", script)),
    )
    cases = [case for case in STEADY if case[0] == name]
    for case, table, other in zip(cases, expected, actual, strict=True):
        print(f"{machine[0]} {label(case)}: largest difference {relative_difference(table, other):.1e}")
        bound = CLOSE_BY_RADAU9 if case[1]["solver.method"] == RADAU9 else CLOSE[name]
        assert relative_difference(table, other) <= bound


def relative_difference(table, other):
    """Return the largest difference of two tables, relative to the largest value of each column."""
    sizes = [max(map(abs, column)) or 1.0 for column in table]
    differences = [max(abs(a - b) for a, b in zip(*pair, strict=True)) for pair in zip(table, other, strict=True)]
    return max(difference / size for difference, size in zip(differences, sizes, strict=True))


@pytest.mark.parametrize("name", STICKSLIP_IN_CI)
def test_model_exchange_agrees_with_linux_on_x86(machine, name):
    script = exchange(name)
    (expected,), (actual,) = (
        tables(run_host_script(build_native_fmus() / f"{name}.fmu", script)[0]),
        tables(run_host_script_there(machine, build_native_fmus() / f"{name}.fmu", script)),
    )
    assert len(set(expected[0])) > 3  # it moves
    assert relative_difference(expected, actual) <= CLOSE[name]


@pytest.mark.parametrize("exchange", [False, True], ids=["co-simulation", "model exchange"])
def test_fmi3_agrees_with_linux_on_x86(machine, exchange):
    """With saved states, for the sled. The numerics are those of FMI 2.0, so one method is enough."""
    sled = fmi3_fixtures.build_reduced_fmu("stickslip")
    references = {variable.name: variable.valueReference for variable in read_model_description(sled).modelVariables}
    script = life_cycle("stickslip", 4000, exchange, references)
    expected, _ = run_host_script(sled, script)
    actual = run_host_script_there(machine, sled, script)
    assert read_values(actual) == [pytest.approx(row, abs=1e-11) for row in read_values(expected)]


def test_messages_agree_with_linux_on_x86(machine):
    ref = value_references("stickslip")
    numbers = [
        "0.1",
        "1e22",
        "5e-324",
        "-1.7976931348623157e308",
        "5.684341886080802e-14",
        "123456.789",
        "1e16",
        "1e-5",
    ]
    script = ["0 new"]
    for number in numbers:
        script += [f"0 setr {ref['x']} {number}", "0 setup nan 0 1", "0 enter", "0 exit", "0 step 0 0.5", "0 reset"]
    expected, actual = (
        run_host_script(build_native_fmus() / "stickslip.fmu", script)[0],
        run_host_script_there(machine, build_native_fmus() / "stickslip.fmu", script),
    )
    assert expected == actual
    assert any("x = 5.684341886080802e-14 is refused" in line for line in expected)
