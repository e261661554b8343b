"""Result of a fit: values with intervals, residuals and remarks; laws of several fits are compared by their BIC."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, log

import numpy as np

from ...errors import check_names
from ...simulation.model_data import LookupTable
from ..estimation.estimate import ColumnResiduals, Estimate

CLEAR_DIFFERENCE = 6.0  # of two BIC, which is strong evidence
SMALLEST_MEAN_SQUARE = 1e-12  # in units of the noise


@dataclass(frozen=True)
class Profile:
    """Profile likelihood of an unknown.

    Attributes
    ----------
    name : str
        Name of the unknown.
    value : tuple of float
        Values (m,) of the unknown.
    excess : tuple of float
        Least sum of squares (m,) with each value, above the minimum and in units of the limit at which the 95 %
        interval ends.
    """

    name: str
    value: tuple[float, ...]
    excess: tuple[float, ...]


@dataclass(frozen=True)
class FittedRecord:
    """Samples of a record, as they were fitted.

    Attributes
    ----------
    name : str
        Name of the record.
    t : numpy.ndarray
        Times (n,) in s.
    y : numpy.ndarray
        Observed columns (n, columns).
    noise : numpy.ndarray
        Standard deviation (columns,) of the noise.
    sampled_t : numpy.ndarray
        Times (m,) in s of the samples of the record.
    width : int
        Number of samples whose mean each row of `y` is.
    """

    name: str
    t: np.ndarray
    y: np.ndarray
    noise: np.ndarray
    sampled_t: np.ndarray
    width: int


@dataclass(frozen=True)
class Validation:
    """Prediction of records that were not fitted.

    Attributes
    ----------
    columns : tuple of ColumnResiduals
        Residuals of each observed column.
    records : tuple of FittedRecord
        The records.
    predictions : tuple of numpy.ndarray
        Predicted signals (n, columns) of each record at its times.
    remarks : tuple of str
        Remarks on columns that are predicted badly.
    """

    columns: tuple[ColumnResiduals, ...]
    records: tuple[FittedRecord, ...]
    predictions: tuple[np.ndarray, ...]
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Slips:
    """Irregular slips of a measured force.

    Attributes
    ----------
    record, column, unit : str
        Names of the record and of the observed variable, and its unit.
    t : numpy.ndarray
        Times (n,) in s at which the slips start.
    before, after : numpy.ndarray
        Forces (n,) at the start and at the end of each slip.
    waiting : numpy.ndarray
        Times (n,) in s from the end of the slip before to the start of each slip.
    """

    record: str
    column: str
    unit: str
    t: np.ndarray
    before: np.ndarray
    after: np.ndarray
    waiting: np.ndarray

    @property
    def drop(self) -> np.ndarray:
        """Forces (n,) that the slips take away."""
        return np.abs(self.before - self.after)

    @property
    def remark(self) -> str:
        """The means and standard deviations, in a sentence."""
        forces = ((self.before, "before"), (self.after, "after"), (self.drop, "drop"))
        parts = [f"{name} {describe(values)} {self.unit}" for values, name in forces]
        return (
            f"The {len(self.t)} slips of {self.column} in {self.record} are irregular, so that one static and one "
            f"sliding friction do not describe them. Means and standard deviations of the force: {', '.join(parts)}; "
            f"waiting time {describe(self.waiting)} s."
        )


def describe(values: np.ndarray) -> str:
    """Return mean and standard deviation of values (n,)."""
    return f"{values.mean():.3g} ± {values.std(ddof=1):.2g}"


@dataclass(frozen=True)
class ComparedLaw:
    """A law in a comparison.

    Attributes
    ----------
    fmu : str
        Name of the FMU.
    unknowns : int
        Number of unknowns that were fitted.
    residual : float
        Root mean square of the residuals, in units of the noise.
    bic : float
        Bayesian information criterion.
    difference : float
        BIC above that of the best law.
    """

    fmu: str
    unknowns: int
    residual: float
    bic: float
    difference: float


@dataclass(frozen=True)
class LawComparison:
    """Comparison of laws that were fitted to the same records.

    Attributes
    ----------
    laws : tuple of ComparedLaw
        The laws, best first.
    n_independent : float
        Number of residuals that count as independent.
    verdict : str
        Conclusion in a sentence.
    """

    laws: tuple[ComparedLaw, ...]
    n_independent: float
    verdict: str

    @property
    def is_clear(self) -> bool:
        """Return whether one law is clearly better than all others."""
        return self.laws[1].difference >= CLEAR_DIFFERENCE


def information_criterion(squares: float, n: int, n_unknowns: int, n_independent: float) -> float:
    """Return the BIC of a fit with an unknown variance.

    Parameters
    ----------
    squares : float
        Sum of squares of all residuals, in units of the noise.
    n : int
        Number of residuals.
    n_unknowns : int
        Number of unknowns that were fitted.
    n_independent : float
        Number of residuals that count as independent.

    References
    ----------
    G. Schwarz, Estimating the Dimension of a Model, Annals of Statistics 6 (1978) 461
    """
    return n_independent * log(max(squares / n, SMALLEST_MEAN_SQUARE)) + n_unknowns * log(n_independent)


@dataclass(frozen=True, repr=False)
class ParameterFit:
    """Parameters of an FMU that were fitted to measured records.

    Attributes
    ----------
    fmu : str
        Name of the FMU.
    estimates : tuple of Estimate
        Value, standard error and 95 % interval of each unknown; an infinite end where the record sets no bound.
    combinations : tuple of Estimate
        Combinations that the record determines, of parameters that it does not.
    profiles : tuple of Profile
        Profiles of the estimates, in their order; empty if the fit does not describe the record.
    correlation : numpy.ndarray
        Correlation (k, k) of the estimates.
    columns : tuple of ColumnResiduals
        Residuals of each observed column.
    remarks : tuple of str
        Sentences about doubtful results.
    notes : tuple of str
        Assumptions made when reading the records.
    describes_record : bool
        Whether the residuals are small enough to rely on the values.
    squares : float
        Sum of squares of the residuals, in units of the noise.
    n_independent : float
        Number of residuals that count as independent; fewer than there are, if they are correlated.
    n_searches, n_runs : int
        Number of searches, and of runs of the FMU, with derivatives or without.
    seconds : float
        Processor time.
    log : tuple of str
        A line for each search.
    records : tuple of FittedRecord
        The fitted records.
    predictions : tuple of numpy.ndarray
        Fitted signals (n, columns) of each record at its times.
    validation : Validation or None
        Prediction of records that were not fitted.
    against : tuple of ParameterFit
        Fits of other FMUs to the same records.
    comparison : LawComparison or None
        Comparison with the other FMUs.
    tables : tuple of LookupTable
        Lookup tables of the FMU with values of y among the unknowns, whose start values they have.
    slips : tuple of Slips
        Slips of each observed force whose slips are irregular.
    """

    fmu: str
    estimates: tuple[Estimate, ...]
    combinations: tuple[Estimate, ...]
    profiles: tuple[Profile, ...]
    correlation: np.ndarray
    columns: tuple[ColumnResiduals, ...]
    remarks: tuple[str, ...]
    notes: tuple[str, ...]
    describes_record: bool
    squares: float
    n_independent: float
    n_searches: int
    n_runs: int
    seconds: float
    log: tuple[str, ...]
    records: tuple[FittedRecord, ...]
    predictions: tuple[np.ndarray, ...]
    validation: Validation | None = None
    against: "tuple[ParameterFit, ...]" = ()
    comparison: LawComparison | None = None
    tables: tuple[LookupTable, ...] = ()
    slips: tuple[Slips, ...] = ()

    @property
    def n_samples(self) -> int:
        """Return the number of samples of all observed columns."""
        return sum(record.y.size for record in self.records)

    @property
    def bic(self) -> float:
        """Return the Bayesian information criterion, with all residuals as independent ones."""
        return information_criterion(self.squares, self.n_samples, len(self.estimates), self.n_samples)

    @property
    def values(self) -> dict[str, float]:
        """Return the fitted values by name."""
        return {estimate.name: estimate.value for estimate in self.estimates}

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of an unknown or of a combination."""
        estimates = {estimate.name: estimate for estimate in (*self.combinations, *self.estimates)}
        check_names("estimate", [name], estimates)
        return estimates[name]

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Return the names of the unknowns that the records do not determine."""
        return tuple(estimate.name for estimate in self.estimates if not isfinite(estimate.error))


def compare_laws(fits: Sequence[ParameterFit]) -> LawComparison:
    """Compare fits of two or more FMUs to the same samples.

    Correlated residuals count as fewer independent ones. Their number is that of the law with the smallest residuals,
    because those of a wrong law are correlated by its error.

    References
    ----------
    R. E. Kass, A. E. Raftery, Bayes Factors, Journal of the American Statistical Association 90 (1995) 773
    """
    n, n_independent = fits[0].n_samples, min(fits, key=lambda fit: fit.squares).n_independent
    values = [information_criterion(fit.squares, n, len(fit.estimates), n_independent) for fit in fits]
    order = sorted(range(len(fits)), key=lambda i: values[i])
    laws = tuple(
        ComparedLaw(
            fits[i].fmu, len(fits[i].estimates), (fits[i].squares / n) ** 0.5, values[i], values[i] - values[order[0]]
        )
        for i in order
    )
    return LawComparison(laws, n_independent, verdict(laws, fits[order[0]].describes_record))


def verdict(laws: Sequence[ComparedLaw], describes_record: bool) -> str:
    """Return the conclusion of the comparison, in a sentence."""
    best, close = laws[0].fmu, [law.fmu for law in laws[1:] if law.difference < CLEAR_DIFFERENCE]
    others = " and ".join(f"{law.difference:.3g} ({law.fmu})" for law in laws[1:])
    if close:
        names = " and ".join([best, *close])
        higher = f"BIC higher by {others} than {best}; {CLEAR_DIFFERENCE:g} is clear"
        return f"The records do not distinguish {names}: {higher}."
    doubt = "" if describes_record else ", which does not describe them either"
    return f"The records favour {best}{doubt}: its BIC is lower by {others}."
