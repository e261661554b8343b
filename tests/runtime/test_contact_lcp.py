"""Which of several contacts stick: random loads, on the vector sources with numpy arrays."""

from itertools import permutations, product

import numpy as np
import pytest
from variants import slow_after

from fmus.runtime import contact_lcp, vectors
from fmus.runtime.codes import ROUNDOFF_MARGIN, STUCK
from fmus.runtime.contact_lcp import AT_REST, CoupledFriction


@pytest.fixture(autouse=True)
def vectors_are_arrays(monkeypatch):
    monkeypatch.setattr(contact_lcp, "contact_vector", lambda: np.zeros(len(vectors.contact_indices)))
    monkeypatch.setattr(contact_lcp, "any_of", np.any)
    monkeypatch.setattr(contact_lcp, "max_of", np.max)


class Chain(CoupledFriction):
    """n contacts at rest: each body on the ground, or each on the previous one; slips accelerate with b - A F."""

    def __init__(self, draw, n, jump, is_stacked):
        bodies = np.eye(n) - (np.eye(n, k=-1) if is_stacked else 0.0)
        mass = draw.uniform(0.5, 3.0, n)
        self.A, self.b = bodies @ np.diag(1.0 / mass) @ bodies.T, bodies @ (draw.normal(0.0, 2.0, n) / mass)
        self.slide = draw.uniform(0.2, 2.0, n)
        self.limit, self.n = self.slide * jump, n
        self.b_rate = np.zeros(n)

    def permute(self, order):
        """Return the same problem with another order of contacts."""
        other = object.__new__(Chain)
        other.A, other.n = self.A[np.ix_(order, order)], self.n
        for name in ("b", "slide", "limit", "b_rate"):
            setattr(other, name, getattr(self, name)[list(order)])
        return other

    def solve_forces(self, modes, b, slide):
        slides = np.array(modes) != STUCK
        return np.linalg.solve(np.where(slides[:, None], np.eye(self.n), self.A), np.where(slides, modes * slide, b))

    def contact_forces(self, t, y, modes):
        size = np.abs(self.b) + self.limit
        return self.solve_forces(modes, self.b, self.slide), self.limit, size, size

    def contact_rates(self, t, y, modes):
        force, rate = self.solve_forces(modes, self.b, self.slide), self.solve_forces(modes, self.b_rate, 0.0)
        pulls = [(b - self.A @ f) / np.diag(self.A) for b, f in ((self.b, force), (self.b_rate, rate))]
        return rate, np.zeros(self.n), *pulls

    def rates(self, t, y, modes):
        return np.zeros(self.n)  # the rates of forces are constant

    def answer(self, tie_tolerance=ROUNDOFF_MARGIN):
        """Return the modes, found from all contacts stuck, and whether they are consistent."""
        vectors.contact_indices[:] = range(self.n)
        y, status = np.zeros(self.n), np.full(self.n, AT_REST)
        modes, fits = contact_lcp.solve_modes(self, 0.0, y, np.zeros(self.n), status, 1.0, tie_tolerance)
        return tuple(map(int, modes)), fits

    def fits(self, modes):
        """Return whether no stuck contact exceeds its limit and no slipping contact is pulled back."""
        force, pull = (
            self.solve_forces(modes, self.b, self.slide),
            self.b - self.A @ self.solve_forces(modes, self.b, self.slide),
        )
        sticks = np.array(modes) == STUCK
        return np.all(np.where(sticks, np.abs(force) <= self.limit * (1 + 1e-12), modes * pull >= -1e-12))


@pytest.mark.parametrize(
    ("n", "jump", "is_stacked"), slow_after(9, product((2, 3, 1, 4), (1.0, 1.3, 2.0), (True, False)))
)
def test_consistent_modes_are_found_for_any_order_of_contacts(n, jump, is_stacked):
    """If static and sliding friction are equal, the solution is unique; otherwise every contact that can stick does."""
    draw = np.random.default_rng([n, round(10 * jump), is_stacked])
    for _ in range(24):
        chain = Chain(draw, n, jump, is_stacked)
        modes, fits = chain.answer()
        assert fits
        assert chain.fits(modes)
        if jump == 1.0:
            assert [candidate for candidate in product((-1, 0, 1), repeat=n) if chain.fits(candidate)] == [modes]
        for order in list(permutations(range(n)))[:: 1 if n < 4 else 37]:
            other, _ = chain.permute(order).answer()
            assert tuple(other[order.index(i)] for i in range(n)) == modes


def test_sequential_updates_reach_the_same_modes(monkeypatch):
    """In cases that take as many iterations as there are contacts."""
    draw, n_cases = np.random.default_rng(7), 0
    for _ in range(100):
        chain = Chain(draw, 4, 1.0, True)
        monkeypatch.setattr(contact_lcp, "MAX_JOINT_ITERATIONS", 60)
        modes = chain.answer()
        monkeypatch.setattr(contact_lcp, "MAX_JOINT_ITERATIONS", 0)
        assert chain.answer() == modes
        n_cases += modes != ((0, 0, 0, 0), True)
    assert n_cases > 50


