"""What a model and an offer fix, and the names of the numbers of a vector."""

import re
from dataclasses import dataclass, field

from .. import BuildError

STATES, CONTACTS = "states", "contacts"  # what a vector may run over
NAMED_VECTOR = re.compile(r"(y|f|modes)(\d*|_\w+)")  # of the vectors that go by names of the model


@dataclass(frozen=True)
class ModelLayout:
    """What is fixed when the numerics are written out.

    states      each state, with the name of its rate, which may be another state
    contacts    the mode of each contact, with the state that is its slip, if one is
    flags       attribute -> its value: has_dry_friction, is_linear, ...
    choices     attribute -> all the values that it can have: method_number, friction, ...
    gone        labels of what is not offered
    methods     label -> class, of those methods with steps that are offered
    """

    states: dict[str, str]
    contacts: dict[str, str]
    flags: dict[str, bool] = field(default_factory=dict)
    choices: dict[str, tuple[int, ...]] = field(default_factory=dict)
    excluded: frozenset[str] = frozenset()
    methods: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = {*self.states, *self.states.values(), *self.contacts}
        for name in names:
            if (other := name.rstrip("0123456789")) in names - {name}:
                raise BuildError(f"{name} is what {other} is called at a stage of a step; take another name.")

    def component_names(self, kind: str) -> list[str]:
        """The names of the states, or of the modes."""
        return list(self.states if kind == STATES else self.contacts)

    @property
    def dynamic_states(self) -> list[int]:
        """The places of the rates that are calculated; the others are states."""
        return [place for place, rate in enumerate(self.states.values()) if rate not in self.states]

    @property
    def velocity_states(self) -> list[int]:
        """The places of the states that are the rate of another."""
        return [place for place, state in enumerate(self.states) if state in self.states.values()]

    def slip(self, contact: int) -> int:
        """The place of the slip of a contact among the states; of one that is an expression nobody needs it."""
        name = list(self.contacts.values())[contact]
        return list(self.states).index(name) if name else -1

    def place(self, contact: int) -> int:
        """The place of the state whose rate the slip of a contact is."""
        name = list(self.contacts.values())[contact]
        return list(self.states.values()).index(name) if name else -1

    def contact_suffix(self, contact: int) -> str:
        """What tells what belongs to one contact from what belongs to another."""
        return f"_{list(self.contacts)[contact]}" if len(self.contacts) > 1 else ""

    def component_name(self, vector: str, kind: str, place: int) -> str:
        """The name of one number of a vector: x2 of y2, a2 of f2, mode0 of modes0; e_x of e."""
        part = self.component_names(kind)[place]
        found = NAMED_VECTOR.fullmatch(vector)
        if not found:
            return vector + (self.contact_suffix(place) if kind == CONTACTS else f"_{part}")
        stem, suffix = found.groups()
        part = self.states[part] if stem == "f" else part
        return part + ("_" if suffix.isdigit() and part[-1].isdigit() else "") + suffix

    def jacobian_entry(self, rate: int, state: int) -> str:
        """The name of an entry of the Jacobian."""
        return f"{list(self.states.values())[rate]}_{list(self.states)[state]}"
