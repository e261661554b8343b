"""What becomes of a scene."""

from dataclasses import dataclass

from ...results.quantity import Quantity
from ...running.run import Run
from ...scenes.scene import Scene


@dataclass(frozen=True)
class Outcome:
    """What became of a scene: its measured quantities, or the sentence that says why there are none."""

    name: str
    scene: Scene | None
    run: Run | None
    quantities: tuple[Quantity, ...]
    error: str | None
