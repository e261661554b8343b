"""Work-precision studies and errors of friction laws."""
