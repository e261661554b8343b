"""Build time only: from a declared model to the FMU in a file."""

# The version is born here; pyproject.toml and every model description read it.
__version__ = "0.2.0"
__date__ = "2026-11-22"  # of this version; FMUs that are built without SOURCE_DATE_EPOCH carry it


class BuildError(Exception):
    """An FMU cannot be built; the message is one sentence for the user."""
