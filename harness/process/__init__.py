"""Signals, child processes and temporary directories."""
