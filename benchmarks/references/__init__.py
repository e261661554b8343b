"""Certified results of the shipped models, by closed forms, power series and independent solvers."""
