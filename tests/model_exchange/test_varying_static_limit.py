"""Static and sliding friction may vary: breakaway is on time, and inconsistent friction is reported."""

import pytest
from internal_steps import components, compute_step, prepared_run, start
from models import DOP853, LARGER_MODELS, MODELS, ODE45, RODAS, declarations_of, scalar_class

from fmus.compiler.lowering import component_name, lowered_model, model_exchange_run, sibling_module
from fmus.runtime.codes import NO_CONSISTENT_MODES

FILES = {path.stem: path for path in LARGER_MODELS}
ULP = 2.0**-52
SLIDER = '''"""A model."""
from fmus import Contact, Input, Mode, Model, Output, Parameter, State


class Slider(Model):
    """A body that is pressed on its way: what it slides with is not known beforehand."""

    m = Parameter(2.0, "kg", "mass", above=0.0)
    grip = Parameter(4.0, "N", "what holds", low=0.0)
    press = Input(3.0, "N", "what slides", low=0.0)
    F_ext = Input(0.0, "N", "outer force")
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    F = Contact("N", "friction", mode=mode, slip=v, slide=press, hold=grip)
    a = Output("m/s2", "acceleration", (F_ext - F) / m, rate_of=v)
'''


@pytest.mark.parametrize("method", [ODE45, DOP853, RODAS])
def test_a_constant_load_breaks_away_when_the_static_limit_drops_to_it(method):
    """A sled under a force, lifted by its driver: breaks away when mu_s (m g - lift u t) equals the force."""
    model = lowered_model(FILES["lift"])()
    run = prepared_run(model, {"solver.method": method, "k": 0.0, "F_ext": 60.0})
    start(model, run, model.initial_state(0.0), 16.0)
    step = run.solver.step
    while not step.event_at_end:
        assert compute_step(model, run) == 0
        assert step.t1 < 16.0
    assert step.t1 == pytest.approx((12.5 * 9.81 - 60.0 / 0.9) / (300.0 * 0.034), rel=1e-9)
    assert components(step, "modes1", model.contacts) == [1]


def externally_integrated(source, values):
    """Return a model under an importer's solver, its model-exchange interface, and its run."""
    cls = lowered_model(source)
    exchange = sibling_module(cls, "runtime.model_exchange")
    model, run = model_exchange_run(cls)
    prepared_run(model, {"solver.method": DOP853, "solver.rtol": 1e-6} | values, run)
    start(model, run, model.initial_state(0.0), 1.0)
    exchange.begin(run, model)
    return model, exchange, run


STICKING_MODELS = [source for source in (*MODELS, *FILES.values()) if scalar_class(source)().contacts]
STICKING_MODELS = [  # belt and clutch slip at the start
    source for source in STICKING_MODELS if source not in (FILES["belt"], FILES["clutch"])
]


@pytest.mark.parametrize("source", STICKING_MODELS, ids=lambda source: getattr(source, "stem", source))
def test_no_contact_sticks_while_its_indicator_requires_breakaway(source):
    """For any input, to the last bit: an importer would never notice it otherwise."""
    rest = {name: 0.0 for name, d in declarations_of(source).items() if name in ("x0", "theta0")}
    model, exchange, run = externally_integrated(source, rest)
    entry = next(
        name for name, d in declarations_of(source).items() if d.causality == "input" and d.unit in ("N", "N.m")
    )
    n_contacts, n_tried = len(model.contacts), 0
    solver = run.solver
    names = [component_name("y", state) for state in model.states]
    names += [component_name("modes", mode) for mode in model.contacts]
    start_values = [getattr(solver, name) for name in names]

    def push(force):
        """Return the indicators before and after the event, with the modes of the start."""
        for name, number in zip(names, start_values, strict=True):
            setattr(solver, name, number)
        setattr(model, entry, force)
        exchange.update_indicators(run, model)
        before = min(run.model_exchange.indicators[n_contacts : 2 * n_contacts])
        exchange.update_modes(run, model)
        exchange.update_indicators(run, model)
        return before, min(run.model_exchange.indicators[n_contacts : 2 * n_contacts])

    low, high = getattr(model, entry), 1e4
    assert push(low)[0] > 0.0 >= push(high)[0]
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (low, middle) if push(middle)[0] <= 0.0 else (middle, high)
    for places in range(300):
        before, after = push(high * (1.0 + places * ULP))
        n_tried += before <= 0.0
        assert after > 0.0, places
    assert n_tried == 300


@pytest.fixture
def slider(tmp_path):
    path = tmp_path / "slider.py"
    path.write_text(SLIDER)
    return path


def test_sliding_friction_above_static_friction_is_reported_and_stops_the_run(slider):
    """In co-simulation by any method, and in model exchange."""
    methods = [value for _, value, _ in declarations_of(slider)["solver.method"].items]
    for method in methods:
        model = lowered_model(slider)()
        run = prepared_run(model, {"solver.method": method, "press": 5.0, "F_ext": 4.5})
        start(model, run, model.initial_state(0.0), 1.0)
        assert compute_step(model, run) == NO_CONSISTENT_MODES
    model, exchange, run = externally_integrated(slider, {"press": 5.0})
    model.F_ext = 4.5
    exchange.update_modes(run, model)
    assert not run.solver.step.event_location.has_consistent_modes
    model, exchange, run = externally_integrated(slider, {"press": 3.9})
    model.F_ext = 4.5
    exchange.update_modes(run, model)
    assert (run.solver.y_x, run.solver.y_v, run.solver.modes_mode) == (0.0, 0.0, 1)
