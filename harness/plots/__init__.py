"""Figures; the only home of matplotlib in the harness."""
