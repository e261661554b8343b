"""The page computes the same values as the native FMU for any setting and any time of change."""

import random
from urllib.parse import urlencode

import native_fmus
import pytest
from models import STICKSLIP_IN_CI, declarations_of, outputs, tunable

EXACT, CLOSED_FORM_MODELS = (
    1e-12,
    {"smd", "coulomb", "stickslip"},
)  # relative to the largest value, where the motion has a closed form
STATED_TOLERANCE = 1e-5  # another math library shifts the steps of the solver, within its tolerance
MAIN_RUN = "const main = app.runs.main;"
TIMES = f"{MAIN_RUN} main.grid.map(row => main.time[row])"
COLUMNS = f"{MAIN_RUN} main.reals.map(name => main.grid.map(row => main.columns[name][row]))"


def random_values(name, seed):
    """Return values of all nonzero tunable parameters, each off by up to a factor of two, within the rules."""
    draw = random.Random(f"{name} {seed}")
    values = {v: d.start * 2 ** draw.uniform(-1, 1) for v, d in tunable(name).items() if d.start}
    if "mu_s" in values:
        values["mu_d"] = draw.uniform(0.4, 0.9) * values["mu_s"]
    return values


@pytest.mark.slow
@pytest.mark.parametrize("name", STICKSLIP_IN_CI)
def test_random_parameters_and_a_change_during_the_run_match_the_native_fmu(page, worker, name):
    for seed in range(2):
        page.open(urlencode({".model": name, **random_values(name, seed)}))
        stop = page.run("app.state().stop")
        change_time, (parameter, factor) = stop / 3, ("k" if "k" in declarations_of(name) else "m", 1.25)
        old_value = page.run(f"app.state().values[{parameter!r}]")
        page.seek(change_time)
        page.check("live", True)
        page.type_number(parameter, repr(factor * old_value))
        page.check("live", False)
        (change,) = page.run("app.state().changes")
        assert (change["t"], change["name"]) == (change_time, parameter)
        times, columns = page.run(f"{{ {TIMES} }}"), page.run(f"{{ {COLUMNS} }}")
        assert len(times) == 1601
        fmu = worker.instantiate(native_fmus.build_native_fmus() / f"{name}.fmu")
        fmu.begin(page.run("app.state().values"), stop=stop)
        names = [v for v in outputs(name) if declarations_of(name)[v].type == "Real"]
        rows = fmu.run_with_changes(sorted({*times, change_time}), names, {change_time: {parameter: change["value"]}})
        at = dict(zip(sorted({*times, change_time}), rows, strict=True))
        fmu.free()
        for actual, expected in zip(columns, zip(*(at[t] for t in times), strict=True), strict=True):
            error = max(abs(a - b) for t, a, b in zip(times, actual, expected, strict=True) if t != change_time)
            assert error <= (EXACT if name in CLOSED_FORM_MODELS else STATED_TOLERANCE) * max(map(abs, expected))
