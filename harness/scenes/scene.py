"""Scenes: specifications of what to run, record, analyse and plot. Format of the TOML file:

    title = "..."             one line
    about = "..."             description of the model, for the report
    remark = "..."            remark on the comparison with known values, for the report
    model = "smd"             fmus/smd.fmu in the working directory or the project; or fmu = "path/from/here.fmu"
    start, stop               s; default: those of the FMU
    method, law               solver.method and friction by name; default: those of the FMU
    rtol, atol, h_max         solver.rtol, solver.atol (m), solver.h_max (s); default: those of the FMU
    outputs = ["x", "v"]      columns to record
    grid                      communication step in s
    times = [0.0, 0.1, 0.3]   times in s; only these are recorded, and the last one is the default stop
    follow = true             step to the ends of internal steps as well; without a grid: to these only
                              default without follow and grid: 4096 equal steps and the internal steps
    repeat = 3                run several times and report the shortest run time
    tolerance = 1e-6          tolerance of the step refinement for FMUs that do not expose their solver's steps, which
                              the run must meet; without it, the run states the error that it achieves;
                              for such FMUs also:
    exchange, lenient = true  use model exchange; run an FMU that violates the standard
    timeout = 60              time limit of one FMI call in s
    analyses = ["decay"]      decay, slip, steps
    plots = ["phase"]         position, velocity, acceleration, phase, steps, or any output; [] for none;
                              an output that has one of these names takes precedence;
                              default: the first six outputs and the phase plane
    [values]                  parameters and inputs by name, SI units; enumerations by label
    [inputs]                  input signals: time = [...] in s, and a list of values for each input
    [decay]                   gives = "zeta", "f" or "T_f"; first = peaks to skip; cycles = cycles to use (all)
    [published]               published quantities: a number, [number, "unit"] or a text; source = "...", the program or
                              method of the publication; these values need the table [citation]
    [citation]                author, title, year, location (table, figure or page) of the publication
    [reference]               the same for a closed form or a certified result; source = "...", its method
    [parameter]               the same for parameters that the run sets; only one of these three tables is allowed

Required are title, outputs, and either model or fmu.
"""

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from ..arguments import NAMES, POSITIVE, TEXT, Rule, above_zero, choice, real, text, whole_number
from ..errors import SceneError, check_names, unknown_name_message, unknown_source_message
from .fmu_files import find_fmu
from .roles import ROLES, find_roles
from .run_spec import DEFAULT_EQUAL_STEPS, SCENE_KEYS, RunSpec
from .schema import TITLE, field_names, parse_table, read_toml

SCENE_FOLDER = Path(__file__).parent
MAX_DEFAULT_PLOTS = 6  # time plots by default
SHORT_KEYS = {  # keys that set a variable of the FMU
    "method": "solver.method",
    "law": "friction",
    "rtol": "solver.rtol",
    "atol": "solver.atol",
    "h_max": "solver.h_max",
}

# Available analyses and plots, and the roles that they need among the outputs.
ANALYSES: dict[str, tuple[str, ...]] = {"decay": ("position", "velocity"), "slip": ("velocity",), "steps": ()}
PLOTS: dict[str, tuple[str, ...]] = {
    "position": ("position",),
    "velocity": ("velocity",),
    "acceleration": ("acceleration",),
    "phase": ("position", "velocity"),
    "steps": (),
}


def known_value(value: Any) -> float | tuple[float, str] | str:
    """Return a number, a pair of a number and a unit, or a text; integers are shown as they are written."""
    if isinstance(value, list):
        number, unit = value
        real(number)
        return number, text(unit)
    if isinstance(value, str):
        return text(value)
    real(value)
    return value


def cycle_count(value: Any) -> float:
    """Return a number above 0 that is whole or half."""
    number = above_zero(value)
    if (2.0 * number) % 1:
        raise ValueError
    return number


KINDS = ("published", "reference", "parameter")  # of known values, by the name of their table
LAST_YEAR = 9999  # of a publication
DECAY_QUANTITIES = ("zeta", "f", "T_f")
CYCLE_COUNT = Rule("a whole or half number above 0", cycle_count)
KNOWN_VALUE = Rule("a number, [number, 'unit'] or a text", known_value)


@dataclass(frozen=True)
class DecayOptions:
    """Table [decay]: the quantity to compute, the number of peaks to skip, and the cycles to use (None for all)."""

    gives: Annotated[str | None, choice("value of decay.gives", DECAY_QUANTITIES)] = None
    first: int = 0
    cycles: Annotated[float | None, CYCLE_COUNT] = None


@dataclass(frozen=True)
class Citation:
    """Table [citation]: the publication of the published values; `location` is a table, a figure or a page of it."""

    author: Annotated[str, TITLE]
    title: Annotated[str, TITLE]
    year: Annotated[int, whole_number(1, LAST_YEAR)]
    location: Annotated[str, TITLE]

    def __str__(self) -> str:
        return f"{self.author}, {self.title}, {self.year}, {self.location}"


