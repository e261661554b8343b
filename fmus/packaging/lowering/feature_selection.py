"""An FMU that offers some of the methods and friction laws, and carries just their code.

What is not offered is settled like what a model fixes, so that its branches, its objects and its files are gone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ...runtime.active_method import EXACT_ITEM, METHOD_ITEMS
from ...runtime.method_registry import methods
from ...runtime.stick_slip import HYBRID_LAW, SIGN_LAW, THRESHOLD_LAW
from .. import BuildError
from ..equations.model_file import ModelFile

METHODS: dict[str, int] = {label: value for label, value, _ in (EXACT_ITEM, *METHOD_ITEMS)}
LAWS: dict[str, int] = {label: value for label, value, _ in (HYBRID_LAW, SIGN_LAW, THRESHOLD_LAW)}
EXACT, HYBRID = EXACT_ITEM[0], HYBRID_LAW[0]


@dataclass(frozen=True)
class FeatureSelection:
    """The labels of the methods and of the laws that an FMU offers."""

    methods: tuple[str, ...]
    laws: tuple[str, ...]

    @property
    def choices(self) -> dict[str, tuple[int, ...]]:
        """Every attribute that tells a choice, with the values that it can have."""
        methods = tuple(METHODS[label] for label in self.methods)
        laws = tuple(LAWS[label] for label in self.laws)
        return {"method": methods, "method_number": methods} | ({"friction": laws} if laws else {})

    @property
    def excluded(self) -> frozenset[str]:
        """The labels of what is not offered."""
        return frozenset({*METHODS, *LAWS} - {*self.methods, *self.laws})

    @property
    def stepping_methods(self) -> dict[str, str]:
        """Label and class of the methods with steps that are offered."""
        return {label: cls.__name__ for label, _, cls in methods if label in self.methods}


def select_features(source: ModelFile, methods: Sequence[str] = (), laws: Sequence[str] = ()) -> FeatureSelection:
    """What is asked for; where nothing is, all that the model has.  BuildError for what it does not have."""
    an, chosen = source.analysis, []
    for word, has, wanted in ("method", an.methods, methods), ("friction law", an.laws, laws):
        for label in wanted:
            if label not in has:
                raise BuildError(f"{source.name} has no {word} {label!r}; it has {', '.join(has) or 'none to choose'}.")
        chosen.append(tuple(label for label in has if label in wanted or not wanted))
    kept, ruling = chosen
    if ruling and HYBRID not in ruling:  # the closed form holds for no other
        kept = tuple(label for label in kept if label != EXACT)
        if not kept:
            raise BuildError(
                f"{source.name} has the method {EXACT!r} for the law {HYBRID!r} only: ask for that law as well."
            )
    return FeatureSelection(kept, ruling)
