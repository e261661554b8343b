"""The rivals with their packages and settings."""

import ast
import re
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from harness.errors import check_names
from harness.results.provenance import HARNESS

from .scenes import Setting

ENGINES = Path(__file__).with_name("engines")
MODELS = Path(__file__).parents[2] / "fmus"
MAX_LINES = 60  # of a rival's file


@dataclass(frozen=True)
class Rival:
    """An engine with its settings.

    Attributes
    ----------
    name : str
        Name on the command line.
    title : str
        Name in tables and figures.
    module : str
        File in engines/ without its suffix.
    package : str
        Package that pip installs.
    default, best : dict
        Default and best setting.
    purpose : str
        Purpose of the engine, and the dry friction that it offers.
    """

    name: str
    title: str
    module: str
    package: str
    default: Setting
    best: Setting
    purpose: str

    @property
    def settings(self) -> dict[str, Setting]:
        """Return the settings by name."""
        return {"default": self.default, "best": self.best}

    @property
    def installed_version(self) -> str | None:
        """Return the version of the package, None if it is not installed."""
        try:
            return version(self.package)
        except PackageNotFoundError:
            return None

    @property
    def lines(self) -> int:
        """Return the number of lines of code that a user writes for all scenes."""
        files = [ENGINES / f"{self.module}.py"]
        if self is OWN_RIVAL:
            files += [MODELS / name for name in ("coulomb.py", "stickslip.py", "pendulum.py", "more/belt.py")]
            files.append(MODELS / "more/clutch.py")
        return sum(count_lines(file.read_text(encoding="utf-8")) for file in files)


def count_lines(source: str) -> int:
    """Return the number of lines of code: without blank lines, comments and docstrings."""
    documented_types = (ast.Module, ast.ClassDef, ast.FunctionDef)
    excluded_lines: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, documented_types) and ast.get_docstring(node) is not None:
            excluded_lines.update(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    lines = enumerate(source.splitlines(), start=1)
    return sum(1 for number, line in lines if number not in excluded_lines and re.match(r"\s*[^#\s]", line))


OWN_RIVAL = Rival(
    "fmu",
    "this FMU",
    "own_fmu",
    HARNESS,
    {},
    {"solver.rtol": 1e-12},
    "co-simulation in any FMI tool; stick and slip are modes",
)
STEP = 1e-4  # s, best setting of engines with constant steps
USER_EVENTS = "the user programs stick and slip as events, here for one contact"
CONTACTS = "robots with contacts; they creep below stiction_tolerance, and joints have no dry friction"
OTHERS = (
    Rival(
        "scipy",
        "scipy",
        "scipy",
        "scipy",
        {},
        {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14},
        f"general ODEs; {USER_EVENTS}",
    ),
    Rival(
        "pathsim",
        "PathSim",
        "pathsim",
        "pathsim",
        {},
        {"Solver": "RKDP87", "tolerance_lte_rel": 1e-10, "tolerance_lte_abs": 1e-12, "event_tolerance": 1e-10},
        f"block diagrams with events; {USER_EVENTS}",
    ),
    Rival(
        "drake-events",
        "Drake events",
        "drake_events",
        "drake",
        {},
        {"accuracy": 1e-10},
        f"general systems with witness functions; {USER_EVENTS}",
    ),
    Rival(
        "drake-discrete",
        "Drake discrete",
        "drake_plant",
        "drake",
        {},
        {"time_step": STEP, "stiction_tolerance": 1e-6},
        f"the plant with steps: {CONTACTS}",
    ),
    Rival(
        "drake-continuous",
        "Drake continuous",
        "drake_plant",
        "drake",
        {"time_step": 0.0},
        {"time_step": 0.0, "integration_scheme": "radau3", "accuracy": 1e-6, "stiction_tolerance": 1e-6},
        f"the plant without steps: {CONTACTS}",
    ),
    Rival(
        "mujoco",
        "MuJoCo",
        "mujoco",
        "mujoco",
        {},
        {"timestep": STEP, "noslip_iterations": 10, "solreffriction": "2e-4 1", "rewrite": 1},
        "fast robots and learning; its soft constraints creep at the default settings",
    ),
    Rival(
        "exudyn",
        "Exudyn",
        "exudyn",
        "exudyn",
        {"step": 1e-3, "presliding": 1e-5, "decay": 1e-3},
        {"step": STEP, "presliding": 1e-6, "decay": 1e-5, "rewrite": 1},
        "flexible multibody systems; friction at rest is an elastic bristle",
    ),
    Rival(
        "dart",
        "DART",
        "dart",
        "dartpy",
        {},
        {"time_step": STEP, "rewrite": 1},
        "robots and animation; joints have Coulomb friction with one coefficient",
    ),
    Rival(
        "pybullet",
        "PyBullet",
        "pybullet",
        "pybullet",
        {},
        {"fixedTimeStep": STEP, "rewrite": 1},
        "robots and learning; a motor with a limited force serves as the friction of a joint",
    ),
)
RIVALS = {rival.name: rival for rival in (OWN_RIVAL, *OTHERS)}


def find_rivals(names: tuple[str, ...]) -> list[Rival]:
    """Return the rivals of these names, by default all. The first is the FMU, with which the others are compared."""
    check_names("rival", names, RIVALS)
    return [rival for rival in RIVALS.values() if rival is OWN_RIVAL or not names or rival.name in names]
