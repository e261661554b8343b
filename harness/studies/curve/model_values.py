"""Values of identified friction for the models belt, lugre, coulomb and stickslip, and the curve as a table."""

import numpy as np

from ...analyses.curve.identification import CurveIdentification
from ...analyses.curve.law_fit import LawFit, group_speeds
from ...errors import option_text

LINEAR_FORCE = "N"  # unit of the force of these models
LAWS = ("stribeck", "viscous", "coulomb")  # that these models have, with the same constants in both directions
STANDARD_G = 9.81  # m/s2, the default of stickslip
DIGITS = 6

Values = dict[str, float | str]


def law_of_models(result: CurveIdentification) -> LawFit | None:
    """Return the best law that the models have; None without one, or for a rotation."""
    if result.points.force_unit != LINEAR_FORCE:
        return None
    fits = [fit for fit in result.laws if fit.name in LAWS]  # best first
    return next((fit for fit in fits if fit.values["F_c"] > 0 and fit.values.get("F_v", 0.0) >= 0), None)


def model_values(result: CurveIdentification) -> dict[str, Values]:
    """Return the values of the parameters of each model, by its name."""
    fit = law_of_models(result)
    if fit is None:
        return {}
    constants = {name: float(f"{value:.{DIGITS}g}") for name, value in fit.values.items()}
    coulomb, viscous = constants["F_c"], constants.get("F_v", 0.0)
    static = max(constants.get("F_s", coulomb), coulomb)
    stribeck: Values = {"v_s": constants["v_s"]} if "v_s" in constants else {}
    mass: Values = {} if result.mass is None else {"m": result.mass}
    forces: Values = {"F_s": static, "F_c": coulomb}
    law: Values = {"law": "coulomb"} if fit.name == "coulomb" else {"law": "stribeck", "b": viscous}
    models = {
        "belt": mass | law | forces | stribeck,
        "lugre": mass | forces | {"sigma_2": viscous} | stribeck,
        "coulomb": mass | {"f": coulomb, "c": viscous},
    }
    if result.mass is not None:
        weight = result.mass * STANDARD_G
        coefficients = {"mu_s": static / weight, "mu_d": coulomb / weight}
        models["stickslip"] = mass | {name: float(f"{value:.{DIGITS}g}") for name, value in coefficients.items()}
    return models


def assignments(values: Values) -> str:
    """Return values as an option of `run`, `sweep` and `fit`, as in "--set F_c=1.2,F_s=1.5", or as an argument."""
    return option_text("values", dict(values))


def tabulate(result: CurveIdentification) -> dict[str, np.ndarray]:
    """Return the measured friction of each direction and of both over the speed, without bias and outliers.

    Points of nearly the same speed are averaged. A direction without a point at a speed is interpolated.
    """
    v = result.points.v[result.used]
    friction = np.sign(v) * (result.points.force[result.used] - result.best.bias)
    directions = {}
    speeds = np.array([float(np.abs(v[group]).mean()) for group in group_speeds(v)])
    for name, sign in (("forward", 1.0), ("backward", -1.0)):
        mask = sign * v > 0
        if mask.any():
            groups = group_speeds(v[mask])
            x, y = (
                np.array([float(values[group].mean()) for group in groups]) for values in (abs(v[mask]), friction[mask])
            )
            directions[name] = np.interp(speeds, x, y)
    return {"speed": speeds, "friction": np.mean([*directions.values()], axis=0), **directions}
