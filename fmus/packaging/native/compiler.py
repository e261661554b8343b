"""The binaries of a native FMU, for every platform on any machine, by the compiler in the package ziglang."""

import math
import os
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

from .. import BuildError
from .expressions import MAY_RAISE, NEVER_RAISING
from .universal_binary import make_universal_binary

# One rounding for each operation, and every function of libm from the machine that runs the FMU: the compiler would
# replace those of constants by values that are right in one more digit, and not the same.
INTRINSICS = {math.fabs, math.copysign, math.sqrt}  # instructions of the processor, and exact
LIBM = [function.__name__ for function in (*NEVER_RAISING, *MAY_RAISE) if function not in INTRINSICS]
BIT_EXACT = ("-O2", "-ffp-contract=off", *(f"-fno-builtin-{name}" for name in LIBM))
UNUSED_WARNINGS_OFF = (
    "-Wno-unused-parameter",
    "-Wno-unused-but-set-variable",
)  # by a branch of the numerics that is not needed
FMI_HEADER_WARNINGS_OFF = ("-Wno-strict-prototypes",)  # in the headers of FMI 3.0
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *UNUSED_WARNINGS_OFF, *FMI_HEADER_WARNINGS_OFF)
# Of libraries those that are named alone: the compiler's own, which nothing of ours calls, takes it longer than ours.
SHARED_LIBRARY = ("-shared", "-fPIC", "-fvisibility=hidden", "-nostdlib", "-Wl,-z,defs")


@dataclass(frozen=True)
class Platform:
    """The suffix of its libraries; for each processor that it serves the folder of FMI 3.0 (of FMI 2.0 there is one for
    all, under our name), and the compiler's name; options and sources of its own."""

    suffix: str
    targets: dict[str, str]
    options: tuple[str, ...]
    sources: tuple[str, ...] = ()


# The C runtime of Windows 10 and later as it is, and the headers that the compiler has for it.
UCRT = (
    *("-isystem", "{compiler}/lib/libc/include/any-windows-any", "-D__USE_MINGW_ANSI_STDIO=0"),
    *(f"-lapi-ms-win-crt-{part}-l1-1-0" for part in ("convert", "heap", "math", "private", "stdio", "string")),
    *("-lkernel32", "-Wl,-e,DllMainCRTStartup"),
)
PLATFORMS = {
    "linux64": Platform(".so", {"x86_64-linux": "x86_64-linux-gnu.2.17"}, ("-lc", "-lm")),
    "win64": Platform(".dll", {"x86_64-windows": "x86_64-windows-gnu"}, UCRT, ("windows_runtime.c",)),
    "darwin64": Platform(
        ".dylib",
        {"x86_64-darwin": "x86_64-macos.11.0", "aarch64-darwin": "aarch64-macos.11.0"},
        ("-Wl,-install_name,@rpath/{name}.dylib", "-lc", "-lm"),
    ),
    "aarch64-linux": Platform(".so", {"aarch64-linux": "aarch64-linux-gnu.2.17"}, ("-lc", "-lm")),
}
DEFAULT_PLATFORMS = ("linux64", "win64", "darwin64")


def compile_binaries(name: str, files: Mapping[str, str], main: str, platform: str, fmi: str) -> dict[str, bytes]:
    """Path and content of what is in binaries/ of the FMU `name` for a platform, in a version of FMI."""
    suffix, slices = PLATFORMS[platform].suffix, compile_libraries(name, files, main, platform)
    if fmi == "2":
        whole = make_universal_binary(list(slices.values())) if len(slices) > 1 else next(iter(slices.values()))
        slices = {platform: whole}
    return {f"binaries/{folder}/{name}{suffix}": content for folder, content in slices.items()}


def compile_libraries(name: str, files: Mapping[str, str], main: str, platform: str) -> dict[str, bytes]:
    """The libraries from the source `main`, which depend on nothing else, by the folders of FMI 3.0."""
    chosen, out = PLATFORMS[platform], f"{name}{PLATFORMS[platform].suffix}"
    own = {source: Path(__file__).with_name(source).read_text(encoding="utf-8") for source in chosen.sources}
    options = (*SHARED_LIBRARY, *own, *chosen.options)
    return {
        place: compile_and_link({**files, **own}, main, target, out, options)
        for place, target in chosen.targets.items()
    }


def find_compiler() -> Path:
    """The folder of the package ziglang."""
    found = find_spec("ziglang")
    if found is None or not found.submodule_search_locations:
        raise BuildError("Native FMUs need the compiler in the package ziglang: try pip install -e '.[native]'.")
    return Path(found.submodule_search_locations[0])


def compile_and_link(files: Mapping[str, str], main: str, target: str, out: str, options: Iterable[str]) -> bytes:
    """What the compiler makes of the source `main` for a target; `out` is a name without a folder, so that none gets
    in, and an option may name the compiler's folder."""
    package = find_compiler()
    options = [option.format(name=Path(out).stem, compiler=package) for option in options]
    with TemporaryDirectory() as folder:
        for file, text in files.items():
            (Path(folder) / file).write_text(text, encoding="utf-8", newline="\n")
        command = [str(package / "zig"), "cc", "-target", target, *STRICT, *BIT_EXACT, *options, "-s"]
        command += [main, "-o", out]
        # It keeps a store at home, which services have not; what it makes of ours stays out, or the store would grow.
        stores = {"HOME": gettempdir(), "ZIG_LOCAL_CACHE_DIR": f"{folder}/store"} | os.environ
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=stores)
        if done.returncode:
            raise BuildError(f"{out} does not compile for {target}:\n{done.stderr.strip()}")
        return (Path(folder) / out).read_bytes()
