"""Parameters of an FMU from measured records."""
