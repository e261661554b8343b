"""Generates the methods that evaluate outputs, modes and conditions at a point."""

from .algebra import rounding_scales
from .codegen_context import CodegenContext, emit_return, emit_scales, method_source
from .contact_methods import emit_friction_force, emit_friction_forces, law_mode
from .expressions import Term
from .tables import Piece

MAX_SUMMANDS = 50  # in one statement


def law_modes_method(context: CodegenContext) -> list[str]:
    """Return the source of the method for the modes under a law without stick and slip; nothing without such laws."""
    contacts, printer = context.analysis.contacts, context.printer()
    if all(len(c.laws) == 1 for c in contacts):
        return []
    slips = [c.slip for c in contacts]
    context.emit_driver(printer, slips)
    printer.count_uses(*slips, *slips)
    modes = [law_mode(printer, c) for c in contacts]
    printer.emit(f"return {', '.join(modes)}")
    return [method_source("law_modes", ["t", *context.states], printer.lines)]


def observe_method(context: CodegenContext) -> str:
    """Return the source of the output method."""
    analysis, printer = context.analysis, context.printer()
    for mode in analysis.modes:
        text = printer.text(mode)
        is_planar = any(mode is c.mode for c in analysis.planar_contacts)  # trial points have modes of their own
        printer.emit(f"self.{mode.name} = {f'0 if {text} == 0 else 1' if is_planar else text}")
    if any(len(c.laws) > 1 for c in analysis.contacts):
        with printer.block("if self.friction != HYBRID:"):  # as InternalStep.force_modes
            printer.emit(" = ".join([*(c.mode.name for c in analysis.contacts if len(c.laws) > 1), "0"]))
    loads = [load for c in analysis.contacts for load in analysis.load_expressions(c)]
    context.emit_driver(printer, [*analysis.drivers, *analysis.input_rates, *loads])
    printer.count_uses(*analysis.outputs, *analysis.outputs)
    printer.count_uses(*analysis.load.values(), *analysis.load.values(), *(c.slide for c in analysis.contacts))
    if context.single_contact is not None:
        emit_friction_force(context, printer, context.single_contact)
    elif analysis.contacts:
        emit_friction_forces(context, printer, analysis.contacts)
    for e in analysis.outputs:
        if isinstance(e.expression, Term):
            printer.local_variable(e)
    for e in (*analysis.input_rates, *analysis.states, *analysis.drivers, *analysis.outputs, *analysis.contacts):
        printer.emit(f"self.{e.name} = {printer.text(e)}")
    # a sum is finite only if all its terms are
    summands = [printer.text(e) for e in (*analysis.states, *analysis.drivers, *analysis.outputs, *analysis.contacts)]
    while len(summands) > MAX_SUMMANDS:
        total = printer.fresh_name("total")
        printer.emit(f"{total} = {' + '.join(summands[:MAX_SUMMANDS])}")
        summands = [total, *summands[MAX_SUMMANDS:]]
    printer.emit(f"return -inf < {' + '.join(summands)} < inf")
    return method_source("compute_outputs", context.arguments, printer.lines)


def condition_methods(context: CodegenContext) -> list[str]:
    """Return the source of the method; nothing without conditions."""
    margins = [condition.margin for condition in context.analysis.conditions]
    if not margins:
        return []
    printer = context.printer()
    context.emit_driver(printer, margins)
    scales = emit_scales(context, printer, rounding_scales(margins))
    context.emit_driver(printer, scales)
    printer.count_uses(*margins, *scales)
    lines = emit_return(printer, [*margins, *scales])
    return [method_source("condition_margins", context.arguments, lines), *pieces_method(context)]


def pieces_method(context: CodegenContext) -> list[str]:
    """Return the source of the method that finds the pieces of tables; nothing without them."""
    printer = context.printer()
    conditions = enumerate(context.analysis.conditions)
    pieces = [(n, condition.piece) for n, condition in conditions if condition.piece is not None]
    context.emit_driver(printer, [piece.args[0] for _, piece in pieces])
    printer.count_uses(*(piece.args[0] for _, piece in pieces[::2]))
    for (n, piece), (other, _) in zip(pieces[::2], pieces[1::2], strict=True):  # both conditions of a piece
        assert isinstance(piece.op, Piece)
        printer.emit(f"self.condition_pieces[{n}] = float(self.{piece.op.method}({printer.text(piece.args[0])}))")
        printer.emit(f"self.condition_pieces[{other}] = self.condition_pieces[{n}]")
    return [method_source("update_pieces", context.arguments, printer.lines)] if pieces else []
