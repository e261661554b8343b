"""Coupled scenes."""
