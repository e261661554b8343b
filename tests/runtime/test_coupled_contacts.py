"""Contacts that share bodies: simultaneous events, order of declaration, loads that peak inside a step, conservation
laws."""

from itertools import groupby, pairwise, product
from math import asin, cos, pi, sin

import numpy as np
import pytest
from internal_steps import components, compute_step, prepared_run, start
from model_text import remove_unused
from models import DOP853, LARGER_MODELS, ODE23, ODE45, RODAS, SIGN, THRESHOLD
from scipy.integrate import quad
from variants import slow_after

from fmus.compiler.lowering import component_name, lowered_model
from fmus.compiler.lowering.feature_selection import select_features
from fmus.compiler.model_lookup import find_model

# Three blocks in a stack: which modes balance the forces, found by trying all of them, with numpy.
MASSES = np.array([2.0, 1.5, 1.0])
NORMAL_FORCES = 9.81 * np.array([4.5, 2.5, 1.0])  # on the ground, on the lowest block, on the middle one
SLIPS = np.eye(3) - np.eye(3, k=-1)  # slips from speeds; its transpose gives forces on the blocks from contact forces


def is_balanced(modes, pulls, holds, slides):
    """Return whether blocks at rest under `pulls` may begin to move in these modes: no stuck contact exceeds its limit,
    and no slip accelerates against its mode."""
    modes = np.array(modes)
    slipping = modes != 0
    A, b = SLIPS @ np.diag(1.0 / MASSES) @ SLIPS.T, SLIPS @ (pulls / MASSES)
    forces = np.linalg.solve(
        np.where(slipping[:, None], np.eye(3), A), np.where(slipping, modes * slides * NORMAL_FORCES, b)
    )
    is_holding = np.abs(forces) <= holds * NORMAL_FORCES * (1.0 + 1e-12)
    return bool(np.all(np.where(slipping, modes * (b - A @ forces) >= -1e-12, is_holding)))


def balanced_modes(pulls, holds, slides):
    """Return all modes that balance."""
    return [modes for modes in product((-1, 0, 1), repeat=3) if is_balanced(modes, pulls, holds, slides)]


NAMES = ("ode23", "ode45", "dop853", "rodas")
FILES = {path.stem: path for path in LARGER_MODELS}
HEAD = '''"""A model."""
from fmus import *

class Mine(Model):
    """Blocks and springs."""

    k = Parameter(300.0, "N/m", "stiffness of a spring", low=0.0)
    m = Parameter(1.0, "kg", "mass of one", above=0.0)
    u = Parameter(0.2, "m/s", "speed of the driver")
'''


@pytest.fixture(scope="module")
def custom_model(tmp_path_factory):
    """Return mine(body): the model whose class has these additional lines, lowered with some or all methods, once."""
    path = tmp_path_factory.mktemp("mine") / "mine.py"

    def make(*body, methods=()):
        path.write_text(remove_unused(HEAD + "".join(f"    {line}\n" for line in body)))
        source = find_model(path)
        return lowered_model(source, select_features(source, methods))()

    return make


def body(name, force, mass):
    """Return the declarations of position, speed and acceleration of a body."""
    return [
        f'x{name} = State("m", "position of {name}")',
        f'v{name} = State("m/s", "speed of {name}", rate_of=x{name})',
    ], f'a{name} = Output("m/s2", "acceleration of {name}", ({force}) / ({mass} * m), rate_of=v{name})'


def contact(name, slip, slide, hold):
    return [
        f"mode{name} = Mode()",
        f'F{name} = Contact("N", "friction {name}", mode=mode{name}, slip={slip}, slide={slide}, hold={hold})',
    ]


DRIVER = 'p = State("m", "driver", rate=u)'


def events(model, method, rtol, stop):
    """Return time and modes at each step that ends with an event, and all step ends with their states and modes."""
    run = prepared_run(model, {"solver.method": method, "solver.rtol": rtol, "solver.atol": 1e-3 * rtol})
    start(model, run, model.initial_state(0.0), stop)
    step, changes, rows = run.solver.step, [], []
    while step.t1 < stop:
        assert compute_step(model, run) == 0
        rows.append((step.t1, components(step, "y1", model.states), components(step, "modes1", model.contacts)))
        if step.event_at_end:
            changes.append((step.t1, *rows[-1][2]))
    return changes, rows


