"""Campaigns over many random models and records; they share helpers with the tests, and no test runs them whole."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "tests" / "support"))
