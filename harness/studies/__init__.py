"""Studies: each package holds one study with its tables and figures."""