def test_simultaneous_equal_events_are_one_event(custom_model):
    """Two equal sleds on two equal springs, pulled alike, have the same bits."""
    (body1, a), (body2, b) = body("1", "k * (p - x1) - F1", 12.5), body("2", "k * (p - x2) - F2", 12.5)
    lines = contact("1", "v1", 20.0, 30.0) + contact("2", "v2", 20.0, 30.0)
    changes, rows = events(custom_model(*body1, *body2, DRIVER, *lines, a, b, methods=["dop853"]), DOP853, 1e-10, 8.0)
    assert len(changes) > 5
    assert all(first == second for _, first, second in changes)
    assert all(x1 == x2 and v1 == v2 for _, (x1, v1, x2, v2), _ in rows)


@pytest.mark.parametrize("method", [ODE23, ODE45, DOP853, RODAS])
def test_mirrored_blocks_stop_together(custom_model, method):
    """Apart from rounding errors, as those of a linear solver that takes the blocks in turn."""
    (body1, a), (body2, b) = (
        body("1", "-k * x1 + 0.4 * k * (x2 - x1) - F1", 1.0),
        body("2", "-k * x2 + 0.4 * k * (x1 - x2) - F2", 1.0),
    )
    body1[0], body2[0] = (line[:-1] + f", start={x})" for line, x in ((body1[0], 0.1), (body2[0], -0.1)))
    lines = contact("1", "v1", 6.0, 7.5) + contact("2", "v2", 6.0, 7.5)
    changes, _rows = events(custom_model(*body1, *body2, *lines, a, b, methods=NAMES), method, 1e-6, 3.0)
    assert [(first, second) for _, first, second in changes] == [(1, -1), (-1, 1), (1, -1), (0, 0)]


def test_two_riders_on_one_carrier_break_away_and_stop_together(custom_model):
    (carrier, a), (rider1, b) = body("0", "F1 + F2 - 3.0 * k * x0", 3.0), body("1", "k * (p - x1) - F1", 1.3)
    rider2, c = body("2", "k * (p - x2) - F2", 1.3)
    lines = contact("1", "v1 - v0", 7.0, 10.0) + contact("2", "v2 - v0", 7.0, 10.0)
    changes, rows = events(
        custom_model(*carrier, *rider1, *rider2, DRIVER, *lines, a, b, c, methods=["dop853"]), DOP853, 1e-10, 8.0
    )
    assert len(changes) > 5
    assert all(first == second for _, first, second in changes)
    assert max(abs(y[2] - y[4]) for _, y, _ in rows) < 1e-12


@pytest.mark.parametrize("method", [ODE23, ODE45, DOP853, RODAS])
def test_a_block_and_the_plank_below_it_stop_under_constant_forces(custom_model, method):
    """The block slides on the plank, then both slide as one body: pieces of constant acceleration, in closed form."""
    (plank, a), (block, b) = body("1", "F2 - F1", 3.0), body("2", "-F2", 1.0)
    block[1] = block[1].replace('"speed of 2"', '"speed of 2", start=4.0')
    lines = contact("1", "v1", 2.0, 2.0) + contact("2", "v2 - v1", 5.0, 5.0)
    changes, rows = events(custom_model(*plank, *block, *lines, a, b, methods=NAMES), method, 1e-6, 10.0)
    sticking_time = 4.0 / (5.0 + 1.0)  # s: accelerations 1 and -5 m/s2
    stop = sticking_time + sticking_time / 0.5  # s: acceleration -0.5 m/s2
    assert changes == [(pytest.approx(sticking_time), 1, 0), (pytest.approx(stop), 0, 0)]
    for t, (_, v1, _, v2), _ in rows:
        common = max(sticking_time - 0.5 * (t - sticking_time), 0.0)
        assert (v1, v2) == pytest.approx((t, 4.0 - 5.0 * t) if t < sticking_time else (common, common), abs=1e-12)


