"""A scene: what to run, what to record, what to measure, what to draw.  Read from a TOML file:

    title = "..."             one line for people
    about = "..."             what its model does, for the report
    model = "smd"             fmus/smd.fmu below the present folder or the project; or fmu = "path/from/this/file.fmu"
    start, stop               s; left out: the FMU's own
    method, law               solver.method and friction by name; left out: the FMU's own
    rtol, atol, h_max         solver.rtol, solver.atol (m), solver.h_max (s); left out: the FMU's own
    outputs = ["x", "v"]      the columns to record
    grid                      communication step in s
    follow = true             visit the ends of the solver's own steps as well; without a grid: these alone
                              both left out: 4096 even steps and the solver's own
    repeat = 3                time the run as often, and report the fastest
    tolerance = 1e-6          to which an FMU is run that does not show its solver's steps; and of such a one also
    exchange, lenient = true  run it by model exchange; run it though it breaks the standard
    timeout = 60             s, for one call of it
    analyses = ["decay"]      decay, slip, steps
    plots = ["phase"]         position, velocity, acceleration, phase, steps, any output by its name; [] for none;
                              left out: every output, and the phase plane
    [values]                  parameters and inputs by name, SI units; enumerations by name
    [decay]                   gives = "zeta", "f" or "T_f"; first = peaks to skip; cycles = how many to use (all)
    [published]               source = "..."; measured names with a number, [number, "unit"] or words

Only title, outputs and one of model and fmu are needed.
"""

from dataclasses import dataclass, field, fields, replace
from math import inf
from pathlib import Path
from typing import Annotated, Any

from ..errors import SceneError, check_names, unknown_name_message
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
MAX_DEFAULT_PLOTS = 6  # over time that are drawn unasked

# What may be asked for, and the roles that it needs among the outputs.
ANALYSES: dict[str, tuple[str, ...]] = {"decay": ("position", "velocity"), "slip": ("velocity",), "steps": ()}
PLOTS: dict[str, tuple[str, ...]] = {
    "position": ("position",),
    "velocity": ("velocity",),
    "acceleration": ("acceleration",),
    "phase": ("position", "velocity"),
    "steps": (),
}


def is_published(value: Any) -> bool:
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
    """The table [decay]: what its peaks are to give, the peaks to skip and the cycles to use, None for all."""

    gives: Annotated[str | None, DECAY_RESULT] = None
    first: Annotated[int, NATURAL_NUMBER] = 0
    cycles: Annotated[float | None, CYCLE_COUNT] = None


@dataclass(frozen=True, kw_only=True)
class SceneKeys:
    """The keys of the file; None means what the FMU itself says."""

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
    """One scene, under the name of its file, with the file of its FMU; `source`: where it was read, or its own name
    if it comes with the harness."""

    name: str
    source: str
    file: Path
    plots: tuple[str, ...]

    @property
    def follows_solver_steps(self) -> bool:
        """Whether the ends of the solver's own steps are visited."""
        return self.grid is None if self.follow is None else self.follow


def shipped_scenes() -> list[Path]:
    """The files of the scenes that come with the harness, by name."""
    return sorted(SHIPPED.glob("*.toml"), key=lambda file: file.stem)


def load_scene(scene: str | Path) -> Scene:
    """The scene of a shipped name or of a file; SceneError says what is wrong with it."""
    path = Path(scene)
    if path.suffix != ".toml":
        path = SHIPPED / f"{scene}.toml"
        if path not in shipped_scenes():
            names = [file.stem for file in shipped_scenes()]
            raise SceneError(f"{unknown_name_message('scene', scene, names)}, or the path of a .toml file")
    source = path.stem if path.parent.resolve() == SHIPPED.resolve() else str(path.resolve())
    table = read_toml(path)
    try:
        return build_scene(path, table, source)
    except SceneError as error:
        raise SceneError(f"scene {path.stem}: {error}") from None


def scene_from_provenance(told: dict[str, Any]) -> Scene:
    """The scene that a result says was run; SceneError if it does not."""
    try:
        table = {each.name: told[each.name] for each in fields(SceneKeys) if told[each.name] not in (None, "")}
        table["decay"] = {name: value for name, value in told["decay"].items() if value is not None}
        path, source, file = Path(told["name"]), str(told["source"]), Path(told["file"])
    except (AttributeError, KeyError, TypeError):
        raise SceneError("its provenance.json holds no scene: run the command that stands there") from None
    return replace(build_scene(path, table, source), file=file, name=path.name)


def build_scene(path: Path, table: dict[str, Any], source: str) -> Scene:
    """A scene from the table that its file holds."""
    keys = parse_table(table, SceneKeys)
    plots = default_plots(keys.outputs) if keys.plots is None else keys.plots
    check_names("name in analyses", keys.analyses, ANALYSES)
    check_names("name in plots", plots, (*PLOTS, *keys.outputs))
    scene = Scene(**vars(keys) | {"name": path.stem, "source": source, "file": locate_fmu(path, keys), "plots": plots})
    check_requirements(scene)
    return scene


def default_plots(outputs: tuple[str, ...]) -> tuple[str, ...]:
    """The plots of a scene that names none."""
    motion = find_roles(outputs)
    names = {output: role for role, output in motion.items()}
    phase = ("phase",) if all(role in motion for role in PLOTS["phase"]) else ()
    return (*[names.get(output, output) for output in outputs][:MAX_DEFAULT_PLOTS], *phase)


def check_requirements(scene: Scene) -> None:
    """What the scene asks for goes together."""
    motion = find_roles(scene.outputs)
    if not scene.outputs:
        raise SceneError("outputs is empty; name at least one, as in outputs = ['x', 'v']")
    for kind, names, needs in ("analysis", scene.analyses, ANALYSES), ("plot", scene.plots, PLOTS):
        for name in names:
            for role in needs.get(name, ()):
                if role not in motion:
                    wanted = " or ".join(ROLES[role])
                    raise SceneError(f"the {kind} '{name}' needs the {role}: add {wanted} to the outputs")
            if name == "steps" and not scene.follows_solver_steps:
                raise SceneError(f"the {kind} 'steps' needs follow = true, or no grid")
    if not scene.follows_solver_steps and scene.grid is None:
        raise SceneError("follow = false needs a grid: name the communication step, as in grid = 0.01")
    if ("decay" in scene.analyses) != (scene.decay.gives is not None):
        raise SceneError("the analysis 'decay' and the table [decay] with gives = 'zeta', 'f' or 'T_f' come together")
    if scene.published and not is_text(scene.published.get("source")):
        raise SceneError("[published] needs a source, as in source = 'MATLAB ode23'")


def locate_fmu(path: Path, keys: SceneKeys) -> Path:
    """Where the FMU is, or will be once it is built."""
    if keys.model is not None and keys.fmu is None:
        return find_fmu(keys.model)
    if keys.fmu is not None and keys.model is None:
        return path.parent / keys.fmu
    raise SceneError("name one of model (as in model = 'smd') and fmu (the path of a file)")
