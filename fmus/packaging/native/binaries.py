"""Compiles the binaries of native FMUs with the package ziglang, which cross-compiles for every platform."""

import logging
import math
import os
import signal
import subprocess
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from struct import pack, unpack_from
from tempfile import TemporaryDirectory, gettempdir
from threading import Event
from typing import Any

from ...compiler import BuildError
from ...compiler.c.c_expressions import MAY_RAISE, NEVER_RAISING

LOG = logging.getLogger(__name__)

# Round after every operation, and call libm at run time: for constant arguments the compiler would insert its own
# results, which can differ in the last digit.
INTRINSICS = {math.fabs, math.copysign, math.sqrt}  # processor instructions with exact results
LIBM = [function.__name__ for function in (*NEVER_RAISING, *MAY_RAISE) if function not in INTRINSICS]
BIT_EXACT = ("-Os", "-ffp-contract=off", *(f"-fno-builtin-{name}" for name in LIBM))
# At -Os the compiler inlines less than pays here. With this threshold, the shipped models run with fewer instructions
# than at -O2, from libraries that are smaller by 10 to 20 %. At 125, a closed form takes 5 to 12 % more instructions;
# 200 saves nothing beyond 150.
INLINING = ("-mllvm", "-inline-threshold=150")
# In the sources of large models, inlining takes half of the compile time and makes no run faster; it changes no bits.
# Functions that are marked inline stay so: some of those in the headers for Windows exist in no library.
LARGE_SOURCE, LARGE_SOURCE_OPTIONS = 500_000, ("-finline-hint-functions",)  # characters in all files
FMI_HEADER_WARNINGS_OFF = ("-Wno-strict-prototypes",)  # the headers of FMI 3.0 declare functions without prototypes
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *FMI_HEADER_WARNINGS_OFF)
# Link only the libraries named explicitly: building the compiler's runtime takes longer than building the FMU.
SHARED_LIBRARY = ("-shared", "-fPIC", "-fvisibility=hidden", "-nostdlib", "-Wl,-z,defs")


@dataclass(frozen=True)
class Platform:
    """A platform that FMUs are built for.

    Parameters
    ----------
    suffix
        Suffix of shared libraries.
    targets
        Compiler target of each processor, by the folder of binaries/ in FMI 3.0. In FMI 2.0 there is one folder per
        platform.
    options, sources
        Additional linker options and C sources.
    """

    suffix: str
    targets: dict[str, str]
    options: tuple[str, ...]
    sources: tuple[str, ...] = ()


# Exceptions do not pass the C interface of FMI, so nothing unwinds the stack through an FMU, except on Windows, which
# requires tables for it. macOS requires frame pointers.
NO_UNWIND_TABLES = ("-fno-unwind-tables", "-fno-asynchronous-unwind-tables")
LINUX = ("-lc", "-lm", "-Wl,--hash-style=gnu", "-fno-plt", "-fomit-frame-pointer", *NO_UNWIND_TABLES)
# Windows 10 and later: link the Universal C Runtime directly, with the headers from the compiler package.
UCRT = (
    *("-isystem", "{compiler}/lib/libc/include/any-windows-any", "-D__USE_MINGW_ANSI_STDIO=0"),
    *(f"-lapi-ms-win-crt-{part}-l1-1-0" for part in ("convert", "heap", "math", "private", "stdio", "string")),
    *("-lkernel32", "-Wl,-e,DllMainCRTStartup", "-fomit-frame-pointer"),
)
PLATFORMS = {
    "linux64": Platform(".so", {"x86_64-linux": "x86_64-linux-gnu.2.17"}, LINUX),
    "win64": Platform(".dll", {"x86_64-windows": "x86_64-windows-gnu"}, UCRT, ("windows_runtime.c",)),
    "darwin64": Platform(
        ".dylib",
        {"x86_64-darwin": "x86_64-macos.11.0", "aarch64-darwin": "aarch64-macos.11.0"},
        ("-Wl,-install_name,@rpath/{name}.dylib", "-lc", "-lm", *NO_UNWIND_TABLES),
    ),
    "aarch64-linux": Platform(".so", {"aarch64-linux": "aarch64-linux-gnu.2.17"}, LINUX),
}
DEFAULT_PLATFORMS = ("linux64", "win64", "darwin64")


def compile_binaries(name: str, files: Mapping[str, str], main: str, platform: str, fmi: str) -> dict[str, bytes]:
    """Compile an FMU for a platform. Returns paths in the FMU, below binaries/, and contents."""
    suffix, libraries = PLATFORMS[platform].suffix, compile_libraries(name, files, main, platform)
    if fmi == "2":
        library = (
            make_universal_binary(list(libraries.values())) if len(libraries) > 1 else next(iter(libraries.values()))
        )
        libraries = {platform: library}
    return {f"binaries/{folder}/{name}{suffix}": content for folder, content in libraries.items()}


