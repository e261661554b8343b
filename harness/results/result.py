"""Results of studies: what Python, the commands, notebooks and the report do with every result."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

from ..arguments import AXES, PATH, check_arguments
from ..errors import HarnessError, check_names, import_optional
from .files import DATA_FILE, read_data, to_json, write_data
from .folder import replace_folder
from .provenance import write_provenance
from .summary import PICTURE_FILE, Outcome, ResultTable, Summary, format_blocks, format_html, write_summary

if TYPE_CHECKING:
    import numpy as np
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TEXT_WIDTH = 100  # characters of a line of `str`
ResultType = TypeVar("ResultType", bound="Result")


class Result(ABC):
    """A result of a study.

    Attributes
    ----------
    study : str
        Name of the study in its summary, as in `STUDIES` of the registry.
    _function : str
        Function of Python that returns the result, for the provenance of saved results.
    """

    study: ClassVar[str]
    _function: ClassVar[str]

    @property
    @abstractmethod
    def title(self) -> str:
        """Name of the result, as the report shows it."""

    @property
    @abstractmethod
    def _headline(self) -> str:
        """The result in a few words, for `repr`."""

    @abstractmethod
    def as_json(self) -> dict[str, Any]:
        """Return the result as plain data, as `--json` prints it."""

    def _tabulate(self) -> tuple[ResultTable, ...]:
        """Return the tables of the result."""
        return ()

    def _tabulate_details(self) -> tuple[ResultTable, ...]:
        """Return tables that only the report shows."""
        return ()

    def _data_table(self) -> ResultTable:
        """Return the table whose items `to_pandas` converts."""
        return self._tabulate()[0]

    def sentences(self) -> list[str]:
        """Return findings and remarks, which are below the tables."""
        return []

    @property
    def _caption(self) -> str:
        """Text alternative of the figure."""
        return ""

    @property
    def outcome(self) -> Outcome | None:
        """Conclusion of the study; None if it judges nothing."""
        return None

    def summary(self) -> Summary:
        """Return the findings: sentences, tables and conclusion, as the report shows them."""
        tables = [part for table in (*self._tabulate(), *self._tabulate_details()) for part in table.summarize()]
        if tables:
            tables[0] = replace(tables[0], title="")
        return Summary(self.study, self.title, tuple(self.sentences()), tuple(tables), self._caption, self.outcome)

    def blocks(self) -> list[ResultTable | str]:
        """Return the tables and the sentences that the command prints."""
        return [*(block for table in self._tabulate() if table.items for block in (table, "")), *self.sentences()]

    def _write_tables(self, folder: Path) -> None:
        """Write the files with numbers."""
        (folder / f"{self.study}.json").write_text(to_json(self.as_json()) + "\n", encoding="utf-8")

    @abstractmethod
    def _draw(self, figure: "Figure") -> None:
        """Draw the figure of the command."""

    @abstractmethod
    def _draw_panel(self, axes: "Axes") -> None:
        """Draw the main panel of the figure into given axes."""

    def to_pandas(self) -> "pandas.DataFrame":
        """Convert the main table to a DataFrame.

        Returns
        -------
        pandas.DataFrame
            Numbers, with a row for each quantity.

        Raises
        ------
        HarnessError
            If pandas is not installed.
        """
        library = import_optional("pandas", "to_pandas()", "sweep")
        rows = self._data_table().records()
        frame: pandas.DataFrame = library.DataFrame(rows).set_index(next(iter(rows[0])))
        return frame

    @check_arguments(ax=AXES)
    def plot(self, *, ax: "Axes | None" = None) -> "np.ndarray":
        """Plot the result with pyplot, so that notebooks show it: the same figure that the command saves.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes for the main panel alone.

        Returns
        -------
        numpy.ndarray
            The matplotlib axes (n,), one for each panel.

        Raises
        ------
        HarnessError
            If the result holds nothing that the figure shows.
        """
        import matplotlib.pyplot as plt
        import numpy as np

        from .style import DPI, find_texts, use_style

        with use_style():
            if ax is not None:
                self._draw_panel(ax)
                return np.array([ax])
            figure = plt.figure(dpi=DPI)
            self._draw(figure)
            if not figure.axes:
                plt.close(figure)
                raise HarnessError(f"this {self.study} result has nothing to plot; to_pandas() has its numbers")
            for text in find_texts(figure):
                text.set_parse_math(False)
        return np.array(figure.axes)

    @check_arguments(folder=PATH)
    def save(self, folder: str | Path) -> None:
        """Write the result into a folder: its files, figure, provenance and summary; `load_result` reads it.

        Parameters
        ----------
        folder : path
            A new folder, or one that holds a result of the same source.

        Raises
        ------
        HarnessError
            If the folder holds other files, or the result of another source.
        """
        from .registry import find_study

        origin = self._origin()
        with replace_folder(Path(folder), find_study(self.study).files, origin["source"]) as new_folder:
            self._write(new_folder)
            write_provenance(new_folder, **origin, command=f"harness.{self._function}")
            write_summary(new_folder, replace(self.summary(), title=Path(folder).name))

    def _origin(self) -> dict[str, Any]:
        """Return the files, parameters and source for the provenance of a result that Python saves."""
        return {"files": (), "source": self.title}

    def _write(self, folder: Path) -> None:
        """Write tables, figure and data into a new folder."""
        self._write_tables(folder)
        self._write_figure(folder / PICTURE_FILE)
        write_data(self, folder / DATA_FILE)

    def _write_figure(self, path: Path) -> None:
        """Save the figure as SVG, if anything can be drawn."""
        from .style import DPI, Figure, save_figure, use_style

        with use_style():
            figure = Figure(dpi=DPI)
            self._draw(figure)
            if figure.axes:
                save_figure(figure, path)

    @classmethod
    def _is_stored(cls, folder: Path) -> bool:
        """Return whether a folder holds the data that `load` reads."""
        return (folder / DATA_FILE).is_file()

    @classmethod
    @check_arguments(folder=PATH)
    def _load(cls, folder: str | Path) -> Self:
        """Read the result in a folder; SceneError if its data are damaged."""
        return read_data(cls, Path(folder) / DATA_FILE)

    def __getitem__(self, name: str) -> Any:
        """Return a part of the result by its key in the JSON."""
        content = self.as_json()
        check_names("key", [name], content)
        return content[name]

    def __repr__(self) -> str:
        text = f"{type(self).__name__} of {self.title}: {self._headline}"
        return f"<{' '.join(text.split())}>"

    def __str__(self) -> str:
        return format_blocks(self.blocks(), TEXT_WIDTH)

    def _repr_html_(self) -> str:
        """Return the tables and sentences of the command for notebooks."""
        return f"<div><strong>{escape(self.title)}</strong>{format_html(self.blocks())}</div>"


def save_result(folder: Path, compute: Callable[[], ResultType], study: str, source: str, **origin: Any) -> ResultType:
    """Compute the result of a command and write it into a folder, whose conflicts are reported before.

    Parameters
    ----------
    folder : pathlib.Path
        Result folder.
    compute : callable
        Returns the result.
    study : str
        Name of the study.
    source : str
        Source of the result, as given on the command line.
    **origin
        Arguments of `write_provenance` that the result does not know: files, parameters, run and scene.
    """
    from .registry import find_study

    with replace_folder(folder, find_study(study).files, source) as new_folder:
        result = compute()
        result._write(new_folder)
        write_provenance(new_folder, **result._origin() | origin | {"source": source})
        write_summary(new_folder, result.summary())
    return result
