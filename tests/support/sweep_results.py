"""Results of sweeps."""

import pytest

xarray = pytest.importorskip("xarray", reason="the extra 'sweep' is not installed")


def open_sweep(folder):
    with xarray.open_dataset(folder / "sweep.nc") as data:
        return data.load()


def sweep_folder(out, begin):
    """The one folder of a sweep whose name begins so."""
    (found,) = (out / "sweep").glob(f"{begin}-????????")
    return found
