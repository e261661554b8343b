"""Writes resources/model_data.json: what the harness reads of an FMU beyond its model description."""

import json
from typing import Any

from ..compiler.equations.model_analysis import ModelAnalysis
from ..runtime.variable_declarations import VariableOwner, exported_name
from .fmi_variables import Variables, fixed_choices, mode_names
from .model_description import type_attributes

MODEL_DATA_FILE = "resources/model_data.json"  # harness/simulation/model_data.py reads it


def model_data(model: type[VariableOwner], declared: Variables, analysis: ModelAnalysis) -> bytes:
    """Return the content of the file.

    tables
        Points of the lookup tables.
    contacts
        Name of the mode of each contact, by that of its friction force.
    rate_inputs
        Names of the inputs on which the rate of an input depends, by its name.
    fixed_choices
        Label and number of the method, law or other enumeration that the build fixed, and that is no variable.
    exclusive_bounds
        Names of the attributes `min` and `max` that are exclusive, by variable: FMI has no open bounds.
    """
    bounds = {
        exported_name(name, meaning): [
            attribute
            for attribute, is_open in (("min", meaning.above >= meaning.low), ("max", meaning.below <= meaning.high))
            if is_open and attribute in type_attributes(name, meaning)
        ]
        for name, meaning in declared
    }
    content: dict[str, Any] = {
        "tables": [table.as_json() for table in analysis.tables],
        "contacts": mode_names(model, declared),
        "rate_inputs": analysis.rate_inputs,
        "fixed_choices": {
            name: {"label": label, "value": value}
            for name, meaning in fixed_choices(model)
            for label, value, _ in meaning.items
        },
        "exclusive_bounds": {name: attributes for name, attributes in bounds.items() if attributes},
    }
    return (json.dumps(content, indent=1) + "\n").encode()
