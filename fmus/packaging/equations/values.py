"""The methods of a written-out model about its values: at its birth, at the start, when they have changed."""

from ...runtime.stick_slip import DryFriction
from .algebra import Memo, parts
from .expressions import Term
from .frame import Frame, method
from .scribe import INDENT


def values(f: Frame) -> list[str]:
    """All of them."""
    return [init(f), initial(f), prepare(f), *finest(f), *drive(f), *courses(f)]


def init(f: Frame) -> str:
    """Every attribute is born here."""
    lines = ["super().__init__()", "self.solver = Solver()"]
    if f.drive is not None:
        lines.append("self.t_base = self.x_base = 0.0")
    for e, rate in f.an.ramps.items():
        lines.append(f"self.{e.name}_polynomial = InputPolynomial()")
        lines.append(f"self.t_base = self.{rate.name} = 0.0")
    if f.constants:
        lines.append(" = ".join(f"self.{e.name}" for e in f.constants) + " = 0.0")
    return method("__init__", (), [2 * INDENT + line for line in lines])


def initial(f: Frame) -> str:
    """Position and speed at the start."""
    s = f.scribe()
    if f.drive is not None:
        s.say("self.t_base, self.x_base = t, 0.0")
    elif f.an.ramps:
        s.say("self.t_base = t")
    return method("initial_state", ["t"], f.returning(s, [state.begins for state in f.an.states]))


def prepare(f: Frame) -> str:
    """Constants and rules; a rule is judged as soon as it can be: what it refuses could not be divided by."""
    s, dry = f.scribe(), bool(f.an.contacts)
    done: list[Term] = []
    s.kept = done
    for e in f.an.ramps:
        s.say(f"self.{e.name}_polynomial.set_value(self.{e.name})")
    s.count(*f.constants, *(rule.broken for rule in f.an.rules))

    def calculate(needed: Memo | None = None) -> None:
        for e in f.constants:
            if (needed is None or id(e) in needed) and not any(e is one for one in done):
                s.let(f"self.{e.name}", e)
                done.append(e)

    for number, rule in enumerate(f.an.rules, len(DryFriction.rules) + 1 if dry else 1):
        calculate(parts(rule.broken))
        with s.block(f"if {s.text(rule.broken)}:"):
            s.say(f"return {number}")
    calculate()
    s.say("return super().prepare()" if dry else "return 0")
    return method("prepare", (), s.lines)


def finest(f: Frame) -> list[str]:
    """The speed that a tolerance must resolve."""
    wanted = [state.finest for state in f.an.states if state.finest is not None]
    return [method("nominal_velocity", (), f.returning(f.scribe(), wanted))] if wanted else []


def drive(f: Frame) -> list[str]:
    """The speed of the driver."""
    return [] if f.drive is None else [method("driver_velocity", (), f.returning(f.scribe(), [f.drive.steady]))]


def courses(f: Frame) -> list[str]:
    """Where inputs have derivatives: fix at time t what goes on by itself, which prepare() takes over; tell their rates
    there; and whether any has more than a rate."""
    if not f.an.ramps:
        return []
    base, rates = f.scribe(), f.scribe()
    for e, rate in f.an.ramps.items():
        base.say(f"self.{e.name} = self.{e.name}_polynomial.shift_to(t - self.t_base)")
        rates.say(f"self.{rate.name} = self.{e.name}_polynomial.rate_at(t - self.t_base)")
    base.say("super().rebase(t)")
    base.say("self.t_base = t")
    bends = f.scribe()
    bends.say("return " + " or ".join(f"self.{e.name}_polynomial.order > 1" for e in f.an.ramps))
    scribes = {"rebase": base, "set_input_rates": rates, "has_higher_order": bends}
    return [method(name, ["t"] * (name != "has_higher_order"), s.lines) for name, s in scribes.items()]
