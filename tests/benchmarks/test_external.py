"""Trials of external FMUs are judged by a second importer, and commands run in a terminal of their own."""

from math import nan

import pytest

from benchmarks.external import trials
from benchmarks.external.trials import FAULT, INEXACT, REFUSED, RIGHT, SLOW, Reply

SUCCESS, REFUSAL = Reply(0, 1.0, 0.5, "Results in a"), Reply(1, 1.0, 0.5, "x\nError: it terminated\nat t = 9 s")
CRASH, TIMEOUT = Reply(1, 1.0, 0.5, "Traceback\nError: x"), Reply(-9, 90.0, 0.5, "", is_killed=True)


@pytest.mark.parametrize(
    ("judgement", "outcome", "text"),
    [
        (trials.judge_run(SUCCESS, "halving it changes no output by more than 1e-7"), RIGHT, "halving"),
        (trials.judge_run(SUCCESS, "fixed internal step of 0.1 s, error unknown"), INEXACT, "error unknown"),
        (trials.judge_run(REFUSAL, REFUSAL.message), REFUSED, "it terminated at t = 9 s"),
        (trials.judge_run(CRASH, ""), FAULT, "Traceback"),
        (trials.judge_run(TIMEOUT, ""), SLOW, "not finished after 90 s"),
        (trials.judge_difference(SUCCESS, 1e-12, 1e-6, "fmpy", FAULT), RIGHT, "1.0e-12"),
        (trials.judge_difference(SUCCESS, 1e-3, 1e-6, "fmpy", FAULT), FAULT, "1.0e-03"),
        (trials.judge_difference(REFUSAL, nan, 1e-6, "fmpy", FAULT), REFUSED, "it terminated"),
        (trials.judge_difference(SUCCESS, 0.25, 1e-3, "co-simulation", INEXACT), INEXACT, "2.5e-01"),
    ],
)
def test_a_wrong_result_is_a_fault_and_a_refusal_is_not(judgement, outcome, text):
    assert judgement[0] == outcome
    assert text in judgement[1]


def test_a_command_shows_its_first_text_in_a_terminal():
    reply = trials.run_in_terminal(["--help"], timeout=60)
    assert (reply.status, reply.is_orderly) == (0, True)
    assert "Usage:" in reply.text
    assert 0 < reply.first_text <= reply.seconds
    late = trials.run_in_terminal(["info", "coulomb"], timeout=0)
    assert late.is_killed
