"""The matrix of hosts judges runs by certified results; pathsim-fmi, the quickest to install, runs two models."""

import subprocess

import numpy as np
import pytest
from commands import build

from benchmarks.hosts import matrix
from harness import HarnessError


def test_a_host_run_is_judged_by_the_certified_result():
    time, expected, name = matrix.read_certified("coulomb")
    assert (time[-1], len(time), name) == (4.0, 401, "x")
    assert matrix.judge([*expected], expected, "", "") == (0.0, "")
    error, failure = matrix.judge([*expected[:-1] + 0.01], expected, "", "a warning")
    assert (error, failure) == (pytest.approx(0.01 / np.abs(expected).max()), "")
    for values, failure, text in (
        ([], "Exception: getReal failed", "Exception: getReal failed"),
        ([0.0, 0.0], "", "2 of 401 values, the last one 0.0; value reference 6 is refused"),
        ([*expected[:-1], float("nan")], "", "values that are no numbers; value reference 6 is refused"),
    ):
        error, message = matrix.judge(values, expected, failure, "value reference 6 is refused\nand again")
        assert np.isnan(error)
        assert message == text


@pytest.mark.campaign
def test_pathsim_agrees_with_certified_results(tmp_path, monkeypatch):
    host = next(host for host in matrix.HOSTS if "pathsim" in host.package)
    try:
        python = matrix.install(host, tmp_path)
    except (HarnessError, subprocess.SubprocessError) as error:
        pytest.skip(str(error))
    monkeypatch.setattr(matrix, "MODELS", ("smd", "coulomb"))
    for folder, options in (("all", ()), ("reals", ("--real-only",))):
        assert build("smd", "coulomb", *options, "--out", tmp_path / folder).returncode == 0
    for folder in "all", "reals":  # the position is right in both; `mode` is not a number in the default FMU
        for _, error, failure in matrix.run_models(python, host, tmp_path / folder):
            assert failure == ""
            assert error < 1e-12
