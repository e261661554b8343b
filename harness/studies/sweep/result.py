"""A finished sweep with its data, its figure and what the command prints."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from ...errors import HarnessError, SceneError, first_line, import_optional, unknown_name_message
from ...results.files import column_heading
from ...results.provenance import load_provenance
from ...results.registry import find_study
from ...results.result import Result
from ...results.summary import Summary

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STUDY = find_study("sweep")
DATASET_FILE, TABLE_FILE, *_ = STUDY.files
MAX_FAILURE_KINDS = 10  # kinds of failures printed


@dataclass(frozen=True)
class FailureGroup:
    """Runs that failed with the same error message, except for numbers in it.

    Attributes
    ----------
    runs : int
        Number of runs.
    sentence : str
        Error message of the first run.
    where : dict
        Varied values of the first run.
    """

    runs: int
    sentence: str
    where: dict[str, float]

    def __str__(self) -> str:
        """Return the number of runs, a point and its error message."""
        point = ", ".join(f"{name} = {value!r}" for name, value in self.where.items())
        return f"{self.runs} run{'s' * (self.runs > 1)}, such as {point}: {self.sentence}"


@dataclass(repr=False, eq=False)
class SweepResult(Result):
    """A finished sweep, as `sweep` returns it and `load_result` reads it.

    ``result["period"]`` is the xarray.DataArray of a measure, a varied parameter or ``error``. Methods and attributes
    of an xarray.Dataset, such as ``result.sel(mu_d=0.3)``, are those of `data`.

    Attributes
    ----------
    name : str
        Name of the sweep.
    runs : int
        Number of runs.
    folder : pathlib.Path or None
        Folder of the results; None if they were not stored.
    n_resumed : int
        Number of runs taken from the checkpoint of an interrupted sweep.
    damaged : bool
        Whether that checkpoint was damaged and not used.
    failures : tuple of FailureGroup
        Failed runs by kind, most frequent first.
    seconds : float
        Run time of the new runs in s.
    columns : str
        The varied parameters and the measures, with their units.
    """

    study, _function = "sweep", "sweep"

    name: str
    runs: int
    folder: Path | None
    n_resumed: int
    damaged: bool
    failures: tuple[FailureGroup, ...]
    seconds: float
    columns: str = ""
    dataset: Any = field(default=None, init=False)

    @classmethod
    def _is_stored(cls, folder: Path) -> bool:
        return (folder / DATASET_FILE).is_file()

    @classmethod
    def _load(cls, folder: str | Path) -> Self:
        result = super()._load(folder)
        result.folder = folder = Path(folder)
        library = import_optional("xarray", "to read a sweep", "sweep")
        try:
            with library.open_dataset(folder / DATASET_FILE, engine="scipy") as dataset:
                result.dataset = dataset.load()
        except (OSError, ValueError) as error:
            raise SceneError(f"{folder / DATASET_FILE} cannot be read: {first_line(error)}") from None
        return result

    @property
    def data(self) -> "xarray.Dataset":
        """The values: a dimension for each varied parameter (``run`` for samples) and a variable for each measure."""
        dataset: xarray.Dataset = self.dataset
        return dataset

    @property
    def title(self) -> str:
        return self.name

    @property
    def _headline(self) -> str:
        return f"{self.runs} runs, {self.failed} failed"

    @property
    def failed(self) -> int:
        """Number of failed runs."""
        return sum(failure.runs for failure in self.failures)

    def __getitem__(self, name: Any) -> Any:
        """Return a measure or a parameter as xarray.DataArray, or a part of the result by its key in the JSON."""
        if isinstance(name, str):
            content = self.as_json()
            if name in content:
                return content[name]
        try:
            return self.data[name]
        except (AttributeError, IndexError, KeyError, TypeError, ValueError):
            names = map(str, self.data.variables)
            raise SceneError(unknown_name_message("measure or parameter", name, names)) from None

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self.data

    def __iter__(self) -> Iterator[Any]:
        return iter(self.data)

    def __len__(self) -> int:
        return len(self.data)

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the dataset."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.data, name)

    @property
    def _caption(self) -> str:
        return f"Sweep {self.name}. {self.counts}"

    @property
    def counts(self) -> str:
        """The numbers of runs, and the columns of the table."""
        return f"{self.runs} runs, {self.failed} failed. Columns: {self.columns}."

    def summary(self) -> Summary:
        return replace(super().summary(), sentences=(self.counts,))

    def as_json(self) -> dict[str, Any]:
        names = ("runs", "folder", "n_resumed", "damaged", "failures", "seconds")
        return {name: getattr(self, name) for name in names}

    def sentences(self) -> list[str]:
        n_new = self.runs - self.n_resumed
        output = [f"{self.runs} runs, {self.n_resumed} of them resumed, {self.failed} failed"]
        if self.damaged:
            output.append("the checkpoint of an interrupted sweep was damaged; its runs were repeated")
        if n_new and self.seconds:
            output.append(f"{n_new} runs in {self.seconds:.3g} s: {n_new / self.seconds:.4g} runs/s")
        return output

    def describe_failures(self) -> Iterator[str]:
        """Yield one sentence for each kind of failure; none if no run failed."""
        if self.failures and self.folder:
            yield f"{self.failed} of {self.runs} runs failed; see the error column of {self.folder / TABLE_FILE}"
        for failure in self.failures[:MAX_FAILURE_KINDS]:
            yield str(failure)
        if len(self.failures) > MAX_FAILURE_KINDS:
            yield f"and {len(self.failures) - MAX_FAILURE_KINDS} other kinds of failures"

    def to_pandas(self) -> "pandas.DataFrame":
        """Convert to a DataFrame with a row for each run, indexed by the varied parameters or the number of the run."""
        frame: pandas.DataFrame = self.data.to_dataframe()
        frame.attrs["units"] = {str(name): item.attrs.get("units", "") for name, item in self.data.variables.items()}
        return frame

    def _origin(self) -> dict[str, Any]:
        old = load_provenance(self.folder) if self.folder else {}
        return {"files": (), "scene": old.get("scene"), "source": self.name}

    def _write_tables(self, folder: Path) -> None:
        """Write the values for xarray and as CSV."""
        self.data.to_netcdf(folder / DATASET_FILE, engine="scipy", format="NETCDF3_64BIT")
        measures = self.data.drop_vars("error").data_vars  # a loaded file has the errors first, a new sweep last
        names = [*map(str, self.data.coords), *map(str, measures), "error"]
        units = {name: self.data[name].attrs.get("units", "1") for name in names}
        frame = self.data.to_dataframe().reset_index()[names]
        frame.columns = [column_heading(name, "" if units[name] == "1" else units[name]) for name in names]
        frame.to_csv(folder / TABLE_FILE, index=False, lineterminator="\n")

    def _draw(self, figure: "Figure") -> None:
        from .figure import draw, thin_out

        if not self.data.drop_vars("error").data_vars:
            raise HarnessError(f"{self.name} has no measures to draw")
        draw(thin_out(self.data), figure, self.failed)

    def _draw_panel(self, axes: "Axes") -> None:
        from .figure import draw_measure, thin_out

        data = thin_out(self.data)
        if not all(data.sizes.values()):
            raise HarnessError(f"the values of {self.name} are too large for an axis; to_pandas() has its numbers")
        draw_measure(axes, data, str(next(iter(data.data_vars))))
