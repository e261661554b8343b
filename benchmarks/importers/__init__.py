"""Checks of the built FMUs in other tools, each in a separate process; results are compared with those of fmpy.

A request (request.py) defines instances, values, connections and changes during the run.  An adapter (*_adapter.py)
executes it in one tool, checks.py defines the checks, and table.py runs them.
"""
