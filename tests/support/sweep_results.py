"""Results of sweeps."""

import pytest

xarray = pytest.importorskip("xarray", reason="the extra 'sweep' is not installed")


def open_sweep(folder):
    with xarray.open_dataset(folder / "sweep.nc") as data:
        return data.load()


def sweep_folder(out, begin):
    """Return the single sweep folder whose name begins with `begin`."""
    (folder,) = (out / "sweep").glob(f"{begin}-????????")
    return folder
