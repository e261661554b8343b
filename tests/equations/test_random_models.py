"""Random models with dry friction, against an independent solver; random_campaign.py runs thousands of them."""

import build_cache
import numpy as np
import pytest
from contact_references import reference_events
from native_fmus import require_compiler

from benchmarks.campaigns import random_campaign
from benchmarks.campaigns.independent_contacts import Contact, Spring, System, solve
from benchmarks.campaigns.random_models import random_structure

GRAVITY = 9.81
LITERATURE = {
    "sleds": System(
        (12.5, 8.0),
        (Spring((1.0, 0.0), 742.5, drive=1.0), Spring((1.0, -1.0), 1100.0)),
        (
            Contact((1.0, 0.0), 73.575, 73.575, 110.3625, 1.0),
            Contact((0.0, 1.0), 40.0, 40.0, 66.0, 1.0),
        ),
        (0.0, 0.0),
        (0.0, 0.0),
        (0.0, 0.0),
        (0.0, 0.0),
        v_driver=0.034,
        stop=16.0,
    ),
    "stacked": System(
        (4.0, 2.0),
        (Spring((1.0, 0.0), 150.0), Spring((0.0, 1.0), 400.0, drive=1.0)),
        (
            Contact((1.0, 0.0), 0.15, 0.15, 0.15 * 1.4, 6.0 * GRAVITY),
            Contact((-1.0, 1.0), 0.5, 0.5, 0.5 * 1.4, 2.0 * GRAVITY),
        ),
        (0.0, 0.0),
        (0.0, 0.0),
        (0.0, 0.0),
        (0.0, 0.0),
        v_driver=0.2,
        stop=8.0,
    ),
    "stribeck": System(  # the viscous part of friction is a damper between block and belt
        (1.0,),
        (Spring((1.0,), 1.0), Spring((1.0,), 0.0, c=0.05)),
        (Contact((1.0,), 0.7, 1.0, 1.0, 1.0, v_s=0.1, belt=0.2),),
        (0.01,),
        (0.0,),
        (1.067,),
        (0.0,),
        stop=50.0,
    ),
}


@pytest.mark.parametrize("name", LITERATURE)
def test_the_series_agree_with_integration_by_scipy(name):
    """Events of the larger models by Taylor series, and by DOP853 of scipy with modes from one release at a time."""
    true, end = reference_events(name)
    solution = solve(LITERATURE[name])
    assert [list(modes) for _, modes in solution.events] == [modes for _, *modes in true]
    assert np.abs(np.array([t for t, _ in solution.events]) - [t for t, *_ in true]).max() < 1e-9
    n = len(end) // 2
    assert np.abs(solution.states(LITERATURE[name].stop) - [*end[::2], *end[1::2]])[: 2 * n].max() < 1e-9


def sled(mu_d, mu_s, **more):
    """A sled of 1 kg with 10 N of load, pulled at 0.1 m/s through a spring of 100 N/m."""
    return System(
        (1.0,),
        (Spring((1.0,), 100.0, drive=1.0),),
        (Contact((1.0,), mu_d, mu_d, mu_s, 10.0),),
        *[(0.0,)] * 4,
        **{"v_driver": 0.1, **more},
    )


def test_the_end_of_a_slip_has_the_steepness_of_the_closed_form():
    """v = u (1 - cos(w s)) + d/w sin(w s) ends with the slope -d, where d = (hold - slide) / m."""
    solution = solve(sled(0.5, 0.55))
    u, w, d = 0.1, 10.0, 0.5
    (_, rest, *_) = (t for t, _ in solution.events)
    assert solution.steepness[rest] == pytest.approx(d / (u + np.hypot(u, d / w)), rel=1e-3)


def test_a_slip_that_only_touches_zero_is_no_event():
    """With equal static and sliding friction the slip is v (1 - cos(w t)) and touches zero once in each period."""
    solution = solve(sled(0.3, 0.3, stop=3.0))
    assert [modes for _, modes in solution.events] == [(1,)]
    touches = [decision.t for decision in solution.decisions if decision.kind == "touch"]
    assert np.abs(np.diff([solution.events[0][0], *touches]) - 0.2 * np.pi).max() < 1e-7
    assert len(touches) == 4


@pytest.mark.parametrize("ratio", [1.5, 1.001, 1.00002])
def test_slips_and_rests_of_the_sled_have_their_closed_form(ratio):
    """From the break-away on, with the driver ahead by mu_s N / k: slip, rest until the load has grown again."""
    low, high, w, v = 3.0, 3.0 * ratio, 10.0, 0.1
    solution = solve(sled(0.3, 0.3 * ratio, stop=8.0))
    times = np.array([t for t, _ in solution.events])
    lead = (high - low) / 100.0
    slip = 2.0 / w * (np.pi - np.arctan(lead * w / v))
    rest = 2.0 * lead / v
    expected = high / (100.0 * v) + np.arange(len(times)) // 2 * (slip + rest) + np.arange(len(times)) % 2 * slip
    assert len(times) > 10
    assert np.abs(times - expected).max() < (1e-9 if ratio > 1.0001 else 1e-6)
    depth = (
        min(decision.margin for decision in solution.decisions if decision.kind == "crossing") if ratio < 1.5 else 0.5
    )
    assert 0.01 < depth / (w * lead / v) ** 2 * 4.0 < 20.0 or ratio == 1.5


VALUES = (2,)


@pytest.mark.campaign
@pytest.mark.parametrize("number", [6, 22])
def test_random_models_agree_with_an_independent_solver(worker, number):
    """Modes, events and states by every method at two tolerances, and all backends bit for bit."""
    require_compiler()
    structure = random_structure(number)

    def make(folder):
        _, refusals = random_campaign.build([structure], folder)
        assert not refusals, refusals[0].text

    folder = build_cache.keep_build(structure.name, make)
    paths = {(number, backend): folder / backend / f"{structure.name}.fmu" for backend in random_campaign.BACKENDS}
    n_compared = 0
    for seed in VALUES:
        reference = random_campaign.make_reference(structure, seed)
        failures, counts, _ = random_campaign.run_case(
            worker, paths, structure, seed, reference, slow_backends=("python", "fmi3")
        )
        assert not failures, "\n".join(map(str, failures))
        n_compared += counts["compared events", 1e-11]
    assert n_compared > len(VALUES)
