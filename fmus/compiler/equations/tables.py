"""Lookup tables in model files: a function of one variable, given by points.

A table is a polynomial in its argument u whose coefficients are constant in each piece between two points:

    mu(u) = value[piece] + slope[piece] * (u - knot[piece])

The expression contains the piece as a term of u, and each coefficient as a term of the piece.  So derivatives and
rounding scales follow from the rules for sums and products.  In generated code, the coefficients are constant arrays.
The piece keeps its value during a step; its change is an event (model_conditions.py).
"""

import csv
import math
import re
from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

from .expressions import Expression, ModelError, Operand, Term, as_operand, author_location, describe, is_number
from .model_declaration import Fixed, Parameter, SettableVariable

LINEAR, PCHIP = "linear", "pchip"
HOLD, CONTINUE, REFUSE = "hold", "continue", "refuse"
INTERPOLATIONS, ENDS = (LINEAR, PCHIP), (HOLD, CONTINUE, REFUSE)
CONSTANT, VALUE_KINDS = "constant", {"fixed": Fixed, "tunable": Parameter}
# Where a piece has no end; states beyond this value are treated as divergence
UNBOUNDED_END = 1e100
LARGEST, SMALLEST_STEP = 1e60, 1e-60  # of the numbers of a table and of x, so that its coefficients are finite
OVERLAP, OVERLAP_OF_PIECE = 1e-9, 1e-4  # of pieces, as shares of the largest argument and of the shortest piece
VARIABLE_KINDS = ("value", "slope")  # columns that depend on the values at the points
UNIT_OF_HEADING = re.compile(r"\[([^][]+)\]\s*$|\(((?:[^()]|\([^()]*\))+)\)\s*$")  # x [m], or k (N/(m.s))
EDGE, KNOT, VALUE, SLOPE, QUADRATIC, CUBIC = "edge", "knot", "value", "slope", "quadratic", "cubic"


