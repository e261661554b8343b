"""Gallery at the top of the page: each oscillator with its motion and its phase plane."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .sections import TRAJECTORY_FILE, PublishedScene
from .svg_curve import draw_curve


@dataclass(frozen=True)
class GalleryEntry:
    """A model with its description, two drawings, and the name of the published case that they show.

    `sticks` marks a motion with phases of sticking, which the drawings emphasize.
    """

    name: str
    text: str
    case: str
    drawings: tuple[str, str]
    sticks: bool


def build_gallery(scenes: Sequence[PublishedScene], results: Path) -> tuple[GalleryEntry, ...]:
    """Return the published cases that have a description and results.

    Unreadable results are skipped; their section reports them.
    """
    entries = []
    for scene in scenes:
        path = results / scene.name / TRAJECTORY_FILE
        if not scene.about or not path.is_file():
            continue
        try:
            t, x, v = np.loadtxt(path, delimiter=",", skiprows=1, usecols=(0, 1, 2), unpack=True)
            name, stuck = scene.model, find_stuck_samples(t, path.with_name("events.csv"))
            drawings = (
                draw_curve(t, x, f"{name}: position over time", stuck),
                draw_curve(x, v, f"{name}: speed over position", stuck),
            )
        except (OSError, ValueError):
            continue
        entries.append(GalleryEntry(name, scene.about, scene.name, drawings, bool(stuck.any())))
    return tuple(entries)


def find_stuck_samples(t: np.ndarray, events: Path) -> np.ndarray:
    """Return whether the mode is 0, stuck, at the times t (n,); without a file of events nothing is stuck."""
    if not events.is_file():
        return np.zeros(len(t), dtype=bool)
    times, modes = np.loadtxt(events, delimiter=",", skiprows=1, usecols=(0, 1), unpack=True, ndmin=2)
    return modes[np.searchsorted(times, t, side="right") - 1] == 0
