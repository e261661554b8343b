"""Comparison of laws that were fitted to the same records, by the Bayesian information criterion (BIC)."""

from collections.abc import Sequence

from .parameter_fit import CLEAR_DIFFERENCE, ComparedLaw, LawComparison, ParameterFit, information_criterion


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
