"""Identified friction for models: values for belt, lugre, coulomb and stickslip, a table, and model files."""

from dataclasses import dataclass

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


def tabulate_friction(result: CurveIdentification) -> dict[str, np.ndarray]:
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


LAW_MODEL, TABLE_MODEL = "measured.py", "measured_table.py"  # files
NEXT_LINE = "\n    "
TIME_TO_SLIP = 1.0  # s, after which the spring of the default run exceeds the static friction


@dataclass(frozen=True)
class Names:
    """Names and units of the variables of a motion."""

    inertia: str
    inertia_unit: str
    stiffness_unit: str
    position: str
    position_unit: str
    velocity: str
    acceleration: str
    acceleration_unit: str
    force: str
    kind: str


LINEAR = Names("m", "kg", "N/m", "x", "m", "v", "a", "m/s2", "F", "force")
ROTATION = Names("J", "kg.m2", "N.m/rad", "theta", "rad", "omega", "alpha", "rad/s2", "T", "torque")


@dataclass(frozen=True)
class Friction:
    """Friction of a model file.

    Attributes
    ----------
    title : str
        Name of the class of the model.
    text : str
        Line of its docstring.
    imports : str
        Names that the expressions need.
    declarations : list of str
        Parameters or tables.
    sliding_friction : list of str
        Expressions over `speed`: one for both directions, or one for each.
    holding_limits : list of str
        Limits of sticking; empty if these are the sliding friction at rest.
    """

    title: str
    text: str
    imports: str
    declarations: list[str]
    sliding_friction: list[str]
    holding_limits: list[str]


def write_law_model(result: CurveIdentification) -> str:
    """Return the text of the model file with the best law."""
    best = result.best
    law = best.law
    suffixes = ("",) if law.is_symmetric else ("+", "-")
    friction = Friction(
        "Measured",
        law.text,
        ", exp" * bool(law.exponent) + ", fabs",
        [
            f'{symbol(item.name)} = Parameter({item.value:.9g}, "{item.unit}", "{item.text}")'
            for item in best.estimates
            if item.name != "bias"
        ],
        [friction_expression(law.exponent, law.is_viscous, suffix) for suffix in suffixes],
        [symbol("F_s" if law.exponent else "F_c", suffix) for suffix in suffixes],
    )
    return write_model(result, friction)


def write_table_model(result: CurveIdentification) -> str:
    """Return the text of the model file that reads the measured friction from the table beside it."""
    names = ["friction"] if result.best.law.is_symmetric else ["forward", "backward"]
    friction = Friction(
        "MeasuredTable",
        "The friction is linear between the points of the table, and constant below the first and above the last one",
        ", Table, fabs",
        [f'{name}_table = Table("{table_file(name)}")' for name in names],
        [f"{name}_table(speed)" for name in names],
        [],
    )
    return write_model(result, friction)