def test_contacts_whose_effects_on_each_other_cancel_move_as_single_ones(custom_model):
    """Between two equal blocks, and on their mean speed: the difference and the mean of their positions are those of
    two blocks that each slide on their own."""
    (body1, a), (body2, b) = body("1", "k * (p - x1) - F1 - 0.5 * F2", 1.0), body("2", "F1 - k * x2 - 0.5 * F2", 1.0)
    (body3, c), (body4, d) = (
        body("3", "k * (p - x3) - 2.0 * F3", 1.0),
        body("4", "0.5 * (k * (p - 2.0 * x4) - F4)", 1.0),
    )
    lines = [
        *contact("1", "v1 - v2", 5.0, 8.0),
        *contact("2", "0.5 * (v1 + v2)", 9.0, 11.0),
        *contact("3", "v3", 5.0, 8.0),
        *contact("4", "v4", 9.0, 11.0),
    ]
    model = custom_model(*body1, *body2, *body3, *body4, DRIVER, *lines, a, b, c, d, methods=["dop853"])
    _changes, rows = events(model, DOP853, 1e-10, 8.0)
    histories = [[mode for mode, _ in groupby(modes)] for modes in zip(*(modes for *_, modes in rows), strict=True)]
    assert histories[:2] == histories[2:]
    assert len(histories[0]) > 5
    assert len(histories[1]) > 5
    for _, (x1, _, x2, _, x3, _, x4, _), _modes in rows:
        assert x1 - x2 == pytest.approx(x3, abs=1e-10)
        assert 0.5 * (x1 + x2) == pytest.approx(x4, abs=1e-10)


@pytest.mark.parametrize("method", slow_after(1, [DOP853, ODE23, ODE45, RODAS]))
@pytest.mark.parametrize(
    ("belt", "second_speed"),
    slow_after(
        1,
        [
            ("choose(x1 < 0.19 * metre, u, 3.0 * u)", 0.6),
            ("choose(clock < second, u, 3.0 * u)", 0.6),
            ("choose(clock < second, u, -u)", -0.2),
        ],
    ),
)
def test_a_block_slides_where_the_speed_of_its_belt_jumps(custom_model, belt, second_speed, method):
    """The block follows the belt after 0.1 s, and is at 0.19 m after 1 s, where the speed jumps; closed form."""
    (block, a), speed = body("1", "-F1", 1.0), 0.2
    units = [
        'second = Parameter(1.0, "s", "time")',
        'metre = Parameter(1.0, "m", "length")',
        'clock = State("s", "time", rate=1.0)',
    ]
    lines = contact("1", f"v1 - {belt}", 2.0, 3.0)
    changes, rows = events(custom_model(*units, *block, *lines, a, methods=NAMES), method, 1e-6, 2.0)
    end = 1.0 + abs(second_speed - speed) / 2.0
    direction = 1 if second_speed < speed else -1
    assert [mode for _, mode in changes] == [0, direction, 0]
    assert [t for t, _ in changes] == pytest.approx([0.1, 1.0, end], abs=1e-12)
    for t, y, _ in rows:
        sliding = speed - 2.0 * direction * (t - 1.0)
        v = 2.0 * t if t < 0.1 else speed if t < 1.0 else sliding if t < end else second_speed
        assert y[-1] == pytest.approx(v, abs=1e-12)


@pytest.mark.campaign
def test_the_order_of_declaration_does_not_matter(custom_model):
    """Three stacked blocks, driven from both sides: at first all contacts carry the same load and have the same
    limit."""
    laws = {"1": "F2 - F1 - k * x1", "2": "F3 - F2", "3": "k * (p - x3) - F3"}
    contacts = {"1": ("v1", 10.0, 14.0), "2": ("v2 - v1", 10.0, 14.0), "3": ("v3 - v2", 8.0, 14.0)}
    models = []
    for order in "123", "312":
        bodies = [body(name, laws[name], 2.0) for name in order]
        lines = [line for states, _ in bodies for line in states] + [DRIVER]
        lines += [line for name in order for line in contact(name, *contacts[name])] + [law for _, law in bodies]
        models.append((custom_model(*lines), order))
    for method in ODE45, DOP853, RODAS:
        results = []
        for model, order in models:
            changes, _ = events(model, method, 1e-9, 6.0)
            results.append([(t, *(modes[order.index(name)] for name in "123")) for t, *modes in changes])
        first, other = results
        assert len(first) > 10
        assert [modes for _, *modes in other] == [modes for _, *modes in first]
        assert np.abs(np.array([t for t, *_ in other]) - [t for t, *_ in first]).max() < 1e-8


