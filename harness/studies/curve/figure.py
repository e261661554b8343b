"""Figure of identified friction: force over velocity with all laws, friction over speed, and residuals."""

import numpy as np

from ...analyses.curve.identification import CurveIdentification
from ...results.style import BLUE, GREEN, GREY, HEIGHT, LEGEND_ABOVE, ORANGE, WIDTH, Axes, Figure, axis_label, set_size

CURVE_POINTS = 400
DIRECTIONS = ((1.0, "forward", BLUE, "o"), (-1.0, "backward", GREEN, "s"))
LAW_COLOURS = {"coulomb": "#CC79A7", "viscous": "#56B4E9", "tustin": "#E69F00", "stribeck": "#999933"}
MAX_SHARE = 0.05  # of the largest speed: with a smaller lowest speed the axis of the speed is logarithmic


def draw(result: CurveIdentification, figure: Figure) -> None:
    """Draw the figure."""
    set_size(figure, 1.8 * WIDTH, 3.2 * HEIGHT)
    force, friction, residuals = figure.subplots(3, 1, height_ratios=(2.2, 2.2, 1))
    plot_force(force, result)
    plot_friction(friction, result)
    plot_residuals(residuals, result)


def plot_force(axes: Axes, result: CurveIdentification) -> None:
    """Plot the force over the velocity, with the best law and the others."""
    points, labels = result.points, set[str]()
    plot_points(axes, result, points.v, points.force)
    for sign, *_ in DIRECTIONS:
        if v := velocities(result, sign):
            for fit in result.laws[:0:-1]:
                colour = LAW_COLOURS.get(fit.name, GREY)
                name = fit.name if fit.law.is_symmetric else "asymmetric laws"
                label = None if name in labels else name
                labels.add(name)
                axes.plot(v, fit.force(np.array(v)), color=colour, linewidth=0.8, linestyle="--", label=label)
            best = None if "fit" in labels else f"fit: {result.best.name}"
            labels.add("fit")
            axes.plot(v, result.best.force(np.array(v)), color=ORANGE, linewidth=1.6, label=best)
    if result.best.bias:
        axes.axhline(result.best.bias, color=GREY, linestyle=":", linewidth=0.8, label="bias")
    axes.set_title(points.name)
    axes.set_xlabel(axis_label("velocity", points.velocity_unit))
    axes.set_ylabel(axis_label("force" if points.force_unit == "N" else "torque", points.force_unit))
    axes.legend(ncols=5, **LEGEND_ABOVE)


def plot_friction(axes: Axes, result: CurveIdentification) -> None:
    """Plot the friction of both directions over the speed, without the bias."""
    points = result.points
    sign, speed = np.sign(points.v), np.abs(points.v)
    plot_points(axes, result, speed, sign * (points.force - result.best.bias))
    for direction, _, colour, _ in DIRECTIONS:
        if v := velocities(result, direction):
            friction = direction * result.best.friction(np.array(v))
            axes.plot(np.abs(v), friction, color=ORANGE if result.best.law.is_symmetric else colour, linewidth=1.4)
    if speed.min() < MAX_SHARE * speed.max():
        axes.set_xscale("log")
    axes.set_title("friction of both directions over the speed, without the bias")
    axes.set_xlabel(axis_label("speed", points.velocity_unit))
    axes.set_ylabel(axis_label("friction", points.force_unit))


def plot_residuals(axes: Axes, result: CurveIdentification) -> None:
    """Plot the residuals of the best law over the velocity."""
    points, residual = result.points, result.best.residual
    plot_points(axes, result, points.v, result.residuals)
    axes.axhspan(-residual, residual, color=GREY, alpha=0.2, linewidth=0)
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.set_title(f"residuals (the band is their standard deviation, {residual:.3g} {points.force_unit})")
    axes.set_xlabel(axis_label("velocity", points.velocity_unit))
    axes.set_ylabel(axis_label("points - fit", points.force_unit))


def plot_points(axes: Axes, result: CurveIdentification, x: np.ndarray, y: np.ndarray) -> None:
    """Plot points of both directions, with crosses on those that do not fit."""
    for sign, label, colour, marker in DIRECTIONS:
        mask = sign * result.points.v > 0
        if mask.any():
            axes.plot(x[mask], y[mask], marker, color=colour, fillstyle="none", markersize=4, label=label)
    if not result.used.all():
        axes.plot(x[~result.used], y[~result.used], "x", color="black", markersize=7, label="does not fit")


def velocities(result: CurveIdentification, sign: float) -> list[float]:
    """Return velocities of one direction for a curve; none if it has no points."""
    speeds = np.abs(result.points.v[sign * result.points.v > 0])
    if not len(speeds):
        return []
    low, high = float(speeds.min()), float(speeds.max())
    grid = np.union1d(np.geomspace(low, high, CURVE_POINTS), np.linspace(low, high, CURVE_POINTS))
    return [float(v) for v in sign * grid]
