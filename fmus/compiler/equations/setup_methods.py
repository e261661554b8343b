"""Generates the methods for construction, initial states, derived constants and inputs."""

from collections.abc import Collection

from .algebra import depends_on, differentiate, subexpressions
from .codegen_context import CodegenContext, method_source, rule_status
from .expression_printer import INDENT, ExpressionPrinter
from .expressions import Expression, Operand, Term, is_among
from .model_declaration import Input
from .tables import EDGE, VARIABLE_KINDS, Table, array_name, table_of


def setup_methods(context: CodegenContext) -> list[str]:
    """Return the source of all setup methods."""
    return [
        *init_method(context),
        initial_method(context),
        prepare_method(context),
        *nominal_velocity_method(context),
        *driver_method(context),
        *input_polynomial_methods(context),
        *prescribed_motion_methods(context),
        *map(piece_method, context.analysis.tables),
    ]


def init_method(context: CodegenContext) -> list[str]:
    """Constructor; creates the attributes that are no variables, if there are any."""
    lines = []
    if context.analysis.conditions:
        lines.append(f"self.condition_sides = [1.0] * {len(context.analysis.conditions)}")
        for n, condition in enumerate(context.analysis.conditions):
            if condition.piece is not None and len(table_of(condition.piece).edges) == 2:
                lines.append(f"self.condition_sides[{n}] = 0.0")  # the only piece of a table
        lines.append("self.violation_time = self.violation_value = 0.0")
    if context.analysis.has_pieces:
        lines.append(f"self.condition_pieces = [-1.0] * {len(context.analysis.conditions)}")
    for table in context.analysis.tables:
        for kind in VARIABLE_KINDS if table.parameters else ():
            lines.append(f"self.{array_name(table, kind)} = {[*table.columns[kind]]!r}")
    if context.driver is not None:
        lines.append("self.t_base = self.x_base = 0.0")
    for e, rate in context.analysis.input_rates.items():
        is_prescribed = is_among(e, context.analysis.prescribed_inputs)
        lines.append(f"self.{e.name}_polynomial = {'PrescribedMotion' if is_prescribed else 'InputPolynomial'}()")
        lines.append(f"self.t_base = self.{rate.name} = 0.0")
    if context.analysis.prescribed_inputs:
        lines.append("self.inconsistent_input = 0")
    if context.constants:
        lines.append(" = ".join(f"self.{context.name_of(e)}" for e in context.constants) + " = 0.0")
    if not lines:
        return []
    return [method_source("__init__", (), [2 * INDENT + line for line in ["super().__init__()", *lines]])]


def initial_method(context: CodegenContext) -> str:
    """Initial states."""
    printer = context.printer()
    if context.driver is not None:
        printer.emit("self.t_base, self.x_base = t, 0.0")
    elif context.analysis.input_rates:
        printer.emit("self.t_base = t")
    for e in context.analysis.prescribed_inputs:
        printer.emit(f"self.{e.name}_polynomial.begin()")
    return method_source(
        "initial_state",
        ["t"],
        context.return_lines(printer, [state.start_expression for state in context.analysis.states]),
    )


def prepare_method(context: CodegenContext) -> str:
    """Constants and rules; a rule is checked as early as possible, before its values are used as divisors."""
    printer, constants = context.printer(), {id(e): e for e in context.constants}
    printer.constants = set()
    emit_input_polynomials(context, printer)
    for table in context.analysis.tables:
        for kind, numbers in table.variable_columns.items():
            for piece, value in numbers:
                printer.emit(f"self.{array_name(table, kind)}[{piece}] = {printer.text(value)}")
    printer.count_uses(*context.constants, *(rule.broken for rule in context.analysis.rules))

    def calculate(selection: Collection[int] = constants) -> None:
        for identity, e in constants.items():
            if identity in selection and identity not in printer.constants:
                printer.emit_assignment(f"self.{context.name_of(e)}", e)
                printer.constants.add(identity)

    for n, rule in enumerate(context.analysis.rules):
        calculate(subexpressions(rule.broken))
        with printer.block(f"if {printer.text(rule.broken)}:"):
            printer.emit(f"return {rule_status(n)}")
    calculate()
    printer.emit("return OK")
    return method_source("prepare", (), printer.lines)


