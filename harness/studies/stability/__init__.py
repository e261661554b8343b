"""Stiff and extreme cases, each with its expected outcome."""
