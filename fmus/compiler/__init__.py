"""Compiler of models: equations to a Python class, the numerics lowered to scalars, and both translated to C."""

# The only definition of the version; pyproject.toml and every model description read it.
__version__ = "0.2.0"
__date__ = "2026-11-22"  # of this version; FMUs that are built without SOURCE_DATE_EPOCH carry it


class BuildError(Exception):
    """Raised when an FMU cannot be built; the message is one sentence for the user."""
