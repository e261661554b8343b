"""Scenes: what to run, record, analyze and plot. Format of the TOML file:

    title = "..."             one line
    about = "..."             description of the model, for the report
    model = "smd"             fmus/smd.fmu in the working directory or the project; or fmu = "path/from/here.fmu"
    start, stop               s; default: those of the FMU
    method, law               solver.method and friction by name; default: those of the FMU
    rtol, atol, h_max         solver.rtol, solver.atol (m), solver.h_max (s); default: those of the FMU
    outputs = ["x", "v"]      columns to record
    grid                      communication step in s
    follow = true             step to the ends of internal steps as well; without a grid: to these only
                              default without follow and grid: 4096 equal steps and the internal steps
    repeat = 3                run several times and report the shortest run time
    tolerance = 1e-6          tolerance of the step refinement for FMUs that do not expose their solver's steps; for
                              such FMUs also:
    exchange, lenient = true  use model exchange; run an FMU that violates the standard
    timeout = 60              time limit of one FMI call in s
    analyses = ["decay"]      decay, slip, steps
    plots = ["phase"]         position, velocity, acceleration, phase, steps, or any output; [] for none;
                              an output that has one of these names takes precedence;
                              default: the first six outputs and the phase plane
    [values]                  parameters and inputs by name, SI units; enumerations by label
    [decay]                   gives = "zeta", "f" or "T_f"; first = peaks to skip; cycles = cycles to use (all)
    [published]               source = "..."; published quantities: a number, [number, "unit"] or a text

Required are title, outputs, and either model or fmu.
"""

from collections.abc import Collection
from dataclasses import dataclass, field, fields, replace
from math import inf
from pathlib import Path
from typing import Annotated, Any

from ..errors import SceneError, check_names, format_value, unknown_source_message
from .fmu_files import find_fmu
from .roles import ROLES, find_roles
from .schema import (
    FLAG,
    NAMES,
    NUMBER,
    POSITIVE,
    TABLE,
    TEXT,
    TITLE,
    Constraint,
    is_number,
    is_text,
    is_whole,
    parse_table,
    read_toml,
)

SHIPPED = Path(__file__).parent
MAX_REPEATS = 1000
MAX_DEFAULT_PLOTS = 6  # time plots by default

# Available analyses and plots, and the roles that they need among the outputs.
ANALYSES: dict[str, tuple[str, ...]] = {"decay": ("position", "velocity"), "slip": ("velocity",), "steps": ()}
PLOTS: dict[str, tuple[str, ...]] = {
    "position": ("position",),
    "velocity": ("velocity",),
    "acceleration": ("acceleration",),
    "phase": ("position", "velocity"),
    "steps": (),
}


def is_published(value: Any) -> bool:
    """Return whether a value is a number, [number, "unit"] or a text."""
    pair = isinstance(value, list) and len(value) == 2 and is_number(value[0]) and is_text(value[1])
    return pair or is_number(value) or is_text(value)


REPEAT_COUNT = Constraint(lambda value: is_whole(value, 1, MAX_REPEATS), f"a whole number from 1 to {MAX_REPEATS}")
DECAY_RESULT = Constraint(lambda value: value in ("zeta", "f", "T_f"), "'zeta', 'f' or 'T_f'")
NATURAL_NUMBER = Constraint(lambda value: is_whole(value, 0, inf), "a whole number of at least 0")
CYCLE_COUNT = Constraint(
    lambda value: POSITIVE.accepts(value) and (2.0 * value) % 1 == 0, "a whole or half number above 0"
)
PUBLISHED_VALUE = Constraint(is_published, "a number, [number, 'unit'] or a text")


@dataclass(frozen=True)
class DecayOptions:
    """Table [decay]: the quantity to compute, the number of peaks to skip, and the cycles to use (None for all)."""

    gives: Annotated[str | None, DECAY_RESULT] = None
    first: Annotated[int, NATURAL_NUMBER] = 0
    cycles: Annotated[float | None, CYCLE_COUNT] = None


