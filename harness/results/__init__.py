"""What is left of a run: folders, files, quantities with their units, the look of figures."""
