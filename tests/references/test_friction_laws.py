"""What the friction laws must show: long-term stick, pre-sliding, Dahl's closed form, Den Hartog's steady motion."""

from math import exp, pi

import numpy as np
import pytest
from build_cache import build_once
from models import DOP853

from benchmarks.literature.study import SLIDING, STOPPING
from benchmarks.references import event_located
from benchmarks.references.den_hartog import steady_motion_with_stops, steady_motion_without_stops

pytestmark = pytest.mark.slow  # builds the FMUs of fmus/more

LOAD, HOLD_TIME, REST = 0.5, 1e5, 10.0  # N, a third of the static friction, and s
REST_TIME = 0.2  # s after which bristles have come to rest to rounding
FREE = {"k": 0.0, "v_driver": 0.0, "F_ext": LOAD}  # no spring
STICKSLIP = FREE | {"m": 1.0, "g": 10.0, "mu_s": 0.15, "mu_d": 0.1}
HYBRID = {"stickslip": STICKSLIP, "belt": {"k": 0.0, "v_belt": 0.0, "F_ext": LOAD, "x0": 0.0}}


@pytest.fixture(scope="module")
def more_fmus():
    """The folder of the FMUs of fmus/more."""
    return build_once("--more")


def hold_and_release(fmu):
    """Return the position under a load that lasts, and after it is gone."""
    fmu.step(0.0, HOLD_TIME)
    loaded_position = fmu.get("x")
    fmu.set({"F_ext": 0.0})
    fmu.step(HOLD_TIME, REST)
    return loaded_position, fmu.get("x")


@pytest.mark.campaign
@pytest.mark.parametrize("name", HYBRID)
def test_a_hybrid_law_holds_a_load_below_the_limit_for_ever(worker, fmus, more_fmus, name):
    folder = fmus if name == "stickslip" else more_fmus
    fmu = worker.instantiate(folder / f"{name}.fmu").begin(HYBRID[name], stop=HOLD_TIME + REST)
    assert hold_and_release(fmu) == (0.0, 0.0)
    assert fmu.get("events.count") == 0
    fmu.free()


def bristle_run(worker, more_fmus, name, **values):
    fmu = worker.instantiate(more_fmus / f"{name}.fmu").begin(
        FREE | {"solver.rtol": 1e-9} | values, stop=HOLD_TIME + REST
    )
    loaded_position, released_position = hold_and_release(fmu)
    fmu.free()
    return loaded_position, released_position


def test_elastoplastic_friction_deflects_elastically_and_returns(worker, more_fmus):
    """F/sigma_0 under the load, and nothing after it (P. Dupont et al., 2002)."""
    loaded_position, released_position = bristle_run(worker, more_fmus, "elastoplastic")
    assert loaded_position == pytest.approx(LOAD / 1e5, rel=1e-9)
    assert abs(released_position) < 1e-13


def test_lugre_friction_keeps_a_displacement_of_a_load_below_the_limit(worker, more_fmus):
    """The drift of G. Rill, T. Schaeffer, M. Schuderer, LuGre or not LuGre, Multibody System Dynamics (2023); the value
    is that of the second formulation."""

    class HeldBristles(event_located.Bristles):
        load, stop = LOAD, REST_TIME

        def pull(self, t, x):
            return self.load

    bristles = HeldBristles()
    (*_, end), _ = event_located.solve(bristles, [0.0, REST_TIME], "DOP853", 3e-14, 1e-17)
    bristles.load, bristles.start = 0.0, tuple(end)
    (*_, free), _ = event_located.solve(bristles, [0.0, REST_TIME], "DOP853", 3e-14, 1e-17)
    loaded_position, released_position = bristle_run(worker, more_fmus, "lugre")
    assert (loaded_position, released_position) == pytest.approx((end[0], free[0]), rel=1e-6)
    assert released_position > 0.1 * LOAD / 1e5


def test_dahl_friction_is_lugre_without_damping(worker, more_fmus):
    """z = (F_c/sigma_0) (1 - exp(-sigma_0 x/F_c)) while the mass slows down."""
    sigma_0, F_c = 2e3, 1.0
    dahl = {"sigma_0": sigma_0, "sigma_1": 0.0, "sigma_2": 0.0, "F_c": F_c, "F_s": F_c}
    values = FREE | dahl | {"F_ext": 0.0, "v0": 0.05, "solver.rtol": 1e-10}
    fmu = worker.instantiate(more_fmus / "lugre.fmu").begin(values, stop=0.05)
    for x, v, z in fmu.run(np.linspace(0.0, 0.04, 21).tolist(), ["x", "v", "z"])[1:]:
        assert v > 0.0
        assert z == pytest.approx(F_c / sigma_0 * (1.0 - exp(-sigma_0 * x / F_c)), rel=1e-8)
    fmu.free()


class ForcedMass(event_located.Forced):
    """Forced motion with other values."""

    def __init__(self, values, steady):
        self.values, self.phase = values, steady.phase

    def load(self, t, x):
        return self.values["P"] * np.cos(self.values["Omega"] * t + self.phase) - self.values["k"] * x

    def rates(self, t, y, modes):
        return [y[1], self.load(t, y[0]) - self.values["f"] * modes[0] if modes[0] else 0.0]

    def contacts(self, t, y, modes):
        return [(y[1], self.load(t, y[0]), self.values["f"])]


def test_the_closed_form_without_stops_is_a_periodic_motion():
    steady = steady_motion_without_stops(**SLIDING)
    mass, period = ForcedMass(SLIDING, steady), 2.0 * pi / SLIDING["Omega"]
    mass.start, mass.first, mass.stop = (steady.amplitude, 0.0), (-1,), 3.0 * period
    _, events = event_located.solve(mass, [0.0, mass.stop - 0.1 * period], "DOP853", 3e-14, 1e-17)
    assert [modes for _, modes in events] == [(1,), (-1,)] * 2 + [(1,)]
    assert [t for t, _ in events] == pytest.approx([0.5 * period * i for i in range(1, 6)], abs=1e-10)


def test_motion_from_rest_settles_to_the_closed_form_with_stops(worker, more_fmus):
    steady = steady_motion_with_stops(**STOPPING)
    values = STOPPING | {"angle0": steady.phase + 0.7, "solver.rtol": 1e-11, "solver.method": DOP853}
    stop = (20.0 * 2.0 * pi - 0.7) / STOPPING["Omega"]
    fmu = worker.instantiate(more_fmus / "forced.fmu").begin(values, stop=stop)
    fmu.step(0.0, stop - 0.5 * steady.stop)
    assert fmu.get("mode") == 0
    assert fmu.get("x") == pytest.approx(steady.amplitude, rel=1e-10)
    assert stop - fmu.get("events.t_last") == pytest.approx(steady.stop, rel=1e-9)
    fmu.free()
