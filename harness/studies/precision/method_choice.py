"""Fastest method of an FMU for each case and accuracy, for the report."""

from ...results.summary import METHODS_TABLE, Outcome, SummaryTable, make_table
from .advice import TARGET, TARGETS, format_power, format_ratio, rank_solvers
from .study import FMU, Point, StudiedCase, Study

NONE_REACHES = "none of the measured methods"  # reaches the accuracy
NOT_MEASURED = "no method has been measured successfully"


def tabulate_choices(study: Study, min_ratio: float) -> tuple[tuple[SummaryTable, ...], Outcome]:
    """Return the table of methods by case and accuracy, and the methods for the usual accuracy."""
    headings = ("case", *(f"error up to {format_power(target)}" for target in TARGETS))
    rows, usual_methods = [], []
    for case in study.cases:
        choices = [choose_method(study, case, target, min_ratio) for target in TARGETS]
        notes = ["error against true stick and slip"] * case.is_chattering + ["quick run"] * bool(min_ratio)
        rows.append(["\n".join(lines) for lines in ((case.name, *notes), *choices)])
        usual_method = choices[TARGETS.index(TARGET)][0]
        if usual_method and not case.is_chattering:
            usual_methods.append(usual_method)
    methods = " or ".join(dict.fromkeys(usual_methods)) or f"{NONE_REACHES} reached it"
    return make_table(headings, rows, METHODS_TABLE), Outcome(methods, f"for an error of {format_power(TARGET)}", True)


def choose_method(study: Study, case: StudiedCase, accuracy: float, min_ratio: float = 0.0) -> tuple[str, ...]:
    """Return the fastest method of the FMU whose error is at most `accuracy`, its run time, and the runner-up.

    The method is empty if there is none. The error of a law that chatters is that against true stick and slip. Run
    times that differ by less than the factor `min_ratio` are not distinguished.
    """
    ranks = rank_solvers(study, case, accuracy, case.is_chattering)
    best = next((point for point in ranks if point.tool == FMU), None)
    if best is None:
        return "", *smallest_error(study, case)
    runner_up = next((point for point in ranks if point is not best), None)
    comparison = compare_times(best, runner_up, min_ratio) if runner_up else "no other solver reaches it"
    return best.method, format_time(best.seconds), comparison


def smallest_error(study: Study, case: StudiedCase) -> tuple[str, ...]:
    """Return sentences on the smallest error that the methods of the FMU reach."""
    curves = [study.curve(case, *solver) for solver in study.solvers(case) if solver[0] == FMU]
    errors = [(point.error(case.is_chattering), point.method) for curve in curves for point in curve]
    if not errors:
        return (NOT_MEASURED,)
    error, method = min(errors)
    return NONE_REACHES, f"smallest error: {error:.2g}, with {method}"


def compare_times(best: Point, other: Point, min_ratio: float) -> str:
    """Return how much faster a method is than another solver."""
    ratio, name = other.seconds / best.seconds, other.method if other.tool == FMU else f"{other.tool} {other.method}"
    if min_ratio and 1 / min_ratio < ratio < min_ratio:
        return f"{name} is about as fast (quick run)"
    if ratio < 1:
        return f"{name} is {format_ratio(1 / ratio)} times faster"
    return f"{format_ratio(ratio)} times faster than {name}"


def format_time(seconds: float) -> str:
    """Format a run time with two digits; a busy machine makes more of them meaningless."""
    return f"{format_ratio(seconds)} s" if seconds >= 1 else f"{format_ratio(1e3 * seconds)} ms"
