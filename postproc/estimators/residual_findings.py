"""What stands out in the residuals, in plain words."""

from collections.abc import Iterator

import numpy as np

from postproc.estimators.metrics import mean_bounds
from postproc.estimators.residuals import Residuals

# limits at which a change is named in 1 % of honest walks
_CHANGE_SIGMAS = 2.6
_SECTOR_CHI2 = 9.2
_CERTAINLY_CORRELATED = 0.99


def findings(left: Residuals) -> list[str]:
    """One sentence for each; empty for a walk that the model explains."""
    return [*_trends(left), *_noise(left), *_filter(left)]


def _trends(left: Residuals) -> Iterator[str]:
    change, sector = left.exponent_change, left.sector
    if change is not None and abs(change.eta_change) > _CHANGE_SIGMAS * change.eta_sigma:
        how = "faster" if change.eta_change > 0.0 else "more slowly"
        yield (
            f"levels fall {how} beyond {change.distance_m:.0f} m: "
            f"the exponent changes by {change.eta_change:+.1f} +- {change.eta_sigma:.1f}"
        )
    if sector is not None and sector.chi2 > _SECTOR_CHI2:
        yield (
            f"sector antenna suspected: {sector.difference_db:.0f} +- "
            f"{sector.difference_sigma_db:.0f} dB stronger towards {sector.azimuth_deg:.0f} deg "
            "than to the opposite side"
        )


def _noise(left: Residuals) -> Iterator[str]:
    if left.correlated > _CERTAINLY_CORRELATED:
        yield (
            f"residuals are correlated over about {left.decorrelation_m:.0f} m: "
            f"{np.sum(np.isfinite(left.residual_db))} readings count for "
            f"{left.independent:.0f} at most"
        )
    if left.outliers:
        worst = left.outliers[0]
        how = "stronger" if worst.residual_db > 0.0 else "weaker"
        yield (
            f"{len(left.outliers)} outlying reading{'s' * (len(left.outliers) > 1)}: the worst, "
            f"of scan {worst.scan_seq}, is {abs(worst.residual_db):.0f} dB {how} than the model "
            f"({worst.sigmas:.1f} sigma)"
        )


def _filter(left: Residuals) -> Iterator[str]:
    consistency = left.innovations
    if consistency is None or consistency.n <= consistency.n_at_limit:
        return
    # squares of correlated innovations correlate by rho^2, so there are fewer independent ones
    correlated = 1.0 + 2.0 * float(np.sum(np.square(consistency.autocorrelation)))
    independent = (consistency.n - consistency.n_at_limit) / correlated
    if consistency.mean_nis > mean_bounds(max(round(independent), 1))[1]:
        yield (
            "the filter is overconfident: its squared innovations are "
            f"{consistency.mean_nis:.1f} times what it expects"
        )
