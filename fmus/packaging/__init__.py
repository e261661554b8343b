"""Build time only: from a declared model to the FMU in a file."""

# The version is born here; pyproject.toml and every model description read it.
__version__ = "0.1.0"


class BuildError(Exception):
    """An FMU cannot be built; the message is one sentence for the user."""
