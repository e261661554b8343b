"""Summaries of results: what is no summary is refused in one sentence, and the rest of the report is written."""

import json
from dataclasses import replace
from html import unescape

import commands
import numpy as np

import harness


def text_with(**changes):
    return json.dumps({"version": 1, "study": "run", "title": "a title"} | changes)


REFUSED_CONTENTS = [  # the content of summary.json, and the reason
    (None, "is missing"),
    ("", "is not complete"),
    ('{"study": "run", "ti', "is not complete"),
    ("[" * 100_000, "is not complete"),
    ("\0", "is not complete"),
    ("[1]", "is not the summary of a result"),
    ('{"name": "of another program"}', "is not the summary of a result"),
    (text_with(version=2), "is of version 2, and this program reads version 1"),
    ('{"version": 1, "title": "a title"}', "is not valid (the key 'study' is missing)"),
    (text_with(colour="red"), "is not valid ("),
    (text_with(sentences="one"), "is not valid (sentences = 'one' must be a list)"),
    (text_with(outcome={"value": "1", "text": "", "is_good": True, "deviation": "x"}), "is not valid (outcome"),
    (
        text_with(tables=[{"headings": ["a"], "rows": [["b", "c"]]}]),
        "is not valid (tables[0]: a row is not as long as the headings)",
    ),
    (text_with(files=["../../secret"]), "is not valid ("),
]


def test_what_is_no_summary_is_shown_with_its_reason_and_the_command_to_run(tmp_path):
    origin = {
        "command": "python -m harness run smd",
        "date": "2026-11-27",
        "files": {},
        "parameters": {},
        "scene": None,
    }
    for i, (content, _) in enumerate([*REFUSED_CONTENTS, (text_with(title="a good one"), "")]):
        folder = tmp_path / f"results/{i}"
        folder.mkdir(parents=True)
        (folder / "provenance.json").write_text(json.dumps(origin))
        if content is not None:
            (folder / "summary.json").write_text(content)
    result = commands.harness(tmp_path, "report")
    assert (result.returncode, result.stderr) == (0, "")
    page = unescape((tmp_path / "results/report.html").read_text(encoding="utf-8"))
    assert "<h3>a good one</h3>" in page
    for i, (_, reason) in enumerate(REFUSED_CONTENTS):
        _, _, text = page.partition(f"<p>results/{i} cannot be shown: summary.json ")
        message, _, _ = text.partition("</p>")
        assert message.startswith(reason), i
        assert message.endswith(": run <code>python -m harness run smd</code> again."), i


def test_five_remarks_are_printed_and_the_others_counted(tmp_path):
    t = np.arange(0, 20, 0.01)
    x = np.exp(-0.05 * t) * np.cos(5 * t) + 1e-3 * np.random.default_rng(1).standard_normal(len(t))
    decay = harness.identify_decay((t, x), unit="m")
    for count, last in ((5, "remark 4"), (8, "3 more remarks: `remarks` has them.")):
        decay = replace(decay, remarks=tuple(f"remark {i}" for i in range(count)))
        assert decay.blocks()[-1] == last
