"""Variables of any FMU as data: units, start values, ranges, friction laws, methods and defaults."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import CO_SIMULATION, MODEL_EXCHANGE
from ..errors import check_names, import_optional
from ..results.summary import ResultColumn, ResultTable, format_blocks, format_html
from .fmu_archive import read_description
from .model_data import LookupTable, read_model_data
from .variable_values import ExclusiveBound, effective_value, enumeration_labels, find_bound, variable_unit

if TYPE_CHECKING:
    import pandas

LAW, METHOD = "friction", "solver.method"  # of FMUs of this project
GROUPS = {  # causality and heading; other variables are internal
    "parameter": "Parameters",
    "structuralParameter": "Structural parameters",
    "calculatedParameter": "Calculated parameters",
    "input": "Inputs",
    "output": "Outputs",
}


@dataclass(frozen=True)
class VariableInfo:
    """Variable of an FMU.

    Attributes
    ----------
    name, type, causality, variability, unit, description : str
        As in the model description; the unit is empty for ratios, counts and modes.
    start : object
        Start value: a number, a label or a text; None without one.
    low, high : float or None
        Range of a number; None without a bound.
    choices : tuple of str
        Labels of an enumeration.
    excludes_low, excludes_high : bool
        Whether the bound itself is excluded.
    """

    name: str
    type: str
    causality: str
    variability: str
    unit: str
    description: str
    start: Any
    low: float | None
    high: float | None
    choices: tuple[str, ...]
    excludes_low: bool = False
    excludes_high: bool = False

    @property
    def range(self) -> str:
        """Return the range or the choices as text; empty without any."""
        if self.choices:
            return ", ".join(self.choices)
        low = "" if self.low is None else f"{'above' if self.excludes_low else 'from'} {self.low:g}"
        high = "" if self.high is None else f"{'to below' if self.excludes_high else 'to'} {self.high:g}"
        return f"{low} {high}".strip()


def format_start(variable: VariableInfo) -> str:
    """Return the start value of a variable; empty without one."""
    if isinstance(variable.start, float):
        return f"{variable.start:.7g}"
    return "" if variable.start is None else str(variable.start)


INTERNAL = "Internal variables"
TEXT_WIDTH = 140  # characters of a line of `str`
COLUMNS = (
    ResultColumn("name", "{0.name}", is_text=True),
    ResultColumn("start", format_start),
    ResultColumn("range", "{0.range}", is_text=True),
    ResultColumn("unit", "{0.unit}", is_text=True),
    ResultColumn("description", "{0.description}", is_text=True),
)


@dataclass(frozen=True)
class FmuDescription:
    """Description of an FMU; `harness.describe` returns it.

    Attributes
    ----------
    name, description, fmi_version : str
        Name and description of the model, and version of the standard.
    interfaces : tuple of str
        "CoSimulation" and "ModelExchange", as far as the FMU has them.
    start, stop, tolerance : float or None
        Start and stop in s and relative tolerance of a default run.
    variables : tuple of VariableInfo
        All variables, in the order of the model description.
    fixed : dict
        Labels of the method and the law that the build fixed, by the name of the absent variable.
    tables : tuple of LookupTable
        Lookup tables of an FMU of this project.
    """

    name: str
    description: str
    fmi_version: str
    interfaces: tuple[str, ...]
    start: float | None
    stop: float | None
    tolerance: float | None
    variables: tuple[VariableInfo, ...]
    fixed: dict[str, str] = field(default_factory=dict)
    tables: tuple[LookupTable, ...] = ()

    @property
    def laws(self) -> tuple[str, ...]:
        """Return the friction laws of an FMU of this project; empty for any other."""
        return self._choices(LAW)

    @property
    def methods(self) -> tuple[str, ...]:
        """Return the integration methods of an FMU of this project; empty for any other."""
        return self._choices(METHOD)

    def __getitem__(self, name: str) -> VariableInfo:
        by_name = {variable.name: variable for variable in self.variables}
        check_names("variable", [name], by_name)
        return by_name[name]

    def tabulate(self) -> tuple[ResultTable, ...]:
        """Return a table of the variables of each group that is not empty, and of the points of each lookup table."""
        groups: dict[str, list[VariableInfo]] = {title: [] for title in (*GROUPS.values(), INTERNAL)}
        for variable in self.variables:
            groups[GROUPS.get(variable.causality, INTERNAL)].append(variable)
        tables = [ResultTable(variables, COLUMNS, title) for title, variables in groups.items() if variables]
        for table in self.tables:
            points = [
                (f"{x:.7g}", f"{y:.7g}" + (f" ({parameter})" if parameter else ""))
                for x, y, parameter in zip(table.x, table.y, table.parameters, strict=True)
            ]
            columns = (
                ResultColumn(f"x [{table.unit_x}]", "{0[0]}"),
                ResultColumn(f"{table.name} [{table.unit_y}]", "{0[1]}"),
            )
            tables.append(ResultTable(points, columns, f"Table {table.name}"))
        return tuple(tables)

    def blocks(self) -> list[ResultTable | str]:
        """Return the sentences and the tables that the command `info` prints."""
        return [*self.sentences(), *(block for table in self.tabulate() for block in ("", table))]

    def sentences(self) -> Iterator[str]:
        """Yield the sentences above the tables."""
        yield f"{self.name}: {self.description}" if self.description else self.name
        yield f"FMI {self.fmi_version}, {' and '.join(self.interfaces)}"
        if self.stop is not None:
            accuracy = "" if self.tolerance is None else f", relative tolerance {self.tolerance:g}"
            yield f"Default run: {self.start or 0.0:g} to {self.stop:g} s{accuracy}"
        for word, name, choices in (("Friction laws", LAW, self.laws), ("Methods", METHOD, self.methods)):
            if choices:
                default = "fixed by the build" if name in self.fixed else f"default {self[name].start}"
                yield f"{word} ({name}): {', '.join(choices)}; {default}"
        for table in self.tables:
            yield f"Table {table.name}: {len(table.x)} points, {table.interpolation}, ends: {table.ends}"

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a table with a row for each variable, indexed by name.

        Raises
        ------
        HarnessError
            If pandas is not installed.
        """
        library = import_optional("pandas", "to_pandas()", "sweep")
        frame: pandas.DataFrame = library.DataFrame([vars(variable) for variable in self.variables]).set_index("name")
        return frame

    def as_json(self) -> dict[str, Any]:
        """Return the description for JSON output."""
        variables, tables = ([vars(item) for item in items] for items in (self.variables, self.tables))
        return vars(self) | {"laws": self.laws, "methods": self.methods, "variables": variables, "tables": tables}

    def __str__(self) -> str:
        return format_blocks(self.blocks(), TEXT_WIDTH)

    def __repr__(self) -> str:
        counts = ", ".join(f"{table.title.lower()}: {len(table.items)}" for table in self.tabulate())
        return f"<FmuDescription {self.name}: FMI {self.fmi_version}, {counts}>"

    def _repr_html_(self) -> str:
        return format_html(self.blocks())

    def _choices(self, name: str) -> tuple[str, ...]:
        fixed_choices = (self.fixed[name],) if name in self.fixed else ()
        return next((variable.choices for variable in self.variables if variable.name == name), fixed_choices)


