"""Reference solutions: closed forms, series, peer solvers and stored certified results."""
