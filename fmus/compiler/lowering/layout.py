"""Facts fixed by a model and its features, and the names of vector components."""

from dataclasses import dataclass, field

STATES, CONTACTS, CONDITIONS = "states", "contacts", "conditions"  # what a vector may run over


def component_name(vector: str, *names: str) -> str:
    """Return the name of a component of a vector, such as y2_x, or of an entry of a matrix, such as J_v_x.

    Underscores in names of the model are doubled, so that the names of two components are never equal.
    """
    return "_".join([vector, *(name.replace("_", "__") for name in names)])


@dataclass(frozen=True)
class ModelLayout:
    """Facts that are fixed when the runtime is lowered.

    states      state -> name of its rate, which may be another state
    contacts    mode of each contact -> the state that is its slip, if any
    flags       attribute -> its value: has_dry_friction, is_linear, ...
    choices     attribute -> its possible values: method_number, friction, ...
    excluded_labels
                labels of excluded methods and laws
    methods     label -> class of the included methods that take steps
    zeros       entries of the Jacobian (index of a state, index of a state) that are always zero
    n_conditions
                number of conditions of the equations
    angles      states that are angles and enter the equations by periodic functions only
    planar      modes of the contacts in a plane
    axes        speeds along the two axes of a plane, in pairs
    """

    states: dict[str, str]
    contacts: dict[str, str]
    flags: dict[str, bool] = field(default_factory=dict)
    choices: dict[str, tuple[int, ...]] = field(default_factory=dict)
    excluded_labels: frozenset[str] = frozenset()
    methods: dict[str, str] = field(default_factory=dict)
    zeros: frozenset[tuple[int, int]] = frozenset()
    n_conditions: int = 0
    angles: tuple[str, ...] = ()
    planar: tuple[str, ...] = ()
    axes: tuple[tuple[str, str], ...] = ()

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
    def states_with_exchanged_axes(self) -> list[int]:
        """Indices of the states, where those along the two axes of a plane stand in the place of each other."""
        names = list(self.states)
        other = dict(self.axes) | {y: x for x, y in self.axes}
        position = {speed: state for state, speed in self.states.items()}
        other |= {position[x]: position[y] for x, y in other.items() if x in position and y in position}
        return [names.index(other.get(name, name)) for name in names]

    @property
    def angle_states(self) -> list[int]:
        """Indices of the angles that enter the equations by periodic functions only."""
        return [place for place, state in enumerate(self.states) if state in self.angles]

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

    def is_planar(self, contact: int) -> bool:
        """Return whether a contact acts in a plane."""
        return list(self.contacts)[contact] in self.planar

    def contact_suffix(self, contact: int) -> str:
        """Return the suffix of names that belong to a contact; empty for a single contact."""
        return f"_{list(self.contacts)[contact]}" if len(self.contacts) > 1 else ""

    def component_name(self, vector: str, kind: str, place: int) -> str:
        """Return the name of a component of a vector."""
        return component_name(vector, self.component_names(kind)[place])

    def entry_name(self, matrix: str, row: int, column: int) -> str:
        """Return the name of an entry of a matrix of states."""
        states = list(self.states)
        return component_name(matrix, states[row], states[column])
