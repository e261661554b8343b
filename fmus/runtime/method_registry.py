"""The methods there are: every file of this folder that says how many STAGES a step takes.  This one stays at home.

Where it is asked which one is in force, one of them is, or the closed form, which asks for none.
"""

from importlib import import_module
from pathlib import Path
from types import ModuleType


def find_methods() -> list[tuple[str, ModuleType, type]]:
    """Label, file and class of each, in the order of their numbers."""
    paths = Path(__file__).parent.glob("*.py")
    labels = [path.stem for path in paths if "\nSTAGES" in path.read_text(encoding="utf-8")]
    files = {label: import_module(f"{__package__}.{label}") for label in sorted(labels)}
    numbers = {label: file.NUMBER for label, file in files.items()}
    for label, number in numbers.items():
        if list(numbers.values()).count(number) > 1 or number <= 1:
            raise ValueError(f"{label}.py: the number {number} is taken; the next is {max(numbers.values()) + 1}")
    rows = [(label, file, getattr(file, label.capitalize())) for label, file in files.items()]
    return sorted(rows, key=lambda row: row[1].NUMBER)


methods = find_methods()
