"""Derivatives of a motion by parameters, through stick and slip."""
