"""Generates the methods for construction, initial states, derived constants and inputs."""

from .algebra import Memo, subexpressions
from .codegen_context import CodegenContext, method_source, rule_status
from .expression_printer import INDENT
from .expressions import Term


def setup_methods(f: CodegenContext) -> list[str]:
    """Return the source of all setup methods."""
    return [
        *init_method(f),
        initial_method(f),
        prepare_method(f),
        *nominal_velocity_method(f),
        *driver_method(f),
        *input_polynomial_methods(f),
    ]


def init_method(f: CodegenContext) -> list[str]:
    """Constructor; creates the attributes that are no variables, if there are any."""
    lines = []
    if f.an.conditions:
        lines.append(f"self.condition_sides = [1.0] * {len(f.an.conditions)}")
        lines.append("self.violation_time = self.violation_value = 0.0")
    if f.driver is not None:
        lines.append("self.t_base = self.x_base = 0.0")
    for e, rate in f.an.ramps.items():
        lines.append(f"self.{e.name}_polynomial = InputPolynomial()")
        lines.append(f"self.t_base = self.{rate.name} = 0.0")
    if f.constants:
        lines.append(" = ".join(f"self.{f.name_of(e)}" for e in f.constants) + " = 0.0")
    if not lines:
        return []
    return [method_source("__init__", (), [2 * INDENT + line for line in ["super().__init__()", *lines]])]


def initial_method(f: CodegenContext) -> str:
    """Initial states."""
    s = f.printer()
    if f.driver is not None:
        s.emit("self.t_base, self.x_base = t, 0.0")
    elif f.an.ramps:
        s.emit("self.t_base = t")
    return method_source("initial_state", ["t"], f.return_lines(s, [state.start_expression for state in f.an.states]))


def prepare_method(f: CodegenContext) -> str:
    """Constants and rules; a rule is checked as early as possible, before its values are used as divisors."""
    s = f.printer()
    computed: list[Term] = []
    s.constants = computed
    for e in f.an.ramps:
        s.emit(f"self.{e.name}_polynomial.set_value(self.{e.name})")
    s.count_uses(*f.constants, *(rule.broken for rule in f.an.rules))

    def calculate(selection: Memo | None = None) -> None:
        for e in f.constants:
            if (selection is None or id(e) in selection) and not any(e is constant for constant in computed):
                s.emit_assignment(f"self.{f.name_of(e)}", e)
                computed.append(e)

    for n, rule in enumerate(f.an.rules):
        calculate(subexpressions(rule.broken))
        with s.block(f"if {s.text(rule.broken)}:"):
            s.emit(f"return {rule_status(n)}")
    calculate()
    s.emit("return OK")
    return method_source("prepare", (), s.lines)


def nominal_velocity_method(f: CodegenContext) -> list[str]:
    """Smallest speed that the tolerance must resolve."""
    states = (*f.an.states, *f.an.drivers)
    velocities = [state.nominal_velocity for state in states if state.nominal_velocity is not None]
    if not velocities:
        return []
    smallest = velocities[0]
    for velocity in velocities[1:]:
        smallest = Term("choose", Term("<", smallest, velocity), smallest, velocity)
    return [method_source("nominal_velocity", (), f.return_lines(f.printer(), [smallest]))]


def driver_method(f: CodegenContext) -> list[str]:
    """Speed of the driver."""
    return (
        []
        if f.driver is None
        else [method_source("driver_velocity", (), f.return_lines(f.printer(), [f.driver.constant_rate]))]
    )


def input_polynomial_methods(f: CodegenContext) -> list[str]:
    """For inputs with derivatives: move the time base to t, set input rates, test for derivatives above order 1."""
    if not f.an.ramps:
        return []
    base, rates = f.printer(), f.printer()
    for e, rate in f.an.ramps.items():
        base.emit(f"self.{e.name} = self.{e.name}_polynomial.shift_to(t - self.t_base)")
        rates.emit(f"self.{rate.name} = self.{e.name}_polynomial.rate_at(t - self.t_base)")
    base.emit("super().rebase(t)")
    base.emit("self.t_base = t")
    bends = f.printer()
    bends.emit("return " + " or ".join(f"self.{e.name}_polynomial.order > 1" for e in f.an.ramps))
    printers = {"rebase": base, "set_input_rates": rates, "has_higher_order": bends}
    return [method_source(name, ["t"] * (name != "has_higher_order"), s.lines) for name, s in printers.items()]
