"""Periodic motions of oscillators with dry friction, their stability, and their branches over a parameter."""
