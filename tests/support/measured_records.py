"""Measured records, which are not a part of the project.

The pendulum of the page on decays is a reduced copy of a file of github.com/dynamicslab/MultiArm-Pendulum (MIT,
Kaheman et al., arXiv 2205.06231): the angle minus pi and the time minus 60 s, every 50th sample. The bicycle wheel, a
torsion pendulum with a rate gyro, is a file of github.com/moorepants/resonance (MIT, Moore and Lyons).
"""

import os
from pathlib import Path

import numpy as np
from scipy.io import savemat

ROOT = Path(__file__).parents[2]
VARIABLE = "FRICTION_FMUS_RECORDS"
RECORD = "pendulum_multiarm.csv"
ORIGINAL = "SingleDataFreeSwing_1_Dt_0_0001.mat"
COMMAND = f"decay {ORIGINAL} --time Theta1.time --column Theta1.signals --unit rad --end 68"


def missing(name):
    """Return the reason for which a test without a record is skipped."""
    return f"no {name}: it is not a part of the project; {VARIABLE} names its folder"


MISSING = missing(RECORD)


def find_record(name=RECORD):
    """Return the path of a record, in the folder that the variable names or in shared/records near the checkout."""
    folders = [parent / "shared" / "records" for parent in ROOT.parents]
    if VARIABLE in os.environ:
        folders = [Path(os.environ[VARIABLE])]
    return next((folder / name for folder in folders if (folder / name).is_file()), None)


def write_original(record, folder):
    """Write a record to a file with the name, the variables and the offsets of the original."""
    time, angle = np.loadtxt(record, delimiter=",", skiprows=1, unpack=True)

    def signal(values):
        return {"time": time + 60.0, "signals": {"values": values, "dimensions": 1.0, "label": ""}, "blockName": ""}

    variables = {"Theta1": signal(angle + np.pi), "Distance": signal(0.0 * angle), "Velocity": signal(0.0 * angle)}
    savemat(folder / ORIGINAL, variables, oned_as="column")
