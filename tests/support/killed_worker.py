"""A worker's task during which its process dies at some points."""

import os
import signal

from harness.studies.sweep.worker import BlockResult


def run_block(points, runs, digest, fmu):
    """Twice the first coordinate; the process dies at 7 and at 30."""
    if {7.0, 30.0} & set(points[:, 0]):
        os.kill(os.getpid(), signal.SIGKILL)
    return BlockResult(points * 2, {}, 1e-3)
