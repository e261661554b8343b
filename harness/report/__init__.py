"""Report: a self-contained HTML page of all results on disk."""
