"""Results: folders, CSV, JSON and NetCDF files, provenance, quantities with units, and the style of figures."""