def compile_libraries(name: str, files: Mapping[str, str], main: str, platform: str) -> dict[str, bytes]:
    """Compile the source `main` for the processors of a platform. Returns libraries by folder of FMI 3.0."""
    configuration, out = PLATFORMS[platform], f"{name}{PLATFORMS[platform].suffix}"
    own_sources = {
        source: Path(__file__).with_name(source).read_text(encoding="utf-8") for source in configuration.sources
    }
    is_large = sum(map(len, files.values())) > LARGE_SOURCE
    options = (*SHARED_LIBRARY, *own_sources, *configuration.options, *(LARGE_SOURCE_OPTIONS if is_large else INLINING))
    return {
        folder: compile_and_link({**files, **own_sources}, main, target, out, options)
        for folder, target in configuration.targets.items()
    }


RUNNING: set[subprocess.Popen[str]] = set()  # compilers
IS_STOPPED = Event()  # while a pool ends its compilers; one that starts then ends at once


class CompilerPool(ThreadPoolExecutor):
    """Threads that wait for compilers. An exception, such as an interrupt, ends the compilers, which take minutes."""

    def __exit__(self, kind: Any, error: Any, traceback: Any) -> None:
        if kind is not None:
            IS_STOPPED.set()
            self.shutdown(wait=False, cancel_futures=True)
            for process in list(RUNNING):
                stop_compiler(process)
        super().__exit__(kind, error, traceback)
        IS_STOPPED.clear()


def stop_compiler(process: subprocess.Popen[str]) -> None:
    """Kill a compiler with its child processes, which are a process group."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL) if hasattr(os, "killpg") else process.kill()


def find_compiler() -> Path:
    """Return the folder of the package ziglang; raise BuildError if it is not installed."""
    spec = find_spec("ziglang")
    if spec is None or not spec.submodule_search_locations:
        raise BuildError(
            "Native FMUs need the C compiler in the package ziglang: python -m pip install 'friction-fmus[native]'."
        )
    return Path(spec.submodule_search_locations[0])


def compile_and_link(files: Mapping[str, str], main: str, target: str, out: str, options: Iterable[str]) -> bytes:
    """Compile and link the source `main` for a target; return the library.

    `out` is a file name without a folder, so that no path of this machine gets into the library. Options may contain
    {name} and {compiler}, the folder of the compiler.
    """
    package = find_compiler()
    options = [option.format(name=Path(out).stem, compiler=package) for option in options]
    with TemporaryDirectory() as folder:
        for file, text in files.items():
            (Path(folder) / file).write_text(text, encoding="utf-8", newline="\n")
        # -g0: without debug information, which -s removes, large models compile in 60 % of the time
        command = [str(package / "zig"), "cc", "-target", target, *STRICT, *BIT_EXACT, *options, "-g0", "-s"]
        command += [main, "-o", out]
        # The compiler caches its own parts in the home directory, which a service may not have. Objects of FMUs go to
        # the temporary folder, so that the cache does not grow.
        caches = {"HOME": gettempdir(), "ZIG_LOCAL_CACHE_DIR": f"{folder}/cache"} | os.environ
        LOG.debug("the C compiler starts for %s, %s", out, target)
        streams: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        with subprocess.Popen(command, cwd=folder, env=caches, start_new_session=True, **streams) as process:
            RUNNING.add(process)
            if IS_STOPPED.is_set():
                stop_compiler(process)
            _, errors = process.communicate()
            RUNNING.discard(process)
        if process.returncode:
            raise BuildError(f"{out} does not compile for {target}:\n{errors.strip()}")
        return (Path(folder) / out).read_bytes()


FAT_MAGIC, MACHO_MAGIC = 0xCAFEBABE, 0xFEEDFACF
ALIGNMENT = 14  # exponent of two: the page size of arm64, a multiple of that of x86_64


def make_universal_binary(slices: list[bytes]) -> bytes:
    """Combine libraries into one file. The header of each library has its processor type."""
    offset = 1 << ALIGNMENT
    header, body = pack(">II", FAT_MAGIC, len(slices)), b""
    for content in slices:
        magic, processor, subtype = unpack_from("<III", content)
        if magic != MACHO_MAGIC:
            raise ValueError("not a 64-bit Mach-O file")
        header += pack(">IIIII", processor, subtype, offset, len(content), ALIGNMENT)
        body += content + bytes(-len(content) % (1 << ALIGNMENT))
        offset = (1 << ALIGNMENT) + len(body)
    return header.ljust(1 << ALIGNMENT, b"\0") + body