STEPS = [(DOP853, 1e-3), (DOP853, 1e-6), (DOP853, 1e-9), (ODE45, 1e-4), (ODE23, 1e-3), (RODAS, 1e-4)]


@pytest.mark.parametrize(("method", "rtol"), slow_after(2, STEPS))
def test_a_load_that_peaks_inside_a_step_is_detected(custom_model, method, rtol):
    """A free mass shakes a block held by friction with up to 10 N: 10 % to 0.01 % above the limit, or as far as the
    method resolves it."""
    (mass, a), (block, b) = body("1", "-k * (x1 - x2)", 1.0), body("2", "k * (x1 - x2) - F2", 5.0)
    hold = 'most = Parameter(9.0, "N", "what is held", above=0.0)'
    mass[1] = mass[1].replace('"speed of 1"', '"speed of 1", start=1.0')
    model = custom_model(hold, *mass, *block, *contact("2", "v2", "0.9 * most", "most"), a, b, methods=NAMES)
    model.k = 100.0
    inside = 0
    for i in range(20):
        model.most = 10.0 * (1.0 - max(10.0 ** -(1.0 + 3.0 * i / 20), 3.0 * rtol))
        result, rows = events(model, method, rtol, 1.0)
        assert result, model.most
        assert abs(result[0][0] - asin(model.most / 10.0) / 10.0) < max(30.0 * rtol, 1e-8) ** 0.5
        before = [t for t, _, _ in rows if t < result[0][0]]
        inside += (before[-1] if before else 0.0) < result[0][0] - 1e-3
    assert inside > 2  # in doubt, a loose tolerance is tightened


GAUSS = np.polynomial.legendre.leggauss(8)


def integrate_power(model, power, stop):
    """Return the integral of `power`, a function of states and forces, over all steps of a run."""
    run = prepared_run(
        model, {"solver.method": DOP853, "solver.rtol": 1e-12, "solver.atol": 1e-15, "solver.h_max": 0.02}
    )
    start(model, run, model.initial_state(0.0), stop)
    step, total = run.solver.step, 0.0
    modes = [component_name("modes0", mode) for mode in model.contacts]
    while step.t1 < stop:
        assert compute_step(model, run) == 0
        h = step.t1 - step.t0
        for node, weight in zip(*GAUSS, strict=True):
            t = step.t0 + 0.5 * h * (1.0 + node)
            y = step.state_at(model, t)
            forces = model.contact_forces(t, *y, *(getattr(step, mode) for mode in modes))[: len(modes)]
            total += 0.5 * h * weight * np.array(power(t, y, forces))
    return total, components(step, "y1", model.states)


def test_a_clutch_conserves_momentum_and_dissipates_the_slip_power():
    """Also while it locks, until it opens: the work of the torque, and the loss by friction."""

    def power(t, y, forces):
        a, b, *_ = y
        torque = 10.0 * sin(10.0 * pi * t)
        return torque, torque * a - forces[0] * (a - b)

    (impulse, work), (a, b, *_) = integrate_power(lowered_model(FILES["clutch"])(), power, 1.2)
    assert a + b == pytest.approx(10.0 + impulse, abs=1e-10)
    assert 0.5 * (a * a + b * b) == pytest.approx(50.0 + work, abs=1e-9)


def test_stacked_blocks_balance_work_and_dissipation():
    def power(t, y, forces):
        _, v1, x2, v2 = y
        return 400.0 * (0.2 * t - x2) * v2 - forces[0] * v1 - forces[1] * (v2 - v1)

    work, (x1, v1, _, v2) = integrate_power(lowered_model(FILES["stacked"])(), power, 8.0)
    assert 2.0 * v1 * v1 + v2 * v2 + 75.0 * x1 * x1 == pytest.approx(work, abs=1e-9)


def test_a_stuck_contact_keeps_zero_slip():
    """The slip of a stuck contact is exactly zero at the end of every step."""
    for name in ("belt", "sleds", "stacked"):
        model = lowered_model(FILES[name])()
        _, rows = events(model, DOP853, 1e-9, model.stop_time)
        n_stuck = 0
        for t, y, modes in rows:
            slips = np.ravel(model.slip_velocities(t, *y))
            assert all(slip == 0.0 for slip, mode in zip(slips, modes, strict=True) if mode == 0)
            n_stuck += 0 in modes
        assert n_stuck > 5


