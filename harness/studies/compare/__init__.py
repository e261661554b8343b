"""Two results, or two FMUs of anyone's, side by side."""
