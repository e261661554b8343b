"""The method of a written-out model that sets its outputs, and says whether they are numbers."""

from .coupled import follow_law
from .expressions import Term
from .frame import Frame, method
from .friction import under_the_law


def observe(f: Frame) -> str:
    an, s = f.an, f.scribe()
    f.place_drive(s, [*an.drives, *an.ramps])
    s.count(*an.outputs, *an.outputs)
    s.count(*an.load.values(), *an.load.values(), *(c.slide for c in an.contacts))
    if f.alone is not None:
        under_the_law(f, s, f.alone)
    elif an.contacts:
        follow_law(f, s)
    for e in an.outputs:
        if isinstance(e.means, Term):
            s.hold(e)
    for e in (*an.ramps, *an.states, *an.drives, *an.outputs, *an.contacts, *an.modes):
        s.say(f"self.{e.name} = {s.text(e)}")
    sizes = (s.text(e) if e.low >= 0.0 else f"fabs({s.text(e)})" for e in an.first_to_overflow)
    s.say(f"return {' + '.join(sizes)} < inf")
    return method("compute_outputs", f.point, s.lines)
