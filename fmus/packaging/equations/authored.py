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
from .anatomy import Anatomy
from .declared import Model
from .dimensions import judge_units
from .expressions import Mistake
from .written import written

PACKAGE = __name__.split(".", 1)[0]
TAKEN = ("guard", "pythonfmu", "runtime")  # what travels beside a model


@dataclass(frozen=True)
class Authored:
    """A file with one model in it; its name is that of the FMU."""

    path: Path
    source: str
    ramps: bool = False  # whether its inputs may have rates

    @property
    def name(self) -> str:
        return self.path.stem

    @property
    def title(self) -> str:
        """The name of the class."""
        return self.anatomy.name

    @cached_property
    def anatomy(self) -> Anatomy:
        """The model, judged."""
        try:
            found = Anatomy(self._model(), self.ramps)
            judge_units(found)
            return found
        except Mistake as mistake:
            raise self._told(mistake) from mistake

    @cached_property
    def text(self) -> str:
        """The module as it travels."""
        try:
            self.anatomy.judge_runtime()
            return written(self.anatomy, self.path.name)
        except Mistake as mistake:
            raise self._told(mistake) from mistake

    @cached_property
    def model(self) -> type[VariableOwner]:
        """The class of the model as it travels, in this process; `inspect` and tracebacks find its text."""
        digest = sha256(self.text.encode()).hexdigest()[:12]
        file = f"written-{digest}/{self.name}.py"
        module = ModuleType(f"{PACKAGE}.written_{digest}.{self.name}")
        module.__package__, module.__file__ = PACKAGE, file
        linecache.cache[file] = (len(self.text), None, self.text.splitlines(keepends=True), file)
        sys.modules[module.__name__] = module
        exec(compile(self.text, file, "exec"), vars(module))
        made = vars(module)[self.title]
        self._judge_start(made())
        return made

    def _judge_start(self, thing: Any) -> None:
        """Refuse start values that go nowhere: nobody could run the model as it is."""
        try:
            rule = thing.prepare()
            begins = thing.initial_state(0.0)
            states = begins if isinstance(begins, tuple) else (begins,)  # of one state a number
            thing.compute_outputs(0.0, *states, *(0 for _ in self.anatomy.contacts))
        except (ArithmeticError, ValueError) as error:
            mistake = Mistake(f"the start values lead out of the range of numbers: {error}", self.anatomy.model.place)
            raise self._told(mistake) from error
        if rule:
            sentence = thing.rules[rule - 1].format_map(vars(thing))
            raise self._told(Mistake(f"the start values are refused: {sentence}", self.anatomy.model.place))

    def _model(self) -> type[Model]:
        """The class in the file."""
        if not (self.name.isidentifier() and self.name.isascii()) or iskeyword(self.name) or self.name in TAKEN:
            taken = f", and not {' or '.join(TAKEN)}" if self.name in TAKEN else ""
            raise BuildError(
                f"{self.path}: a model has the name of its file, in letters, digits and _{taken}: rename it."
            )
        module = ModuleType(f"{PACKAGE}.authored.{self.name}")
        module.__file__ = str(self.path)
        try:
            exec(compile(self.source, str(self.path), "exec"), vars(module))
        except Mistake:
            raise
        except SyntaxError as error:
            raise Mistake(f"this is no Python: {error.msg}", (str(self.path), error.lineno or 1)) from error
        except (Exception, SystemExit) as error:
            lines = [frame.lineno or 1 for frame in extract_tb(error.__traceback__) if frame.filename == str(self.path)]
            told = " ".join(f"{type(error).__name__}: {error}".split())
            raise Mistake(told, (str(self.path), lines[-1] if lines else 1)) from error
        models = [
            one
            for one in vars(module).values()
            if isinstance(one, type) and issubclass(one, Model) and one.__module__ == module.__name__
        ]
        if len(models) != 1:
            what = f"has {len(models)} of them, {', '.join(one.__name__ for one in models)}" if models else "has none"
            raise BuildError(f"{self.path}: a file holds one class that derives from Model; this one {what}.")
        return models[0]

    def _told(self, mistake: Mistake) -> BuildError:
        """The sentence, with the line."""
        file, line = mistake.place
        where = f"{self.path}, line {line}" if file == str(self.path) else str(self.path)
        return BuildError(f"{where}: {mistake}.")


_known: dict[Path, Authored] = {}


def authored(path: Path) -> Authored:
    """The model in a file; read anew when the file has changed, and otherwise made once."""
    try:
        source = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise BuildError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    known = _known.get(path.resolve())
    if known is None or (known.path, known.source) != (path, source):
        known = _known[path.resolve()] = Authored(path, source)
    return known
