"""One degree of freedom: what all oscillators share."""

from math import inf

from .declare import Count, Declaring, Local


class Events(Declaring):
    """Changes of mode up to the present point."""

    count = Count("changes of mode up to the present point")
    t_last = Local("s", "time of the last change of mode; the start time before the first")


class Oscillator(Declaring):
    """An oscillator of position x and speed v, whatever the model calls them.

    A model owns `solver`, a March, and says
        initial(t)                     position and speed at the start, which is at time t
        prepare()                      constants that follow from the values; 0, or the number of the broken rule
        rates(t, x, v, mode)           those that are no states: the acceleration; mode is the direction of sliding, 0
                                       where the law itself looks at v
        jacobian(t, x, v, mode)        derivatives of that rate by t, x and v, for rodas
        observe(t, x, v, mode)         sets the outputs; whether they are numbers
    """

    dry = False  # friction with modes: see automaton.py
    driven = False  # it follows a driver, who stood at x_base at the time t_base and moves at the speed drive()
    linear = False  # piecewise linear: it owns `exact` and has push(t, mode); see exact.py
    rules: tuple[str, ...] = ()  # one sentence for each rule that binds several values, in their names
    own_solver = 0  # the number of the rule that is about our solver, and does not bind an importer's
    stop_time = 4.0
    step_size = 0.004
    tolerance = 1e-6

    def __init__(self):
        super().__init__()
        self.events = Events()

    def finest(self):
        """The speed, in m/s or rad/s, that an absolute tolerance must resolve; inf where none is special."""
        return inf

    def drive(self):
        """The speed of the driver."""
        return 0.0

    def rebase(self, t):
        """Fix at time t what is integrated in closed form, before a value changes: where the driver is."""
        if self.driven:
            self.t_base, self.x_base = t, self.x_base + self.drive() * (t - self.t_base)
