"""Result of a fit: values with intervals, residuals and remarks."""

from dataclasses import dataclass
from math import isfinite

import numpy as np

from ..decay.estimates import Estimate
from .measured_record import MeasuredRecord


@dataclass(frozen=True)
class ColumnResiduals:
    """Residuals of one observed column: root mean square, noise of the record, and range, in the unit of the FMU."""

    record: str
    name: str
    unit: str
    residual: float
    noise: float
    range: float


@dataclass(frozen=True)
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
    correlation : numpy.ndarray
        Correlation (k, k) of the estimates.
    columns : tuple of ColumnResiduals
    remarks : tuple of str
        Sentences about doubtful results.
    notes : tuple of str
        Assumptions made when reading the records.
    describes_record : bool
        Whether the residuals are small enough to rely on the values.
    bic : float
        Bayesian information criterion, for comparisons of fits to the same records.
    n_searches, n_runs : int
    seconds : float
        Processor time.
    log : tuple of str
        Course of the search.
    records : tuple of MeasuredRecord
    predictions : tuple of numpy.ndarray
        Fitted signals (n, columns) of each record at its times.
    """

    fmu: str
    estimates: tuple[Estimate, ...]
    combinations: tuple[Estimate, ...]
    correlation: np.ndarray
    columns: tuple[ColumnResiduals, ...]
    remarks: tuple[str, ...]
    notes: tuple[str, ...]
    describes_record: bool
    bic: float
    n_searches: int
    n_runs: int
    seconds: float
    log: tuple[str, ...]
    records: tuple[MeasuredRecord, ...]
    predictions: tuple[np.ndarray, ...]

    @property
    def values(self) -> dict[str, float]:
        """Return the fitted values by name."""
        return {estimate.name: estimate.value for estimate in self.estimates}

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of an unknown or of a combination."""
        return next(each for each in (*self.estimates, *self.combinations) if each.name == name)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Return the names of the unknowns that the records do not determine."""
        return tuple(estimate.name for estimate in self.estimates if not isfinite(estimate.error))
