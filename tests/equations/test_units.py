"""Units of heat and electricity: friction heats and motors drive."""

import re
import zipfile
from math import exp
from xml.etree import ElementTree

import build_cache
import fmpy
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

import harness
from fmus.compiler import BuildError
from fmus.compiler.units import parse_unit
from fmus.packaging.archive import build

BRAKE = '''
from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State


class Fading(Model):
    """Disc that a brake stops, whose friction falls as the brake heats up: J alpha = -M_friction."""

    J = Parameter(0.4, "kg.m2", "moment of inertia", above=0)
    N = Parameter(500.0, "N", "normal force", low=0)
    r = Parameter(0.1, "m", "radius of the brake", low=0)
    mu_0 = Parameter(0.4, "1", "coefficient of friction at T_0", low=0)
    fade = Parameter(2e-3, "1/K", "relative loss of friction with temperature", low=0)
    C_h = Parameter(50.0, "J/K", "heat capacity", above=0)
    h = Parameter(20.0, "W/(m2.K)", "coefficient of heat transfer", low=0)
    A = Parameter(0.02, "m2", "surface", low=0)
    T_0 = Fixed(293.15, "K", "temperature of the air and of the brake at the start", above=0)
    omega_0 = Fixed(150.0, "rad/s", "speed at the start")
    omega = State("rad/s", "speed", start=omega_0)
    T = State("K", "temperature of the brake", start=T_0)
    mode = Mode()
    rise = Output("K", "rise in temperature", T - T_0)
    M_friction = Contact("N.m", "friction torque", mode=mode, slip=omega, slide=mu_0 * (1.0 - fade * rise) * r * N)
    P = Output("W", "heat of friction", M_friction * omega)
    alpha = Output("rad/s2", "acceleration", -M_friction / J, rate_of=omega)
    dT = Output("K/s", "rate of the temperature", (P - h * A * rise) / C_h, rate_of=T)
    tolerance = 1e-10
'''
MOTOR = '''
from fmus import Contact, Mode, Model, Output, Parameter, State


class Motor(Model):
    """Motor with dry friction in its bearings: J alpha = K_t i - M_friction, L di/dt = U - R i - K_t omega."""

    J = Parameter(1e-4, "kg.m2", "moment of inertia", above=0)
    K_t = Parameter(0.05, "N.m/A", "torque constant, which is the voltage constant in V.s/rad")
    R = Parameter(1.2, "ohm", "resistance", above=0)
    L = Parameter(2e-3, "H", "inductance", above=0)
    U = Parameter(12.0, "V", "voltage")
    M_s = Parameter(0.03, "N.m", "torque of friction at rest", low=0)
    M_d = Parameter(0.02, "N.m", "torque of friction in motion", low=0)
    omega = State("rad/s", "speed")
    i = State("A", "current")
    q = State("C", "charge that has flowed")
    mode = Mode()
    M_friction = Contact("N.m", "friction torque", mode=mode, slip=omega, slide=M_d, hold=M_s)
    U_ind = Output("V", "induced voltage", K_t * omega)
    alpha = Output("rad/s2", "acceleration", (K_t * i - M_friction) / J, rate_of=omega)
    di = Output("A/s", "rate of the current", (U - R * i - U_ind) / L, rate_of=i)
    dq = Output("A", "current as the rate of the charge", i, rate_of=q)
    stop_time = 0.5
    step_size = 0.001
    tolerance = 1e-10
'''


