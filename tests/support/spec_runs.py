"""Runs of specifications, and callbacks for their progress."""

from harness.simulation import runner


def ignore_progress(*report):
    """Receive the progress of a study or a run, and do nothing."""


def run_spec(spec):
    """Run an FMU as specified and return its trajectory."""
    return runner.run(spec, ignore_progress)
