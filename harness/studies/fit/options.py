"""Options of the command fit: ranges, assignments, columns and values to start from."""

import json
from collections.abc import Iterable, Mapping
from math import isfinite
from pathlib import Path

from ...errors import SceneError, format_value
from ...scenes.assignments import parse_assignments
from .request import is_unknown


def split_list(texts: Iterable[str]) -> list[str]:
    """Return the items of comma-separated lists."""
    return [item.strip() for text in texts for item in text.split(",") if item.strip()]


def parse_ranges(texts: Iterable[str]) -> dict[str, tuple[float, float] | None]:
    """Return the range of each name, as in "mu_s,mu_d=0.1:2"; None without a range."""
    ranges: dict[str, tuple[float, float] | None] = {}
    for item in split_list(texts):
        name, separator, limits = (part.strip() for part in item.partition("="))
        if name in ranges:
            raise SceneError(f"--free names {name} twice: remove one")
        low, colon, high = limits.partition(":")
        if separator and not colon:
            raise SceneError(f"--free {item}: give a range, as in {name}=0.1:2, or fix it by --set {item}")
        ranges[name] = (parse_number("--free", item, low), parse_number("--free", item, high)) if separator else None
    return ranges


def parse_numbers(option: str, texts: Iterable[str]) -> dict[str, float]:
    """Return the numbers of assignments, as in "k=800,m=3"."""
    return {
        name: parse_number(option, f"{name}={value}", str(value))
        for name, value in parse_assignments(option, texts).items()
    }


def parse_starts(texts: Iterable[str], free: Iterable[str], each: Iterable[str]) -> dict[str, float]:
    """Return the values to start from: assignments, and the values of stored fits that are free again."""
    starts: dict[str, float] = {}
    assignments = []
    for text in texts:
        path = Path(text)
        if path.is_dir() or path.suffix == ".json":
            starts |= select_starts(read_fitted_values(path), free, each)
        else:
            assignments.append(text)
    return starts | parse_numbers("--start", assignments)


def select_starts(values: Mapping[str, float], free: Iterable[str], each: Iterable[str]) -> dict[str, float]:
    """Return those values of an earlier fit that are free again."""
    return {name: value for name, value in values.items() if is_unknown(name, free, each)}


def read_fitted_values(path: Path) -> dict[str, float]:
    """Return the values of a stored fit by name, from its folder or its fit.json.

    Raises
    ------
    SceneError
        If there is no fit.
    """
    file = path / "fit.json" if path.is_dir() else path
    try:
        fitted = json.loads(file.read_text(encoding="utf-8"))["fit"]
        return {estimate["name"]: float(estimate["value"]) for estimate in fitted if estimate["value"] is not None}
    except (OSError, ValueError, KeyError, TypeError):
        raise SceneError(f"{path} holds no result of a fit: name its folder or its fit.json") from None


def parse_number(option: str, item: str, text: str) -> float:
    """Return a finite number; raise SceneError if the text is none."""
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    if not isfinite(number):
        raise SceneError(f"{option} {item}: {format_value(text)} is not a finite number")
    return number


def parse_columns(option: str, texts: Iterable[str]) -> dict[str, str]:
    """Return the heading of each variable, as in "x=position"; the name of the variable without a heading."""
    columns = {}
    for text in texts:
        name, _, heading = text.partition("=")
        if not name.strip():
            raise SceneError(f"{option} {format_value(text)} names no variable; write it as in x=position")
        columns[name.strip()] = heading.strip() or name.strip()
    return columns
