"""Comparison of two results or FMUs."""
