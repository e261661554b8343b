"""Description of an FMU from Python: `describe`."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments import PATH, check_arguments

if TYPE_CHECKING:
    from ..simulation.fmu_variables import FmuDescription


@check_arguments(source=PATH)
def describe(source: "str | Path") -> "FmuDescription":
    """List the variables of a model or an FMU: units, start values, ranges, friction laws, methods and defaults.

    Parameters
    ----------
    source : str or path
        The name of a model, or the path of any FMU, FMI 2.0 or 3.0. The FMU is read, not run.

    Returns
    -------
    FmuDescription
        Variables, laws, methods and defaults; printed as tables.

    Raises
    ------
    SceneError
        If there is no such model or file.
    HarnessError
        If the file is not an FMU.

    Examples
    --------
    >>> describe("stickslip").methods  # doctest: +SKIP
    ('exact', 'ode23', 'ode45', 'dop853', 'rodas')
    """
    from ..scenes.fmu_files import find_fmu
    from ..simulation.fmu_variables import describe_fmu

    return describe_fmu(find_fmu(str(source)))
