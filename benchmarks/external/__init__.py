"""FMUs of other tools through the commands run, compare, sweep and fit."""
