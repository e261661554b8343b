"""The C library functions of the page behave like those of C and Python."""

import json
import math
import random
import struct

import pytest

from fmus.compiler.c.c_expressions import ARGUMENT_COUNTS, MAY_RAISE, NEVER_RAISING
from fmus.packaging.native.binaries import INTRINSICS
from fmus.page.html_page import PAGE_FOLDER

FUNCTIONS = [function for function in (*NEVER_RAISING, *MAY_RAISE) if function not in INTRINSICS]
AT = (0.0, -0.0, 1e-300, 1e-9, 0.3, -0.7, 1.0, -1.0, 2.5, -20.0, 700.0, 1e22, math.inf, -math.inf, math.nan)
NUMBERS = [0.1, 5e-324, 1.7976931348623157e308, 9007199254740993.0, 1e16, 123456.0, 1e-4, 9.5e-5, 4.35, 2.0**-1074]


@pytest.fixture(scope="module")
def library(browser):
    """Return an evaluator of library functions, with a memory of their own and helpers to write and read strings."""
    text = (PAGE_FOLDER / "script" / "libc.js").read_text(encoding="utf-8").replace("export ", "")
    helpers = """
        const memory = new WebAssembly.Memory({ initial: 1 }), output = [];
        const c = libc(() => memory, (bytes) => output.push(...bytes));
        const view = () => new DataView(memory.buffer);
        const store = (text) => {
          const address = c.malloc(text.length + 1);
          [...text, "\\0"].forEach((character, i) => view().setUint8(address + i, character.charCodeAt(0)));
          return address;
        };
        const load = (address) => {
          let text = "";
          for (let i = address; view().getUint8(i); i++) text += String.fromCharCode(view().getUint8(i));
          return text;
        };
    """
    return lambda expression: browser.run(f"(() => {{ {text} {helpers} return {expression}; }})()")


def value(function, *arguments):
    """Return the result as in C, where Python raises for undefined or overflowing results."""
    try:
        return function(*arguments)
    except (ValueError, OverflowError):
        return None


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
def test_mathematical_functions_agree_with_python(library, function):
    points = [(a,) for a in AT] if ARGUMENT_COUNTS.get(function, 1) == 1 else [(a, b) for a in AT for b in AT]
    plain = "(a) => Number.isFinite(a) ? a : String(a)"  # JSON has no other numbers
    point_list = ", ".join("[" + ", ".join(map(js, point)) + "]" for point in points)
    results = library(f"[{point_list}].map((point) => ({plain})(c.{function.__name__}(...point)))")
    for point, actual in zip(points, results, strict=True):
        expected = value(function, *point)
        if expected is None:
            assert actual in ("NaN", "Infinity", "-Infinity"), point
        else:
            assert float(actual) == pytest.approx(expected, rel=1e-15, abs=0, nan_ok=True), point


def js(number):
    return {math.inf: "Infinity", -math.inf: "-Infinity"}.get(number, "NaN" if math.isnan(number) else repr(number))


@pytest.mark.parametrize(
    ("format", "types", "values"),
    [
        ("%s (%s): %s\n", "sss", ("sled", "", "no")),
        ("%lld", "l", (-(2**63),)),
        ("%se%d", "sd", ("12", -7)),
        ("%.*e", "de", (16, 5e-324)),
        ("%.*e", "de", (0, 9.5e22)),
        ("%c%s%se%c%02d", "csscd", (49, ".", "5", 45, 7)),
        ("0.%.*s%s", "dss", (2, "0000", "15")),
        ("\\x%02x", "x", (10,)),
        ("%d %s %lld %.*e %d", "dslded", (1, "two", 3, 1, 4.0, 5)),
    ],
)
def test_strings_and_numbers_are_formatted_as_in_c(library, format, types, values):
    size = {"l": 8, "e": 8}
    method = {"l": "setBigInt64", "e": "setFloat64"}
    offset, steps = 0, []
    for kind, item in zip(types, values, strict=True):
        offset = -(-offset // size.get(kind, 4)) * size.get(kind, 4)
        argument = f"store({json.dumps(item)})" if kind == "s" else f"{item!r}n" if kind == "l" else repr(item)
        steps.append(f"view().{method.get(kind, 'setInt32')}(values + {offset}, {argument}, true)")
        offset += size.get(kind, 4)
    write = f"c.snprintf(address, capacity, store({json.dumps(format)}), values)"
    memory = "address = c.malloc(100), values = c.malloc(64)"
    expected = format.replace("%lld", "%d") % values
    for capacity in (100, 3):
        result = library(
            f"(({memory}, capacity = {capacity}) => [{', '.join(steps)}, {write}, load(address)].slice(-2))()"
        )
        assert result == [len(expected), expected[: capacity - 1]]


def test_memory_is_allocated_once_and_grows_until_exhausted(library):
    sizes = (1, 100, 70_000, 2**32 - 1, 16)
    *addresses, failed_address, last_address = library(f"{list(sizes)}.map((size) => c.malloc(size))")
    assert failed_address == 0
    for address, size, next_address in zip(addresses, sizes, [*addresses[1:], last_address], strict=False):
        assert (bool(address), address % 16, address + size <= next_address) == (True, 0, True)
    assert library("(p => [...new Uint8Array(memory.buffer, p, 15)])(c.calloc(3, 5))") == [0] * 15


def test_string_functions_behave_as_in_c(library):
    assert library("[c.strlen(store('')), c.strlen(store('four'))]") == [0, 4]
    assert library("((a) => [c.strchr(a, 101) - a, c.strchr(a, 120)])(store('1e5e'))") == [1, 0]
    signs = library("['b', 'bb', 'a', 'c'].map((other) => Math.sign(c.strcmp(store('b'), store(other))))")
    assert signs == [0, -1, 1, -1]
    assert library("[c.strtod(store('15e-1')), c.atoi(store('-07')), c.atoi(store('+308'))]") == [1.5, -7, 308]
    assert bytes(library("(c.fwrite(store('tell'), 1, 4, 0), output)")) == b"tell"


def test_numbers_in_a_message_are_formatted_as_in_python(page):
    draw = random.Random(3)
    doubles = (struct.unpack("<d", draw.randbytes(8))[0] for _ in range(300))
    values = [-abs(item) for item in (*NUMBERS, *doubles) if math.isfinite(item)]
    page.open(".model=stickslip")
    result = "(m) => { try { app.runs.main.fmu.begin({ m }, 1) } catch (error) { return error.message } }"
    for item, sentence in zip(values, page.run(f"{json.dumps(values)}.map({result})"), strict=True):
        assert sentence.startswith(f"m = {item!r} kg is refused")
