"""Stored results for Python: `load_result`."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments import PATH, check_arguments

if TYPE_CHECKING:
    from ..results.result import Result


@check_arguments(folder=PATH)
def load_result(folder: "str | Path") -> "Result":
    """Read a stored result.

    Parameters
    ----------
    folder : path
        A result folder, as a command or `save` writes it.

    Returns
    -------
    Result
        The same class as from the function of Python: a `Trajectory`, `DecayResult`, `FitResult`, `Comparison` or
        `SweepResult`; for other studies the class of their results.

    Raises
    ------
    SceneError
        If the folder holds no result, or it is damaged.
    """
    from ..results.registry import load

    return load(Path(folder))
