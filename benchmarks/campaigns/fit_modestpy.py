"""Fit a record with ModestPy: python fit_modestpy.py < record.json. It prints the values as JSON in its last line.

ModestPy 0.1.1 calls DataFrame.append, which pandas 2 has not, and the pandas before needs numpy 1, with which harness
does not run. So ModestPy runs in an environment of its own.
"""

import json
import os
import sys
import tempfile


def fit_with_modestpy(t, x, free, known_values, force, fmu):
    """Fit by a genetic algorithm and pattern search."""
    import pandas
    from fmpy.fmi1 import FMICallException
    from modestpy import Estimation
    from modestpy.fmi.model import Model

    index = pandas.Index(t, name="time")
    simulate = Model.simulate

    def simulate_or_reset(model, reset=True):
        try:
            return simulate(model, reset)
        except FMICallException:  # of mu_d above mu_s; ModestPy alone does not reset the FMU and stops
            model.model.reset()
            return pandas.DataFrame({"x": 1e3}, index=index)

    Model.simulate = simulate_or_reset
    inputs = pandas.DataFrame({"F_ext": 0.0 if force is None else force}, index=index)
    positions = pandas.DataFrame({"x": x}, index=index)
    one_process = {"workers": 1}
    estimation = Estimation(os.getcwd(), fmu, inputs, known_values, free, positions, modestga_opts=one_process)
    return estimation.estimate()


if __name__ == "__main__":
    arguments = json.load(sys.stdin)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # ModestPy writes there
        values = fit_with_modestpy(**arguments)
        os.chdir("/")
    print()
    print(json.dumps({name: float(value) for name, value in values.items()}))