class Table(Expression):
    """A function of one variable, given by points: measured friction over slip, stiffness over position. ::

        mu = Table([0.0, 0.01, 0.1, 1.0], [0.8, 0.6, 0.5, 0.45], "m/s", "1")
        mu = Table("mu.csv")
        F_friction = Contact("N", "friction force", mode=mode, slip=v, slide=N * mu(fabs(v)))

    Parameters
    ----------
    x
        Values of the argument, which rise; or the name of a CSV file beside the model file, with two columns and their
        names and units in the first line, as in `slip [m/s],mu [1]` or `slip (m/s),mu (1)`.
    y
        Values of the function: numbers, or parameters of the model where users set them (linear tables only).
    unit_x, unit_y
        Their SI units.
    interpolation
        "linear", or "pchip": monotone cubic polynomials without overshoot.
    ends
        Beyond the first and the last point: "hold" their values, "continue" with the slope at the end, or "refuse",
        which ends the run with a message.
    values
        "constant"; or "fixed" or "tunable": each value of y becomes such a parameter, `mu.y[1]`, `mu.y[2]` and so on
        for a table `mu` (linear tables only).  In FMI 3.0 they are the array `mu.y`.
    low
        Smallest allowed value of these parameters, such as 0.0 for friction.
    """

    def __init__(
        self,
        x: Sequence[float] | str,
        y: Sequence[float | Expression] | None = None,
        unit_x: str = "",
        unit_y: str = "",
        *,
        interpolation: str = LINEAR,
        ends: str = HOLD,
        values: str = CONSTANT,
        low: float = -math.inf,
    ) -> None:
        self.location = author_location()
        self.file: Path | None = None
        self.headings: tuple[str, ...] = ()  # of x and y in the file
        source = ""  # begin of messages about points
        if isinstance(x, str):
            if y is not None or unit_x or unit_y:
                raise ModelError(f"a table of the file {x} has its points and units from there: write Table({x!r})")
            self.file = Path(self.location[0]).parent / x
            self.file_content = read_content(self.file)
            x, y, unit_x, unit_y, self.headings = read_points(self.file.name, self.file_content)
            source = f"{self.file.name}: "
        choices = (
            ("interpolation", interpolation, INTERPOLATIONS),
            ("ends", ends, ENDS),
            ("values", values, (CONSTANT, *VALUE_KINDS)),
        )
        for word, value, allowed_values in choices:
            if value not in allowed_values:
                raise ModelError(
                    f"{word} of a table must be {' or '.join(map(repr, allowed_values))}, got {describe(value)}"
                )
        for word, unit in ("unit_x", unit_x), ("unit_y", unit_y):
            if not isinstance(unit, str) or not unit:
                raise ModelError(f'a table needs its units: {word} is {describe(unit)}; a pure number has the unit "1"')
        self.x, self.y = checked_points(x, y, source)
        if values != CONSTANT and interpolation != LINEAR:
            raise ModelError(
                f'the values of a table with interpolation="{interpolation}" are constant: leave out `values`, or '
                f'write interpolation="{LINEAR}"'
            )
        if values != CONSTANT:
            self.declare_values(VALUE_KINDS[values], unit_x, unit_y, low)
        elif low != -math.inf:
            remedy = 'add values="tunable", or leave it out' if interpolation == LINEAR else "leave it out"
            raise ModelError(f"low = {describe(low)} has no effect on constant values: {remedy}")
        self.unit_x, self.unit_y = unit_x, unit_y
        self.interpolation, self.ends = interpolation, ends
        self.parameters = tuple(value for value in self.y if isinstance(value, SettableVariable))
        if self.parameters and interpolation != LINEAR:
            raise ModelError(
                f"the table has the parameter {self.parameters[0]}, but tables with parameters are linear: write "
                f'numbers instead, or interpolation="{LINEAR}"'
            )
        self.is_called = False

    def declare_values(self, kind: type[SettableVariable], unit_x: str, unit_y: str, low: float) -> None:
        """Replace each value of y by a parameter."""
        if parameters := [value for value in self.y if isinstance(value, Expression)]:
            raise ModelError(
                f"{parameters[0]} in the table is a parameter already: leave out `values`, or write numbers in the "
                "table"
            )
        suffix = "" if unit_x == "1" else f" {unit_x}"
        self.y = tuple(kind(y, unit_y, f"value at {x:g}{suffix}", low=low) for x, y in zip(self.x, self.y, strict=True))
        self.own_variables = [(f"_y{n}", f".y[{n}]", value) for n, value in enumerate(self.y, 1)]

    def __call__(self, u: Operand) -> Operand:
        """Return the value of the table at u: an expression, or a number for a number."""
        u = as_operand(u)
        if not self.name:
            raise ModelError("a table without a name is called: assign it to a name in the class first")
        self.is_called = True
        if not isinstance(u, Expression) and not self.parameters:
            return self.at(u)
        is_straight = len(self.edges) == 2 and self.ends == CONTINUE
        is_number = not isinstance(u, Expression)
        piece = 0.0 if is_straight else float(self.piece_at(u)) if is_number else Term(Piece(self), u)
        knot = Term(Coefficient(self, KNOT), piece)
        coefficients = [Term(Coefficient(self, kind), piece, *self.parameters) for kind in self.kinds[1:]]
        w = Term("-", u, knot)
        *others, result = coefficients
        for coefficient in reversed(others):
            result = coefficient + w * result
        return result

    def at(self, u: float) -> float:
        """Return the value at a number."""
        if self.ends == REFUSE and not self.x[0] <= u <= self.x[-1]:
            raise ModelError(
                f'{self}({u!r}) is beyond the ends of the table: extend it, or declare ends="hold" or ends="continue"'
            )
        piece = self.piece_at(u)
        knot, *coefficients = (self.columns[kind][piece] for kind in self.kinds)
        *others, result = coefficients
        for coefficient in reversed(others):
            result = coefficient + (u - knot) * result
        return result

    def piece_at(self, u: float) -> int:
        """Return the number of the piece that contains u; a point belongs to the piece above it."""
        return bisect_right(self.edges, u, 1, len(self.edges) - 1) - 1

    def has_changed(self) -> bool:
        """Return whether the file of the table has other content than when it was read."""
        return self.file is not None and read_content(self.file) != self.file_content

    def as_json(self) -> dict[str, Any]:
        """Return the points as data; values of y that are parameters have their start values and names."""
        start = [value.start if isinstance(value, SettableVariable) else value for value in self.y]
        names = [value.label if isinstance(value, SettableVariable) else "" for value in self.y]
        return {
            "name": self.name,
            "unit_x": self.unit_x,
            "unit_y": self.unit_y,
            "x": list(self.x),
            "y": start,
            "parameters": names,
            "interpolation": self.interpolation,
            "ends": self.ends,
        }

    @property
    def kinds(self) -> tuple[str, ...]:
        """The columns of a piece: its knot, and the coefficients of the polynomial, lowest first."""
        return (KNOT, VALUE, SLOPE) if self.interpolation == LINEAR else (KNOT, VALUE, SLOPE, QUADRATIC, CUBIC)

    @property
    def has_end_pieces(self) -> bool:
        """Whether there are other polynomials before the first and after the last point."""
        return self.ends == HOLD or self.interpolation == PCHIP

    @property
    def scale(self) -> float:
        """Magnitude of the argument, to which rounding errors of its distance to an edge are relative."""
        return max(abs(self.x[0]), abs(self.x[-1]))

    @property
    def overlap(self) -> float:
        """Distance by which a piece that is in use reaches beyond its edges.

        A motion may settle at a point of the table.  Without the overlap, the errors of a method would change the piece
        in every step.  A motion that passes the point is off by the square of the overlap.
        """
        return min(OVERLAP * self.scale, OVERLAP_OF_PIECE * min(b - a for a, b in pairwise(self.x)))

    @cached_property
    def edges(self) -> tuple[float, ...]:
        """Lower ends of all pieces, then the upper end of the last one."""
        return (-UNBOUNDED_END, *(self.x if self.has_end_pieces else self.x[1:-1]), UNBOUNDED_END)

    @cached_property
    def columns(self) -> dict[str, tuple[float, ...]]:
        """The knot and the coefficients of all pieces, by kind, with the start values of parameters."""
        return self.columns_with([value.start for value in self.parameters])

    def columns_with(self, values: Sequence[float]) -> dict[str, tuple[float, ...]]:
        """Return the knot and the coefficients of all pieces, by kind, with values of the parameters."""
        parameter_values = dict(zip(self.parameters, values, strict=True))
        points = [parameter_values[value] if isinstance(value, SettableVariable) else value for value in self.y]
        steps = [b - a for a, b in pairwise(self.x)]
        secants = [(b - a) / h for (a, b), h in zip(pairwise(points), steps, strict=True)]
        rows: list[tuple[float, ...]] = []  # of each piece
        if self.interpolation == LINEAR:
            rows = list(zip(self.x, points, secants, strict=False))
            first = last = 0.0
        else:
            slopes = pchip_slopes(steps, secants)
            for x, y, h, secant, (c, d) in zip(self.x, points, steps, secants, pairwise(slopes), strict=False):
                rows.append((x, y, c, (3.0 * secant - 2.0 * c - d) / h, (c + d - 2.0 * secant) / (h * h)))
            first, last = (0.0, 0.0) if self.ends == HOLD else (slopes[0], slopes[-1])
        if self.has_end_pieces:
            zeros = (0.0,) * (len(self.kinds) - 3)
            rows = [(self.x[0], points[0], first, *zeros), *rows, (self.x[-1], points[-1], last, *zeros)]
        return dict(zip(self.kinds, zip(*rows, strict=True), strict=True))

    @property
    def variable_columns(self) -> dict[str, list[tuple[int, Operand]]]:
        """The numbers in the columns that depend on parameters, as expressions of these, each with its piece."""
        first = int(self.has_end_pieces)  # piece that begins at the first point
        values: list[tuple[int, Operand]] = [(n + first, y) for n, y in enumerate(self.y[: len(self.x) - 1])]
        if self.has_end_pieces:
            values = [(0, self.y[0]), *values, (len(self.x), self.y[-1])]
        slopes: list[tuple[int, Operand]] = []
        for n, ((a, b), (u, w)) in enumerate(zip(pairwise(self.y), pairwise(self.x), strict=True)):
            if isinstance(a, Expression) or isinstance(b, Expression):
                slopes.append((n + first, Term("/", Term("-", b, a), w - u)))
        return {VALUE: [item for item in values if isinstance(item[1], Expression)], SLOPE: slopes}

    def is_nonnegative(self, nonnegative_argument: bool) -> bool:
        """Return whether no value is negative, for arguments of any sign or for those that are not negative."""
        least = [y if not isinstance(y, SettableVariable) else max(y.low, y.above) for y in self.y]
        if self.ends == HOLD or self.parameters or min(least) < 0.0:
            return self.ends == HOLD and min(least) >= 0.0
        slopes, is_reached = self.columns[SLOPE], not (nonnegative_argument and self.x[0] <= 0.0)
        rises_backward, rises_forward = slopes[0] <= 0.0 or not is_reached, self.last_slope >= 0.0
        return rises_backward and rises_forward

    @property
    def last_slope(self) -> float:
        """Slope beyond the last point."""
        return self.columns[SLOPE][-1]


