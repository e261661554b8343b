"""Loads model files: path, analysed model, and the source of the generated class.

Errors are reported in one sentence with file and line.
"""

import ast
from dataclasses import dataclass
from functools import cached_property
from keyword import iskeyword
from pathlib import Path
from traceback import extract_tb
from types import ModuleType

from .. import BuildError
from .declaration_checks import check_use
from .dimensions import check_frequencies, check_units
from .expressions import ModelError
from .model_analysis import ModelAnalysis
from .model_class import model_source
from .model_conditions import add_liftoff, locate_kinks
from .model_declaration import Model
from .python_errors import check_statements, explain
from .start_values import check_start_values

PACKAGE = __name__.split(".", 1)[0]
RESERVED_FILE_NAMES = ("pythonfmu", "runtime")  # embedded in the same package


@dataclass(frozen=True)
class ModelFile:
    """A file that defines one model; its stem is the name of the FMU."""

    path: Path
    source: str
    has_input_derivatives: bool = False  # whether inputs may have time derivatives
    revision: int = 0  # counts the changes of the files of its tables

    @property
    def name(self) -> str:
        return self.path.stem

    @property
    def class_name(self) -> str:
        """Name of the model class."""
        return self.analysis.name

    @cached_property
    def analysis(self) -> ModelAnalysis:
        """The analysed and checked model."""
        try:
            analysis = ModelAnalysis(self._load_class(), self.has_input_derivatives)
            check_units(analysis)
            check_frequencies(analysis)
            return analysis
        except ModelError as mistake:
            raise self._build_error(mistake) from mistake

    @cached_property
    def generated_source(self) -> str:
        """Source of the generated module."""
        try:
            self.analysis.check_solvable()
            source = model_source(self.analysis, self.path.name)
            check_start_values(self.analysis)
            check_use(self.analysis)
            return source
        except ModelError as mistake:
            raise self._build_error(mistake) from mistake

    def _load_class(self) -> type[Model]:
        """Execute the file and return its model class."""
        if (
            not (self.name.isidentifier() and self.name.isascii())
            or iskeyword(self.name)
            or self.name in RESERVED_FILE_NAMES
        ):
            exceptions = f", and not {' or '.join(RESERVED_FILE_NAMES)}" if self.name in RESERVED_FILE_NAMES else ""
            raise BuildError(
                f"{self.path}: the file name is the model name: use only ASCII letters, digits and _{exceptions}."
            )
        module = self._execute()
        models = [
            model
            for model in vars(module).values()
            if isinstance(model, type) and issubclass(model, Model) and model.__module__ == module.__name__
        ]
        if len(models) != 1:
            content = f"has {len(models)}: {', '.join(model.__name__ for model in models)}" if models else "has none"
            raise BuildError(
                f"{self.path}: a model file must define exactly one class derived from Model; this one {content}."
            )
        check_statements(ast.parse(self.source), models[0], str(self.path))
        return models[0]

    def _execute(self) -> ModuleType:
        """Execute the file."""
        module = ModuleType(f"{PACKAGE}.model_files.{self.name}")
        module.__file__ = str(self.path)
        try:
            exec(compile(self.source, str(self.path), "exec", optimize=0), vars(module))
        except ModelError as error:
            lines = [frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == str(self.path)]
            if error.location[0] != str(self.path) and lines:  # raised by a library that the file calls
                error.location = (str(self.path), lines[-1] or 1)
            raise
        except SyntaxError as error:
            raise ModelError(f"invalid Python: {error.msg}", (str(self.path), error.lineno or 1)) from error
        except (Exception, SystemExit) as error:
            raise explain(error, ast.parse(self.source), str(self.path)) from error
        for model in vars(module).values():
            if isinstance(model, type) and issubclass(model, Model):
                add_liftoff(model)
                locate_kinks(model)
        return module

    def _build_error(self, mistake: ModelError) -> BuildError:
        """Return a BuildError with file and line in front of the message."""
        file, line = mistake.location
        location = f"{self.path}, line {line}" if file == str(self.path) else str(self.path)
        return BuildError(f"{location}: {mistake}.")


_model_files: dict[Path, ModelFile] = {}


def load_model_file(path: Path) -> ModelFile:
    """Load a model file; cached until the file changes."""
    try:
        source = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise BuildError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    model_file = _model_files.get(path.resolve())
    if model_file is None or (model_file.path, model_file.source) != (path, source):
        model_file = _model_files[path.resolve()] = ModelFile(path, source)
    elif "analysis" in vars(model_file) and any(table.has_changed() for table in model_file.analysis.tables):
        model_file = _model_files[path.resolve()] = ModelFile(path, source, revision=model_file.revision + 1)
    return model_file
