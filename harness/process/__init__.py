"""Signals, worker processes and temporary directories."""
