"""Symmetry of the built FMUs: what must not change a motion, and does it?

changes.py      what is changed in a run, and what the motion must then be
motion.py       runs of one FMU at the steps and events of its solver; comparison of two motions
equations.py    the model class inside a Python FMU: whether it scales with its units, which variables are odd
model_text.py   model files with another order of declarations, or in a moving frame
builds.py       the FMUs, built once for the present sources
study.py        all runs of a model, and the table
command.py      python -m benchmarks symmetry
"""