@dataclass(frozen=True, kw_only=True)
class SceneKeys:
    """Keys of a scene file; None stands for the default of the FMU."""

    title: Annotated[str, TITLE]
    outputs: Annotated[tuple[str, ...], NAMES]
    model: Annotated[str | None, TEXT] = None
    fmu: Annotated[str | None, TEXT] = None
    start: Annotated[float | None, NUMBER] = None
    stop: Annotated[float | None, NUMBER] = None
    method: Annotated[str | None, TEXT] = None
    law: Annotated[str | None, TEXT] = None
    rtol: Annotated[float | None, POSITIVE] = None
    atol: Annotated[float | None, POSITIVE] = None
    h_max: Annotated[float | None, POSITIVE] = None
    grid: Annotated[float | None, POSITIVE] = None
    follow: Annotated[bool | None, FLAG] = None
    repeat: Annotated[int, REPEAT_COUNT] = 1
    tolerance: Annotated[float, POSITIVE] = 1e-6
    exchange: Annotated[bool, FLAG] = False
    lenient: Annotated[bool, FLAG] = False
    timeout: Annotated[float, POSITIVE] = 60.0
    about: Annotated[str, TITLE] = ""
    analyses: Annotated[tuple[str, ...], NAMES] = ()
    plots: Annotated[tuple[str, ...] | None, NAMES] = None
    values: Annotated[dict[str, Any], TABLE] = field(default_factory=dict)
    decay: DecayOptions = field(default_factory=DecayOptions)
    published: dict[str, Annotated[Any, PUBLISHED_VALUE]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Scene(SceneKeys):
    """Scene with its name, its FMU, and its source: the path of the scene file, or its name if it is built in."""

    name: str
    source: str
    file: Path
    plots: tuple[str, ...]

    @property
    def follows_solver_steps(self) -> bool:
        """Return whether the run steps to the ends of internal steps."""
        return self.grid is None if self.follow is None else self.follow


def shipped_scenes() -> list[Path]:
    """Return the files of the built-in scenes, sorted by name."""
    return sorted(SHIPPED.glob("*.toml"), key=lambda file: file.stem)


def load_scene(scene: str | Path) -> Scene:
    """Load a scene by built-in name or by file.

    Raises
    ------
    SceneError
        If the scene is invalid.
    """
    path = Path(scene)
    if path.suffix != ".toml":
        path = SHIPPED / f"{scene}.toml"
        if path not in shipped_scenes():
            names = [file.stem for file in shipped_scenes()]
            raise SceneError(unknown_source_message("scene", str(scene), names, ", or the path of a .toml file"))
    source = path.stem if path.parent.resolve() == SHIPPED.resolve() else str(path.resolve())
    table = read_toml(path)
    try:
        return build_scene(path, table, source)
    except SceneError as error:
        raise SceneError(f"scene {path.stem}: {error}") from None


def scene_from_provenance(stored: dict[str, Any]) -> Scene:
    """Return the scene of a stored result; raise SceneError if the result has none."""
    try:
        stored = {"timeout": stored.get("patience")} | stored  # results of earlier versions
        table = {each.name: stored[each.name] for each in fields(SceneKeys) if stored[each.name] not in (None, "")}
        table["decay"] = {name: value for name, value in stored["decay"].items() if value is not None}
        path, source, file = Path(stored["name"]), str(stored["source"]), Path(stored["file"])
    except (AttributeError, KeyError, TypeError):
        raise SceneError("its provenance.json contains no scene: run the command in it instead") from None
    if path.name in ("", ".."):
        raise SceneError(f"its provenance.json has the invalid scene name {format_value(stored['name'])}")
    return replace(build_scene(path, table, source), file=file, name=path.name)


def build_scene(path: Path, table: dict[str, Any], source: str) -> Scene:
    """Build a scene from the table in its file."""
    keys = parse_table(table, SceneKeys)
    plots = default_plots(keys.outputs) if keys.plots is None else keys.plots
    check_names("name in analyses", keys.analyses, ANALYSES)
    check_names("name in plots", plots, (*PLOTS, *keys.outputs))
    scene = Scene(**vars(keys) | {"name": path.stem, "source": source, "file": locate_fmu(path, keys), "plots": plots})
    check_requirements(scene)
    return scene


def is_panel(name: str, outputs: Collection[str]) -> bool:
    """Return whether a plot is a panel of this program; an output of the same name takes precedence."""
    return name in PLOTS and name not in outputs


def default_plots(outputs: tuple[str, ...], chosen: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return the plots of a scene that names none: the `chosen` outputs or the first ones, and the phase plane."""
    motion = find_roles(outputs)
    names = {output: role for role, output in motion.items() if is_panel(role, outputs)}
    has_phase = is_panel("phase", outputs) and all(role in motion for role in PLOTS["phase"])
    phase = ("phase",) if has_phase else ()
    return (*[names.get(output, output) for output in chosen or outputs[:MAX_DEFAULT_PLOTS]], *phase)


def check_requirements(scene: Scene) -> None:
    """Check that the keys of a scene are consistent."""
    motion = find_roles(scene.outputs)
    if not scene.outputs:
        raise SceneError("outputs is empty; give at least one, as in outputs = ['x', 'v']")
    panels = tuple(name for name in scene.plots if is_panel(name, scene.outputs))
    for category, names, required_roles in ("analysis", scene.analyses, ANALYSES), ("plot", panels, PLOTS):
        for name in names:
            for role in required_roles.get(name, ()):
                if role not in motion:
                    candidates = " or ".join(ROLES[role])
                    raise SceneError(f"the {category} '{name}' needs the {role}: add {candidates} to the outputs")
            if name == "steps" and not scene.follows_solver_steps:
                raise SceneError(f"the {category} 'steps' needs follow = true, or no grid")
    if not scene.follows_solver_steps and scene.grid is None:
        raise SceneError("follow = false needs a grid: set the communication step, as in grid = 0.01")
    if ("decay" in scene.analyses) != (scene.decay.gives is not None):
        raise SceneError(
            "the analysis 'decay' needs the table [decay] with gives = 'zeta', 'f' or 'T_f', and vice versa"
        )
    if scene.published and not is_text(scene.published.get("source")):
        raise SceneError("[published] needs a source, as in source = 'MATLAB ode23'")


def locate_fmu(path: Path, keys: SceneKeys) -> Path:
    """Return the path of the FMU, built or not."""
    if keys.model is not None and keys.fmu is None:
        return find_fmu(keys.model)
    if keys.fmu is not None and keys.model is None:
        return path.parent / keys.fmu
    raise SceneError("set either model (as in model = 'smd') or fmu (the path of a file)")
