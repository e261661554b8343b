"""Reads published cases from the scene files of the harness: settings and published values."""

from collections.abc import Collection, Iterable
from pathlib import Path
from tomllib import loads
from typing import Any

# Keys of a scene and the variables they set; values of enumerations are labels.
ENUMERATION_KEYS = {"law": "friction", "method": "solver.method"}
NUMBER_KEYS = {"rtol": "solver.rtol", "atol": "solver.atol"}
COPIED_KEYS = ("title", "model", "stop", "grid", "decay", "published")


def read_presets(scenes: Iterable[Path], models: Collection[str]) -> list[dict[str, Any]]:
    """Return the scenes with published values of one of the models, sorted by file name."""
    presets = []
    for path in sorted(scenes):
        scene = loads(path.read_text(encoding="utf-8"))
        if "published" in scene and scene.get("model") in models:
            labels = {name: scene[key] for key, name in ENUMERATION_KEYS.items() if key in scene}
            numbers = {name: scene[key] for key, name in NUMBER_KEYS.items() if key in scene}
            copied = {key: scene[key] for key in COPIED_KEYS if key in scene}
            presets.append({"name": path.stem, **copied, "labels": labels, "values": scene.get("values", {}) | numbers})
    return presets
