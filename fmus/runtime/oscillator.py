"""One degree of freedom: what all oscillators share."""

from math import inf

from .variable_declarations import Count, Local, VariableOwner


class Events(VariableOwner):
    """Changes of mode up to the present point."""

    count = Count("changes of mode up to the present point")
    t_last = Local("s", "time of the last change of mode; the start time before the first")


class Oscillator(VariableOwner):
    """An oscillator of some states, those of one body where it does not say otherwise, under names of its own.

    A model owns `solver`, a March, and says, of all its states and modes in their order,
        initial(t)                     the states at the start, which is at time t
        prepare()                      constants that follow from the values; 0, or the number of the broken rule
        rates(t, states, modes)        those that are no states; a mode is the direction of sliding, 0 where the law
                                       itself looks at the speed
        jacobian(t, states, modes)     for each of these its derivatives by t and by the states, for rodas
        observe(t, states, modes)      sets the outputs; whether they are numbers
    and if it is linear, between its modes, m v' + c v + k x = F + k u t,
        piece()                        m, c, k and u
        push(t, modes)                 what of the acceleration is due to forces, at x = v = 0
        push_rate(t, n)                the n-th derivative of that, where inputs have any
    """

    states: dict[str, str] = {"x": "v", "v": "a"}  # name -> name of its rate, which may be a state
    contacts: dict[str, str] = {}  # name of the mode -> the state that is its slip
    has_dry_friction = False  # friction with modes: see automaton.py
    rests_when_stuck = False  # while its contact is stuck nothing moves
    is_coupled = False  # a contact may be stuck while something moves
    has_driver = False  # it follows a driver, who stood at x_base at the time t_base and moves at the speed drive()
    has_input_derivatives = (
        False  # its inputs have derivatives, those in input_course at the time t_base; some bend, if bends()
    )
    is_linear = False  # piecewise linear: see exact.py
    rules: tuple[str, ...] = ()  # one sentence for each rule that binds several values, in their names
    own_solver_rule = 0  # the number of the rule that is about our solver, and does not bind an importer's
    stop_time = 4.0
    step_size = 0.004
    tolerance = 1e-6

    def __init__(self):
        super().__init__()
        self.events = Events()

    def nominal_velocity(self):
        """The speed, in m/s or rad/s, that an absolute tolerance must resolve; inf where none is special."""
        return inf

    def driver_velocity(self):
        """The speed of the driver."""
        return 0.0

    def rebase(self, t):
        """Fix at time t what is integrated in closed form, before a value changes: where the driver is."""
        if self.has_driver:
            self.t_base, self.x_base = t, self.x_base + self.driver_velocity() * (t - self.t_base)
