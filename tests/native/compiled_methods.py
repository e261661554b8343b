"""Compile methods of two floats to C and compare them with CPython on edge-case values."""

import copy
import ctypes
import math
import random
import struct
import subprocess
from itertools import product
from pathlib import Path

from native_host import compiler

import fmus.packaging.native as native
from fmus.compiler.c.c_types import FLOAT, FloatArray, ScalarTuple, StructPointer
from fmus.compiler.c.call_graph import CallGraph
from fmus.packaging.native.binaries import BIT_EXACT, STRICT

FAULT_EXCEPTIONS = (ArithmeticError, ValueError, IndexError)  # the C code sets the fault flag for these
VALUES = [0.0, -0.0, 1.0, -1.0, 0.3, -2.5, 7.0, 1e-5, 1e5, 710.0, 5e-324, 1e-300, 1e300, math.inf, -math.inf, math.nan]
VALUES += [random.Random(1).uniform(-4.0, 4.0) for _ in range(6)]
PAIRS = [*product(VALUES, VALUES)]


def flat_values(owner):
    """Yield all numbers of an object, in order."""
    for value in vars(owner).values():
        if hasattr(value, "__dict__"):
            yield from flat_values(value)
        elif isinstance(value, list):
            yield from value
        else:
            yield value


def c_member_paths(layout, cls, prefix):
    """Yield the C expressions of the same numbers."""
    for name, kind in layout.fields[cls].items():
        if isinstance(kind, StructPointer):
            yield from c_member_paths(layout, kind.cls, f"{prefix}{name}.")
        elif isinstance(kind, FloatArray):
            yield from (f"{prefix}{name}[{i}]" for i in range(kind.length))
        else:
            yield prefix + name


def bits(values):
    """Return the bit patterns of numbers; all NaNs are equal."""
    return [struct.pack("<d", math.nan if value != value else float(value)) for value in values]


class CompiledMethods:
    """Methods of an object compiled to C; each call starts from a fresh copy of the object."""

    def __init__(self, owner, methods, folder, warnings=STRICT):
        call_graph = CallGraph(owner)
        cls = type(owner)
        state = list(c_member_paths(call_graph.layout, cls, "instance."))
        calls, self.widths = [], {}
        for name in methods:
            result = call_graph.add_model_entry_point(f"run_{name}", getattr(cls, name), FLOAT, FLOAT).result
            parts = [f"r._{i}" for i in range(len(result.parts))] if isinstance(result, ScalarTuple) else ["r"]
            self.widths[name] = len(parts)
            calls.append(
                f"int {name}(double x, double y, double *out) {{\n"
                f"    struct {cls.__name__} instance = image;\n    bool fault = false;\n"
                f"    {result.c} r = run_{name}(&instance, x, y, &fault);\n"
                + "".join(f"    *out++ = (double){part};\n" for part in parts + state)
                + "    return fault;\n}\n"
            )
        image = f"static const struct {cls.__name__} image = {call_graph.layout.initializer(owner)};\n"
        text = '#include "python_arithmetic.h"\n' + call_graph.text() + image + "".join(calls)
        (folder / "frozen.c").write_text(text)
        header = Path(native.__file__).parent
        command = [compiler(), *warnings, *BIT_EXACT, "-shared", "-fPIC", f"-I{header}"]
        subprocess.run([*command, "frozen.c", "-o", "frozen.so", "-lm"], cwd=folder, check=True)
        self.library, self.size = ctypes.CDLL(str(folder / "frozen.so")), 16 + len(state)

    def call(self, name, x, y):
        """Return the fault flag, and the returned values followed by the state of the object."""
        out = (ctypes.c_double * self.size)()
        fault = getattr(self.library, name)(ctypes.c_double(x), ctypes.c_double(y), out)
        return bool(fault), list(out)


def assert_same_as_python(compiled_methods, owner, name, pairs):
    """Compare results, final object states and exceptions (faults in C) of a method in C and CPython."""
    for x, y in pairs:
        python_owner = copy.deepcopy(owner)
        try:
            result = getattr(python_owner, name)(x, y)
        except FAULT_EXCEPTIONS as error:
            result = error
        fault, out = compiled_methods.call(name, x, y)
        assert fault == isinstance(result, Exception), f"{name}({x!r}, {y!r}): {result!r}"
        members = list(flat_values(python_owner))
        values = [] if fault else [*result] if isinstance(result, tuple) else [result]
        if fault:  # a fault returns no value, but earlier side effects remain
            out = out[compiled_methods.widths[name] :]
        assert bits(out[: len(values) + len(members)]) == bits(values + members), f"{name}({x!r}, {y!r})"
