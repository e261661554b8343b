"""A declared model in the hands of a host, whatever the version of FMI: values, steps, failure, state.

Nothing here lets an exception into the host: the native layer would free what it still needs, and a host that is not
Python would abort.  What is wrong is remembered and said in one sentence, in the log and on standard error; do_step
then returns False and every calculated Real reads NaN.
"""

import json
import sys
from math import fabs, inf, isfinite, nan

from .declare import variables
from .march import ENDLESS, MOST_CALLS, MOST_STEPS
from .step import DIVERGED, OK, STALLED

SENTENCES = {
    DIVERGED: "the motion leaves the range of numbers after t = {t!r} s; lower what drives it or check the parameters",
    STALLED: "the solver makes no headway after t = {t!r} s, its step is as small as the time axis can hold; "
    "raise solver.rtol or choose another solver.method",
    ENDLESS: f"more than {MOST_STEPS} internal steps or {MOST_CALLS} right-hand sides within one communication step, "
    "from t = {start!r} s on; choose another solver.method, raise solver.rtol or take shorter communication steps",
}

SETTING_UP, RUNNING = 0, 1
ERROR = 3  # a status of FMI, in all its versions
CALCULATED, SETTABLE = ("output", "local"), ("parameter", "input")
KEPT = ("phase", "start_time", "stop_time", "given_tolerance", "changed", "failure")


class NotThere(LookupError):
    """A value reference that no variable of the kind has."""


def hosting(slave, model):
    """The class of slaves of a model class, under its name.

    A spare instance says what there is: CPython 3.11 reads the attributes of an object whose __dict__ has been
    looked at twice as slowly, so nobody looks at that of an instance which runs.
    """
    spare = model()
    about = {"Model": model, "variables": variables(spare), "shape": shape(spare), "__module__": __name__}
    return type(model.__name__, (slave,), about)


def getter(kind, blank):
    """The method that reads variables of a kind; `blank` answers for those that are not there."""

    def get(slave, references):
        try:
            asked, values, counts, ahead = slave.asked[kind]
            if asked != references:
                asked, values, counts, ahead = slave.reader(kind, references)
            if not slave.observed and not slave.failure:
                slave.observe()
            if counts and slave.observed:
                slave.recount(ahead)
            return values(slave.model)
        except BaseException as error:  # an exception that left Python would crash the host
            slave.fail(unforeseen(error, slave.model))
            return [blank for _ in references]

    return get


def setter(kind):
    """The method that writes variables of a kind."""

    def put(slave, references, values):
        try:
            for reference, value in zip(references, values):
                slave.write(kind, reference, value)
        except BaseException as error:  # as above
            slave.fail(unforeseen(error, slave.model))

    return put


