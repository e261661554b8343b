"""Runs external FMUs in a child process, so that a hang, crash or output of the FMU is reported in one sentence."""
