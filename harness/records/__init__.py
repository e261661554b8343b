"""Measured records, read from tables in many file formats: headings, units and time stamps."""
