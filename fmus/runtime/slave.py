"""The FMI side: a pythonfmu slave made from a declared model.

Nothing here lets an exception into the host: pythonfmu's native layer would free what it still needs, and a host
that is not Python would abort.  What is wrong is remembered and said in one sentence, in the log and on standard
error; do_step then returns False and every calculated Real reads NaN.
"""

import json
import sys
from math import fabs, inf, isfinite, nan
from operator import attrgetter

from pythonfmu.fmi2slave import Fmi2Slave, Fmi2Status

from .declare import variables
from .march import ENDLESS, MOST_STEPS
from .step import DIVERGED, OK, STALLED

SENTENCES = {
    DIVERGED: "the motion leaves the range of numbers after t = {t!r} s; lower what drives it or check the parameters",
    STALLED: "the solver makes no headway after t = {t!r} s, its step is as small as the time axis can hold; "
    "raise solver.rtol or choose another solver.method",
    ENDLESS: f"more than {MOST_STEPS} internal steps within one communication step, from t = {{start!r}} s on; "
    "choose another solver.method, raise solver.rtol or take shorter communication steps",
}

SETTING_UP, RUNNING = 0, 1
CALCULATED = ("output", "local")


def slave_for(model):
    """The slave of a model class, under its name."""
    return type(model.__name__, (Slave,), {"Model": model, "__module__": __name__})


