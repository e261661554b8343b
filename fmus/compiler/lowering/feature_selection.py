"""Selects the integration methods and friction laws that an FMU includes.

Code of excluded methods and laws is removed by constant folding, and as unused functions and imports.
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
    """Labels of the methods and laws that an FMU includes, and whether its variables are Reals only."""

    methods: tuple[str, ...]
    laws: tuple[str, ...]
    real_only: bool = False

    @property
    def choices(self) -> dict[str, tuple[int, ...]]:
        """Attributes that hold a choice, with their possible values."""
        methods = tuple(METHODS[label] for label in self.methods)
        laws = tuple(LAWS[label] for label in self.laws)
        return {"method": methods, "method_number": methods} | ({"friction": laws} if laws else {})

    @property
    def excluded_labels(self) -> frozenset[str]:
        """Labels of excluded methods and laws."""
        return frozenset({*METHODS, *LAWS} - {*self.methods, *self.laws})

    @property
    def stepping_methods(self) -> dict[str, str]:
        """Label and class of the included methods that take steps."""
        return {label: cls.__name__ for label, _, cls in methods if label in self.methods}


def select_features(
    source: ModelFile, methods: Sequence[str] = (), laws: Sequence[str] = (), real_only: bool = False
) -> FeatureSelection:
    """Select methods and laws, by default all that the model offers; with Reals only, its default method and law.

    Raises
    ------
    BuildError
        If the model cannot have one of them, or there are several and the FMU has Reals only.
    """
    analysis, selections = source.analysis, []
    if real_only:
        laws = laws or analysis.laws[:1]
        methods = methods or [analysis.method]
        for option, values in (("--method", methods), ("--law", laws)):
            if len(values) > 1:
                raise BuildError(
                    f"{option} {' and '.join(values)}: an FMU with Reals only has one: give {option} once."
                )
    for word, default, available_labels, requested_labels in (
        ("method", analysis.methods, analysis.available_methods, methods),
        ("friction law", analysis.laws, analysis.laws, laws),
    ):
        for label in requested_labels:
            if label not in available_labels:
                raise BuildError(
                    f"{source.name} has no {word} {label!r}; it has {', '.join(available_labels) or 'none to choose'}."
                )
        selections.append(tuple(label for label in available_labels if label in (requested_labels or default)))
    selection, selected_laws = selections
    if selected_laws and HYBRID not in selected_laws:  # the closed form requires the hybrid law
        selection = tuple(label for label in selection if label != EXACT)
        if not selection:
            remedy = f"give --law {HYBRID} instead" if real_only else f"add --law {HYBRID}"
            raise BuildError(
                f"{source.name}: the method {EXACT!r} needs the law {HYBRID!r}: {remedy}, or give another --method."
            )
    return FeatureSelection(selection, selected_laws, real_only)
