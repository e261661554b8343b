"""Capabilities of an FMU of this project."""

from dataclasses import dataclass
from typing import Any

from ..scenes.fmu_files import find_fmu
from .fmu_variables import METHOD
from .model_data import read_model_data
from .runner import read_own_description
from .variable_values import enumeration_labels


@dataclass(frozen=True)
class FmuInfo:
    """Capabilities of an FMU: methods, start values of parameters and inputs, enumerations, default stop in s."""

    methods: tuple[str, ...]
    default_method: str  # a method
    start_values: dict[str, float]
    enumerations: dict[str, dict[str, int]]
    stop: float

    def resolve_labels(self, values: dict[str, Any]) -> dict[str, float]:
        """Replace enumeration labels by numbers."""
        return {
            name: self.enumerations[name][value] if isinstance(value, str) else value for name, value in values.items()
        }


def read_info(model: str) -> FmuInfo:
    """Return the capabilities of a model's FMU."""
    fmu = find_fmu(model)
    description = read_own_description(fmu)
    settable = [variable for variable in description.modelVariables if variable.causality in ("parameter", "input")]
    enumerations = {variable.name: variable for variable in settable if variable.type == "Enumeration"}
    choices = {
        name: {label: number for number, label in enumeration_labels(variable).items()}
        for name, variable in enumerations.items()
    }
    defaults = {
        variable.name: int(variable.start) if variable.name in choices else float(variable.start)
        for variable in settable
    }
    fixed_choices = read_model_data(fmu).fixed_choices
    choices |= {name: {label: number} for name, (label, number) in fixed_choices.items()}
    methods = {number: label for label, number in choices[METHOD].items()}
    default = methods[fixed_choices[METHOD][1] if METHOD in fixed_choices else int(defaults[METHOD])]
    return FmuInfo(tuple(methods.values()), default, defaults, choices, float(description.defaultExperiment.stopTime))
