"""Friction over velocity: points from plateaus of constant velocity, friction laws with intervals, and their choice."""
