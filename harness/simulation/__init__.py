"""Runs of built FMUs, of this project or external, through fmpy. No other package imports fmpy."""
