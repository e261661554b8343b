"""Which kind of step a run takes: tests that several files share, written inline in generated code."""

from .codes import EXACT, STUCK
from .vectors import all_of, inlined


@inlined
def has_events(model):
    """Return whether events may end the steps of a model."""
    return model.has_dry_friction or model.has_conditions


@inlined
def is_at_rest(model, step, modes):
    """Return whether nothing moves in these modes."""
    return model.rests_when_stuck and step.is_hybrid and all_of(modes == STUCK)


@inlined
def stays_at_rest(model, step):
    """Return whether nothing moves in the step that begins, or a velocity has only touched zero."""
    return (
        model.rests_when_stuck
        and step.is_hybrid
        and (all_of(step.modes0 == STUCK) or step.event_location.grazes_at_end)
    )


@inlined
def follows_closed_form(model, step):
    """Return whether the motion is computed in closed form."""
    return model.is_linear and step.active_method.method_number == EXACT


@inlined
def has_law_without_sticking(model, step):
    """Return whether the law of friction, as sign(v), has no events."""
    return model.has_other_laws and not step.is_hybrid


@inlined
def has_narrow_features(model, step):
    """Return whether friction varies within a small range of slip velocities."""
    return model.has_nominal_velocity and step.is_hybrid
