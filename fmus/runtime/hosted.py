"""A declared model in the hands of a host, whatever the version of FMI: values, steps, failure, state.

Nothing here lets an exception into the host: the native layer would free what it still needs, and a host that is not
Python would abort.  What is wrong is remembered and said in one sentence, in the log and on standard error; do_step
then returns False and every calculated Real reads NaN.
"""

from contextlib import suppress
from math import fabs, inf, isfinite, nan
from weakref import WeakSet

from .boundary import announce, guarded, pass_on, printable
from .codes import DIVERGED, ENDLESS, OK, STALLED
from .declare import variables
from .march import MOST_CALLS, MOST_STEPS
from .state import NOWHERE, RUNNING, SETTABLE, SETTING_UP, Saved, shape

SENTENCES = {
    DIVERGED: "the motion leaves the range of numbers after t = {t!r} s; lower what drives it or check the parameters",
    STALLED: "the solver makes no headway after t = {t!r} s, its step is as small as the time axis can hold; "
    "raise solver.rtol or choose another solver.method",
    ENDLESS: f"more than {MOST_STEPS} internal steps or {MOST_CALLS} right-hand sides within one communication step, "
    "from t = {start!r} s on; choose another solver.method, raise solver.rtol or take shorter communication steps",
}
INTERRUPTED = "the run was interrupted after t = {t!r} s; reset the FMU to run again"

ERROR = 3  # a status of FMI, in all its versions
CALCULATED = ("output", "local")
MOST_READERS = 64  # an importer that asks for other lists all the time costs time, not memory


def hosting(slave, model):
    """The class of slaves of a model class, under its name.

    A spare instance says what there is: CPython 3.11 reads the attributes of an object whose __dict__ has been
    looked at twice as slowly, so nobody looks at that of an instance which runs.
    """
    spare = model()
    about = {"Model": model, "variables": variables(spare), "shape": shape(spare), "__module__": __name__}
    about["living"] = WeakSet()
    made = type(model.__name__, (slave,), about)
    made.bare = made  # an entry script may derive from it
    return made


def getter(kind, blank):
    """The method that reads variables of a kind; `blank` answers for those that are not there."""

    @guarded
    def get(slave, references):
        try:
            asked, values, counts, ahead = slave.asked[kind]
            if asked != references:
                asked, values, counts, ahead = slave.reader(kind, references, blank)
            if not slave.observed and not slave.failure:
                slave.observe()
            if counts and slave.observed:
                slave.recount(ahead)
            return values(slave.model)
        except BaseException as error:  # an exception that left Python would crash the host
            slave.rescue(error)
            return [blank for _ in references]

    return get


def setter(kind):
    """The method that writes variables of a kind."""

    @guarded
    def put(slave, references, values):
        try:
            for i, reference in enumerate(references):
                if slave.is_one(kind, reference):
                    slave.write(reference, values[i])
                else:  # and its value is not touched: a text that is not UTF-8 is no object at all
                    slave.refused.setdefault(NOWHERE, no_variable(kind, reference))
                    slave.observed = False
        except BaseException as error:  # as above
            slave.rescue(error)

    return put


