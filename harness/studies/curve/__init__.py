"""Identification of friction over velocity from points or records over time."""
