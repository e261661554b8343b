"""Generates the method that evaluates the conditions of the equations."""

from .algebra import rounding_scale
from .codegen_context import CodegenContext, emit_scales, method_source


def condition_methods(f: CodegenContext) -> list[str]:
    """Return the source of the method; nothing without conditions."""
    margins = [condition.margin for condition in f.an.conditions]
    if not margins:
        return []
    s = f.printer()
    f.emit_driver(s, margins)
    scales = emit_scales(f, s, [rounding_scale(e) for e in margins])
    f.emit_driver(s, scales)
    s.count_uses(*margins, *scales)
    s.emit("location = self.event_location")
    for n, (margin, scale) in enumerate(zip(margins, scales, strict=True)):
        s.emit(f"location.margins[{n}] = {s.text(margin)}")
        s.emit(f"location.margin_scales[{n}] = {s.text(scale)}")
    return [method_source("update_conditions", f.arguments, s.lines)]
