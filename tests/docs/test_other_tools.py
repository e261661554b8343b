"""The numbers that the page on other tools asks its readers to compare."""

from pathlib import Path

import pytest
from fmpy import simulate_fmu
from native_fmus import build_native_fmus

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "other_tools.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("settings", "digits"),
    [
        ({"fmi_type": "CoSimulation", "output_interval": 0.01}, "0.454934"),
        ({"fmi_type": "CoSimulation", "output_interval": 4.0}, "0.454934"),
        ({"fmi_type": "ModelExchange", "relative_tolerance": 1e-8}, "0.45493"),
        ({"fmi_type": "ModelExchange"}, "0.45493"),
        ({"fmi_type": "ModelExchange", "solver": "Euler", "step_size": 0.016, "output_interval": 0.016}, "0.49991"),
        ({"fmi_type": "ModelExchange", "solver": "Euler", "step_size": 0.001, "output_interval": 0.001}, "0.45749"),
    ],
)
def test_the_sled_ends_where_the_page_says(settings, digits):
    fmu = build_native_fmus() / "stickslip.fmu"
    end = simulate_fmu(str(fmu), stop_time=16.0, output=["x", "mode"], **settings)[-1]
    assert f"{end['x']:.{len(digits) - 2}f}" == digits
    assert f"{digits} m" in PAGE
    assert end["mode"] == 0
