"""Reading of result folders of any study and version."""

import json
from pathlib import Path
from typing import Any

from ..errors import HarnessError, SceneError, first_line
from .registry import find_study, study_of_folder
from .result import Result, StoredResult
from .summary import SUMMARY_FILE, Summary, read_summary


def load(folder: Path) -> Result:
    """Return the result in a folder; SceneError if there is none, or if it is damaged."""
    summary = load_summary(folder)
    try:
        study = find_study(summary.study) if summary else study_of_folder(folder)
    except SceneError:
        if summary is None:
            raise
        return StoredResult(folder, summary, {})
    kind = study.result_class()
    if kind.is_stored(folder):
        return study.read(folder)
    return StoredResult(folder, summary or Summary(study.name, folder.name), load_numbers(folder / study.files[0]))


def load_summary(folder: Path) -> Summary | None:
    """Return the summary of a result; None if there is none that this version reads."""
    try:
        return read_summary(folder) if (folder / SUMMARY_FILE).is_file() else None
    except HarnessError:
        return None


def load_numbers(file: Path) -> dict[str, Any]:
    """Return the numbers in the JSON file of a result; empty for another file."""
    if file.suffix != ".json" or not file.is_file():
        return {}
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise SceneError(f"{file} cannot be read: {first_line(error)}") from None
    if not isinstance(content, dict):
        raise SceneError(f"{file} cannot be read: it is not a table")
    return content
