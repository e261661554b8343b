"""Base class of all models: what a model offers to the solver.

A model holds no solver.  `RunState` (run_state.py) creates one for it and passes the model to it in every call.

Methods with a docstring only are declarations: the generated class of a model defines those that its flags require, and
FMUs do not carry them. stick_slip.py and contact_lcp.py declare the methods of models with dry friction. A state vector
runs over the states of a model, and a contact vector over its contacts; generated methods take and return their
components.
"""

from math import inf
from typing import Any

from .variable_declarations import VariableOwner
from .vectors import ConditionVector, ContactVector, Derivatives, Rates, StateVector


class Oscillator(VariableOwner):
    """Oscillator with one or more states.

    Its constructor creates all attributes.  No variable of a model has the name of an attribute of this class or of
    those derived from it (reserved_names.py).
    """

    solver_class: Any  # Integrator with the methods that suit the model
    friction: int  # friction law, of models with contacts
    inconsistent_input: int  # index, from 1, of a prescribed input that jumps again and again against its rate; or 0
    # of each condition: 1.0 where it holds, else -1.0, or the piece of its table; the solver sets them at events
    condition_sides: list[float]
    condition_pieces: list[float]  # of each condition: the piece of its table at the latest evaluation, or -1.0
    condition_texts: tuple[str, ...]  # of each condition: what changes where its event function falls to zero
    condition_units: tuple[str, ...]  # of each condition: the unit of its margin
    violation_time: float  # when a condition that must hold was violated
    violation_value: float  # its value then
    x_base: float  # position of the driver at t_base
    t_base: float  # time of the last change of its speed, or of an input with derivatives

    states: dict[str, str] = {"x": "v", "v": "a"}  # state -> its rate, which may be a state
    contacts: dict[str, str] = {}  # mode -> state that is the slip velocity of the contact
    angles: tuple[str, ...] = ()  # states in rad that enter the equations by periodic functions only
    has_dry_friction = False  # friction with modes (stick_slip.py)
    has_other_laws = False  # friction laws without stick and slip: law_modes() is defined
    rests_when_stuck = False  # a single body: nothing moves while its contact sticks
    is_coupled = False  # a contact may stick while something moves (contact_lcp.py)
    has_variable_levers = False  # the lever of a contact force changes with the motion, and may vanish
    has_slip_conditions = False  # a slip velocity depends on conditions, with which it may jump
    has_nominal_velocity = False  # nominal_velocity() is defined
    checks_event_steps = False  # steps to events are checked: see method_step.is_accurate_at
    has_driver = False  # the driver is at x_base at time t_base and moves at driver_velocity()
    has_input_derivatives = False  # inputs are polynomials around t_base
    prescribed_inputs: tuple[tuple[str, str], ...] = ()  # names of each input with a declared rate, and of its rate
    counts_jumps = False  # the importer sets some of these rates: count_jumps() is defined
    has_prescribed_slips = False  # some of them are part of a slip: slip_deviations() is defined
    is_linear = False  # piecewise linear (linear_closed_form.py)
    real_only = False  # the FMU offers Reals only, for hosts without other types
    has_pieces = False  # the piece of a table may change during a step: update_pieces() is defined
    has_conditions = False  # choose() with conditions that change during a step (event_location.py)
    # event functions: number, first of a condition; conditions that switch; status of the first of the others, limits
    n_event_functions = first_condition = n_switches = first_limit_rule = 0
    rules: dict[int, str] = {}  # status of each rule that values must satisfy -> message; fields are their names
    stop_time = 4.0
    step_size = 0.004
    tolerance = 1e-6

    def prepare(self) -> int:
        """Compute the constants that depend on parameters; return OK, or the status of a violated rule."""

    def initial_state(self, t: float) -> StateVector:
        """Return the states at the start time t."""

    def rates(self, t: float, y: StateVector, modes: ContactVector) -> Rates:
        """Return the rates of the states; a generated method returns those that are not states themselves.

        A mode is the direction of sliding, or 0 where the friction law evaluates the velocity itself.
        """

    def rate_magnitudes(self, t: float, y: StateVector, modes: ContactVector) -> Rates:
        """Return bounds on the magnitudes of the terms of these rates, to which their rounding errors are relative."""

    def jacobian(self, t: float, y: StateVector, modes: ContactVector) -> Derivatives:
        """Return the derivatives of these rates by t and by the states, for implicit methods."""

    def fastest_clock(self, t: float, y: StateVector, modes: ContactVector) -> float:
        """Return the largest rate (1/s) at which clocks, states with constant rates, change functions, or 0."""

    def compute_outputs(self, t: float, y: StateVector, modes: ContactVector) -> bool:
        """Set the outputs; return whether all are finite."""

    def condition_margins(
        self, t: float, y: StateVector, modes: ContactVector
    ) -> tuple[ConditionVector, ConditionVector]:
        """Return the margins of the conditions, if there are any, and the scales of their rounding errors."""

    def update_pieces(self, t: float, y: StateVector, modes: ContactVector) -> None:
        """Find the pieces of tables that contain their arguments, if there are any."""

    def linear_coefficients(self) -> tuple[float, float, float, float]:
        """Return m, c, k and u of a linear model: m v' + c v + k x = F + k u t between changes of mode."""

    def applied_acceleration(self, t: float, modes: ContactVector) -> float:
        """Return the acceleration of a linear model due to forces, at x = v = 0."""

    def applied_acceleration_rate(self, t: float) -> float:
        """Return the rate of that, if inputs have derivatives."""

    def set_input_rates(self, t: float) -> None:
        """Set the rates of inputs with derivatives."""

    def count_jumps(self) -> None:
        """Note the input that jumps at many communication points in succession, against its rate."""

    def has_moving_inputs(self) -> bool:
        """Return whether an input varies between settings."""

    def nominal_velocity(self):
        """Return the velocity (m/s or rad/s) that the absolute tolerance must resolve; inf if there is none."""
        return inf

    def driver_velocity(self):
        """Return the velocity of the driver."""
        return 0.0

    def rebase(self, t):
        """Move the reference of closed-form motions (the driver) to time t, before a parameter changes."""
        if self.has_driver:
            self.t_base, self.x_base = t, self.x_base + self.driver_velocity() * (t - self.t_base)
