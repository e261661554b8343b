"""What the page begins with: the oscillators, each with a picture of its motion and of its phase plane."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .sections import TRAJECTORY_FILE, PublishedScene
from .svg_curve import draw_curve


@dataclass(frozen=True)
class GalleryEntry:
    """A model in words and two drawings, with the name of the published case that they show."""

    name: str
    text: str
    case: str
    drawings: tuple[str, str]


def build_gallery(scenes: Sequence[PublishedScene], results: Path) -> tuple[GalleryEntry, ...]:
    """The published cases that say what their model does, as far as they have been run; one that cannot be read is
    told of further down."""
    found = []
    for scene in scenes:
        path = results / scene.name / TRAJECTORY_FILE
        if not scene.about or not path.is_file():
            continue
        try:
            t, x, v = np.loadtxt(path, delimiter=",", skiprows=1, usecols=(0, 1, 2), unpack=True)
            name = scene.model
            drawings = draw_curve(t, x, f"{name}: position over time"), draw_curve(x, v, f"{name}: speed over position")
        except (OSError, ValueError):
            continue
        found.append(GalleryEntry(name, scene.about, scene.name, drawings))
    return tuple(found)
