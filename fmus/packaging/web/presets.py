"""The published cases, as the scenes of the harness tell them: what is set, and the figures to stand beside."""

from collections.abc import Collection, Iterable
from pathlib import Path
from tomllib import loads
from typing import Any

ENUMERATION_KEYS = {"law": "friction", "method": "solver.method"}  # key of a scene -> variable, by label
NUMBER_KEYS = {"rtol": "solver.rtol", "atol": "solver.atol"}
COPIED_KEYS = ("title", "model", "stop", "grid", "decay", "published")


def read_presets(scenes: Iterable[Path], models: Collection[str]) -> list[dict[str, Any]]:
    """Every scene with published figures of one of the models, in the order of their files' names."""
    found = []
    for path in sorted(scenes):
        scene = loads(path.read_text(encoding="utf-8"))
        if "published" in scene and scene.get("model") in models:
            labels = {name: scene[key] for key, name in ENUMERATION_KEYS.items() if key in scene}
            numbers = {name: scene[key] for key, name in NUMBER_KEYS.items() if key in scene}
            kept = {key: scene[key] for key in COPIED_KEYS if key in scene}
            found.append({"name": path.stem, **kept, "labels": labels, "values": scene.get("values", {}) | numbers})
    return found