@dataclass(frozen=True)
class KnownValues:
    """Values that are known before a run, which the measured quantities are compared with.

    Attributes
    ----------
    kind : {"published", "reference", "parameter"}
        Published with a citation, reference for a closed form or a certified result, or parameter for a parameter that
        the run sets; the name of the table of the scene file.
    source : str
        Program or method that gave the values; empty for parameters.
    values : dict
        A number, a pair (number, unit) or a text for each quantity.
    citation : Citation or None
        The publication of published values.
    """

    kind: str
    source: str
    values: dict[str, Any]
    citation: Citation | None = None

    @property
    def label(self) -> str:
        """Return the kind, and the source in parentheses."""
        return f"{self.kind} ({self.source})" if self.source else self.kind

    @property
    def tables(self) -> dict[str, Any]:
        """Return the tables of a scene file from which these values are read."""
        source = {"source": self.source} if self.source else {}
        return {self.kind: source | self.values, "citation": self.citation}


@dataclass(frozen=True, kw_only=True)
class SceneKeys:
    """Keys of a scene file other than those of its run (`run_spec.SCENE_KEYS`)."""

    title: Annotated[str, TITLE]
    about: Annotated[str, TITLE] = ""
    model: Annotated[str | None, TEXT] = None
    fmu: Annotated[str | None, TEXT] = None
    method: Annotated[str | None, TEXT] = None
    law: Annotated[str | None, TEXT] = None
    rtol: Annotated[float | None, POSITIVE] = None
    atol: Annotated[float | None, POSITIVE] = None
    h_max: Annotated[float | None, POSITIVE] = None
    analyses: Annotated[tuple[str, ...], NAMES] = ()
    plots: Annotated[tuple[str, ...] | None, NAMES] = None
    decay: DecayOptions = field(default_factory=DecayOptions)
    remark: Annotated[str, TITLE] = ""
    published: dict[str, Annotated[Any, KNOWN_VALUE]] = field(default_factory=dict)
    reference: dict[str, Annotated[Any, KNOWN_VALUE]] = field(default_factory=dict)
    parameter: dict[str, Annotated[Any, KNOWN_VALUE]] = field(default_factory=dict)
    citation: Citation | None = None


@dataclass(frozen=True)
class Scene:
    """A scene: its run, its analyses and plots, and known values to compare with.

    Attributes
    ----------
    name : str
        Name of the result folder.
    source : str
        Path of the scene file, or the name of a scene that is built in.
    run : RunSpec
        Run of the scene.
    title, about, remark : str
        Title of one line, description of the model, and remark on the comparison with the known values.
    analyses, plots : tuple of str
        Names of the analyses and plots.
    decay : DecayOptions
        Options of the analysis decay.
    known : KnownValues or None
        Published, reference or parameter values.
    """

    name: str
    source: str
    run: RunSpec
    title: str
    about: str
    remark: str
    analyses: tuple[str, ...]
    plots: tuple[str, ...]
    decay: DecayOptions
    known: KnownValues | None

    @property
    def presentation(self) -> dict[str, Any]:
        """Return all of the scene except its run, by the keys of a scene file, for the provenance."""
        content = {name: value for name, value in vars(self).items() if name not in ("run", "known")}
        return content | (self.known.tables if self.known else {})


def shipped_scenes() -> list[Path]:
    """Return the files of the built-in scenes, sorted by name."""
    return sorted(SCENE_FOLDER.glob("*.toml"), key=lambda file: file.stem)


def load_scene(scene: str | Path) -> Scene:
    """Load a scene by built-in name or by file.

    Raises
    ------
    SceneError
        If the scene is invalid.
    """
    path = Path(scene)
    if path.suffix != ".toml":
        path = SCENE_FOLDER / f"{scene}.toml"
        if path not in shipped_scenes():
            names = [file.stem for file in shipped_scenes()]
            raise SceneError(unknown_source_message("scene", str(scene), names, ", or the path of a .toml file"))
    source = path.stem if path.parent.resolve() == SCENE_FOLDER.resolve() else str(path.resolve())
    table = read_toml(path)
    try:
        return build_scene(path, table, source)
    except SceneError as error:
        raise SceneError(f"scene {path.stem}: {error}") from None


def build_scene(path: Path, table: dict[str, Any], source: str) -> Scene:
    """Build a scene from the table in its file."""
    allowed_keys = {*field_names(SceneKeys), *SCENE_KEYS}
    if unknown_keys := {*table} - allowed_keys:
        raise SceneError(unknown_name_message("key", min(unknown_keys), allowed_keys))
    keys = parse_table({name: value for name, value in table.items() if name not in SCENE_KEYS}, SceneKeys)
    run = build_run(locate_fmu(path, keys), keys, table)
    plots = default_plots(run.outputs) if keys.plots is None else keys.plots
    check_names("name in analyses", keys.analyses, ANALYSES)
    check_names("name in plots", plots, (*PLOTS, *run.outputs))
    known_values = find_known_values(keys)
    texts = keys.title, keys.about, keys.remark
    scene = Scene(path.stem, source, run, *texts, keys.analyses, plots, keys.decay, known_values)
    check_requirements(scene)
    return scene


