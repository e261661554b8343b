"""README.md is short, its code blocks run, its links lead somewhere."""

import re
from doctest import ELLIPSIS, NORMALIZE_WHITESPACE, OutputChecker

import measured_records
import numpy as np
import pytest
from commands import run_process

from tests.docs.test_docs import DOCS, ROOT, assert_same_texts, load, run_page, scripts

README = ROOT / "README.md"
DECAY_PAGE = DOCS / "tutorials" / "identify_decay.md"


def test_readme_is_short():
    assert 60 <= len(README.read_text(encoding="utf-8").splitlines()) < 120


@pytest.mark.slow
def test_readme_code_blocks_run_and_draw_its_pictures(workspace, environment):
    run_page(README, workspace, environment)
    images = load("make_images")
    _, precision = images.FIGURES_OF_COMMANDS["precision"]
    label_pattern = r"\w+: \w+"  # the labels of the fastest methods
    assert_same_texts(DOCS / "images" / "precision.svg", workspace / precision, leave_out=label_pattern)
    images.plot_stability(workspace / "results/stability/stability.csv", workspace / "stability.svg")
    assert_same_texts(DOCS / "images" / "stability.svg", workspace / "stability.svg")


@pytest.mark.slow
def test_the_measured_pendulum_gives_the_quoted_output(tmp_path):
    """From the reduced record, written to a file like the original."""
    record = measured_records.find_record()
    if record is None:
        pytest.skip(measured_records.MISSING)
    measured_records.write_original(record, tmp_path)
    blocks = scripts.find_blocks(DECAY_PAGE.read_text(encoding="utf-8"))
    (index,) = [i for i, block in enumerate(blocks) if measured_records.ORIGINAL in block.text]
    command, output = blocks[index : index + 2]
    assert command.text.strip() == f"friction-fmus {measured_records.COMMAND}"
    result = run_process(tmp_path, *measured_records.COMMAND.split())
    assert result.returncode == 0, result.stderr
    flags = ELLIPSIS | NORMALIZE_WHITESPACE
    assert OutputChecker().check_output(output.text, result.stdout, flags), result.stdout
    (figure,) = tmp_path.glob("results/decay/*/figure.svg")
    assert_same_texts(DOCS / "images" / "measured.svg", figure)
    amplitude = np.abs(np.loadtxt(record, delimiter=",", skiprows=1)[:, 1]).max()
    assert f"explains {100 * amplitude**2 / 16:.2f} %" in DECAY_PAGE.read_text(encoding="utf-8")


def test_set_up_commands_come_first():
    """.ci/run runs the first two blocks."""
    first, second = re.findall(r"^```sh\n(.*?)^```$", README.read_text(encoding="utf-8"), re.M | re.S)[:2]
    assert "python build_fmus.py && python -m harness" in first
    assert "python -m pytest" in second


def test_the_readme_and_the_first_page_count_the_models_of_fmus_more():
    names = sorted(path.stem for path in (ROOT / "fmus/more").glob("*.py"))
    count = {9: "nine", 10: "ten", 11: "eleven"}[len(names)]
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    (model_list,) = re.findall(rf"`friction-fmus build --more` builds {count} more models \((.*?)\)", readme)
    assert sorted(re.findall("`(.*?)`", model_list)) == names
    assert f"`fmus/more` has {count} more models" in (ROOT / "docs/index.md").read_text(encoding="utf-8")


def test_links_of_the_readme_exist():
    text = README.read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#:]+)\)|src(?:set)?=\"([^\"]+)\"", text):
        (path,) = filter(None, link)
        assert (ROOT / path).exists(), path
