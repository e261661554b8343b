"""The codes of the numerics: a number for each law, method, mode and status, said here and nowhere else."""

EXACT, ODE23, ODE45, DOP853, RODAS = 1, 2, 3, 4, 5  # methods, as solver.method
HYBRID, SIGN, THRESHOLD = 1, 2, 3  # friction laws, as friction
BACKWARD, STUCK, FORWARD = -1, 0, 1  # modes
OK, DIVERGED, STALLED, ENDLESS = 0, 1, 2, 3  # statuses of a step
