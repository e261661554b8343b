"""Three blocks in a stack: which modes balance the forces, found by trying all of them, with numpy."""

from itertools import product

import numpy as np

MASSES = np.array([2.0, 1.5, 1.0])
NORMAL_FORCES = 9.81 * np.array([4.5, 2.5, 1.0])  # on the ground, on the lowest block, on the middle one
SLIPS = np.eye(3) - np.eye(3, k=-1)  # slips from speeds; its transpose gives forces on the blocks from contact forces


def is_balanced(modes, pulls, holds, slides):
    """Return whether blocks at rest under `pulls` may begin to move in these modes: no stuck contact exceeds its limit,
    and no slip accelerates against its mode."""
    modes = np.array(modes)
    slipping = modes != 0
    A, b = SLIPS @ np.diag(1.0 / MASSES) @ SLIPS.T, SLIPS @ (pulls / MASSES)
    forces = np.linalg.solve(
        np.where(slipping[:, None], np.eye(3), A), np.where(slipping, modes * slides * NORMAL_FORCES, b)
    )
    held = np.abs(forces) <= holds * NORMAL_FORCES * (1.0 + 1e-12)
    return bool(np.all(np.where(slipping, modes * (b - A @ forces) >= -1e-12, held)))


def balanced_modes(pulls, holds, slides):
    """Return all modes that balance."""
    return [modes for modes in product((-1, 0, 1), repeat=3) if is_balanced(modes, pulls, holds, slides)]
