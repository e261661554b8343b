"""Successive settings at one time act like one setting, even if values are read in between."""

from models import counts, each_case, outputs, push
from row_comparison import assert_identical

WHERE = (0.0, 0.13, 0.5, 0.77)  # fraction of the run


@each_case
def test_two_settings_at_one_point_act_as_one(launch, case):
    """The first setting starts the body, or reverses it; the second undoes that. All begin at the state saved there."""
    name, values, stop = case
    names = outputs(name) + counts(name)
    force, size = push(name)
    internal, rows = launch(name, values, stop=stop).follow(
        0.0, stop, ["events.count"] if "events.count" in names else []
    )
    change_times = [t for t, before, after in zip(internal[1:], rows, rows[1:], strict=False) if after != before]
    fmu, now, last = launch(name, values, stop=stop), 0.0, {force: -size, "m": 0.3}
    for t in sorted([share * stop for share in WHERE] + change_times[:2]):
        fmu.run([now, t][: 1 + (t > now)], [])
        now, state = t, fmu.save()
        for read in (False, True):
            runs = []
            for settings in [last], [{force: size}, {force: 3.0 * size}, last]:
                for setting in settings:
                    fmu.set(setting)
                    if read:
                        fmu.get(*names, "solver.t_next")
                runs.append(fmu.run([t, t + 0.001, t + 0.05 * (stop - t), t + 0.1 * (stop - t)], names))
                fmu.restore(state)
            assert_identical(runs[1], runs[0], names)
