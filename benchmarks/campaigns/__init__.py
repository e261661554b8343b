"""Campaigns over many random models and records; they share helpers with the tests, and no test runs them whole."""

import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in a command; must be set before numpy is imported
sys.path.append(str(Path(__file__).parents[2] / "tests" / "support"))
