"""Declared rates of the inputs of an FMU, from the file resources/input_rates.json of FMUs of this project."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .fmu_archive import cached_by_mtime, read_json_resource

INPUT_RATES_FILE = "resources/input_rates.json"  # fmus/packaging/documentation_page.py writes it


@cached_by_mtime
def read_rate_inputs(fmu: Path) -> dict[str, tuple[str, ...]]:
    """Return the inputs on which the rate of each input with a rate depends; none for an FMU without the file.

    Raises
    ------
    HarnessError
        If the file is damaged.
    """
    return read_json_resource(fmu, INPUT_RATES_FILE, parse_rate_inputs) or {}


def parse_rate_inputs(content: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Return the inputs of rates from their JSON."""
    return {str(name): tuple(map(str, inputs)) for name, inputs in content.items()}
