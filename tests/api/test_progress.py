"""Progress bars of functions: in a terminal, for what takes longer than two seconds, unless switched off."""

import commands
import pytest
from variants import slow_after

SCRIPT = """
import sys
import harness
from harness.process import progress_bar

progress_bar.DELAY = {delay}
sys.stderr.isatty = lambda: {terminal}
harness.simulate("coulomb", stop=2.0{options})
"""


@pytest.mark.parametrize(
    ("terminal", "delay", "options", "is_shown"),
    slow_after(
        1,
        [
            (True, 0.0, "", True),
            (True, 1e3, "", False),
            (False, 0.0, "", False),
            (True, 0.0, ", progress=False", False),
        ],
    ),
    ids=["terminal", "short", "no terminal", "switched off"],
)
def test_a_bar_is_shown_in_a_terminal_for_long_calls(workspace, terminal, delay, options, is_shown):
    script = SCRIPT.format(terminal=terminal, delay=delay, options=options)
    result = commands.run_python(workspace, "-c", script, TERM="xterm", COLUMNS="80")
    assert (result.returncode, result.stdout) == (0, "")
    assert ("simulate" in result.stderr) == is_shown
    assert is_shown or result.stderr == ""


def test_a_bar_ends_with_a_call_that_fails(workspace):
    script = SCRIPT.format(terminal=True, delay=0.0, options=", inputs={'time': [0.0, 1.0], 'F_ext': [1e308, 1e308]}")
    result = commands.run_python(workspace, "-c", script, TERM="xterm", COLUMNS="80")
    assert result.returncode == 1
    bar, _, error = result.stderr.partition("Traceback")
    assert "simulate" in bar
    assert "HarnessError" in error
