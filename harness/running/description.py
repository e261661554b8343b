"""What an FMU says of itself."""

from pathlib import Path
from typing import Any

import fmpy

from ..errors import HarnessError, SceneError, reason


def description(path: Path) -> Any:
    """What an FMU says of itself; HarnessError if it cannot be read."""
    if not path.is_file():
        raise SceneError(f"there is no {path}")
    try:
        return fmpy.read_model_description(path)
    except Exception as error:  # fmpy raises bare Exceptions, and those of zip and XML readers
        raise HarnessError(f"{path.name} cannot be read: {reason(error)}") from None
