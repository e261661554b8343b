"""Run the code blocks of Markdown pages, in order, in one folder and in one Python process for each page.

    sh                          run by bash; it must exit with status 0
    python                      executed; the blocks of a page share their names
    any, with title="NAME"      written to the file NAME
    text, after sh or python    the output of that block, where "..." matches anything

A block after the comment <!-- not run: REASON --> is skipped.  `python docs/run_blocks.py --write FOLDER PAGE...` runs
pages in a folder and rewrites the outputs that differ. The programs are those in the folder of Python, or in the
folder that the environment variable PROGRAMS names.
"""

import os
import re
import subprocess
import sys
from contextlib import redirect_stdout
from dataclasses import dataclass
from doctest import ELLIPSIS, NORMALIZE_WHITESPACE, OutputChecker
from io import StringIO
from pathlib import Path

FENCE = re.compile(
    r"^(?P<indent> *)```(?P<language>\w*)(?: title=\"(?P<title>[^\"]+)\")?\n(?P<text>.*?)^(?P=indent)```$", re.M | re.S
)
SKIP = re.compile(r"<!-- not run: ([^>]+) -->\s*\Z")
RUN = ("sh", "python")
TIMEOUT = 300.0  # s


@dataclass(frozen=True)
class Block:
    """A code block of a page.

    Attributes
    ----------
    language : str
        Language after the fence, such as sh.
    title : str
        Name of the file to write; empty if the block is not a file.
    text : str
        Text without indentation.
    line : int
        Number of the line of the fence.
    indent : str
        Indentation in the page.
    span : tuple of (int, int)
        Start and end of the text in the page, in characters.
    skip_reason : str
        Reason for which the block is not run; empty if it is run.
    """

    language: str
    title: str
    text: str
    line: int
    indent: str
    span: tuple[int, int]
    skip_reason: str


def find_blocks(page: str) -> list[Block]:
    """Return all code blocks of a page."""
    blocks = []
    for fence in FENCE.finditer(page):
        skip = SKIP.search(page[: fence.start()])
        indent = fence["indent"]
        text = "".join(line.removeprefix(indent) for line in fence["text"].splitlines(keepends=True))
        line = page.count("\n", 0, fence.start()) + 1
        reason = skip[1] if skip else ""
        blocks.append(Block(fence["language"], fence["title"] or "", text, line, indent, fence.span("text"), reason))
    return blocks


def run(block: Block, page: Path, names: dict[str, object]) -> str:
    """Run one block in the current folder and return its output.

    Raises
    ------
    RuntimeError
        If the block fails.
    """
    if block.language == "sh":
        process = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", block.text], capture_output=True, text=True, timeout=TIMEOUT
        )
        if process.returncode or process.stderr:
            raise RuntimeError(f"exit status {process.returncode}\n{block.text}{process.stdout}{process.stderr}")
        return process.stdout
    with redirect_stdout(StringIO()) as output:
        exec(compile("\n" * block.line + block.text, str(page), "exec"), names)
    return output.getvalue()


def run_page(page: Path, write: bool = False) -> list[str]:
    """Run the blocks of a page in the current folder, and return a message for each failure.

    Parameters
    ----------
    write : bool
        Whether the outputs in the page are replaced by those of the blocks.
    """
    text = page.read_text(encoding="utf-8")
    names: dict[str, object] = {"__name__": "__main__"}
    failures, output, changes, last_language = [], "", [], ""
    check, options = OutputChecker(), ELLIPSIS | NORMALIZE_WHITESPACE
    for block in find_blocks(text):
        try:
            if block.title:
                Path(block.title).parent.mkdir(parents=True, exist_ok=True)
                Path(block.title).write_text(block.text, encoding="utf-8")
            elif block.language in RUN and not block.skip_reason:
                output, last_language = run(block, page, names), block.language
                continue
            elif (
                block.language == "text"
                and last_language
                and not block.skip_reason
                and not check.check_output(block.text, output, options)
            ):
                failures.append(f"{page.name}, line {block.line}: the output is\n{output}")
                changes.append((block, output))
        except Exception as error:
            failures.append(f"{page.name}, line {block.line}: {type(error).__name__}: {error}")
        last_language = ""
    if write:
        for block, output in reversed(changes):
            begin, end = block.span
            new = "".join(f"{block.indent}{line.rstrip()}\n" for line in output.splitlines())
            text = text[:begin] + new + text[end:]
        page.write_text(text, encoding="utf-8")
    return failures


def main() -> None:
    """Run pages in a folder; exit with status 1 if a block fails."""
    arguments = [argument for argument in sys.argv[1:] if argument != "--write"]
    folder, *pages = (Path(argument).resolve() for argument in arguments)
    programs = os.environ.get("PROGRAMS", str(Path(sys.executable).parent))
    os.environ.update(PATH=f"{programs}{os.pathsep}{os.environ['PATH']}", MPLBACKEND="agg", COLUMNS="80")
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    failures = [failure for page in pages for failure in run_page(page, "--write" in sys.argv)]
    sys.exit("\n\n".join(failures) or 0)


if __name__ == "__main__":
    main()
