"""Writes the documentation page of an FMU as self-contained HTML; colours of charts come from its style sheet."""

import re
from collections.abc import Sequence
from html import escape
from inspect import cleandoc
from itertools import pairwise
from math import ceil, floor, log10
from pathlib import Path

from ..compiler import __version__
from ..compiler.equations.tables import PCHIP, Table
from ..compiler.units import unit_of
from ..runtime.variable_access import SETTABLE_CAUSALITIES
from ..runtime.variable_declarations import VariableDeclaration, VariableOwner, exported_name
from .certified_result import RESULT_FOLDER, CertifiedResult
from .fmi_variables import Variables, fixed_choices, integrated_states

GREEK = {"theta": "theta", "omega": "omega", "alpha": "alpha", "mu": "mu", "eps": "epsilon", "phi": "phi", "pi": "pi"}
CURVE_POINTS = 200  # of a table that is not linear
WIDTH, HEIGHT = 640, 230  # of the view box of a chart
LEFT, RIGHT, TOP, BOTTOM = 70, 14, 10, 48  # its margins for the tick labels
TICKS = 5
STYLE = Path(__file__).with_name("documentation_page.css")
USAGE = """\
<p>Parameters can be changed at every communication point, those marked <i>fixed</i> only until initialization ends.
The internal steps of the solver do not depend on the communication steps. To see every internal step and every event,
step to <code>solver.t_next</code>.</p>
<p>A wrong call is refused, and a run that cannot continue fails; both are reported in one sentence in the log and on
standard error. A refused call changes nothing. After a failure all calculated Reals are NaN until reset.</p>
"""
CAPABILITIES = """\
| | in Python | native | native, FMI 3.0 |
| FMI | 2.0 | 2.0 | 3.0 |
| co-simulation; save, restore and serialize the state | yes | yes | yes |
| model exchange: event indicators, time events, nominal values | | yes | yes |
| partial derivatives, also with respect to start values and parameters | | yes | yes, also adjoint |
| derivatives of outputs (order 1) | | yes | yes |
| first derivatives of inputs | | yes | |
| event mode, early return at stick and slip | | | yes |
| intermediate update after each internal step, where inputs can be set | | | yes |
| terminal `flange`: position, speed, force | | | yes |
"""  # of each kind of FMU; docs/how-to/native.md has the same table
UNRESTRICTED_RANGE = VariableDeclaration("", "").allowed_range  # the range text of an unbounded variable


def documentation_page(
    model: type[VariableOwner],
    name: str,
    declarations: Variables,
    result: CertifiedResult | None,
    tables: Sequence[Table],
    icon: str,
    use: str,
) -> bytes:
    """Return the page of the FMU `name` as self-contained HTML.

    `icon` is the path of the icon in the FMU or "", `use` a paragraph on how to run the FMU.
    """
    first, *blocks = cleandoc(model.__doc__ or "").split("\n\n")
    title = f"<h1>{escape(name)}</h1><p>{escape(first)}</p>"
    picture = f"<img src='../{icon}' alt=''>" if icon else ""
    parts = [f"<header>{picture}<div>{title}</div></header>", "<h2>Equations</h2>"]
    parts += map(format_paragraph, blocks)
    if result is not None:
        parts += _result_figure(result, declarations)
    if tables:
        parts += ["<h2>Tables</h2>", *map(table_figure, tables)]
    choices = [(variable, meaning) for variable, meaning in declarations if meaning.items]
    for variable, meaning in (*fixed_choices(model), *choices):
        parts.append(_enumeration_table(variable, meaning))
    numbers = [(variable, meaning) for variable, meaning in declarations if not meaning.items]
    for title, rows in (
        ("Parameters", [pair for pair in numbers if pair[1].causality == "parameter" and "." not in pair[0]]),
        ("Input", [pair for pair in numbers if pair[1].causality == "input"]),
        ("Outputs", [pair for pair in numbers if pair[1].causality == "output"]),
        ("Solver and events", [pair for pair in numbers if "." in pair[0]]),
    ):
        if rows:
            parts += [f"<h2>{title}</h2>", _variable_table(rows)]
    parts += ["<h2>Use</h2>", USAGE + use, _capabilities_table(), _footer(model, result)]
    head = f"<meta charset='utf-8'><meta name='viewport' content='width=device-width'><title>{escape(name)}</title>"
    style = STYLE.read_text(encoding="utf-8")
    begin = f"<!doctype html>\n<html lang='en'><head>{head}<style>\n{style}</style></head><body>"
    return "\n".join((begin, *parts, "</body></html>\n")).encode()