def test_several_drivers_each_pull_at_their_own_speed(custom_model):
    """A mass between two drivers; the second starts at another position, and its speed is an expression."""
    another = 'q = State("m", "another", start=0.3, rate=0.5 * u)'
    (mass, a) = body("1", "k * (p - x1) + k * (q - x1)", 1.0)
    model = custom_model(*mass, DRIVER, another, a, methods=["dop853"])
    _, rows = events(model, DOP853, 1e-11, 2.0)
    w = 600.0**0.5
    for t, (x, v, q), _ in rows:
        assert q == pytest.approx(0.3 + 0.1 * t, abs=1e-14)
        assert x == pytest.approx(0.15 * (1.0 + t - np.cos(w * t) - np.sin(w * t) / w), abs=1e-9)
        assert v == pytest.approx(0.15 * (1.0 + w * np.sin(w * t) - np.cos(w * t)), abs=1e-8)
    model.compute_outputs(0.0, 0.0, 0.0, 0.3)
    assert model.q_rate == 0.1


# ---- three blocks in a stack

STACK = [
    'x1_start = Fixed(0.0, "m", "start of 1")',
    'x2_start = Fixed(0.0, "m", "start of 2")',
    'x3_start = Fixed(0.0, "m", "start of 3")',
    'mu_s = Parameter(0.4, "1", "static", low=0.0)',
    'mu_d = Parameter(0.25, "1", "sliding", low=0.0)',
    'g = Parameter(9.81, "m/s2", "gravity")',
]


def stack(without=""):
    """Return the declarations of three blocks on springs, each on the next; `without` is the contact to leave out."""
    forces = {name: "0.0" if name in without else f"F{name}" for name in "123"}
    laws = {"1": "{2} - {1} - k * x1", "2": "{3} - {2} - k * x2", "3": "k * (p - x3) - {3}"}
    laws = {name: law.format("", *forces.values()) for name, law in laws.items()}
    bodies = [body(name, laws[name], mass) for name, mass in zip("123", MASSES, strict=True)]
    states = [
        line.replace('")', f'", start=x{line[1]}_start)') if line[0] == "x" else line for s, _ in bodies for line in s
    ]
    slips = {"1": ("v1", "4.5"), "2": ("v2 - v1", "2.5"), "3": ("v3 - v2", "1.0")}
    contacts = [
        line
        for name, (slip, mass) in slips.items()
        if name not in without
        for line in contact(name, slip, f"mu_d * {mass} * m * g", f"mu_s * {mass} * m * g")
    ]
    return [*STACK, *states, DRIVER, *contacts, *(law for _, law in bodies)]


def test_random_starts_hold_as_many_contacts_as_balance(custom_model):
    model, draw, n_choices = custom_model(*stack(), methods=["ode45"]), np.random.default_rng(0), 0
    for _ in range(200):
        mu_s = draw.uniform(0.2, 0.6)
        mu_d = mu_s * draw.choice([1.0, draw.uniform(0.4, 1.0)])
        x = draw.normal(0.0, 0.3, 3) * draw.choice([0.3, 1.0, 2.0])
        model.mu_s, model.mu_d, model.k = mu_s, mu_d, draw.uniform(20.0, 200.0)
        model.x1_start, model.x2_start, model.x3_start = x
        run = prepared_run(model, {"solver.method": ODE45})
        start(model, run, model.initial_state(0.0), 1.0)
        solutions = balanced_modes(-model.k * x, mu_s, mu_d)
        modes = tuple(components(run.solver.step, "modes1", model.contacts))
        assert run.solver.step.event_location.has_consistent_modes
        assert modes in solutions
        assert modes.count(0) == max(solution.count(0) for solution in solutions)
        n_choices += len(solutions) > 1
    assert n_choices > 10


