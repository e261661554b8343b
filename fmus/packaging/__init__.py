"""Writes FMU files: model description, documentation, archive, and the FMI functions in C."""
