"""Base class of all models: protocol between a model and the solver."""

from math import inf

from .variable_declarations import Count, Local, VariableOwner


class Events(VariableOwner):
    """Statistics of mode changes up to the current time."""

    count = Count("changes of mode up to the current time")
    t_last = Local("s", "time of the last change of mode; the start time if there is none")


class Oscillator(VariableOwner):
    """Oscillator with one or more states.

    The generated model class owns `solver`, an Integrator, and defines

        initial_state(t)               states at the start time t
        prepare()                      constants that depend on parameters; returns OK, or the status of a violated rule
        rates(t, states, modes)        rates that are not states themselves; a mode is the direction of sliding, or 0
                                       where the friction law evaluates the velocity itself
        jacobian(t, states, modes)     for each of these rates its derivatives by t and by the states (for rodas)
        compute_outputs(t, states, modes)   sets the outputs; returns whether all are finite
        update_conditions(t, states, modes)   evaluates the conditions into `event_location`, if there are any

    A model that is linear between its changes of mode, m v' + c v + k x = F + k u t, also defines

        linear_coefficients()          m, c, k and u
        applied_acceleration(t, modes) acceleration due to forces, at x = v = 0
        applied_acceleration_derivative(t, n)   n-th derivative of that, if inputs have derivatives
    """

    states: dict[str, str] = {"x": "v", "v": "a"}  # state -> its rate, which may be a state
    contacts: dict[str, str] = {}  # mode -> state that is the slip velocity of the contact
    has_dry_friction = False  # friction with modes (stick_slip.py)
    has_other_laws = False  # friction laws without stick and slip: law_modes() is defined
    rests_when_stuck = False  # a single body: nothing moves while its contact sticks
    is_coupled = False  # a contact may stick while something moves (contact_lcp.py)
    has_variable_levers = False  # the lever of a contact force changes with the motion, and may vanish
    has_nominal_velocity = False  # nominal_velocity() is defined
    checks_event_steps = False  # steps to events are checked: see InternalStep.is_accurate_at
    has_driver = False  # the driver is at x_base at time t_base and moves at driver_velocity()
    has_input_derivatives = False  # inputs are polynomials around t_base; has_higher_order() if any order exceeds 1
    is_linear = False  # piecewise linear (linear_closed_form.py)
    has_conditions = False  # choose() with conditions that change during a step (event_location.py)
    # event functions: number, first of a condition; conditions that switch; status of the first of the others, limits
    n_event_functions = first_condition = n_switches = first_limit_rule = 0
    rules: dict[int, str] = {}  # status of each rule that values must satisfy -> message; fields are their names
    stop_time = 4.0
    step_size = 0.004
    tolerance = 1e-6

    def __init__(self):
        super().__init__()
        self.events = Events()

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
