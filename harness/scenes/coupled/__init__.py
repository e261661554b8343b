"""Scenes of coupled models."""