@pytest.mark.parametrize("rate", [-1.0, 0.0, 1.0])
def test_a_load_at_the_limit_breaks_away_if_it_grows_and_sticks_otherwise(rate):
    """Two stacked bodies: both contacts are at their limits at once, except for rounding."""
    draw = np.random.default_rng(5)
    for _ in range(200):
        chain = Chain(draw, 2, 1.0, True)
        chain.b = chain.A @ (chain.limit * [1.0, -1.0]) * (1.0 + draw.choice([-1.0, 0.0, 1.0]) * 4.0 * 2.0**-52)
        chain.b_rate = chain.A @ ([rate, -rate])
        assert chain.answer() == ((1, -1) if rate > 0.0 else (0, 0), True)


@pytest.mark.parametrize(
    ("rate", "tie_tolerance", "mode"), [(-1.0, 1e-5, 0), (-1.0, 1e-7, 1), (0.0, 1e-5, 1), (1.0, 1e-5, 1)]
)
def test_a_load_above_the_limit_sticks_only_if_it_decreases_and_within_the_tolerance(rate, tie_tolerance, mode):
    chain = Chain(np.random.default_rng(1), 1, 1.0, False)
    chain.b, chain.b_rate = chain.A @ chain.limit * (1.0 + 1e-6), chain.A @ [rate]
    assert chain.answer(tie_tolerance) == ((mode,), True)


def test_a_contact_with_more_sliding_than_static_friction_is_reported():
    chain = Chain(np.random.default_rng(1), 1, 1.0, False)
    chain.limit, chain.b = 0.5 * chain.slide, chain.A @ (0.75 * chain.slide)
    assert chain.answer() == ((0,), False)


@pytest.mark.parametrize(("n", "jump"), slow_after(3, product((2, 3, 4), (1.3, 2.0))))
def test_as_many_contacts_are_held_as_can_be(monkeypatch, n, jump):
    """Of all consistent modes, those that hold the most; also where releasing the highest loads lets more go.

    So it is where pivots do not end at consistent modes.
    """
    draw, n_choices = np.random.default_rng([n, round(10 * jump)]), 0
    for _ in range(60 if n < 4 else 30):
        chain = Chain(draw, n, jump, True)
        stuck_counts = [modes.count(STUCK) for modes in product((-1, 0, 1), repeat=n) if chain.fits(modes)]
        modes, fits = chain.answer()
        assert fits
        assert modes.count(STUCK) == max(stuck_counts)
        with monkeypatch.context() as patch:
            patch.setattr(contact_lcp, "MAX_ITERATIONS", 0)
            modes, fits = chain.answer()
        assert (modes.count(STUCK), fits) == (max(stuck_counts), True)
        n_choices += min(stuck_counts) < max(stuck_counts)
    assert n_choices > 3


def test_with_many_contacts_at_rest_none_is_released_that_could_be_held_alone(monkeypatch):
    """Without trying all combinations."""
    draw, n_relocked = np.random.default_rng(11), 0
    for _ in range(150):
        chain = Chain(draw, 7, 3.0, True)
        modes, fits = chain.answer()
        assert fits
        assert chain.fits(modes)
        for i in range(7):
            assert modes[i] == STUCK or not chain.fits([STUCK if j == i else mode for j, mode in enumerate(modes)])
        with monkeypatch.context() as patch:
            patch.setattr(contact_lcp, "relock", lambda model, t, y, modes, status, h_max, tie_tolerance: modes)
            n_relocked += chain.answer()[0] != modes
    assert n_relocked > 0


def test_a_contact_without_friction_never_sticks():
    """It slips in the direction of its acceleration, and the others are as they would be without it."""
    draw = np.random.default_rng(3)
    for _ in range(50):
        chain = Chain(draw, 3, 1.0, True)
        chain.slide[1] = chain.limit[1] = 0.0
        modes, fits = chain.answer()
        assert fits
        assert modes[1] != STUCK
        assert chain.fits(modes)


def test_a_contact_without_a_lever_holds_nothing():
    """At a dead point a load within the limit is the quotient of rounding errors."""
    chain = Chain(np.random.default_rng(1), 1, 1.0, False)
    chain.b = chain.A @ (0.5 * chain.limit)
    chain.has_variable_levers = True
    assert chain.answer() == ((0,), True)
    force, limit, size, _ = chain.contact_forces(0.0, None, np.zeros(1))
    chain.contact_forces = lambda t, y, modes: (force, limit, size, np.full(1, 1e20))
    assert chain.answer() == ((1,), True)
