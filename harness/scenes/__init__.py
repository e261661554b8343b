"""Scenes: TOML files that specify runs and coupled systems."""
