"""What is left of a run: folders, files, where they came from, quantities with their units, the look of figures."""
