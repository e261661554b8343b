"""A block at rest breaks away at the first peak of the load above the limit, however long the steps are."""

import math
from dataclasses import asdict, dataclass
from random import Random

import pytest
from build_cache import build_user_model
from models import DOP853, ODE23, ODE45, RODAS
from native_fmus import require_compiler

STOP = 5.0
SHAKEN_BLOCK = '''"""Block at rest under a harmonic force."""

from fmus import Contact, Mode, Model, Output, Parameter, State, sin


class ShakenBlock(Model):
    """Block under a harmonic force: m a = F - F_friction."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    f_d = Parameter(2.0, "N", "sliding friction", low=0.0)
    ratio = Parameter(1.5, "1", "static over sliding friction", low=1.0)
    F_0 = Parameter(5.0, "N", "amplitude of the force", low=0.0)
    Omega = Parameter(6.0, "rad/s", "angular frequency of the force", low=0.0)

    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    angle = State("rad", "phase angle of the force", rate=Omega)
    mode = Mode()
    F = Output("N", "force", F_0 * sin(angle))
    F_friction = Contact("N", "friction", mode=mode, slip=v, slide=f_d, hold=ratio * f_d)
    a = Output("m/s2", "acceleration", (F - F_friction) / m, rate_of=v)

    stop_time = 5.0
'''


@dataclass(frozen=True)
class ShakenBlock:
    """Parameters of the block under a harmonic force, in SI units; its peaks exceed the limit by the share `excess`."""

    m: float
    f_d: float
    ratio: float
    F_0: float
    Omega: float
    excess: float

    def values(self):
        """Return the values to set in the FMU."""
        return {name: value for name, value in asdict(self).items() if name != "excess"}


def draw_shaken_blocks(number=200, seed=1, excesses=(1e-8, 1e-1)):
    """Return random blocks under a harmonic force whose amplitude lies above or below the static limit by random
    shares."""
    draw = Random(f"shaken {seed}")
    low, high = (float(math.log10(excess)) for excess in excesses)
    blocks = []
    for _ in range(number):
        f_d, ratio, excess = draw.uniform(1.0, 5.0), draw.uniform(1.0, 1.5), 10.0 ** draw.uniform(low, high)
        excess *= -0.5 if draw.random() < 0.5 else 1.0
        blocks.append(ShakenBlock(1.0, f_d, ratio, ratio * f_d * (1.0 + excess), draw.uniform(2.0, 40.0), excess))
    return blocks


@pytest.mark.parametrize("method", [ODE23, ODE45, DOP853, RODAS])
def test_a_block_breaks_away_at_the_first_peak_of_the_load(worker, tmp_path, method):
    """Nothing moves but the phase angle, so that the error control allows steps of many periods."""
    require_compiler()
    (file := tmp_path / "shaken_at_rest.py").write_text(SHAKEN_BLOCK)
    words = ("--native", "--platform", "linux64")
    fmu = worker.instantiate(build_user_model(file, *words) / "native" / "shaken_at_rest.fmu")
    wrong = []
    for parameters in draw_shaken_blocks(60, excesses=(1e-4, 1.0)):
        end = 1.5 * math.pi / parameters.Omega  # behind the first peak, before the next one
        fmu.reset()
        fmu.begin({**parameters.values(), "solver.method": method, "solver.rtol": 1e-6}, stop=STOP)
        (count,) = fmu.run([0.0, end], ["events.count"])[-1]
        if (count > 0) != (parameters.excess > 0.0):
            wrong.append((count, parameters))
    fmu.free()
    assert wrong == []
