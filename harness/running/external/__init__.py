"""Runs somebody else's FMU, in a process of its own: what hangs, crashes or prints there is a sentence here."""