def change_run(scene: Scene, run: RunSpec) -> Scene:
    """Return a scene with another run; its known values hold no longer, but for parameters that keep their value."""
    if run == scene.run:
        return scene
    known_values = scene.known
    if known_values:
        is_kept = {name: run.values.get(name) == scene.run.values.get(name) for name in known_values.values}
        kept_values = {
            name: value
            for name, value in known_values.values.items()
            if known_values.kind == "parameter" and is_kept[name]
        }
        known_values = replace(known_values, values=kept_values) if kept_values else None
    return replace(scene, run=run, known=known_values, remark=scene.remark if known_values == scene.known else "")


def find_known_values(keys: SceneKeys) -> KnownValues | None:
    """Return the known values of a scene; None without any."""
    tables = {name: getattr(keys, name) for name in KINDS if getattr(keys, name)}
    if keys.citation is not None and "published" not in tables:
        raise SceneError("[citation] has no effect without [published]: it names the publication of published values")
    if "published" in tables and keys.citation is None:
        raise SceneError("[published] needs the table [citation]; values without a publication are a [reference]")
    if len(tables) > 1:
        raise SceneError(f"[{'] and ['.join(tables)}] are both given: a scene compares with values of one kind")
    if not tables:
        return None
    ((name, table),) = tables.items()
    source, values = table.get("source", ""), {name: value for name, value in table.items() if name != "source"}
    if name != "parameter" and not TEXT.accepts(source):
        raise SceneError(f"[{name}] needs a source, as in source = 'MATLAB ode23'")
    return KnownValues(name, source, values, keys.citation)


def build_run(fmu: Path, keys: SceneKeys, table: dict[str, Any]) -> RunSpec:
    """Build the run of a scene from the keys of its file."""
    run = RunSpec.from_json({name: table[name] for name in SCENE_KEYS if name in table} | {"fmu": str(fmu)})
    by_key = {name: getattr(keys, key) for key, name in SHORT_KEYS.items() if getattr(keys, key) is not None}
    for name in by_key:
        if name in run.values:
            raise SceneError(f"{name} is set twice, in [values] and by its key: remove one")
    if "follow" not in table:
        run = replace(run, follow="grid" not in table, equal_steps=DEFAULT_EQUAL_STEPS)
    return replace(run, values=by_key | run.values)


def is_panel(name: str, outputs: Collection[str]) -> bool:
    """Return whether a plot is one of PLOTS; an output of the same name takes precedence."""
    return name in PLOTS and name not in outputs


def default_plots(outputs: tuple[str, ...], preferred_outputs: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return the default plots of a scene: the preferred outputs or the first ones, and the phase plane."""
    motion = find_roles(outputs)
    names = {output: role for role, output in motion.items() if is_panel(role, outputs)}
    has_phase = is_panel("phase", outputs) and all(role in motion for role in PLOTS["phase"])
    phase = ("phase",) if has_phase else ()
    return (*[names.get(output, output) for output in preferred_outputs or outputs[:MAX_DEFAULT_PLOTS]], *phase)


def check_requirements(scene: Scene) -> None:
    """Check that the keys of a scene are consistent."""
    run, motion = scene.run, scene.run.motion_outputs
    if not run.outputs:
        raise SceneError("outputs is empty; give at least one, as in outputs = ['x', 'v']")
    panels = tuple(name for name in scene.plots if is_panel(name, run.outputs))
    for category, names, required_roles in ("analysis", scene.analyses, ANALYSES), ("plot", panels, PLOTS):
        for name in names:
            for role in required_roles.get(name, ()):
                if role not in motion:
                    candidates = " or ".join(ROLES[role])
                    raise SceneError(f"the {category} '{name}' needs the {role}: add {candidates} to the outputs")
            if name == "steps" and not run.follow:
                raise SceneError(f"the {category} 'steps' needs follow = true, or no grid")
    if not run.follow and run.grid is None and not len(run.times):
        raise SceneError("follow = false needs a grid: set the communication step, as in grid = 0.01, or times")
    if ("decay" in scene.analyses) != (scene.decay.gives is not None):
        raise SceneError(
            "the analysis 'decay' needs the table [decay] with gives = 'zeta', 'f' or 'T_f', and vice versa"
        )


def locate_fmu(path: Path, keys: SceneKeys) -> Path:
    """Return the path of the FMU, built or not."""
    if keys.model is not None and keys.fmu is None:
        return find_fmu(keys.model)
    if keys.fmu is not None and keys.model is None:
        return path.parent / keys.fmu
    raise SceneError("set either model (as in model = 'smd') or fmu (the path of a file)")
