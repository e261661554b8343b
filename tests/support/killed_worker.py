"""A work function whose process is killed at some points."""

import os
import signal

from harness.studies.sweep.worker import BlockResult


def run_block(points, runs, digest, fmu):
    """Return twice the first coordinate; the process is killed at 7 and at 30."""
    if {7.0, 30.0} & set(points[:, 0]):
        os.kill(os.getpid(), signal.SIGKILL)
    return BlockResult(points * 2, {}, 1e-3)