def format_paragraph(paragraph: str) -> str:
    """Format a paragraph of the docstring; indented text, or text with " = " in every line, is shown as equations."""
    if paragraph.startswith("    ") or all(" = " in line for line in paragraph.splitlines()):
        return f"<pre>{typeset(cleandoc(paragraph))}</pre>"
    return f"<p>{typeset(paragraph)}</p>"


def typeset(text: str) -> str:
    """Typeset subscripts, powers and Greek letters as HTML.

    >>> typeset("m a^2 = F_ext - mu_s m g")
    'm a<sup>2</sup> = F<sub>ext</sub> &minus; &mu;<sub>s</sub> m g'
    """
    text = re.sub(rf"\b(\w|{'|'.join(GREEK)})_(\w+)", r"\1<sub>\2</sub>", escape(text, quote=False))
    text = re.sub(r"\^(\w+)", r"<sup>\1</sup>", text).replace(" - ", " &minus; ")
    return re.sub(rf"\b({'|'.join(GREEK)})\b", lambda word: f"&{GREEK[word[0]]};", text)


def readable_unit(unit: str) -> str:
    """Write units with multiplication dots and superscripts.

    >>> readable_unit("kg.m2")
    'kg·m²'
    """
    return re.sub(r"(?<=[a-z])2", "²", re.sub(r"(?<=[A-Za-z])\.", "·", unit)) if unit != "1" else ""


def _result_figure(result: CertifiedResult, declarations: Variables) -> list[str]:
    """Return a figure of the certified states over time."""
    times, *columns = ([float(word) for word in column] for column in zip(*result.rows, strict=True))
    parts = ["<h2>Default run</h2>", "<figure>"]
    for values, (variable, meaning) in zip(columns, integrated_states(declarations), strict=True):
        unit, factor = meaning.unit, 1.0
        if meaning.display:
            unit, factor = meaning.display, unit_of(variable, meaning.unit).factor
        parts.append(draw_chart(times, [factor * value for value in values], f"{variable} in {readable_unit(unit)}"))
    return [*parts, f"<figcaption>{escape(result.caption)}</figcaption></figure>"]


def table_figure(table: Table) -> str:
    """Return a chart of a table, with the start values of its parameters, and a caption."""
    x, y = list(table.x), table.as_json()["y"]
    if table.interpolation == PCHIP:
        x = [x[0] + i / CURVE_POINTS * (x[-1] - x[0]) for i in range(CURVE_POINTS)] + [x[-1]]
        y = [table.at(u) for u in x]
    label, axis = (
        f"{text}{f' in {readable_unit(unit)}' if readable_unit(unit) else ''}"
        for text, unit in ((table.name, table.unit_y), ("argument", table.unit_x))
    )
    values = ", with the start values of its parameters" if table.parameters else ""
    caption = f"{len(table.x)} points, {table.interpolation}, ends: {table.ends}{values}."
    chart = draw_chart(x, y, escape(label), escape(axis))
    return f"<div class='table'>{chart}</div><p>Table <code>{escape(table.name)}</code>: {caption}</p>"


def _enumeration_table(variable: str, meaning: VariableDeclaration) -> str:
    """Return a table of the items of an enumeration; that with one item is no variable and has no value to set."""
    title = meaning.text[0].upper() + meaning.text[1:]
    rows = "".join(
        f"<tr><td><code>{value}</code></td><td><b>{escape(label)}</b>{' (default)' if value == meaning.start else ''}"
        f"</td><td>{escape(sentence)}</td></tr>"
        for label, value, sentence in meaning.items
    )
    head = "<thead><tr><th>value</th><th>name</th><th>description</th></tr></thead>"
    return f"<h2>{escape(title)}: <code>{escape(variable)}</code></h2>\n<table>{head}{rows}</table>"