@pytest.mark.campaign
@pytest.mark.parametrize("free", slow_after(1, "123"))
def test_a_contact_without_friction_is_no_contact(custom_model, free):
    """The run is that of a model without it; it makes no events."""
    lines = [
        line.replace("slide=mu_d", "slide=0.0 * mu_d").replace("hold=mu_s", "hold=0.0 * mu_s")
        if line.startswith(f"F{free} ")
        else line
        for line in stack()
    ]
    results = []
    for declarations in lines, stack(without=free):
        model = custom_model(*declarations, methods=["dop853"])
        model.x1_start, model.x2_start, model.x3_start = 0.3, -0.2, 0.1
        changes, rows = events(model, DOP853, 1e-9, 6.0)
        results.append((changes, rows[-1][1]))
    (changes, end), (expected_changes, expected_end) = results
    assert len(changes) > 2
    assert [[*modes[: int(free) - 1], *modes[int(free) :]] for _, *modes in changes] == [
        modes for _, *modes in expected_changes
    ]
    assert all(modes[int(free) - 1] != 0 for _, *modes in changes)
    assert np.abs(np.array([t for t, *_ in changes]) - [t for t, *_ in expected_changes]).max() < 1e-6
    assert np.abs(np.array(end) - expected_end).max() < 1e-6


@pytest.mark.parametrize("method", [ODE45, DOP853])
def test_friction_may_vanish_and_return_in_a_run(custom_model, method):
    """A block upon a block, pressed by a force that comes and goes: without it, nothing sticks, and the lower block is
    a free oscillator."""
    (lower_block, a), (upper_block, b) = body("1", "F2 - k * x1", 4.0), body("2", "k * (p - x2) - F2", 2.0)
    law = 'N = Output("N", "force", choose(sin(phase) > 0.0, most * sin(phase), 0.0))'
    lines = [
        'most = Parameter(40.0, "N", "largest force")',
        'phase = State("rad", "phase", rate=3.0)',
        *lower_block,
        *upper_block,
        DRIVER,
        law,
        *contact("2", "v2 - v1", "N", "1.5 * N"),
    ]
    model = custom_model(*lines, a, b, methods=["ode45", "dop853"])
    changes, rows = events(model, method, 1e-10, 6.0)
    assert {mode for _, mode in changes} == {-1, 0, 1}
    free = [(t, y, modes[0]) for t, y, modes in rows if sin(3.0 * t) < -1e-9]
    assert len(free) > 10
    assert all(mode != 0 for _, _, mode in free)
    x, v = list(model.states).index("x1"), list(model.states).index("v1")
    w, n_compared = (300.0 / 4.0) ** 0.5, 0
    for (t, y, _), (end, later, _) in pairwise(free):
        if 3.0 * (end - t) < 1.0:  # within one interval without friction
            n_compared += 1
            expected = y[x] * cos(w * (end - t)) + y[v] / w * sin(w * (end - t))
            assert later[x] == pytest.approx(expected, abs=1e-7)
    assert n_compared > 10


# ---- slips that touch zero, and levers that vanish


@pytest.mark.parametrize(
    ("method", "rtol"),
    [
        (DOP853, 1e-12),
        *(
            pytest.param(method, rtol, marks=pytest.mark.campaign)
            for method, rtol in ((ODE23, 1e-6), (ODE45, 1e-6), (ODE45, 1e-12), (DOP853, 1e-6), (RODAS, 1e-6))
        ),
    ],
)
def test_a_slip_that_only_touches_zero_is_no_event(custom_model, method, rtol):
    """A block on a belt, with equal holding and sliding force, that starts at rest: its speed touches that of the belt
    once in each period."""
    (block, a) = body("1", "-k * x1 - F1", 1.0)
    model = custom_model(*block, *contact("1", "v1 - u", "2.0", "2.0"), a, methods=NAMES)
    model.k = 100.0
    changes, rows = events(model, method, rtol, 20.0)
    assert changes == []
    t, (x, v), _ = rows[-1]
    assert (x, v) == pytest.approx((0.02 - 0.02 * cos(10.0 * t), 0.2 * sin(10.0 * t)), abs=max(3e3 * rtol, 1e-9) * 0.2)


CRANK_BEHIND = {"J": 1.0, "k": 0.0, "r": 0.3, "f_d": 2.0, "f_s": 3.0}


