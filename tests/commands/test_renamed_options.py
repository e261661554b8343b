"""Options that were renamed: the former name works, help shows the new one."""

import pytest

from harness.commands import commands
from harness.commands.terminal import FORMER_TIMEOUT


@pytest.mark.parametrize("command", ["run", "compare a b", "sweep m --vary c=1,2"])
def test_the_former_name_of_timeout_still_works(command):
    name, *arguments = command.split()
    option, before = commands.commands[name], {}
    for spelling in ("--timeout", FORMER_TIMEOUT):
        with option.make_context(name, [*arguments, spelling, "2.5"]) as context:
            before[spelling] = {key: value for key, value in context.params.items() if value == 2.5}
    assert len(before["--timeout"]) == 1
    assert before["--timeout"] == before[FORMER_TIMEOUT]


def test_help_shows_only_the_new_name():
    with commands.commands["run"].make_context("run", []) as context:
        text = commands.commands["run"].get_help(context)
    assert "--timeout" in text
    assert FORMER_TIMEOUT not in text
