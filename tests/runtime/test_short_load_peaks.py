"""A block at rest breaks away at the first peak of the load above the limit, however long the steps are."""

import math

import pytest
import short_sticks
from build_cache import build_user_model
from models import DOP853, ODE23, ODE45, RODAS
from native_fmus import require_compiler

STOP = 5.0


@pytest.mark.parametrize("method", [ODE23, ODE45, DOP853, RODAS])
def test_a_block_breaks_away_at_the_first_peak_of_the_load(worker, tmp_path, method):
    """Nothing moves but the phase angle, so that the error control allows steps of many periods."""
    require_compiler()
    (file := tmp_path / "shaken_at_rest.py").write_text(short_sticks.SHAKEN)
    words = ("--native", "--platform", "linux64")
    fmu = worker.instantiate(build_user_model(file, *words) / "native" / "shaken_at_rest.fmu")
    wrong = []
    for parameters in short_sticks.shaken(60, excesses=(1e-4, 1.0)):
        end = 1.5 * math.pi / parameters.Omega  # behind the first peak, before the next one
        fmu.reset()
        fmu.begin({**parameters.values(), "solver.method": method, "solver.rtol": 1e-6}, stop=STOP)
        (count,) = fmu.run([0.0, end], ["events.count"])[-1]
        if (count > 0) != (parameters.excess > 0.0):
            wrong.append((count, parameters))
    fmu.free()
    assert wrong == []