class Hosted:
    """One instance of the model `Model`; a value reference is a place in `variables(model)`.

    A base class after this one has `instance_name` and log(sentence, status).
    """

    Model = variables = shape = None  # of the subclass that hosting() makes
    kept: tuple[str, ...] = KEPT  # what a state holds beside the model

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
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

    def exit_initialization_mode(self):
        try:
            self.settle()
        except BaseException as error:  # as above
            self.fail(unforeseen(error, self.model))
        self.phase = RUNNING

    def do_step(self, current_time, step_size):
        try:
            known = self.observed and self.phase == RUNNING  # nothing was set since the last point was read
            if not known and not self.prepared():
                return False
            model, end = self.model, current_time + step_size
            march = model.solver
            step = march.step
            beside = (1.0 - 1e-14) * step.t1 <= end <= (1.0 + 1e-14) * step.t1
            if beside or not 0.0 <= self.start_time <= current_time == march.t < end < step.t_end:
                end = self.judged(current_time, step_size)
            start = march.t
            if end > start:
                status = march.advance(model, end)
                if status != OK:
                    return self.fail(SENTENCES[status].format(t=step.t0, start=start))
                if known:  # who has read the last point will read this one too
                    model.observe(march.t, march.x, march.v, march.mode)
            return not self.failure
        except BaseException as error:  # as above
            return self.fail(unforeseen(error, self.model))

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
        self.failure, self.observed = sentence, False
        self.silence()
        self.log(sentence, ERROR)
        if sys.stderr is not None:
            print(f"{type(self).__name__} ({self.instance_name}): {sentence}", file=sys.stderr, flush=True)
        return False

    def silence(self):
        """Every calculated Real reads NaN."""
        for (_, declared), (thing, name) in zip(self.variables, self.owners):
            if declared.type == "Real" and declared.causality in CALCULATED:
                setattr(thing, name, nan)

    # ---- reading and writing

    def reader(self, kind, references):
        """The references, what reads them, whether they tell of the solver, and whether it must look ahead first."""
        key = kind, *references
        if key not in self.readers:
            places = [self.place(self.variable(kind, reference)[0]) for reference in references]
            values = eval(f"lambda model: [{', '.join('model.' + place for place in places)}]")  # no other is as fast
            solver = any("." in place for place in places)
            self.readers[key] = list(references), values, solver, "solver.t_next" in places
        self.asked[kind] = self.readers[key]
        return self.readers[key]

    def variable(self, kind, reference):
        """Name and declaration of a reference."""
        if 0 <= reference < len(self.variables):
            name, declared = self.variables[reference]
            if kind == ("Real" if declared.type == "Real" else "Integer"):
                return name, declared
        raise NotThere(
            f"value reference {reference} is refused: it is not that of a variable of type {kind}; "
            "the model description of this very FMU has those that are"
        )

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
        march = model.solver
        model.observe(march.t, march.x, march.v, march.mode)
        self.observed = True

    def write(self, kind, reference, value):
        """Take over a value; one that cannot be used is remembered, and told by the next step."""
        name, declared = self.variable(kind, reference)
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

    # ---- state

    def _get_fmu_state(self):
        kept = {name: getattr(self, name) for name in self.kept}
        return kept | {"origin": __name__, "refused": dict(self.refused), "model": numbers(self.model, self.shape)}

    @staticmethod
    def _fmu_state_from_bytes(state):
        """The state in the bytes; what cannot be read becomes a state of no FMU, which is refused when it is set."""
        try:
            return json.loads(state)
        except ValueError:
            return {}

    def _set_fmu_state(self, state):
        try:
            origin = state.get("origin") if isinstance(state, dict) else None
            if origin != __name__:
                self.fail(f"a state of {origin} is refused: it must be of {__name__}; take it from this very FMU")
                return
            for name in self.kept:
                setattr(self, name, state[name])
            self.refused = dict(state["refused"])
            take_over(self.model, state["model"])
            self.observed = False
        except BaseException as error:  # as above
            self.fail(unforeseen(error, self.model))


def shape(thing):
    """The name of every number of an object with None, and of every object it owns with the shape of that."""
    return {name: shape(value) if hasattr(value, "__dict__") else None for name, value in vars(thing).items()}


def numbers(thing, names):
    """All numbers of an object and of the objects it owns, as its shape names them: a flat copy that JSON can hold."""
    kept = {}
    for name, inner in names.items():
        value = getattr(thing, name)
        kept[name] = numbers(value, inner) if inner is not None else list(value) if isinstance(value, list) else value
    return kept


def take_over(thing, state):
    """Put the numbers back."""
    for name, value in state.items():
        if isinstance(value, dict):
            take_over(getattr(thing, name), value)
        else:
            setattr(thing, name, list(value) if isinstance(value, list) else value)


def unforeseen(error, model):
    """The sentence for an exception; plain floats raise where C gives infinity or NaN."""
    if isinstance(error, NotThere):
        return str(error)
    if isinstance(error, (ArithmeticError, ValueError)) and not isinstance(error, UnicodeError):
        return SENTENCES[DIVERGED].format(t=model.solver.step.t0)
    return f"unforeseen {type(error).__name__}: {error}; please report it with the values of the run"
