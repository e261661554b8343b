"""Fits the parameters of an FMU to record files, and writes the result folder."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from os.path import exists
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from ...analyses.fit.fit_course import fit_records
from ...analyses.fit.fit_description import describe_fit
from ...analyses.fit.parameter_fit import ParameterFit
from ...errors import SceneError, format_value
from ...records.signal_table import SignalTable, read_signals
from ...results import provenance
from ...results.files import column_heading, to_json, write_csv
from ...results.folder import replace_folder
from ...running.native_equivalent import native_equivalent
from ...running.whole_run import open_simulator
from .request import FitRequest, ResolvedRequest, make_unknowns, record_data, resolve_request

FOLDER = "fit"
FILES = ("fit.json", "fit.csv", "figure.svg")


def fit_files(
    request: FitRequest, files: Sequence[str], out: Path, report: Callable[[float], None]
) -> tuple[ParameterFit, Path]:
    """Fit the parameters of an FMU to record files, and write the result to out/fit/<record>."""
    resolved = resolve_request(request)
    tables = [read_file(resolved, source) for source in files]
    folder = out / FOLDER / tables[0].name
    source = provenance.describe_sources(*files)
    with replace_folder(folder, FILES, source) as new_folder:
        fit = fit_tables(resolved, tables, report)
        write_results(fit, new_folder)
        paths = [request.fmu, *(Path(file) for file in files if file != "-")]
        scene = {name: value for name, value in asdict(request).items() if name not in ("fmu", "columns")}
        parameters = {name: (value, "") for name, value in request.fixed.items()}
        provenance.write_provenance(new_folder, files=paths, parameters=parameters, scene=scene, source=source)
    return fit, folder


def read_file(resolved: ResolvedRequest, source: str) -> SignalTable:
    """Read the signals of a request from a file."""
    if source != "-" and not exists(source):
        raise SceneError(f"{format_value(source)} does not exist: give an existing record")
    name = "stdin" if source == "-" else Path(source).stem.encode("utf-8", "replace").decode()
    return read_signals(source, resolved.sources, resolved.request.columns, name)


def fit_tables(
    resolved: ResolvedRequest, tables: Sequence[SignalTable], report: Callable[[float], None]
) -> ParameterFit:
    """Fit the parameters of an FMU to the signals in tables."""
    request, begun = resolved.request, process_time()
    data = [record_data(resolved, table) for table in tables]
    unknowns = make_unknowns(resolved, data)
    with open_simulator(native_equivalent(request.fmu), resolved.settings, request.timeout) as simulator:
        problem, course = fit_records(
            simulator.simulate, data, [*request.observe], unknowns, resolved.fixed, request.robust, report
        )
        notes = [note for table in tables for note in table.notes]
        fit = describe_fit(request.fmu.stem, problem, course, notes, simulator.n_runs, process_time() - begun)
    units = {name: resolved.variables[name].unit for name in request.observe}
    return replace(fit, columns=tuple(replace(each, unit=units[each.name]) for each in fit.columns))


def fit_as_json(fit: ParameterFit) -> dict[str, Any]:
    """Return a fit for JSON output, with the keys that `decay` has in common."""
    return {
        "fmu": fit.fmu,
        "record": ", ".join(record.name for record in fit.records),
        "remarks": list(fit.remarks),
        "notes": list(fit.notes),
        "describes_record": fit.describes_record,
        "used": [
            {
                "record": record.name,
                "from": float(record.sampled_t[0]),
                "until": float(record.sampled_t[-1]),
                "samples": len(record.sampled_t),
                "averaged": record.width,
                "time_unit": "s",
            }
            for record in fit.records
        ],
        "fit": [asdict(estimate) for estimate in fit.estimates],
        "undetermined": list(fit.undetermined),
        "combinations": [asdict(estimate) for estimate in fit.combinations],
        "correlation": fit.correlation.tolist(),
        "columns": [asdict(column) for column in fit.columns],
        "bic": fit.bic,
        "searches": fit.n_searches,
        "runs": fit.n_runs,
        "log": list(fit.log),
    }


def write_results(fit: ParameterFit, folder: Path) -> None:
    """Write fit.json, the fitted signals, and the figure."""
    from .figure import draw

    (folder / "fit.json").write_text(to_json(fit_as_json(fit)) + "\n", encoding="utf-8")
    outputs = [column for column in fit.columns if column.record == fit.records[0].name]
    heads = ["record", "t [s]"]
    numbers = np.concatenate([np.full(len(record.t), float(i + 1)) for i, record in enumerate(fit.records)])
    columns = [numbers, np.concatenate([record.t for record in fit.records])]
    for j, column in enumerate(outputs[: fit.predictions[0].shape[1]]):
        measured = np.concatenate([record.y[:, j] for record in fit.records])
        fitted = np.concatenate([prediction[:, j] for prediction in fit.predictions])
        heads += [column_heading(f"{column.name}{suffix}", column.unit) for suffix in ("", " fit", " residual")]
        columns += [measured, fitted, measured - fitted]
    write_csv(folder / "fit.csv", heads, columns)
    draw(fit, folder / "figure.svg")
