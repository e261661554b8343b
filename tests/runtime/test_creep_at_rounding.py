"""A body under control that creeps within the tolerance, or the rounding errors, of its set point."""

import fmpy
import pytest
from build_cache import build_user_model
from native_fmus import require_compiler

AXIS = '''from fmus import Contact, Mode, Model, Output, Parameter, State, Table, fabs


class Axis(Model):
    """Axis under PID control: its friction does not vary at low speed, so that it creeps to the set point."""

    m = Parameter(2.0, "kg", "mass", above=0.0)
    r = Parameter(0.01, "m", "set point of the position")
    K_p = Parameter(5e3, "N/m", "proportional gain", low=0.0)
    K_i = Parameter(2e4, "N/(m.s)", "integral gain", low=0.0)
    K_d = Parameter(50.0, "N.s/m", "derivative gain", low=0.0)
    DECLARATION
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    E = State("m.s", "integral of the position error")
    mode = Mode()
    e = Output("m", "position error", r - x, rate_of=E)
    F = Output("N", "force of the controller", K_p * e - K_d * v + K_i * E)
    F_friction = Contact("N", "friction force", mode=mode, slip=v, slide=FRICTION)
    a = Output("m/s2", "acceleration", (F - F_friction) / m, rate_of=v)
    stop_time, step_size, method = 60.0, 0.05, "dop853"
'''


FRICTION = {  # declaration and sliding force
    "table": (
        'guide = Table([0.001, 0.002, 0.004, 0.007, 0.02], [13.015, 12.915, 12.59, 12.12, 9.1], "m/s", "N")',
        "guide(fabs(v))",
    ),
    "constant": ('F_k = Parameter(13.015, "N", "sliding force", low=0.0)', "F_k"),
}


@pytest.mark.campaign
@pytest.mark.parametrize("kind", FRICTION)
def test_slips_within_the_tolerance_take_few_steps(tmp_path, kind):
    """The load equals the friction but for rounding errors, or slips are too slow for the error control to see."""
    require_compiler()
    path = tmp_path / "axis.py"
    declaration, friction = FRICTION[kind]
    path.write_text(AXIS.replace("DECLARATION", declaration).replace("FRICTION", friction))
    fmu = build_user_model(path, "--native", "--platform", "linux64") / "native" / "axis.fmu"
    result = fmpy.simulate_fmu(
        fmu, start_values={"solver.rtol": 1e-8}, stop_time=60.0, output_interval=0.5, output=["x", "solver.steps"]
    )
    assert abs(result["x"][-1] - 0.01) < 1e-9
    assert result["solver.steps"][-1] < 2000
