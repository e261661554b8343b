"""What the page begins with: the oscillators, each with a picture of its motion and of its phase plane."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .drawing import drawing
from .sections import SHOWN, Published


@dataclass(frozen=True)
class Sketch:
    """A model in words and two drawings, with the name of the published case that they show."""

    name: str
    text: str
    case: str
    drawings: tuple[str, str]


def gallery(scenes: Sequence[Published], results: Path) -> tuple[Sketch, ...]:
    """The published cases that say what their model does, as far as they have been run; one that cannot be read is
    told of further down."""
    found = []
    for scene in scenes:
        path = results / scene.name / SHOWN
        if not scene.about or not path.is_file():
            continue
        try:
            t, x, v = np.loadtxt(path, delimiter=",", skiprows=1, usecols=(0, 1, 2), unpack=True)
            name = scene.model
            drawings = drawing(t, x, f"{name}: position over time"), drawing(x, v, f"{name}: speed over position")
        except (OSError, ValueError):
            continue
        found.append(Sketch(name, scene.about, scene.name, drawings))
    return tuple(found)
