"""The binaries for other machines, where an emulator is at hand: Wine for Windows, qemu for Linux on ARM.

On Debian: apt-get install wine64 wine qemu-user libc6-arm64-cross.  Only libm's last place may differ.
"""

import os
import shutil
import subprocess
import sys

import pytest
from models import CASES, HYBRID, MODELS, RODAS, declared, label, outputs
from native_fmus import built, room
from native_host import HEADERS, SOURCE, begin, folder, guid, play, references, unpacked

ROWS = 50
ARM = "/usr/aarch64-linux-gnu"  # where Debian puts the C library
MACHINES = {
    "win64": ("x86_64-windows-gnu", ".dll", ["wine"]),
    "aarch64-linux": ("aarch64-linux-gnu.2.17", ".so", ["qemu-aarch64", "-L", ARM]),
}
CLOSE = dict.fromkeys(MODELS, 1e-11) | {"pacejka": 1e-9}  # of an output's largest value; break-aways amplify


def is_steady(case):
    """Whether a last bit stays one: not with a law that chatters, nor with an explicit method on the stiff curve."""
    name, values, _ = case
    return values.get("friction", HYBRID) == HYBRID and (name != "pacejka" or values["solver.method"] == RODAS)


STEADY = [case for case in CASES if is_steady(case)]


@pytest.fixture(scope="module", params=MACHINES)
def machine(request):
    """A platform, and the command that starts the host there."""
    target, _, (emulator, *options) = MACHINES[request.param]
    if not shutil.which(emulator) or (options and not os.path.isdir(ARM)):
        pytest.skip(f"{emulator} is not here: apt-get install wine64 wine qemu-user libc6-arm64-cross")
    out = folder(f"host on {request.param}") / "host.exe"
    command = [
        sys.executable,
        "-m",
        "ziglang",
        "cc",
        "-target",
        target,
        "-O1",
        f"-I{HEADERS}",
        str(SOURCE),
        "-o",
        str(out),
    ]
    subprocess.run(command, check=True)
    return request.param, [emulator, *options, str(out)]


def play_there(machine, name, script):
    """As play, there."""
    platform, command = machine
    fmu = built(*MACHINES) / f"{name}.fmu"
    library = unpacked(fmu) / "binaries" / platform / f"{name}{MACHINES[platform][1]}"
    quiet = {"WINEDEBUG": "-all", "WINEPREFIX": str(folder("wine")), "HOME": room().name}
    done = subprocess.run(
        [*command, str(library), guid(fmu), "1"],
        input="\n".join(script),
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, **quiet},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def runs(name):
    """A script with every case of a model, each in an instance of its own, and how many rows each tells."""
    ref, script = references(name), []
    reals = " ".join(str(ref[v]) for v in outputs(name) if declared(name)[v].type == "Real")
    for i, (_, values, stop) in enumerate(case for case in STEADY if case[0] == name):
        sets = [f"{i} {'seti' if declared(name)[v].items else 'setr'} {ref[v]} {x!r}" for v, x in values.items()]
        script += [f"{i} new", *sets, *begin(i, stop=stop)[1:]]
        script += [f"{i} run {stop * k / ROWS!r} {stop * (k + 1) / ROWS!r} 1 {reals}" for k in range(ROWS)]
    return script


def tables(answers):
    """The rows of every case, column by column."""
    rows = [[float.fromhex(word) for word in line.split()[1:]] for line in answers if line.count(" ") > 2]
    return [list(zip(*rows[k : k + ROWS], strict=True)) for k in range(0, len(rows), ROWS)]


@pytest.mark.parametrize("name", MODELS)
def test_the_answers_are_those_of_linux_on_x86(machine, name):
    script = runs(name)
    here, there = tables(play(built() / f"{name}.fmu", script)[0]), tables(play_there(machine, name, script))
    cases = [case for case in STEADY if case[0] == name]
    for case, table, other in zip(cases, here, there, strict=True):
        sizes = [max(map(abs, column)) or 1.0 for column in table]
        apart = [max(abs(a - b) for a, b in zip(*pair, strict=True)) for pair in zip(table, other, strict=True)]
        worst = max(difference / size for difference, size in zip(apart, sizes, strict=True))
        print(f"{machine[0]} {label(case)}: largest difference {worst:.1e}")
        assert worst <= CLOSE[name]


def test_the_sentences_are_those_of_linux_on_x86(machine):
    ref = references("stickslip")
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
    here, there = play(built() / "stickslip.fmu", script)[0], play_there(machine, "stickslip", script)
    assert here == there
    assert any("x = 5.684341886080802e-14 is refused" in line for line in here)
