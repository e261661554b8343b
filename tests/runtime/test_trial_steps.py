"""A step whose stages leave the domain of the equations is repeated with a smaller size."""

from math import exp, log, sqrt

import pytest
from build_cache import build_user_model
from models import DOP853, ODE23, ODE45, RADAU9, RODAS
from native_fmus import require_compiler
from scipy.integrate import solve_ivp
from variants import campaign_after

STOP, T_ON, END = 4.0, 1.0, 1.02
RATES = {  # of each kind of exception: start value and rate, as the model and as Python write it
    "sqrt": (1.0, "-60.0 * sqrt(z)", lambda z: -60.0 * sqrt(z)),
    "log": (1.0, "-30.0 * log(1.0 + z)", lambda z: -30.0 * log(1.0 + z)),
    "exp": (1.0, "60.0 * (exp(-100.0 * z) - 1.0)", lambda z: 60.0 * (exp(-100.0 * z) - 1.0)),
    "division": (0.0, "20.0 / (1.0 + z)", lambda z: 20.0 / (1.0 + z)),
}
MODEL = '''from fmus import *


class Late(Model):
    """A quantity that rests for one second, while the steps grow, and then decays."""

    rate = Parameter(1.0, "Hz", "one per second", low=0.0)
    t_on = Parameter({t_on!r}, "s", "end of the rest")
    clock = State("s", "time", rate=1.0)
    z = State("1", "quantity", start={start!r})
    dz = Output("Hz", "rate of the quantity", choose(clock > t_on, {rate} * rate, 0.0), rate_of=z)
    stop_time = {stop!r}
'''


@pytest.mark.parametrize(
    ("name", "kind"),
    campaign_after(1, [*((name, "") for name in RATES), ("log", "native"), ("division", "native")]),
)
def test_a_trial_step_outside_the_domain_of_a_function_is_repeated(worker, tmp_path, name, kind):
    start, rate, function = RATES[name]
    (file := tmp_path / "late.py").write_text(MODEL.format(t_on=T_ON, stop=STOP, start=start, rate=rate))
    words = [f"--method={method}" for method in ("ode23", "ode45", "dop853", "rodas", "radau9")]
    if kind:
        require_compiler()
        words += ["--native", "--platform", "linux64"]
    path = build_user_model(file, *words) / kind / "late.fmu"
    true = solve_ivp(lambda t, z: [function(*z)], (T_ON, END), [start], "DOP853", rtol=1e-12, atol=1e-14, max_step=1e-4)
    for method in (ODE23, ODE45, DOP853, RODAS, RADAU9):
        fmu = worker.instantiate(path).begin({"solver.method": method, "solver.rtol": 1e-9}, stop=STOP)
        fmu.step(0.0, END)
        assert abs(fmu.get("z") - true.y[0, -1]) < 2e-7
        fmu.free()