def _variable_table(variables: Variables) -> str:
    """Return a table of name, default, unit, description and range of each variable."""
    rows = []
    for variable, meaning in variables:
        unit = readable_unit(meaning.unit)
        settable = meaning.causality in SETTABLE_CAUSALITIES
        value = f"{meaning.start:.10g}" if settable else ""
        if settable and meaning.display:
            display_value = meaning.start * unit_of(variable, meaning.unit).factor
            value = f"{display_value:.10g} {readable_unit(meaning.display)} = {value}"
        notes = (
            [readable_unit(meaning.allowed_range)] if settable and meaning.allowed_range != UNRESTRICTED_RANGE else []
        )
        if meaning.variability == "fixed":
            notes.append("fixed")
        text = escape(meaning.text) + (f" <small>({escape('; '.join(notes))})</small>" if notes else "")
        cells = (f"<code>{escape(exported_name(variable, meaning))}</code>", f"{value} {escape(unit)}".strip(), text)
        rows.append("<tr><td>{}</td><td class='number'>{}</td><td>{}</td></tr>".format(*cells))
    is_settable = [meaning.causality in SETTABLE_CAUSALITIES for _, meaning in variables]
    value = "default" if all(is_settable) else "default, unit" if any(is_settable) else "unit"
    head = f"<thead><tr><th>name</th><th>{value}</th><th>description</th></tr></thead>"
    return f"<table>{head}{''.join(rows)}</table>"


def _capabilities_table() -> str:
    """Return the table of capabilities of each kind of FMU."""
    text = re.sub("`(.*?)`", r"<code>\1</code>", CAPABILITIES)
    head, *rows = ([cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines())
    titles = "".join(f"<th>{title}</th>" for title in head)
    lines = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table class='offered'><thead><tr>{titles}</tr></thead>{lines}</table>"


def _footer(model: type[VariableOwner], result: CertifiedResult | None) -> str:
    """Return the footer: default experiment, licences and version."""
    run = f"Default run: 0 to {model.stop_time:g} s, tolerance {model.tolerance:g}."  # type: ignore[attr-defined]
    link = f" Certified result: <a href='../{RESULT_FOLDER}/'>{RESULT_FOLDER}</a>." if result else ""
    licences = " Licences: <a href='licenses/'>licenses</a>."
    return f"<footer>{run}{link}{licences} friction-fmus {__version__}.</footer>"


def draw_chart(times: list[float], values: list[float], label: str, axis: str = "time in s") -> str:
    """Return the SVG of values over times, or over another quantity; `label` and `axis` name both with their units."""
    low, high = min(values), max(values)
    margin = 0.05 * (high - low) or 1.0
    low, high = low - margin, high + margin

    def to_view_box(t: float, value: float) -> tuple[float, float]:
        x = LEFT + (t - times[0]) / (times[-1] - times[0]) * (WIDTH - LEFT - RIGHT)
        return x, TOP + (high - value) / (high - low) * (HEIGHT - TOP - BOTTOM)

    parts = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{label} over {axis}">']
    for value in tick_values(low, high):
        _, y = to_view_box(times[0], value)
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    for t in tick_values(times[0], times[-1]):
        x, _ = to_view_box(t, low)
        parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 19}" text-anchor="middle">{t:g}</text>')
    points = [to_view_box(t, value) for t, value in zip(times, values, strict=True)]
    parts.append(f'<path class="curve" d="{relative_path(points)}"/>')
    parts.append(f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 6}" text-anchor="end">{axis}</text>')
    parts.append(f'<text x="{LEFT}" y="{HEIGHT - 6}">{label}</text></svg>')
    return "\n".join(parts)


def relative_path(points: list[tuple[float, float]]) -> str:
    """Return the path data of a polyline, with points relative to the one before, which compress to half the size.

    >>> relative_path([(0.0, 1.0), (0.26, 1.0), (0.5, 0.5)])
    'M0 1l0.3 0 0.2 -0.5'
    """
    rounded_points = [
        (round(10.0 * x), round(10.0 * y)) for x, y in points
    ]  # in tenths, so that roundings do not add up
    steps = [(x - x0, y - y0) for (x0, y0), (x, y) in pairwise(rounded_points)]
    start = "M{:g} {:g}l".format(*(coordinate / 10.0 for coordinate in rounded_points[0]))
    return start + " ".join(f"{dx / 10.0:g} {dy / 10.0:g}" for dx, dy in steps)


def tick_values(low: float, high: float) -> list[float]:
    """Return about TICKS round numbers from low to high.

    >>> tick_values(-0.11, 0.11)
    [-0.1, -0.05, 0.0, 0.05, 0.1]
    """
    rough = (high - low) / TICKS
    power = 10.0 ** floor(log10(rough))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough * (1.0 - 1e-9))
    return [round(i * step, 12) + 0.0 for i in range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)]