@pytest.fixture(scope="module", params=["fading", "motor"])
def fmu(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    path = folder / f"{request.param}.py"
    path.write_text(BRAKE if request.param == "fading" else MOTOR, encoding="utf-8")
    return build(path, folder)


def base_units(path):
    """Return the exponents of each unit in the model description."""
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    return {unit.get("name"): dict(unit.find("BaseUnit").attrib) for unit in root.iter("Unit")}


EXPONENTS = {
    "fading": {
        "K": {"K": "1"},
        "1/K": {"K": "-1"},
        "J/K": {"kg": "1", "m": "2", "s": "-2", "K": "-1"},
        "W/(m2.K)": {"kg": "1", "s": "-3", "K": "-1"},
        "W": {"kg": "1", "m": "2", "s": "-3"},
        "K/s": {"K": "1", "s": "-1"},
    },
    "motor": {
        "A": {"A": "1"},
        "C": {"s": "1", "A": "1"},
        "V": {"kg": "1", "m": "2", "s": "-3", "A": "-1"},
        "ohm": {"kg": "1", "m": "2", "s": "-3", "A": "-2"},
        "H": {"kg": "1", "m": "2", "s": "-2", "A": "-2"},
        "N.m/A": {"kg": "1", "m": "2", "s": "-2", "A": "-1"},
    },
}


def test_units_have_exponents_of_kelvin_and_ampere(fmu):
    assert EXPONENTS[fmu.stem].items() <= base_units(fmu).items()


def test_fmpy_finds_no_problem(fmu):
    assert validate_fmu(str(fmu)) == []
    assert {variable.unit for variable in fmpy.read_model_description(fmu).modelVariables} >= EXPONENTS[fmu.stem].keys()


def test_fmi3_has_the_same_units(tmp_path):
    path = tmp_path / "motor.py"
    path.write_text(MOTOR, encoding="utf-8")
    words = ("--fmi", "3", "--platform", "linux64", "--method", "ode45")
    fmu = build_cache.build_user_model(path, *words) / "native" / "fmi3" / "motor.fmu"
    assert EXPONENTS["motor"].items() <= base_units(fmu).items()


def test_a_brake_fades_and_stops_as_scipy_says(tmp_path):
    """Also by the balance of energy: the loss of kinetic energy heats the brake and the air."""
    path = tmp_path / "fading.py"
    path.write_text(BRAKE, encoding="utf-8")
    run = harness.simulate(str(build(path, tmp_path)), {"h": 0.0}, stop=4.0)

    def rates(t, y):
        torque = 0.4 * (1.0 - 2e-3 * (y[1] - 293.15)) * 0.1 * 500.0
        return [-torque / 0.4, torque * y[0] / 50.0]

    def stops(t, y):
        return y[0]

    stops.terminal = True
    peer = solve_ivp(rates, (0.0, 4.0), [150.0, 293.15], "DOP853", rtol=1e-12, atol=1e-12, events=stops)
    frame = run.to_pandas()
    assert run.events.t[-1] == pytest.approx(peer.t_events[0][0], rel=1e-9)
    assert frame["T"].iloc[-1] - 293.15 == pytest.approx(0.5 * 0.4 * 150.0**2 / 50.0, rel=1e-9)
    assert frame["mode"].iloc[-1] == 0


@pytest.mark.slow
def test_a_motor_turns_at_the_speed_at_which_torques_balance(tmp_path):
    path = tmp_path / "motor.py"
    path.write_text(MOTOR, encoding="utf-8")
    frame = harness.simulate(str(build(path, tmp_path)), stop=2.0).to_pandas()
    current = 0.02 / 0.05
    assert frame["i"].iloc[-1] == pytest.approx(current, rel=1e-6)
    assert frame["omega"].iloc[-1] == pytest.approx((12.0 - 1.2 * current) / 0.05, rel=1e-6)
    stuck_rows = frame[frame["mode"] == 0]  # with the rotor at rest the current is that of a coil
    assert list(stuck_rows["i"]) == pytest.approx(
        [12.0 / 1.2 * (1.0 - exp(-1.2 / 2e-3 * t)) for t in stuck_rows.index], rel=1e-9
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"N.m/A"', '"N.m"', r"U_ind is declared in V, but K_t \* omega is in kg m\^2/s\^3"),
        ('"ohm"', '"V"', r"mixes units: kg m\^2/s\^3/A and kg m\^2/s\^3"),
        ('"H"', '"H/s"', "di is declared in A/s"),
        ('"A", "current"', '"Volt", "current"', 'write "V"'),
        ('"A", "current"', '"degC", "current"', "use K for temperatures"),
    ],
)
def test_a_wrong_unit_is_refused(tmp_path, old, new, message):
    path = tmp_path / "wrong.py"
    path.write_text(MOTOR.replace(old, new), encoding="utf-8")
    with pytest.raises(BuildError, match=message):
        build(path, tmp_path)


def test_equal_units_have_equal_exponents():
    pairs = [("V", "W/A"), ("ohm", "V/A"), ("C", "A.s"), ("H", "V.s/A"), ("N.m/A", "V.s"), ("W/(m2.K)", "W/m2/K")]
    for a, b in pairs:
        first, second = (re.sub("quantity='[^']*'", "", repr(parse_unit(unit))) for unit in (a, b))
        assert first == second
    assert parse_unit("W/(m2.K") is parse_unit("W/(m2/K)") is parse_unit("()") is None
