"""Build-time package: turns a declared model into an FMU file."""

# The only definition of the version; pyproject.toml and every model description read it.
__version__ = "0.1.0"


class BuildError(Exception):
    """Raised when an FMU cannot be built; the message is one sentence for the user."""
