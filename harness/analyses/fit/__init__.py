"""Parameters of an FMU from measured records: search, least squares, and intervals by profile likelihood."""