def describe_fmu(path: Path) -> FmuDescription:
    """Return the description of an FMU, even if it violates the standard.

    Raises
    ------
    HarnessError
        If the file does not exist or cannot be read.
    """
    content, data = read_description(path, lenient=True), read_model_data(path)
    experiment = content.defaultExperiment
    interfaces = ((CO_SIMULATION, content.coSimulation), (MODEL_EXCHANGE, content.modelExchange))
    return FmuDescription(
        name=content.modelName,
        description=(content.description or "").rstrip("."),
        fmi_version=content.fmiVersion,
        interfaces=tuple(name for name, interface in interfaces if interface is not None),
        start=read_number(experiment, "startTime"),
        stop=read_number(experiment, "stopTime"),
        tolerance=read_number(experiment, "tolerance"),
        variables=tuple(map(describe_variable, content.modelVariables)),
        fixed={name: label for name, (label, _) in data.fixed_choices.items()},
        tables=data.tables,
    )


def read_number(experiment: Any, name: str) -> float | None:
    """Return a number of the default experiment, None without it."""
    text = getattr(experiment, name, None)
    return None if text is None else float(text)


def describe_variable(variable: Any) -> VariableInfo:
    """Return a variable of a model description."""
    is_number = variable.type not in ("Boolean", "String", "Binary", "Clock", "Enumeration")
    low, high = (find_bound(variable, name) if is_number else None for name in ("min", "max"))
    return VariableInfo(
        variable.name,
        variable.type,
        variable.causality or "local",
        variable.variability or "",
        variable_unit(variable),
        variable.description or "",
        effective_value(variable, variable.start),
        low,
        high,
        tuple(enumeration_labels(variable).values()),
        *(isinstance(bound, ExclusiveBound) for bound in (variable.min, variable.max)),
    )
