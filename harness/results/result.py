"""Results of studies: what Python, the commands, notebooks and the report do with every result."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

from ..arguments import AXES, FLAG, PATH, check_arguments
from ..errors import HarnessError, check_names, import_optional
from .folder import OVERWRITE, replace_folder
from .provenance import write_provenance
from .stored_data import DATA_FILE, read_data, write_data
from .summary import PICTURE_FILE, Summary, read_cells, write_summary

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
    function : str
        Function of Python that returns the result, for the provenance of saved results.
    """

    study: ClassVar[str]
    function: ClassVar[str]

    @property
    @abstractmethod
    def title(self) -> str:
        """Name of the result, as the report shows it."""

    @property
    @abstractmethod
    def headline(self) -> str:
        """The result in a few words, for `repr`."""

    @abstractmethod
    def summary(self) -> Summary:
        """Return the findings: sentences, tables and conclusion, as the report shows them."""

    @abstractmethod
    def as_json(self) -> dict[str, Any]:
        """Return the result as plain data, as `--json` prints it."""

    @abstractmethod
    def blocks(self) -> list[Any]:
        """Return the tables of rich and the sentences that the command prints."""

    def rows(self) -> "tuple[list[Mapping[str, Any]], str]":
        """Return the rows of the main table, if possible as numbers, and the name of the column that is their index."""
        if not (tables := self.summary().tables):
            raise HarnessError(f"the result {self.title} has no table")
        headings = tables[0].headings
        return [dict(zip(headings, row, strict=True)) for row in tables[0].rows], headings[0]

    @abstractmethod
    def write_tables(self, folder: Path) -> None:
        """Write the files with numbers."""

    @abstractmethod
    def draw(self, figure: "Figure") -> None:
        """Draw the figure of the command."""

    @abstractmethod
    def draw_panel(self, axes: "Axes") -> None:
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
        rows, index = self.rows()
        frame: pandas.DataFrame = library.DataFrame(rows).set_index(index)
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
                self.draw_panel(ax)
                return np.array([ax])
            figure = plt.figure(dpi=DPI)
            self.draw(figure)
            if not figure.axes:
                plt.close(figure)
                raise HarnessError(f"this {self.study} result has nothing to plot; to_pandas() has its numbers")
            for text in find_texts(figure):
                text.set_parse_math(False)
        return np.array(figure.axes)

    @check_arguments(folder=PATH, overwrite=FLAG)
    def save(self, folder: str | Path, overwrite: bool = False) -> None:
        """Write the result into a folder: its files, figure, provenance and summary; `load_result` reads it.

        Parameters
        ----------
        folder : path
            A new folder, or one that holds a result of the same source.
        overwrite : bool
            Whether a result of another source may be replaced.

        Raises
        ------
        HarnessError
            If the folder holds other files, or the result of another source without `overwrite`.
        """
        from .registry import find_study

        origin = self.origin()
        allowed = OVERWRITE.set(OVERWRITE.get() or overwrite)
        try:
            with replace_folder(Path(folder), find_study(self.study).files, origin["source"]) as new_folder:
                self.write(new_folder)
                write_provenance(new_folder, **origin, command=f"harness.{self.function}")
                write_summary(new_folder, replace(self.summary(), title=Path(folder).name))
        finally:
            OVERWRITE.reset(allowed)

    def origin(self) -> dict[str, Any]:
        """Return the files, parameters and source for the provenance of a result that Python saves."""
        return {"files": (), "source": self.title}

    def write(self, folder: Path) -> None:
        """Write tables, figure and data into a new folder."""
        self.write_tables(folder)
        self.write_figure(folder / PICTURE_FILE)
        write_data(self, folder / DATA_FILE)

    def write_figure(self, path: Path) -> None:
        """Save the figure as SVG, if anything can be drawn."""
        from .style import DPI, Figure, save_figure, use_style

        with use_style():
            figure = Figure(dpi=DPI)
            self.draw(figure)
            if figure.axes:
                save_figure(figure, path)

    @classmethod
    def is_stored(cls, folder: Path) -> bool:
        """Return whether a folder holds the data that `load` reads."""
        return (folder / DATA_FILE).is_file()

    @classmethod
    @check_arguments(folder=PATH)
    def load(cls, folder: str | Path) -> Self:
        """Read the result in a folder; SceneError if its data are damaged."""
        return read_data(cls, Path(folder) / DATA_FILE)

    def __getitem__(self, name: str) -> Any:
        """Return a part of the result by its key in the JSON."""
        content = self.as_json()
        check_names("key", [name], content)
        return content[name]

    def __repr__(self) -> str:
        text = f"{type(self).__name__} of {self.title}: {self.headline}"
        return f"<{' '.join(text.split())}>"

    def __str__(self) -> str:
        from rich.console import Console

        console = Console(width=TEXT_WIDTH, markup=False, highlight=False)
        with console.capture() as text:
            for block in self.blocks():
                console.print(block)
        return text.get().rstrip("\n")

    def _repr_html_(self) -> str:
        """Return the tables and sentences of the command for notebooks."""
        from rich.table import Table

        parts = []
        for block in self.blocks():
            if isinstance(block, Table):
                caption = f"<caption>{escape(str(block.title))}</caption>" if block.title else ""
                for table in read_cells(block):
                    head = "".join(f"<th>{escape(heading)}</th>" for heading in table.headings)
                    rows = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in table.rows)
                    body = "".join(f"<tr>{row}</tr>" for row in rows)
                    parts.append(f"<table>{caption}<tr>{head}</tr>{body}</table>")
            elif str(block):
                parts.append(f"<p>{escape(str(block))}</p>")
        return f"<div><strong>{escape(self.title)}</strong>{''.join(parts)}</div>"


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
        result.write(new_folder)
        write_provenance(new_folder, **result.origin() | origin | {"source": source})
        write_summary(new_folder, result.summary())
    return result
