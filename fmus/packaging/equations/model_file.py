"""The file of an author: where it is, the model that it holds, and the same written out.

What is wrong with it is told in one sentence, with file and line.
"""

import linecache
import sys
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from keyword import iskeyword
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any

from ...runtime.variable_declarations import VariableOwner
from .. import BuildError
from .dimensions import check_units
from .expressions import ModelError
from .model_analysis import ModelAnalysis
from .model_declaration import Model
from .model_source import model_source

PACKAGE = __name__.split(".", 1)[0]
RESERVED_FILE_NAMES = ("pythonfmu", "pythonfmu_workarounds", "runtime")  # what travels beside a model


@dataclass(frozen=True)
class ModelFile:
    """A file with one model in it; its name is that of the FMU."""

    path: Path
    source: str
    ramps: bool = False  # whether its inputs may have rates

    @property
    def name(self) -> str:
        return self.path.stem

    @property
    def class_name(self) -> str:
        """The name of the class."""
        return self.analysis.name

    @cached_property
    def analysis(self) -> ModelAnalysis:
        """The model, judged."""
        try:
            found = ModelAnalysis(self._load_class(), self.ramps)
            check_units(found)
            return found
        except ModelError as mistake:
            raise self._build_error(mistake) from mistake

    @cached_property
    def generated_source(self) -> str:
        """The module as it travels."""
        try:
            self.analysis.check_solvable()
            return model_source(self.analysis, self.path.name)
        except ModelError as mistake:
            raise self._build_error(mistake) from mistake

    @cached_property
    def model(self) -> type[VariableOwner]:
        """The class of the model as it travels, in this process; `inspect` and tracebacks find its text."""
        digest = sha256(self.generated_source.encode()).hexdigest()[:12]
        file = f"written-{digest}/{self.name}.py"
        module = ModuleType(f"{PACKAGE}.written_{digest}.{self.name}")
        module.__package__, module.__file__ = PACKAGE, file
        linecache.cache[file] = (
            len(self.generated_source),
            None,
            self.generated_source.splitlines(keepends=True),
            file,
        )
        sys.modules[module.__name__] = module
        exec(compile(self.generated_source, file, "exec"), vars(module))
        made = vars(module)[self.class_name]
        self._check_start_values(made())
        return made

    def _check_start_values(self, thing: Any) -> None:
        """Refuse start values that go nowhere: nobody could run the model as it is."""
        try:
            rule = thing.prepare()
            begins = thing.initial_state(0.0)
            states = begins if isinstance(begins, tuple) else (begins,)  # of one state a number
            thing.compute_outputs(0.0, *states, *(0 for _ in self.analysis.contacts))
        except (ArithmeticError, ValueError) as error:
            mistake = ModelError(
                f"the start values lead out of the range of numbers: {error}", self.analysis.model.location
            )
            raise self._build_error(mistake) from error
        if rule:
            sentence = thing.rules[rule - 1].format_map(vars(thing))
            raise self._build_error(
                ModelError(f"the start values are refused: {sentence}", self.analysis.model.location)
            )

    def _load_class(self) -> type[Model]:
        """The class in the file."""
        if (
            not (self.name.isidentifier() and self.name.isascii())
            or iskeyword(self.name)
            or self.name in RESERVED_FILE_NAMES
        ):
            taken = f", and not {' or '.join(RESERVED_FILE_NAMES)}" if self.name in RESERVED_FILE_NAMES else ""
            raise BuildError(
                f"{self.path}: a model has the name of its file, in letters, digits and _{taken}: rename it."
            )
        module = ModuleType(f"{PACKAGE}.authored.{self.name}")
        module.__file__ = str(self.path)
        try:
            exec(compile(self.source, str(self.path), "exec"), vars(module))
        except ModelError:
            raise
        except SyntaxError as error:
            raise ModelError(f"this is no Python: {error.msg}", (str(self.path), error.lineno or 1)) from error
        except (Exception, SystemExit) as error:
            lines = [frame.lineno or 1 for frame in extract_tb(error.__traceback__) if frame.filename == str(self.path)]
            told = " ".join(f"{type(error).__name__}: {error}".split())
            raise ModelError(told, (str(self.path), lines[-1] if lines else 1)) from error
        models = [
            one
            for one in vars(module).values()
            if isinstance(one, type) and issubclass(one, Model) and one.__module__ == module.__name__
        ]
        if len(models) != 1:
            what = f"has {len(models)} of them, {', '.join(one.__name__ for one in models)}" if models else "has none"
            raise BuildError(f"{self.path}: a file holds one class that derives from Model; this one {what}.")
        return models[0]

    def _build_error(self, mistake: ModelError) -> BuildError:
        """The sentence, with the line."""
        file, line = mistake.location
        where = f"{self.path}, line {line}" if file == str(self.path) else str(self.path)
        return BuildError(f"{where}: {mistake}.")


_loaded: dict[Path, ModelFile] = {}


def load_model_file(path: Path) -> ModelFile:
    """The model in a file; read anew when the file has changed, and otherwise made once."""
    try:
        source = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise BuildError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    known = _loaded.get(path.resolve())
    if known is None or (known.path, known.source) != (path, source):
        known = _loaded[path.resolve()] = ModelFile(path, source)
    return known