class Piece(str):
    """The operation that finds the piece of a table that contains its operand; equal for the same table."""

    table: Table

    def __new__(cls, table: Table) -> "Piece":
        """Create the operation of a table."""
        piece = super().__new__(cls, f"{table.name}_piece")
        piece.table = table
        return piece

    def evaluate(self, u: float) -> float:
        """Return the number of the piece."""
        return float(self.table.piece_at(u))

    @property
    def method(self) -> str:
        """Name of the method in generated code."""
        return array_name(self.table, "piece")


class Coefficient(str):
    """The operation that returns a column of a table for its operand, a piece; equal for the same table and column."""

    table: Table
    kind: str
    offset: int  # of the edge above a piece: 1

    def __new__(cls, table: Table, kind: str, offset: int = 0) -> "Coefficient":
        """Create the operation of a column."""
        coefficient = super().__new__(cls, f"{table.name}_{kind}" + ("_above" if offset else ""))
        coefficient.table, coefficient.kind, coefficient.offset = table, kind, offset
        return coefficient

    def evaluate(self, piece: float, *values: float) -> float:
        """Return the number in the column, with values of the parameters of the table."""
        table = self.table
        if self.kind == EDGE:
            return table.edges[int(piece) + self.offset]
        return (table.columns_with(values) if values else table.columns)[self.kind][int(piece)]

    @property
    def array(self) -> str:
        """The array in generated code: a constant of the module, or an attribute where parameters set it."""
        name = array_name(self.table, self.kind)
        return f"self.{name}" if self.table.parameters and self.kind in VARIABLE_KINDS else name


