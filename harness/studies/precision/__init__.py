"""Work-precision studies, errors of friction laws, and problems from the literature."""
