"""Run the code inside FMUs without FMI, in any Python that runs this file (3.9 or newer, standard library only).

Reads JSON from standard input, a list of {"resources": folder, "reals": {reference: value}, "integers": {...}, "times":
[...], "outputs": [references of Reals]}; prints the rows of every run as JSON.
"""

import json
import sys
from importlib import import_module
from pathlib import Path


def run(resources, reals, integers, times, outputs):
    sys.path.insert(0, resources)
    entry = import_module(Path(resources, "slavemodule.txt").read_text().strip())
    slave_class = next(
        value
        for value in vars(entry).values()
        if isinstance(value, type) and "Fmi2Slave" in [base.__name__ for base in value.__mro__[1:]]
    )
    slave = slave_class(instance_name="embedded", resources=resources)
    slave.set_real([int(reference) for reference in reals], list(reals.values()))
    slave.set_integer([int(reference) for reference in integers], list(integers.values()))
    slave.setup_experiment(times[0], times[-1], None)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    rows = [slave.get_real(outputs)]
    for t, ahead in zip(times, times[1:]):  # noqa: B905, RUF007 - Python 3.9 has neither strict= nor pairwise
        if not slave.do_step(t, ahead - t):
            sys.exit("do_step failed")
        rows.append(slave.get_real(outputs))
    return rows


if __name__ == "__main__":
    print(json.dumps([run(**request) for request in json.load(sys.stdin)]))
