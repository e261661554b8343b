"""Benchmarks, each against a target and a baseline of the same run."""
