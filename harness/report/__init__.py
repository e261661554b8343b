"""The report: one self-contained page about all results on disk."""
