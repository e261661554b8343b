"""Runs of external FMUs in a child process. A hang, a crash or output of the FMU is reported in one sentence."""
