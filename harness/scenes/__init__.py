"""Scenes: TOML files that specify runs."""