def array_name(table: Table, kind: str) -> str:
    """Return the name of a column, or of the search, in generated code; no variable of a model starts with _."""
    return f"_{table.name}_{kind}"


def is_piece(e: Operand) -> bool:
    """Return whether an expression is the piece of a table."""
    return isinstance(e, Term) and isinstance(e.op, Piece)


def table_of(piece: Term) -> Table:
    """Return the table of a piece."""
    assert isinstance(piece.op, Piece)
    return piece.op.table


def find_table_call(e: Operand) -> tuple[Table, Operand] | None:
    """Return the table and the argument of an expression that is the value of a table, else None."""
    first = e.args[0] if isinstance(e, Term) and e.op == "+" else None
    if not (isinstance(first, Term) and isinstance(first.op, Coefficient) and is_piece(first.args[0])):
        return None
    return (first.op.table, first.args[0].args[0]) if first.op.kind == VALUE else None


def pchip_slopes(steps: Sequence[float], secants: Sequence[float]) -> list[float]:
    """Return the slopes at the points, with which cubic polynomials are monotone where the points are.

    References
    ----------
    F. N. Fritsch, J. Butland, A method for constructing local monotone piecewise cubic interpolants, SIAM J. Sci. Stat.
    Comput. 5 (1984) 300-304; the ends: C. Moler, Numerical Computing with MATLAB, 3.6.
    """
    if len(steps) == 1:
        return [secants[0], secants[0]]
    inner = []
    for (h, k), (a, b) in zip(pairwise(steps), pairwise(secants), strict=True):
        w, q = 2.0 * k + h, k + 2.0 * h
        inner.append((w + q) / (w / a + q / b) if a * b > 0.0 else 0.0)
    first = end_slope(steps[0], steps[1], secants[0], secants[1])
    last = end_slope(steps[-1], steps[-2], secants[-1], secants[-2])
    return [first, *inner, last]


