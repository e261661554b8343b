"""Runs of one scene, of one FMU, and of all published scenes."""