class Hosted(Saved):
    """One instance of the model `Model`; a value reference is a place in `variables(model)`.

    A base class after this one has `instance_name` and log(sentence, status).
    """

    Model = variables = None  # of the subclass that hosting() makes

    @guarded
    def __init__(self, **kwargs):
        try:
            self.begin(**kwargs)
        except Exception:
            raise
        except BaseException as error:  # the layer that resets an instance needs the new one
            self.begin(**kwargs)
            self.rescue(error)

    def begin(self, **kwargs):
        """As after instantiation."""
        super().__init__(**kwargs)
        self.living.add(self)
        self.model = self.Model()
        self.owners = [self.owner(name) for name, _ in self.variables]
        self.readers = {}  # kind and value references -> what reads them; the same by kind, for those last asked for
        self.asked = dict.fromkeys(("Real", "Integer", "Boolean", "String"), (None, None, False, False))
        self.phase = SETTING_UP
        self.start_time, self.stop_time, self.given_tolerance = 0.0, inf, self.model.tolerance
        self.refused = {}  # name -> sentence: values that were set and cannot be used
        self.changed = False  # values were set since the motion was last settled
        self.observed = False  # the outputs are those of the present point
        self.failure = ""

    def place(self, name):
        """Where in the model a variable is."""
        return name

    def owner(self, name):
        """The object that holds a variable, and the name of the attribute there."""
        thing = self.model
        *path, last = self.place(name).split(".")
        for part in path:
            thing = getattr(thing, part)
        return thing, last

    # ---- the run

    @guarded
    def exit_initialization_mode(self):
        try:
            self.settle()
            self.phase = RUNNING
        except BaseException as error:  # as above
            self.rescue(error)
            self.phase = RUNNING

    @guarded
    def do_step(self, current_time, step_size):
        try:
            known = self.observed and self.phase == RUNNING  # nothing was set since the last point was read
            if not known and not self.prepared():
                return False
            end = current_time + step_size
            model = self.model
            march = model.solver
            step = march.step
            beside = (1.0 - 1e-14) * step.t1 <= end <= (1.0 + 1e-14) * step.t1
            if beside or not 0.0 <= self.start_time <= current_time == march.t < end < step.t_end:
                end = self.judged(current_time, step_size)
            if end > march.t:
                status = march.advance(model, end)
                if status != OK:
                    return self.give_up(status)
                if known:  # who has read the last point will read this one too
                    self.show(model, march)
            return not self.failure
        except BaseException as error:  # as above
            return self.rescue(error)

    def give_up(self, status):
        """Fail: an internal step could not be taken."""
        march = self.model.solver
        return self.fail(SENTENCES[status].format(t=march.step.t0, start=march.t))

    def prepared(self):
        """Whether the run can go on; values that were set are judged first."""
        if self.phase == SETTING_UP:
            self.exit_initialization_mode()
        if self.failure:
            return False
        return self.settle() if self.changed or self.refused else True

    def settle(self):
        """Take over what was set, or fail."""
        sentence = self.objection()
        if sentence:
            return self.fail(sentence)
        self.apply()
        return True

    def judged(self, current_time, step_size):
        """Where a communication step ends, which must begin at the present point and end by the stop time."""
        march = self.model.solver
        step = march.step
        now, stop = march.t, step.t_end
        end = current_time + step_size
        size = max(fabs(self.start_time), fabs(now), fabs(end))  # a time near 0 carries the rounding of the start
        if fabs(end - step.t1) <= 1e-15 * size < inf:
            end = step.t1  # the end of an internal step, but for the rounding of the sum
        elif stop < end < inf and end <= stop + 1e-6 * step_size + 1e-11 * size:
            end = stop  # a million steps that were added up end as far beyond it
        begins_here = fabs(current_time - now) <= 1e-6 * step_size + 4e-15 * size
        if not (step_size > 0.0 and begins_here and now <= end <= stop and end < inf):
            self.fail(
                f"a communication step of {step_size!r} s from t = {current_time!r} s is refused: it must be above "
                f"zero, begin at the present point, t = {now!r} s, and end by the stop time, t = {stop!r} s"
            )
            return now
        return end

    def objection(self):
        """What is wrong with the values as they stand, or nothing."""
        for sentence in self.refused.values():
            return sentence
        if not isfinite(self.start_time):
            return f"start time = {self.start_time!r} s is refused: it must be a finite number"
        if not self.stop_time > self.start_time:
            return (
                f"stop time = {self.stop_time!r} s is refused: it must be above the start time, {self.start_time!r} s"
            )
        rule = self.broken_rule()
        return self.model.rules[rule - 1].format_map(vars(self.model)) if rule else ""

    def broken_rule(self):
        """The number of the rule that the values break, or 0."""
        return self.model.prepare()

    def apply(self):
        """Let the motion begin, or go on from the present point, with values that have been found good."""
        model = self.model
        if self.phase == SETTING_UP:
            x, v = model.initial(self.start_time)
            model.solver.start(model, self.start_time, x, v, self.stop_time, self.given_tolerance)
        else:
            model.solver.restart(model)
        self.changed = self.observed = False

    # ---- failure

    def fail(self, sentence):
        """Say the sentence, and answer NaN from now on."""
        self.failure, self.observed = printable(sentence), False
        self.silence()
        self.say(sentence)
        return False

    def say(self, sentence):
        """In the log and on standard error."""
        self.log(printable(sentence), ERROR)
        announce(f"{type(self).__name__} ({self.instance_name}): {sentence}")

    def rescue(self, error):
        """Fail by an exception; one that is the host's, as an interrupt, reaches it when the call is over."""
        with suppress(Exception):
            if isinstance(error, Exception):
                self.fail(unforeseen(error, self.model))
            else:
                self.fail(INTERRUPTED.format(t=self.model.solver.t))
                self.passing = pass_on(error, self._get_log_queue()[-1])
        return False

    def silence(self):
        """Every calculated Real reads NaN."""
        for (_, declared), (thing, name) in zip(self.variables, self.owners):
            if declared.type == "Real" and declared.causality in CALCULATED:
                setattr(thing, name, nan)

    # ---- reading and writing

    def reader(self, kind, references, blank):
        """The references, what reads them, whether they tell of the solver, and whether it must look ahead first."""
        key = kind, *references
        if key in self.readers:
            self.asked[kind] = self.readers[key]
            return self.readers[key]
        there = [self.is_one(kind, reference) for reference in references]
        places = [self.place(self.variables[r][0]) if is_one else "" for r, is_one in zip(references, there)]
        terms = ["model." + place if place else "blank" for place in places]
        values = eval(f"lambda model: [{', '.join(terms)}]", {"blank": blank})  # no other is as fast
        found = list(references), values, any("." in place for place in places), "solver.t_next" in places
        if not all(there):
            self.say(no_variable(kind, references[there.index(False)]))
            return found
        if len(self.readers) == MOST_READERS:
            self.readers.clear()
        self.asked[kind] = self.readers[key] = found
        return found

    def is_one(self, kind, reference):
        """Whether a reference is that of a variable of the kind."""
        if not 0 <= reference < len(self.variables):
            return False
        return kind == ("Real" if self.variables[reference][1].type == "Real" else "Integer")

    def recount(self, ahead):
        """Bring what is told of solver and events to the present point; `ahead`: also where the next step ends."""
        model = self.model
        model.solver.report(model.events)
        if ahead:
            model.solver.look_ahead(model)

    def observe(self):
        """Bring the outputs to the present point; NaN while the values cannot be used."""
        model = self.model
        if self.changed or self.refused or self.phase == SETTING_UP:
            if self.objection():
                self.silence()
                return
            self.apply()
        self.show(model, model.solver)
        if not self.observed:
            raise OverflowError

    def show(self, model, march):
        """Set the outputs; the energy overflows first, for it has squares and products of the others."""
        model.observe(march.t, march.x, march.v, march.mode)
        self.observed = model.energy < inf

    def write(self, reference, value):
        """Take over a value; one that cannot be used is remembered, and told by the next step."""
        name, declared = self.variables[reference]
        thing, attribute = self.owners[reference]
        if value == getattr(thing, attribute) and name not in self.refused:
            return
        self.observed = False
        self.refused.pop(name, None)
        if declared.causality not in SETTABLE:
            self.refused[name] = f"{name} = {value!r} is refused: {declared.text} is calculated, not set"
        elif self.phase == RUNNING and declared.variability == "fixed":
            self.refused[name] = (
                f"{name} = {value!r} is refused: {declared.text} is fixed, it must be set before "
                "initialisation ends; reset the FMU to change it"
            )
        elif not declared.accepts(value):
            self.refused[name] = declared.refusal(name, value)
        else:
            if not self.changed and self.phase == RUNNING:
                self.model.rebase(self.model.solver.t)
            self.changed = True
            setattr(thing, attribute, value)


def no_variable(kind, reference):
    """The sentence about a value reference, which the layer hands over as if it had a sign."""
    return (
        f"value reference {reference & 0xFFFFFFFF} is refused: it is not that of a variable of type {kind}; "
        "the model description of this very FMU has those that are"
    )


def unforeseen(error, model):
    """The sentence for an exception; plain floats raise where C gives infinity or NaN."""
    if isinstance(error, (ArithmeticError, ValueError)) and not isinstance(error, UnicodeError):
        return SENTENCES[DIVERGED].format(t=model.solver.step.t0)
    return f"unforeseen {type(error).__name__}: {error}; please report it with the values of the run"
