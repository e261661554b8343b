"""A scene: what to run, what to record, what to measure, what to draw.  Read from a TOML file:

    title = "..."             one line for people
    model = "smd"             fmus/smd.fmu below the present folder or the project; or fmu = "path/from/this/file.fmu"
    start, stop               s; left out: the FMU's own
    method, law               solver.method and friction by name; left out: the FMU's own
    rtol, atol, h_max         solver.rtol, solver.atol (m), solver.h_max (s); left out: the FMU's own
    outputs = ["x", "v"]      the columns to record
    grid                      communication step in s; left out: the ends of the solver's own steps
    follow = true             with a grid: visit the ends of the solver's own steps as well
    repeat = 3                time the run as often, and report the fastest
    analyses = ["decay"]      decay, slip, steps
    plots = ["phase"]         position, velocity, acceleration, phase, steps
    [values]                  parameters and inputs by name, SI units; enumerations by name
    [decay]                   gives = "zeta", "f" or "T_f"; first = peaks to skip; cycles = how many to use (all)
    [published]               source = "..."; measured names with a number, [number, "unit"] or words

Only title, outputs and one of model and fmu are needed.
"""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any

from ..errors import HarnessError, SceneError, shown, unknown

SHIPPED = Path(__file__).parent
LONGEST_TITLE = 200  # letters
MOST_REPEATS = 1000
LARGEST = 1_000_000  # bytes of a file that somebody wrote

# The outputs that play a role, in the models of a sled or mass and in those of a pendulum.
ROLES = {"position": ("x", "theta"), "velocity": ("v", "omega"), "acceleration": ("a", "alpha")}

# What may be asked for, and the roles that it needs among the outputs.
ANALYSES = {"decay": ("position", "velocity"), "slip": ("velocity", "acceleration"), "steps": ()}
PLOTS = {
    "position": ("position",),
    "velocity": ("velocity",),
    "acceleration": ("acceleration",),
    "phase": ("position", "velocity"),
    "steps": (),
}


@dataclass(frozen=True)
class Scene:
    """One scene; None means what the FMU itself says."""

    name: str
    title: str
    model: str
    fmu: Path
    outputs: tuple[str, ...]
    start: float | None = None
    stop: float | None = None
    method: str | None = None
    law: str | None = None
    rtol: float | None = None
    atol: float | None = None
    h_max: float | None = None
    grid: float | None = None
    follow: bool = True
    repeat: int = 1
    analyses: tuple[str, ...] = ()
    plots: tuple[str, ...] = ()
    values: dict = field(default_factory=dict)
    decay: dict = field(default_factory=dict)
    published: dict = field(default_factory=dict)

    @property
    def motion(self) -> dict[str, str]:
        """The output that plays each role, of those recorded."""
        return {role: name for role, names in ROLES.items() for name in names if name in self.outputs}


def is_text(value: object) -> bool:
    return isinstance(value, str) and bool(value)


def is_title(value: object) -> bool:
    text = str(value)
    return is_text(value) and len(text) <= LONGEST_TITLE and text.splitlines() == [text] and "\0" not in text


def is_number(value: object) -> bool:
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # an integer beyond all floats
        return False


def is_positive(value: Any) -> bool:
    return is_number(value) and value > 0


def is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= MOST_REPEATS


