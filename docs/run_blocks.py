"""Run the code blocks of Markdown pages, in order, in one folder and one Python process a page.

    sh                          run by bash; it must exit with status 0
    python                      executed; the blocks of a page share their names
    any, with title="NAME"      written to the file NAME
    text, after sh or python    the output of that block, where "..." matches anything

A block after the comment <!-- not run: REASON --> is skipped.  `python docs/run_blocks.py --write FOLDER PAGE...` runs
pages in a folder and rewrites the outputs that differ.
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
TIMEOUT = 120.0  # s


@dataclass(frozen=True)
class Block:
    """A code block: its language, file name, text, line, indentation and place in the page, and why it is not run."""

    language: str
    title: str
    text: str
    line: int
    indent: str
    span: tuple[int, int]
    skipped: str


def blocks(page: str) -> list[Block]:
    """All code blocks of a page."""
    result = []
    for fence in FENCE.finditer(page):
        skip = SKIP.search(page[: fence.start()])
        indent = fence["indent"]
        text = "".join(line.removeprefix(indent) for line in fence["text"].splitlines(keepends=True))
        line = page.count("\n", 0, fence.start()) + 1
        reason = skip[1] if skip else ""
        result.append(Block(fence["language"], fence["title"] or "", text, line, indent, fence.span("text"), reason))
    return result


def run(block: Block, page: Path, names: dict[str, object]) -> str:
    """Run one block in the current folder; its output.  RuntimeError if it fails."""
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
    """Run the blocks of a page in the current folder; the faults, one text each."""
    text = page.read_text(encoding="utf-8")
    names: dict[str, object] = {"__name__": "__main__"}
    faults, output, changes, last = [], "", [], ""
    check, options = OutputChecker(), ELLIPSIS | NORMALIZE_WHITESPACE
    for block in blocks(text):
        try:
            if block.title:
                Path(block.title).parent.mkdir(parents=True, exist_ok=True)
                Path(block.title).write_text(block.text, encoding="utf-8")
            elif block.language in RUN and not block.skipped:
                output, last = run(block, page, names), block.language
                continue
            elif (
                block.language == "text"
                and last
                and not block.skipped
                and not check.check_output(block.text, output, options)
            ):
                faults.append(f"{page.name}, line {block.line}: the output is\n{output}")
                changes.append((block, output))
        except Exception as error:
            faults.append(f"{page.name}, line {block.line}: {type(error).__name__}: {error}")
        last = ""
    if write:
        for block, output in reversed(changes):
            begin, end = block.span
            new = "".join(f"{block.indent}{line.rstrip()}\n" for line in output.splitlines())
            text = text[:begin] + new + text[end:]
        page.write_text(text, encoding="utf-8")
    return faults


def main() -> None:
    """Run pages in a folder; exit with status 1 if a block fails."""
    words = [word for word in sys.argv[1:] if word != "--write"]
    folder, *pages = (Path(word).resolve() for word in words)
    bin = str(Path(sys.executable).parent)
    os.environ.update(PATH=f"{bin}{os.pathsep}{os.environ['PATH']}", MPLBACKEND="agg", COLUMNS="80")
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    faults = [fault for page in pages for fault in run_page(page, "--write" in sys.argv)]
    sys.exit("\n\n".join(faults) or 0)


if __name__ == "__main__":
    main()
