"""Reading of result folders of any study."""

from pathlib import Path

from ..errors import HarnessError, SceneError
from .provenance import load_provenance
from .registry import find_study, study_of_folder
from .result import Result
from .summary import SUMMARY_FILE, Summary, read_summary


def load(folder: Path) -> Result:
    """Return the result in a folder; SceneError if there is none, or if it is damaged."""
    summary = load_summary(folder)
    kind = (find_study(summary.study) if summary else study_of_folder(folder)).result_class()
    if not kind._is_stored(folder):
        command = load_provenance(folder).get("command", "the command that wrote it")
        raise SceneError(f"{folder} lacks the data of its result: run `{command}` again")
    return kind._load(folder)


def load_summary(folder: Path) -> Summary | None:
    """Return the summary of a result; None if there is none that this version reads."""
    try:
        return read_summary(folder) if (folder / SUMMARY_FILE).is_file() else None
    except HarnessError:
        return None
