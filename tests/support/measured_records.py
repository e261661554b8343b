"""The measured pendulum of the README, whose record is not a part of the project.

It is a reduced copy of a file of github.com/dynamicslab/MultiArm-Pendulum (MIT, Kaheman et al., arXiv 2205.06231): the
angle minus pi and the time minus 60 s, every 50th sample.
"""

import os
from pathlib import Path

import numpy as np
from scipy.io import savemat

ROOT = Path(__file__).parents[2]
VARIABLE = "FRICTION_FMUS_RECORDS"
RECORD = "pendulum_multiarm.csv"
ORIGINAL = "SingleDataFreeSwing_1_Dt_0_0001.mat"
COMMAND = f"decay {ORIGINAL} --time Theta1.time --column Theta1.signals --unit rad --until 68"
MISSING = f"no {RECORD}: it is not a part of the project; {VARIABLE} names its folder"


def find_record():
    """Return the path of the record, in the folder that the variable names or in shared/records near the checkout."""
    folders = [parent / "shared" / "records" for parent in ROOT.parents]
    if VARIABLE in os.environ:
        folders = [Path(os.environ[VARIABLE])]
    return next((folder / RECORD for folder in folders if (folder / RECORD).is_file()), None)


def write_original(record, folder):
    """Write a record to a file with the name, the variables and the offsets of the original."""
    time, angle = np.loadtxt(record, delimiter=",", skiprows=1, unpack=True)

    def signal(values):
        return {"time": time + 60.0, "signals": {"values": values, "dimensions": 1.0, "label": ""}, "blockName": ""}

    variables = {"Theta1": signal(angle + np.pi), "Distance": signal(0.0 * angle), "Velocity": signal(0.0 * angle)}
    savemat(folder / ORIGINAL, variables, oned_as="column")