def end_slope(h: float, k: float, a: float, b: float) -> float:
    """Return the slope at the end of the first of two steps h and k, with secants a and b."""
    slope = ((2.0 * h + k) * a - h * b) / (h + k)
    if slope * a <= 0.0:
        return 0.0
    return 3.0 * a if a * b <= 0.0 and abs(slope) > 3.0 * abs(a) else slope


def checked_points(x: object, y: object, source: str) -> tuple[tuple[float, ...], tuple[Any, ...]]:
    """Return the points as floats, or as parameters of y; raise ModelError for points that are no table.

    The message begins with `source`.
    """
    columns: list[tuple[Any, ...]] = []
    for word, values in ("x", x), ("y", y):
        try:
            numbers = [*values]  # type: ignore[misc]
        except (TypeError, ModelError):
            raise ModelError(f"{word} of a table must be a list of numbers, got {describe(values)}") from None
        for n, number in enumerate(numbers, 1):
            if word == "y" and isinstance(number, (Parameter, Fixed)):
                continue
            if not is_number(number) or not math.isfinite(number):
                description = f"got {describe(number)} as point {n}"
                raise ModelError(f"{source}{word} of a table must be finite numbers, {description}")
            if abs(number) > LARGEST:
                limits = f"between {-LARGEST:g} and {LARGEST:g}"
                raise ModelError(f"{source}{word} of a table must be {limits}, got {describe(number)} as point {n}")
        columns.append(tuple(value if isinstance(value, Expression) else float(value) for value in numbers))
    first, second = columns
    if len(first) != len(second):
        raise ModelError(f"a table needs as many values of y as of x, got {len(second)} and {len(first)}")
    if len(first) < 2:
        raise ModelError(f"{source}a table needs at least two points, got {len(first)}")
    for n, (a, b) in enumerate(pairwise(first), 2):
        if not a < b:
            raise ModelError(f"{source}x of a table must rise, but point {n} has {b!r} after {a!r}")
        if b - a < SMALLEST_STEP:
            rise = f"rise by {SMALLEST_STEP} or more"
            raise ModelError(f"{source}x of a table must {rise}, but point {n} has {b!r} after {a!r}")
    return first, second


def read_content(file: Path) -> str:
    """Return the text of a file; raise ModelError if it cannot be read."""
    try:
        return file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ModelError(f"the table {file.name} beside the model file cannot be read: {reason}") from error


def read_points(name: str, content: str) -> tuple[list[float], list[float], str, str, tuple[str, ...]]:
    """Return both columns of a CSV file, their units and their headings."""
    rows = [row for row in csv.reader(content.splitlines()) if any(cell.strip() for cell in row)]
    titles = rows[0] if rows else []
    units = [match[1] or match[2] for match in map(UNIT_OF_HEADING.search, titles) if match]
    if len(titles) != 2 or len(units) != 2:
        raise ModelError(
            f"{name} must begin with the names and units of two columns, as in 'slip [m/s],mu [1]', got "
            f"{describe(','.join(titles))}"
        )
    columns: tuple[list[float], list[float]] = [], []
    for n, row in enumerate(rows[1:], 2):
        try:
            x, y = map(float, row)
        except ValueError:
            raise ModelError(f"{name}, row {n}: {','.join(row)!r} is not two numbers") from None
        columns[0].append(x)
        columns[1].append(y)
    return *columns, *units, tuple(title.strip() for title in titles)  # type: ignore[return-value]