@pytest.mark.parametrize("method", slow_after(2, [DOP853, RODAS, ODE23, ODE45]))
@pytest.mark.parametrize("start_angle", [0.0, 0.5 * pi])
def test_a_crank_passes_its_dead_points(method, start_angle):
    """Without a spring: friction takes the energy f r |cos q| for each angle, and the time follows by quadrature; the
    mode changes its sign at each dead point."""
    rtol, stop = {ODE23: 1e-7}.get(method, 1e-10), 5.0
    model = lowered_model(FILES["crank"])()
    run = prepared_run(
        model, {"solver.method": method, "solver.rtol": rtol, "solver.atol": 1e-3 * rtol, **CRANK_BEHIND}
    )
    start(model, run, (start_angle, 6.0, *model.initial_state(0.0)[2:]), stop)
    step, changes = run.solver.step, []
    while step.t1 < stop:
        assert compute_step(model, run) == 0
        if step.event_at_end:
            changes.append((step.y1_q, step.modes1_mode))

    def speed(q):
        turns, angle = divmod(q + 0.5 * pi, pi)
        first, first_angle = divmod(start_angle + 0.5 * pi, pi)
        integral = 2.0 * (turns - first) - cos(angle) + cos(first_angle)
        return (36.0 - 2.0 * 2.0 * 0.3 * integral) ** 0.5

    dead_points = [0.5 * pi + n * pi for n in range(1 if start_angle else 0, len(changes) + (1 if start_angle else 0))]
    assert len(changes) > 5
    assert [q for q, _ in changes] == pytest.approx(dead_points, abs=1e-9)
    assert [mode for _, mode in changes] == [1 if cos(q + 0.1) > 0.0 else -1 for q in dead_points]
    elapsed = quad(lambda q: 1.0 / speed(q), start_angle, step.y1_q, points=dead_points, limit=200, epsabs=1e-13)[0]
    assert elapsed == pytest.approx(stop, abs=3e3 * rtol)
    assert step.y1_w == pytest.approx(speed(step.y1_q), abs=3e3 * rtol)


def test_a_crank_at_rest_at_its_dead_point_is_not_held():
    """Without a torque it stays there."""
    ends = []
    for speed_of_driver in 0.0, 3.0:
        model = lowered_model(FILES["crank"])()
        model.Omega = speed_of_driver
        run = prepared_run(model, {"solver.method": DOP853, "solver.rtol": 1e-9, "solver.atol": 1e-12, "k": 2.0})
        model.k = 2.0 if speed_of_driver else 0.0
        assert model.prepare() == 0
        start(model, run, (0.5 * pi, 0.0, *model.initial_state(0.0)[2:]), 0.5)
        while run.solver.step.t1 < 0.5:
            assert compute_step(model, run) == 0
        ends.append((run.solver.step.y1_q, run.solver.step.modes1_mode))
    assert ends[0] == (0.5 * pi, 0)
    assert ends[1][0] < 0.5 * pi - 0.5
    assert ends[1][1] in (-1, 0)


# ---- laws without sticking

LAWS = {
    SIGN: ("laws=(HYBRID, SIGN)", lambda slip: np.sign(slip)),
    THRESHOLD: ("laws=(HYBRID, THRESHOLD), eps=0.01", lambda slip: np.sign(slip) * (abs(slip) >= 0.01)),
}


