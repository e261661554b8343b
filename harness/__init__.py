"""Runs the built FMUs, measures what they do, and sets it beside what was published."""
