"""The outputs that play a role in every motion."""

from collections.abc import Collection, Mapping
from typing import Any

# Their names in the models of a sled or mass, and in those of a pendulum.
ROLES = {"position": ("x", "theta"), "velocity": ("v", "omega"), "acceleration": ("a", "alpha")}


def find_roles(outputs: Collection[str] | Mapping[str, Any]) -> dict[str, str]:
    """The output that plays each role, of those there are: by the names above; of variables of an FMU, by their names,
    that of the first position whose rate has a rate, as their declarations say, whatever it is called."""
    if isinstance(outputs, Mapping):
        rate = {one.derivative.name: name for name, one in outputs.items() if one.derivative is not None}
        for position in outputs:
            if rate.get(position) in rate and position not in rate.values():
                return dict(zip(ROLES, (position, rate[position], rate[rate[position]]), strict=True))
    return {role: name for role, names in ROLES.items() for name in names if name in outputs}
