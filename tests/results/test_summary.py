"""Summaries of results: what is written reads back, and what is no summary is refused in one sentence."""

import json

import pytest

from harness import HarnessError
from harness.results.provenance import write_provenance
from harness.results.summary import (
    SUMMARY_FILE,
    MissingResult,
    Outcome,
    Sketch,
    Summary,
    SummaryTable,
    read_summary,
    write_summary,
)

WHOLE = Summary(
    "run",
    "a title",
    ("A sentence.",),
    (SummaryTable(("", "x [m]"), (("first", "1"), ("last", "2"))), SummaryTable(("a",), (("b",),), "folded")),
    "the figure in words",
    Outcome("+2 %", "period differs by +2 %", True, 2.0, "published", "a book"),
    (Sketch("motion", "0.0,1.0 2.0,3.0", ("2.0,3.0 4.0,5.0",), 75.0), Sketch("phase", "0.0,1.0", (), None)),
    (MissingResult("another", "a command"),),
)


@pytest.fixture
def folder(tmp_path):
    """A folder with a provenance, a table and a figure."""
    write_provenance(tmp_path, [], {"k": (2.0, "N/m")}, command="python -m harness run smd")
    for name in ("b.csv", "a.csv", "figure.svg"):
        (tmp_path / name).write_text("")
    return tmp_path


def test_a_summary_reads_back_with_origin_and_files(folder):
    write_summary(folder, WHOLE)
    summary = read_summary(folder)
    assert summary.files == ("a.csv", "b.csv")
    assert summary.origin[0].endswith(": python -m harness run smd")
    assert summary.origin[1] == "Parameters: k = 2.0 N/m."
    assert {name: value for name, value in vars(summary).items() if name not in ("files", "origin")} == {
        name: value for name, value in vars(WHOLE).items() if name not in ("files", "origin")
    }


def test_a_summary_names_a_figure_only_if_there_is_one(folder):
    (folder / "figure.svg").unlink()
    write_summary(folder, WHOLE)
    assert read_summary(folder).picture == ""


def text_with(**changes):
    return json.dumps({"version": 1, "study": "run", "title": "a title"} | changes)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "is missing, as in results of earlier versions"),
        ("", "is not complete"),
        ('{"study": "run", "ti', "is not complete"),
        ("[" * 100_000, "is not complete"),
        ("\0", "is not complete"),
        ("[1]", "is not the summary of a result"),
        ('{"name": "of another program"}', "is not the summary of a result"),
        (text_with(version=2), "is of version 2, and this program reads version 1"),
        ('{"version": 1, "title": "a title"}', "is not valid (the key 'study' is missing)"),
        (text_with(colour="red"), "is not valid ("),
        (text_with(sentences="one"), "is not valid (sentences = 'one' is not a list)"),
        (text_with(outcome={"value": "1", "text": "", "is_good": True, "deviation": "x"}), "is not valid (outcome"),
        (
            text_with(tables=[{"headings": ["a"], "rows": [["b", "c"]]}]),
            "is not valid (tables[0] = a table whose rows are not as long as its headings)",
        ),
        (text_with(files=["../../secret"]), "is not valid ("),
    ],
)
def test_what_is_no_summary_is_refused_with_the_command_to_run(folder, content, reason):
    if content is not None:
        (folder / SUMMARY_FILE).write_text(content)
    with pytest.raises(HarnessError) as refused:
        read_summary(folder)
    message = str(refused.value)
    assert message.startswith(f"summary.json {reason}")
    assert message.endswith(": run `python -m harness run smd` again")
    assert "\n" not in message