def emit_input_polynomials(context: CodegenContext, printer: ExpressionPrinter) -> None:
    """Emit the polynomials of inputs; a declared rate, which is declared before its input, gives the derivatives."""
    analysis = context.analysis
    for e in analysis.input_rates:
        polynomial = f"self.{e.name}_polynomial"
        if not is_among(e, analysis.prescribed_inputs):
            printer.emit(f"{polynomial}.set_value(self.{e.name})")
            continue
        inputs = [variable for variable in analysis.input_orders if depends_on(e.declared_rate, (variable,))]
        for n in range(analysis.input_orders[e]):
            value = derivative_of_rate(analysis.names, e, inputs, n, printer)
            printer.emit(f"{polynomial}.continue_by({n + 1}, {value})")
        printer.emit(f"{polynomial}.set_motion(self.{e.name})")


def derivative_of_rate(
    names: dict[Expression, str], e: Input, inputs: list[Input], n: int, printer: ExpressionPrinter
) -> str:
    """Return the text of the n-th derivative of the declared rate of an input; its inputs have polynomials."""
    if n == 0:
        return printer.text(e.declared_rate)
    derivatives: dict[Expression, Operand] = {}
    for variable in inputs:
        symbol = Expression()
        symbol.name = f"{variable.name}_{n}"
        printer.bound_names[symbol] = f"self.{variable.name}_polynomial.derivatives[{n}]"
        derivatives[variable] = symbol
    return printer.text(differentiate(e.declared_rate, derivatives, names))


def nominal_velocity_method(context: CodegenContext) -> list[str]:
    """Smallest speed that the tolerance must resolve."""
    states = (*context.analysis.states, *context.analysis.drivers)
    velocities = [state.nominal_velocity for state in states if state.nominal_velocity is not None]
    if not velocities:
        return []
    smallest = velocities[0]
    for velocity in velocities[1:]:
        smallest = Term("choose", Term("<", smallest, velocity), smallest, velocity)
    return [method_source("nominal_velocity", (), context.return_lines(context.printer(), [smallest]))]


def driver_method(context: CodegenContext) -> list[str]:
    """Speed of the driver."""
    return (
        []
        if context.driver is None
        else [
            method_source(
                "driver_velocity", (), context.return_lines(context.printer(), [context.driver.constant_rate])
            )
        ]
    )


def input_polynomial_methods(context: CodegenContext) -> list[str]:
    """For inputs with derivatives: move the time base to t, set input rates, test whether an input moves."""
    if not context.analysis.input_rates:
        return []
    base, rates = context.printer(), context.printer()
    for e, rate in context.analysis.input_rates.items():
        base.emit(f"self.{e.name} = self.{e.name}_polynomial.shift_to(t - self.t_base)")
        rates.emit(f"self.{rate.name} = self.{e.name}_polynomial.rate_at(t - self.t_base)")
    base.emit("super().rebase(t)")
    base.emit("self.t_base = t")
    input_motion = context.printer()
    input_motion.emit(
        "return " + " or ".join(f"self.{e.name}_polynomial.order > 0" for e in context.analysis.input_rates)
    )
    return [
        method_source("rebase", ["t"], base.lines),
        method_source("set_input_rates", ["t"], rates.lines),
        method_source("has_moving_inputs", (), input_motion.lines),
    ]


def piece_method(table: Table) -> str:
    """Piece of a table that contains u, by bisection of its edges; the first one where u is NaN."""
    edges, last = array_name(table, EDGE), len(table.edges) - 2
    lines = ["piece = 0"]
    for power in reversed(range(last.bit_length())):
        lines += [
            f"if piece + {2**power} <= {last} and u >= {edges}[piece + {2**power}]:",
            f"{INDENT}piece = piece + {2**power}",
        ]
    return method_source(array_name(table, "piece"), ["u"], [2 * INDENT + line for line in [*lines, "return piece"]])


def prescribed_motion_methods(context: CodegenContext) -> list[str]:
    """For inputs whose rate an importer sets: note the first that jumps against it at many communication points."""
    analysis, printer = context.analysis, context.printer()
    for n, e in reversed([*enumerate(analysis.prescribed_inputs, 1)]):
        if depends_on(e.declared_rate, analysis.inputs):
            with printer.block(f"if self.{e.name}_polynomial.count_jump():"):
                printer.emit(f"self.inconsistent_input = {n}")
    if not printer.lines:
        return []
    return [method_source("count_jumps", (), printer.lines)]
