"""Registry of integration methods: every module of this package that defines STAGES.

FMUs do not carry this module; loops over `methods` are unrolled at build time.
"""

from importlib import import_module
from pathlib import Path
from types import ModuleType


def find_methods() -> list[tuple[str, ModuleType, type]]:
    """Find all methods.

    Returns
    -------
    list
        Label, module and class of each method, ordered by number.
    """
    paths = Path(__file__).parent.glob("*.py")
    labels = [path.stem for path in paths if "\nSTAGES" in path.read_text(encoding="utf-8")]
    files = {label: import_module(f"{__package__}.{label}") for label in sorted(labels)}
    numbers = {label: file.NUMBER for label, file in files.items()}
    for label, number in numbers.items():
        if list(numbers.values()).count(number) > 1 or number <= 1:
            raise ValueError(
                f"{label}.py: method number {number} is in use; the next free one is {max(numbers.values()) + 1}"
            )
    rows = [(label, file, getattr(file, label.capitalize())) for label, file in files.items()]
    return sorted(rows, key=lambda row: row[1].NUMBER)


methods = find_methods()
