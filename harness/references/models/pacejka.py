"""Sled with the magic formula, by scipy's Radau with the exact Jacobian, restarted where a value changes."""

from collections.abc import Iterator
from math import asin, atan, cos, pi, sin, tan
from pathlib import Path

import numpy as np

from ...scenes.run_spec import RunSpec
from ..certified_reference import ReferenceCase
from ..ode_problem import JacobianFunction, OdeProblem, RhsFunction, StateVector
from ..segments import ParameterSpan, ParameterValues, Segment, shift_time
from .stickslip import StickslipProblem


class MagicFormula:
    """Coefficient of friction `mu` and its `slope` in s/m, as functions of the velocity in m/s."""

    def __init__(self, p: ParameterValues):
        self.D, self.C = p["mu_s"], 1 + (1 - 2 * asin(p["mu_d"] / p["mu_s"]) / pi)
        self.B = (p["mu_s"] / (p["x_m"] / 2)) / (self.C * self.D)
        top = self.B * p["x_m"]
        self.E = (top - tan(pi / (2 * self.C))) / (top - atan(top))

    def mu(self, v: float) -> float:
        bv = self.B * v
        return self.D * sin(self.C * atan(bv - self.E * (bv - atan(bv))))

    def slope(self, v: float) -> float:
        bv = self.B * v
        inner = bv - self.E * (bv - atan(bv))
        rise = self.B * (1 - self.E * bv * bv / (1 + bv * bv))
        return self.D * self.C * cos(self.C * atan(inner)) * rise / (1 + inner * inner)


class PacejkaProblem(StickslipProblem):
    """The sled with the magic formula: one smooth equation without modes."""

    has_dry_friction, is_stiff = False, True

    def __init__(self, x_m: float = 0.01) -> None:
        self.atol_factor = min(x_m, OdeProblem.atol_factor)  # the velocity at the peak of the curve sets the scale
        self.curve = MagicFormula({"mu_s": self.mu_s, "mu_d": self.mu_d, "x_m": x_m})

    def rates(self, mode: int) -> RhsFunction:
        square, speed, weight = self.k / self.m, self.v_driver, self.curve.D * self.g
        B, C, E = self.curve.B, self.curve.C, self.curve.E  # inlined, as in a program written for speed

        def rates(t: float, y: StateVector) -> tuple[float, float]:
            x, v = y
            z = B * v
            return v, square * (speed * t - x) - weight * sin(C * atan(z - E * (z - atan(z))))

        return rates

    def jacobian(self, mode: int) -> JacobianFunction:
        square = self.k / self.m
        return lambda t, y: [[0.0, 1.0], [-square, -self.curve.slope(y[1]) * self.g]]


def solve_segments(spans: list[ParameterSpan]) -> Iterator[Segment]:
    """Yield the motion of m a = F_ext + k (x_driver - x) - mu(v) m g, one segment from each change of values on."""
    from scipy.integrate import solve_ivp

    y, drive = [spans[0][2]["x0"], spans[0][2]["v0"]], 0.0
    for begin, end, p in spans:
        curve = MagicFormula(p)

        def rates(
            s: float, y: np.ndarray, p: ParameterValues = p, curve: MagicFormula = curve, drive: float = drive
        ) -> tuple[float, float]:
            load = p["F_ext"] + p.get("rate", 0.0) * s + p["k"] * (drive + p["v_driver"] * s - y[0])
            return y[1], load / p["m"] - curve.mu(y[1]) * p["g"]

        def jacobian(s: float, y: np.ndarray, p: ParameterValues = p, curve: MagicFormula = curve) -> list[list[float]]:
            return [[0.0, 1.0], [-p["k"] / p["m"], -curve.slope(y[1]) * p["g"]]]

        # time counts from the beginning of the span, where it has more digits than the time of the run
        options = {"rtol": 1e-11, "atol": 1e-15, "dense_output": True}
        run = solve_ivp(rates, (0.0, end - begin), y, "Radau", jac=jacobian, **options)
        yield Segment(begin, 1, shift_time(run.sol, begin))
        y, drive = run.y[:, -1], drive + p["v_driver"] * (end - begin)


def make_case(x_m: str, reference: str) -> ReferenceCase:
    """Return the case of a curve with its peak at the velocity x_m (m/s)."""
    run = RunSpec(Path("pacejka.fmu"), ("x", "v"), {"x_m": float(x_m)})
    law, problem = f"magic formula, x_m = {x_m} m/s", PacejkaProblem(float(x_m))
    return ReferenceCase(f"pacejka-{x_m}", run, law, reference, problem, "stickslip")


CASES = (
    make_case("0.01", "pacejka"),
    make_case("0.001", "pacejka-0.001"),
    make_case("0.0001", "pacejka-0.0001"),
)
