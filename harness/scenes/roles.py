"""The outputs that play a role in every motion."""

from collections.abc import Collection

# Their names in the models of a sled or mass, and in those of a pendulum.
ROLES = {"position": ("x", "theta"), "velocity": ("v", "omega"), "acceleration": ("a", "alpha")}


def roles(outputs: Collection[str]) -> dict[str, str]:
    """The output that plays each role, of those there are."""
    return {role: name for role, names in ROLES.items() for name in names if name in outputs}