class Slave(Fmi2Slave):
    """One instance of the model `Model`; a value reference is a place in `variables(model)`."""

    Model = None

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.model = self.Model()
        self.variables = variables(self.model)
        self.owners = [self.owner(name) for name, _ in self.variables]
        self.readers = {"Real": {}, "Integer": {}, "Boolean": {}, "String": {}}  # value references -> what reads them
        self.phase = SETTING_UP
        self.start_time, self.stop_time, self.given_tolerance = 0.0, inf, self.model.tolerance
        self.refused = {}  # name -> sentence: values that were set and cannot be used
        self.changed = False  # values were set since the motion was last settled
        self.observed = False  # the outputs are those of the present point
        self.failure = ""

    def owner(self, name):
        """The object that holds a variable, and the name of the attribute there."""
        thing = self.model
        *path, last = name.split(".")
        for part in path:
            thing = getattr(thing, part)
        return thing, last

    # ---- the run

    def setup_experiment(self, start_time, stop_time=None, tolerance=None):
        self.start_time = start_time
        self.stop_time = inf if stop_time is None else stop_time
        if tolerance is not None and 0.0 < tolerance < 1.0:
            self.given_tolerance = tolerance
        self.changed, self.observed = True, False

    def exit_initialization_mode(self):
        try:
            sentence = self.objection()
            if sentence:
                self.fail(sentence)
            else:
                self.apply()
        except BaseException as error:  # an exception that left Python would crash the host
            self.fail(unforeseen(error, self.model))
        self.phase = RUNNING

    def do_step(self, current_time, step_size):
        try:
            if self.phase == SETTING_UP:
                self.exit_initialization_mode()
            if self.failure:
                return False
            if self.changed or self.refused:
                sentence = self.objection()
                if sentence:
                    return self.fail(sentence)
                self.apply()
            return self.advance(current_time, step_size)
        except BaseException as error:  # as above
            return self.fail(unforeseen(error, self.model))

    def advance(self, current_time, step_size):
        """One communication step, which must begin at the present point and end by the stop time."""
        march = self.model.solver
        now, stop = march.t, march.t_end
        end = current_time + step_size
        if fabs(end - march.t1) <= 1e-15 * fabs(end) < inf:
            end = march.t1  # the end of an internal step, but for the rounding of the sum
        elif stop < end < inf and end <= stop + 1e-9 * step_size + 1e-12 * fabs(stop):
            end = stop
        begins_here = fabs(current_time - now) <= 1e-6 * step_size + 1e-12 * fabs(now)
        if not (step_size > 0.0 and begins_here and now <= end <= stop and end < inf):
            return self.fail(
                f"a communication step of {step_size!r} s from t = {current_time!r} s is refused: it must be above "
                f"zero, begin at the present point, t = {now!r} s, and end by the stop time, t = {stop!r} s"
            )
        if end > now:
            self.observed = False
            status = march.advance(self.model, end)
            if status != OK:
                return self.fail(SENTENCES[status].format(t=march.t0, start=now))
        return True

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
        rule = self.model.prepare()
        return self.model.rules[rule - 1].format_map(vars(self.model)) if rule else ""

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
        self.log(sentence, Fmi2Status.error)
        if sys.stderr is not None:
            print(f"{type(self).__name__} ({self.instance_name}): {sentence}", file=sys.stderr, flush=True)
        return False

    def silence(self):
        """Every calculated Real reads NaN."""
        for (_, declared), (thing, name) in zip(self.variables, self.owners):
            if declared.type == "Real" and declared.causality in CALCULATED:
                setattr(thing, name, nan)

    def log(self, msg, status=Fmi2Status.ok, category=None, debug=None):
        """The native layer takes the message for a printf format."""
        super().log(str(msg).replace("%", "%%"), status, category, debug)

    # ---- reading and writing

    def read(self, kind, references):
        """The values of the references, all of one kind."""
        try:
            key = tuple(references)
            reader = self.readers[kind].get(key)
            if reader is None:
                reader = self.readers[kind][key] = self.reader(kind, key)
            if not self.observed and not self.failure:
                self.observe()
            values, counts, ahead = reader
            if counts and self.observed:
                self.model.solver.report(self.model.events)
                if ahead:
                    self.model.solver.look_ahead(self.model)
            return list(values(self.model)[:-2])
        except BaseException as error:  # as above
            self.fail(unforeseen(error, self.model))
            return [nan if kind == "Real" else 0 for _ in references]

    def reader(self, kind, references):
        """What reads the references, whether they tell of the solver, and whether a look ahead must come first."""
        names = [self.variable(kind, reference)[0] for reference in references]
        together = attrgetter(*names, "solver", "solver")  # of two or more: of one alone it gives no tuple
        return together, any("." in name for name in names), "solver.t_next" in names

    def variable(self, kind, reference):
        """Name and declaration of a reference."""
        if 0 <= reference < len(self.variables):
            name, declared = self.variables[reference]
            if kind == ("Real" if declared.type == "Real" else "Integer"):
                return name, declared
        raise LookupError(f"value reference {reference} is not that of a variable of type {kind}")

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

    def write(self, kind, references, values):
        """Take over the values; those that cannot be used are remembered, and told by the next step."""
        try:
            for reference, value in zip(references, values):
                name, declared = self.variable(kind, reference)
                thing, attribute = self.owners[reference]
                if value == getattr(thing, attribute) and name not in self.refused:
                    continue
                self.observed = False
                self.refused.pop(name, None)
                if declared.causality in CALCULATED:
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
        except BaseException as error:  # as above
            self.fail(unforeseen(error, self.model))

    def get_real(self, vrs):
        return self.read("Real", vrs)

    def get_integer(self, vrs):
        return self.read("Integer", vrs)

    def set_real(self, vrs, values):
        self.write("Real", vrs, values)

    def set_integer(self, vrs, values):
        self.write("Integer", vrs, values)

    # No variable is a Boolean or a String; a host that asks all the same is told so, and not crashed.

    def get_boolean(self, vrs):
        self.read("Boolean", vrs)
        return [False for _ in vrs]

    def get_string(self, vrs):
        self.read("String", vrs)
        return ["" for _ in vrs]

    def set_boolean(self, vrs, values):
        self.write("Boolean", vrs, values)

    def set_string(self, vrs, values):
        self.write("String", vrs, values)

    # ---- state

    def _get_fmu_state(self):
        kept = {name: getattr(self, name) for name in KEPT}
        return kept | {"origin": __name__, "refused": dict(self.refused), "model": numbers(self.model)}

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
            for name in KEPT:
                setattr(self, name, state[name])
            self.refused = dict(state["refused"])
            take_over(self.model, state["model"])
            self.observed = False
        except BaseException as error:  # as above
            self.fail(unforeseen(error, self.model))


KEPT = ("phase", "start_time", "stop_time", "given_tolerance", "changed", "failure")


def numbers(thing):
    """All numbers of an object and of the objects it owns: a flat copy that JSON can hold."""
    return {
        name: numbers(value) if hasattr(value, "__dict__") else list(value) if isinstance(value, list) else value
        for name, value in vars(thing).items()
    }


def take_over(thing, state):
    """Put the numbers back."""
    for name, value in state.items():
        if isinstance(value, dict):
            take_over(getattr(thing, name), value)
        else:
            setattr(thing, name, list(value) if isinstance(value, list) else value)


def unforeseen(error, model):
    """The sentence for an exception; plain floats raise where C gives infinity or NaN."""
    if isinstance(error, (ArithmeticError, ValueError)) and not isinstance(error, UnicodeError):
        return SENTENCES[DIVERGED].format(t=model.solver.t0)
    return f"unforeseen {type(error).__name__}: {error}; please report it with the values of the run"
