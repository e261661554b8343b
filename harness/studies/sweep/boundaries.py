"""Known boundaries in the space of parameters, to be drawn into the map of a sweep: where a quantity is 1."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Space = dict[str, Any]  # parameters by name: numbers, or arrays of one shape


@dataclass(frozen=True)
class Boundary:
    """`quantity` of the parameters and the stop time is 1 on the boundary; it depends on the parameters named."""

    text: str
    parameters: tuple[str, ...]
    quantity: Callable[[Space, float], Any]


def first_pull(p: Space, stop: float) -> Any:
    """The force of a spring pulled at constant speed until the stop, over the holding limit."""
    return p["k"] * np.abs(p["v_driver"]) * stop / (p["mu_s"] * p["m"] * p["g"])


SLED = ("m", "k", "mu_s", "g", "v_driver")
BOUNDARIES = {
    "smd": (Boundary("critical damping, c = 2 sqrt(k m)", ("m", "k", "c"), lambda p, _: damping_ratio(p)),),
    "coulomb": (
        Boundary("no motion from rest, f = k |x0|", ("k", "f", "x0"), lambda p, _: p["f"] / (p["k"] * np.abs(p["x0"]))),
    ),
    "stickslip": (
        Boundary("first break-away at the stop, v_driver = mu_s m g/(k t)", SLED, first_pull),
        Boundary("no loss of friction on sliding, mu_d = mu_s", ("mu_s", "mu_d"), lambda p, _: p["mu_d"] / p["mu_s"]),
    ),
    "pacejka": (
        Boundary(
            "peak of the friction curve, v_driver = x_m: steady sliding is stable below",
            ("x_m", "v_driver"),
            lambda p, _: np.abs(p["v_driver"]) / p["x_m"],
        ),
        Boundary("first slip of a rigid contact at the stop, v_driver = mu_s m g/(k t)", SLED, first_pull),
    ),
    "pendulum": (
        Boundary(
            "no motion from rest, mu r = a |sin(theta0)|",
            ("mu", "r", "a", "theta0"),
            lambda p, _: p["mu"] * p["r"] / (p["a"] * np.abs(np.sin(p["theta0"]))),
        ),
    ),
}


def damping_ratio(p: Space) -> Any:
    return p["c"] / (2 * np.sqrt(p["k"] * p["m"]))


def known(model: str, varied: tuple[str, ...]) -> list[Boundary]:
    """The boundaries of a model that run through the space of these parameters."""
    return [each for each in BOUNDARIES.get(model, ()) if set(each.parameters) & set(varied)]