@pytest.mark.parametrize("law", slow_after(1, LAWS))
def test_laws_without_sticking_depend_on_each_slip(custom_model, law):
    """Rates, outputs and Jacobian are those of the modes given by the slips; the threshold law holds at most the
    limit."""
    words, expected_modes = LAWS[law]
    (body1, a), (body2, b) = body("1", "F2 - F1 - k * x1", 4.0), body("2", "k * (p - x2) - F2", 2.0)
    contact_lines = [line.replace("hold=", f"{words}, hold=") for line in contact("1", "v1", 9.0, 12.0)]
    contact_lines += [line.replace("hold=", f"{words}, hold=") for line in contact("2", "v2 - v1", 6.0, 8.0)]
    model, draw, n_clipped = (
        custom_model(*body1, *body2, DRIVER, *contact_lines, a, b, methods=["ode23"]),
        np.random.default_rng(2),
        0,
    )
    assert model.prepare() == 0
    for _ in range(200):
        y = draw.uniform(-0.05, 0.05, 4) * [1.0, draw.choice([0.0, 0.1, 1.0]), 1.0, draw.choice([0.1, 1.0])]
        model.friction = 1
        slips = np.array(model.slip_velocities(0.0, *y))
        modes = [int(expected_modes(slip)) for slip in slips]
        forces = np.array(model.contact_forces(0.0, *y, *modes)[:2])
        if law == SIGN:
            forces = np.sign(slips) * [9.0, 6.0]
        limit = np.where(np.array(modes) == 0, [12.0, 8.0], np.inf)
        n_clipped += bool(np.any(np.abs(forces) > limit))
        forces = np.clip(forces, -limit, limit)
        model.friction = law
        expected = (forces[1] - forces[0] - 300.0 * y[0]) / 4.0, (-300.0 * y[2] - forces[1]) / 2.0
        assert model.rates(0.0, *y, 0, 0) == pytest.approx(expected, abs=1e-11)
        assert model.law_modes(0.0, *y) == tuple(modes)
        model.compute_outputs(0.0, *y, 1, -1)  # the modes at the last event do not matter
        assert (model.mode1, model.mode2) == (1, -1)
        assert pytest.approx(forces, abs=1e-11) == (model.F1, model.F2)
    assert n_clipped == 0 or law == THRESHOLD
    run = prepared_run(model, {"solver.method": ODE23, "solver.rtol": 1e-3, "solver.atol": 1e-5, "u": 1.0})
    start(model, run, model.initial_state(0.0), 0.3)
    while run.solver.step.t1 < 0.3:
        assert compute_step(model, run) == 0


@pytest.mark.parametrize("bodies", [1, 2])
def test_the_jacobian_of_the_threshold_law_includes_the_load_limit(custom_model, bodies):
    """It agrees with differences of the rates, on the limit and below, so that rodas takes few steps."""
    (body1, a), (body2, b) = (
        body("1", "k * (p - x1) - F1" + " + F2" * (bodies - 1), 1.0),
        body("2", "-F2 - k * x2", 1.0),
    )
    contact_lines = contact("1", "v1", "f + w * x1", "1.5 * f + 2.0 * w * x1") + contact("2", "v2 - v1", "f", "2.0 * f")
    declarations = ['f = Parameter(6.0, "N", "friction")', 'w = Parameter(40.0, "N/m", "how it grows")', DRIVER, *body1]
    lines = [line.replace("hold=", f"{LAWS[THRESHOLD][0]}, hold=") for line in contact_lines]
    lines = [*declarations, *body2, *lines, a, b] if bodies == 2 else [*declarations, *lines[:2], a]
    model, draw, n_states = custom_model(*lines, methods=["rodas"]), np.random.default_rng(3), 2 * bodies
    assert model.prepare() == 0
    model.friction, n_limited = THRESHOLD, 0
    for _ in range(200):
        y = draw.uniform(-0.1, 0.1, n_states) * np.tile([1.0, 0.05], bodies)
        slopes = []
        for shift in 1e-7 * np.eye(n_states):
            ahead, behind = (np.ravel(model.rates(0.1, *(y + sign * shift), *[0] * bodies)) for sign in (1, -1))
            slopes.append((ahead - behind) / 2e-7)
        actual = np.reshape(model.jacobian(0.1, *y, *[0] * bodies), (bodies, n_states + 1))
        assert np.abs(actual[:, 1:].T - slopes).max() < 1e-5
        n_limited += bool(abs(slopes[0][0]) < 300.0)
    assert 20 < n_limited < 180


@pytest.mark.slow
@pytest.mark.parametrize("hold", [5.0, 8.0])
@pytest.mark.parametrize(("change", "mode"), [(1.0, 1), (0.0, 0), (-1.0, 0)])
def test_the_second_derivative_decides_where_a_load_starts_at_its_limit(custom_model, hold, change, mode):
    """The load is hold + change (1 - cos(p / 1 m)): at the start its rate is zero."""
    first, acceleration = body(1, f"{hold} * f + {change} * f * (1.0 - cos(p / d)) - F1", 1.0)
    model = custom_model(
        'f = Parameter(1.0, "N", "unit of force")',
        'd = Parameter(1.0, "m", "unit of length")',
        DRIVER,
        *first,
        *contact(1, "v1", "5.0 * f", f"{hold} * f"),
        acceleration,
    )
    run = prepared_run(model, {})
    start(model, run, model.initial_state(0.0), 5.0)
    assert components(run.solver.step, "modes1", ["mode1"]) == [mode]
