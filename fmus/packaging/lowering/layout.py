"""Facts fixed by a model and its features, and the names of vector components."""

import re
from dataclasses import dataclass, field

STATES, CONTACTS, CONDITIONS = "states", "contacts", "conditions"  # what a vector may run over
# names of vectors whose components are named after the states, rates and modes of the model
NAMED_VECTOR = re.compile(r"(y|f|modes)(\d*|_\w+)")


def stage_name(name: str, suffix: str, separator: str) -> str:
    """Return the name of a state, rate or mode at a stage of a step: x2, x_end; x1_2 where it ends in a digit."""
    if suffix.isdigit() and name[-1].isdigit():
        separator = separator or "_"
    return f"{name}{separator}{suffix}" if suffix else name


@dataclass(frozen=True)
class ModelLayout:
    """Facts that are fixed when the runtime is lowered.

    states      state -> name of its rate, which may be another state
    contacts    mode of each contact -> the state that is its slip, if any
    flags       attribute -> its value: has_dry_friction, is_linear, ...
    choices     attribute -> its possible values: method_number, friction, ...
    excluded    labels of excluded methods and laws
    methods     label -> class of the included methods that take steps
    zeros       entries of the Jacobian (index of a state, index of a state) that are always zero
    n_conditions
                number of conditions of the equations
    separator   between the name of a state and the number of a stage
    """

    states: dict[str, str]
    contacts: dict[str, str]
    flags: dict[str, bool] = field(default_factory=dict)
    choices: dict[str, tuple[int, ...]] = field(default_factory=dict)
    excluded: frozenset[str] = frozenset()
    methods: dict[str, str] = field(default_factory=dict)
    zeros: frozenset[tuple[int, int]] = frozenset()
    n_conditions: int = 0
    separator: str = ""

    def component_names(self, kind: str) -> list[str]:
        """Return the names of the states or modes."""
        return list(self.states if kind == STATES else self.contacts)

    def size(self, kind: str) -> int:
        """Return the number of components of a vector."""
        return self.n_conditions if kind == CONDITIONS else len(self.component_names(kind))

    @property
    def dynamic_states(self) -> list[int]:
        """Indices of states whose rates are computed; the other rates are states."""
        return [place for place, rate in enumerate(self.states.values()) if rate not in self.states]

    @property
    def kinematic_states(self) -> list[int]:
        """Indices of states whose rates are states."""
        return [place for place, rate in enumerate(self.states.values()) if rate in self.states]

    @property
    def velocity_states(self) -> list[int]:
        """Indices of the states that are rates of other states."""
        return [place for place, state in enumerate(self.states) if state in self.states.values()]

    def rate_place(self, state: int) -> int:
        """Return the index of the state that is the rate of a state."""
        return list(self.states).index(list(self.states.values())[state])

    def slip(self, contact: int) -> int:
        """Return the index of the slip of a contact among the states; -1 if it is an expression."""
        name = list(self.contacts.values())[contact]
        return list(self.states).index(name) if name else -1

    def place(self, contact: int) -> int:
        """Return the index of the state whose rate is the slip of a contact."""
        name = list(self.contacts.values())[contact]
        return list(self.states.values()).index(name) if name else -1

    def contact_suffix(self, contact: int) -> str:
        """Return the suffix of names that belong to a contact; empty for a single contact."""
        return f"_{list(self.contacts)[contact]}" if len(self.contacts) > 1 else ""

    def component_name(self, vector: str, kind: str, place: int) -> str:
        """Return the name of a component: x2 of y2, a2 of f2, mode0 of modes0, e_x of e."""
        part = self.component_names(kind)[place]
        match = NAMED_VECTOR.fullmatch(vector)
        if not match:
            return vector + (self.contact_suffix(place) if kind == CONTACTS else f"_{part}")
        stem, suffix = match.groups()
        part = self.states[part] if stem == "f" else part
        return stage_name(part, suffix, self.separator)

    def jacobian_entry(self, rate: int, state: int) -> str:
        """Return the name of an entry of the Jacobian."""
        return f"{list(self.states.values())[rate]}_{list(self.states)[state]}"