def write_model(result: CurveIdentification, friction: Friction) -> str:
    """Return the text of a model file with this friction."""
    best, points = result.best, result.points
    names = LINEAR if points.force_unit == "N" else ROTATION
    force, kind = names.force, names.kind
    is_symmetric = len(friction.sliding_friction) == 1
    curve_names = ["sliding"] if is_symmetric else ["forward", "backward"]
    curves = [f"{name} = {text}" for name, text in zip(curve_names, friction.sliding_friction, strict=True)]
    limits = [f"slide={mean_of(curve_names)}"] + (
        [f"hold={mean_of(friction.holding_limits)}"] if friction.holding_limits else []
    )
    contact = f"{force}_friction" if is_symmetric else f"{force}_mean"
    asymmetry = (
        ""
        if is_symmetric
        else f"""
    {force}_friction = Output(
        "{points.force_unit}",
        "friction {kind}, opposing the motion",
        {force}_mean + 0.5 * (forward - backward),
    )"""
    )
    static = max(best.values.get(name, 0.0) for name in ("F_s", "F_c", "F_s+", "F_s-", "F_c+", "F_c-"))
    speed = default_speed(result)
    imports = "Contact, Fixed, Input, Mode, Model, Output, Parameter, State" + friction.imports
    return f'''"""Body on a spring, with measured friction."""

from fmus import {imports}


class {friction.title}(Model):
    """Body that a driver of constant speed pulls through a spring; friction identified from {one_line(points.name)}.

    {friction.text}.
    """

    {names.inertia} = Parameter({result.mass or 1.0:.9g}, "{names.inertia_unit}", "inertia", above=0.0)
    k = Parameter({static / (speed * TIME_TO_SLIP):.4g}, "{names.stiffness_unit}", "stiffness of the spring", low=0.0)
    v_driver = Parameter({speed:.4g}, "{points.velocity_unit}", "speed of the driver")
    bias = Parameter({best.bias:.9g}, "{points.force_unit}", "constant {kind} against the motion, such as gravity")
    {NEXT_LINE.join(friction.declarations)}
    {names.position}0 = Fixed(0.0, "{names.position_unit}", "initial position")
    {names.velocity}0 = Fixed(0.0, "{points.velocity_unit}", "initial speed")
    {force}_ext = Input(0.0, "{points.force_unit}", "external {kind}")

    {names.position} = State("{names.position_unit}", "position", start={names.position}0)
    {names.velocity} = State("{points.velocity_unit}", "speed", start={names.velocity}0, rate_of={names.position})
    driver = State("{names.position_unit}", "position of the driver", rate=v_driver)
    mode = Mode()

    speed = fabs({names.velocity})
    {NEXT_LINE.join(curves)}
    {force}_spring = Output("{points.force_unit}", "{kind} of the spring", k * (driver - {names.position}))
    {contact} = Contact(
        "{points.force_unit}",
        "{"friction " + kind + ", opposing the motion" if is_symmetric else "mean of both directions"}",
        mode=mode,
        slip={names.velocity},
        {(NEXT_LINE + "    ").join(f"{limit}," for limit in limits)}
    ){asymmetry}
    {names.acceleration} = Output(
        "{names.acceleration_unit}",
        "acceleration",
        ({force}_ext + {force}_spring - bias - {force}_friction) / {names.inertia},
        rate_of={names.velocity},
    )

    stop_time, step_size = {10 * TIME_TO_SLIP}, {0.01 * TIME_TO_SLIP}
'''


def table_file(name: str) -> str:
    """Return the file of a column of `tabulate`."""
    return "table.csv" if name == "friction" else f"table-{name}.csv"


def mean_of(terms: list[str]) -> str:
    """Return the expression of one term, or of the mean of two."""
    return terms[0] if len(terms) == 1 else f"0.5 * ({terms[0]} + {terms[1]})"


def symbol(name: str, suffix: str = "") -> str:
    """Return the Python name of a constant, as F_c_forward for F_c+."""
    return f"{name}{suffix}".replace("+", "_forward").replace("-", "_backward")


def friction_expression(exponent: int, is_viscous: bool, suffix: str) -> str:
    """Return friction over `speed` in one direction as an expression."""
    coulomb, static, v_s, viscous = (symbol(name, suffix) for name in ("F_c", "F_s", "v_s", "F_v"))
    ratio = f"(speed / {v_s})"
    decrease = {0: "", 1: f"exp(-{ratio})", 2: f"exp(-{ratio} * {ratio})"}[exponent]
    text = coulomb + (f" + ({static} - {coulomb}) * {decrease}" if exponent else "")
    return text + (f" + {viscous} * speed" if is_viscous else "")


def default_speed(result: CurveIdentification) -> float:
    """Return a speed of the driver: half of the Stribeck velocity, or the smallest measured speed."""
    values = result.best.values
    for name in ("v_s", "v_s+"):
        if name in values:
            return 0.5 * values[name]
    return float(np.abs(result.points.v).min())


def one_line(name: str) -> str:
    """Return the name of a record without characters that end a docstring."""
    return "".join(letter if letter.isalnum() or letter in " ._-" else "_" for letter in name)
