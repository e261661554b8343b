"""Values set one after the other at one point are values set at once, whatever is read in between."""

import pytest
from compare import identical
from models import CASES, counts, label, outputs, push

WHERE = (0.0, 0.13, 0.5, 0.77)  # of the run


@pytest.mark.parametrize("read", [False, True], ids=["unread", "read"])
@pytest.mark.parametrize("case", CASES, ids=label)
def test_two_settings_at_one_point_are_one(launch, case, read):
    """The first sets the body in motion, the other way or out of its rest; the second takes that back."""
    name, values, stop = case
    names = outputs(name) + counts(name)
    force, size = push(name)
    internal, rows = launch(name, values, stop=stop).follow(
        0.0, stop, ["events.count"] if "events.count" in names else []
    )
    changed = [t for t, before, after in zip(internal[1:], rows, rows[1:], strict=False) if after != before]
    for t in [share * stop for share in WHERE] + changed[:2]:
        runs = []
        for settings in ([{force: -size, "m": 0.3}], [{force: size}, {force: 3.0 * size}, {force: -size, "m": 0.3}]):
            fmu = launch(name, values, stop=stop)
            fmu.run([0.0, t][: 1 + (t > 0.0)], [])
            for setting in settings:
                fmu.set(setting)
                if read:
                    fmu.get(*names, "solver.t_next")
            runs.append(fmu.run([t, t + 0.001, t + 0.05 * (stop - t), t + 0.1 * (stop - t)], names))
        identical(runs[1], runs[0], names)