def is_natural(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def is_half_count(value: Any) -> bool:
    return is_positive(value) and float(2 * value).is_integer()


def is_flag(value: object) -> bool:
    return isinstance(value, bool)


def is_names(value: object) -> bool:
    return isinstance(value, list) and all(map(is_text, value)) and len(set(value)) == len(value)


def is_table(value: object) -> bool:
    return isinstance(value, dict)


def is_published(value: object) -> bool:
    pair = isinstance(value, list) and len(value) == 2 and is_number(value[0]) and is_text(value[1])
    return pair or is_number(value) or is_text(value)


Kind = tuple[Callable[[Any], bool], str]
TEXT: Kind = (is_text, "a text")
NUMBER: Kind = (is_number, "a finite number")
POSITIVE: Kind = (is_positive, "a finite number above 0")
NAMES: Kind = (is_names, "a list of different names")
TABLE: Kind = (is_table, "a table")

KEYS: dict[str, Kind] = {
    "title": (is_title, f"a text of one line and at most {LONGEST_TITLE} letters"),
    **dict.fromkeys(("model", "fmu", "method", "law"), TEXT),
    **dict.fromkeys(("start", "stop"), NUMBER),
    **dict.fromkeys(("rtol", "atol", "h_max", "grid"), POSITIVE),
    **dict.fromkeys(("outputs", "analyses", "plots"), NAMES),
    **dict.fromkeys(("values", "decay", "published"), TABLE),
    "follow": (is_flag, "true or false"),
    "repeat": (is_count, f"a whole number from 1 to {MOST_REPEATS}"),
}
DECAY: dict[str, Kind] = {
    "gives": (lambda value: value in ("zeta", "f", "T_f"), "'zeta', 'f' or 'T_f'"),
    "first": (is_natural, "a whole number of at least 0"),
    "cycles": (is_half_count, "a whole or half number above 0"),
}


def shipped() -> list[Path]:
    """The files of the scenes that come with the harness, by name."""
    return sorted(SHIPPED.glob("*.toml"), key=lambda file: file.stem)


def load(scene: str | Path) -> Scene:
    """The scene of a shipped name or of a file; SceneError says what is wrong with it."""
    path = Path(scene)
    if path.suffix != ".toml":
        path = SHIPPED / f"{scene}.toml"
        if path not in shipped():
            names = [file.stem for file in shipped()]
            raise SceneError(f"{unknown('scene', scene, names)}, or the path of a .toml file")
    table = read(path)
    try:
        return build(path, table)
    except SceneError as error:
        raise SceneError(f"scene {path.stem}: {error}") from None


def read(path: Path) -> dict[str, Any]:
    """The table in a TOML file; SceneError in one sentence if there is none."""
    try:
        if path.exists() and not path.is_file():
            raise SceneError(f"cannot read the scene {path}: not a file")
        if path.stat().st_size > LARGEST:
            raise SceneError(f"scene {path.stem}: more than {LARGEST} bytes are no scene")
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise SceneError(f"cannot read the scene {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SceneError(f"scene {path.stem}: not a text file in UTF-8") from None
    except RecursionError:
        raise SceneError(f"scene {path.stem}: not valid TOML: brackets too deep in each other") from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"scene {path.stem}: not valid TOML: {error}") from None
    except ValueError:
        raise SceneError(f"scene {path.stem}: an integer of thousands of digits") from None


def build(path: Path, table: dict) -> Scene:
    """A scene from the table that its file holds."""
    check(table, KEYS, "key")
    check(table.get("decay", {}), DECAY, "key in [decay]")
    for key in ("title", "outputs"):
        if key not in table:
            raise SceneError(f"the key '{key}' is missing")
    for key, allowed in (("analyses", ANALYSES), ("plots", PLOTS)):
        table[key] = tuple(table.get(key, ()))
        for name in table[key]:
            if name not in allowed:
                raise SceneError(unknown(f"name in {key}", name, allowed))
    table["outputs"] = tuple(table["outputs"])
    table.setdefault("follow", "grid" not in table)
    table["model"], table["fmu"] = find(path, table)
    scene = Scene(name=path.stem, **table)
    check_needs(scene)
    return scene


def check(table: dict, kinds: dict[str, Kind], what: str) -> None:
    """Every key is known, and its value of its kind."""
    for key, value in table.items():
        if key not in kinds:
            raise SceneError(unknown(what, key, kinds))
        accepts, words = kinds[key]
        if not accepts(value):
            raise SceneError(f"{key} = {shown(value)} is not {words}")


def check_needs(scene: Scene) -> None:
    """What the scene asks for goes together."""
    if not scene.outputs:
        raise SceneError("outputs is empty; name at least one, as in outputs = ['x', 'v']")
    for kind, names, needs in (("analysis", scene.analyses, ANALYSES), ("plot", scene.plots, PLOTS)):
        for name in names:
            for role in needs[name]:
                if role not in scene.motion:
                    wanted = " or ".join(ROLES[role])
                    raise SceneError(f"the {kind} '{name}' needs the {role}: add {wanted} to the outputs")
            if name == "steps" and not scene.follow:
                raise SceneError(f"the {kind} 'steps' needs follow = true, or no grid")
    if not scene.follow and scene.grid is None:
        raise SceneError("follow = false needs a grid: name the communication step, as in grid = 0.01")
    if ("decay" in scene.analyses) != ("gives" in scene.decay):
        raise SceneError("the analysis 'decay' and the table [decay] with gives = 'zeta', 'f' or 'T_f' come together")
    if scene.published and not is_text(scene.published.get("source")):
        raise SceneError("[published] needs a source, as in source = 'MATLAB ode23'")
    for key, value in scene.published.items():
        if not is_published(value):
            raise SceneError(f"published {key} = {shown(value)} is not a number, [number, 'unit'] or a text")


def find(path: Path, table: dict) -> tuple[str, Path]:
    """The model's name, and where its FMU is or will be once it is built."""
    if ("model" in table) == ("fmu" in table):
        raise SceneError("name one of model (as in model = 'smd') and fmu (the path of a file)")
    if "fmu" in table:
        file = path.parent / table["fmu"]
        return file.stem, file
    return table["model"], fmu_of(table["model"])


def fmu_of(name: str) -> Path:
    """Where the FMU of a model is, or will be once it is built."""
    folders = (Path("fmus"), Path(__file__).parents[2] / "fmus")
    files = [file for folder in folders for file in folder.glob("*.fmu")]
    sources = [file for folder in folders for file in folder.glob("[!_]*.py")]
    names = {file.stem for file in files + sources}
    if not names:
        raise SceneError("there are no models here: run from the folder of the project, or name fmu = 'a/file.fmu'")
    if name not in names:
        raise SceneError(unknown("model", name, names))
    return next((file for file in files if file.stem == name), Path("fmus") / f"{name}.fmu")


def check_built(fmu: Path) -> None:
    """The FMU is there."""
    if not fmu.is_file():
        raise HarnessError(f"there is no {fmu}: build the FMUs with `python build_fmus.py`, or name another file")
