"""Identification of damping and friction from a decay, measured or simulated."""
