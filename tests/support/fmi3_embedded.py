"""embedded.py for the code inside FMI 3.0 FMUs: the same requests, each run for co-simulation, then for model exchange.

The second by Euler's steps, with an event after each; its rows follow those of the first.
"""

import json
import sys
from importlib import import_module
from pathlib import Path


def run(resources, reals, integers, times, outputs):
    sys.path.insert(0, resources)
    entry = import_module(Path(resources, "slavemodule.txt").read_text().strip())
    (slave_class,) = [thing for thing in vars(entry).values() if getattr(thing, "__module__", "") == entry.__name__]
    rows = []
    for exchange in (False, True):
        slave = slave_class(instance_name="embedded", resources=resources, logger=None, visible=False)
        slave.set_float64([int(reference) for reference in reals], list(reals.values()))
        slave.set_int64([int(reference) for reference in integers], list(integers.values()))
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
        if exchange:
            slave.update_discrete_states()
        rows.append(slave.get_float64(outputs))
        for t, ahead in zip(times, times[1:]):  # noqa: B905, RUF007 - Python 3.9 knows neither strict= nor pairwise
            if exchange:
                euler(slave, t, ahead)
            elif slave.do_step(t, ahead - t).status:
                sys.exit("do_step failed")
            rows.append(slave.get_float64(outputs))
    return rows


def euler(slave, t, ahead):
    states, rates = slave.get_continuous_states(), slave.get_continuous_state_derivatives()
    slave.set_time(ahead)
    slave.set_continuous_states([x + (ahead - t) * rate for x, rate in zip(states, rates)])  # noqa: B905 - as above
    if slave.update_discrete_states().terminateSimulation:
        sys.exit("update_discrete_states asks for the end")


if __name__ == "__main__":
    print(json.dumps([run(**request) for request in json.load(sys.stdin)]))
