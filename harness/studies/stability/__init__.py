"""Stiff and extreme scenes, each with the ending it must have."""
