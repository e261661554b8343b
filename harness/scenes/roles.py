"""Outputs with a role: position, velocity, acceleration."""

from collections.abc import Collection, Mapping
from typing import Any

# Names for translation and rotation.
ROLES = {"position": ("x", "theta"), "velocity": ("v", "omega"), "acceleration": ("a", "alpha")}


def find_roles(outputs: Collection[str] | Mapping[str, Any]) -> dict[str, str]:
    """Return the output of each role.

    Parameters
    ----------
    outputs : collection of str or mapping
        Names of outputs, matched by the names in `ROLES`; or variables of an FMU by name, where the roles follow from
        the declared derivatives: the first variable that has a first and a second derivative is the position.
    """
    if isinstance(outputs, Mapping):
        derivatives = {
            variable.derivative.name: name for name, variable in outputs.items() if variable.derivative is not None
        }
        for position in outputs:
            if derivatives.get(position) in derivatives and position not in derivatives.values():
                return dict(
                    zip(ROLES, (position, derivatives[position], derivatives[derivatives[position]]), strict=True)
                )
    return {role: name for role, names in ROLES.items() for name in names if name in outputs}
