"""Damping and friction from a decay, measured or simulated."""
