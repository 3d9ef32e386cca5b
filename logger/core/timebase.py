"""From time since boot to UTC, fitted over what the GPS receiver said, since a Pi has no clock."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np
import numpy.typing as npt

from logger.core.arrays import IntArray
from logger.core.schema import UNKNOWN_TIME

AGREE_S = 2.0
"""Receivers report an epoch up to a second late; what is further off is a jump, a rollover or a wrong date."""
DRIFT_SPAN_S = 600.0
"""Shorter runs do not determine the drift of a crystal (some ppm) against the jitter of a serial line."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class TimeBase:
    """UTC = reference_utc + (1 + drift) (t - reference_t); `sigma_s` is the scatter of the pairs used."""

    reference_t_ns: int
    reference_utc_ns: int
    drift: float
    sigma_s: float
    n_pairs: int
    n_rejected: int

    def utc_ns(self, t_ns: int) -> int:
        """UTC of a time since boot."""
        elapsed = t_ns - self.reference_t_ns
        return self.reference_utc_ns + elapsed + round(self.drift * elapsed)

    def utc_ns_array(self, t_ns: IntArray) -> IntArray:
        """UTC of times since boot, shape as given."""
        elapsed = t_ns - self.reference_t_ns
        return self.reference_utc_ns + elapsed + np.round(self.drift * elapsed).astype(np.int64)


def fit(t_ns: IntArray, utc_ns: IntArray) -> TimeBase | None:
    """Fit the pairs (time since boot, UTC by GPS), arrays of shape (n,) with `UNKNOWN_TIME` where there is none.

    The median offset decides which pairs agree; None when none or not even half of them do: UTC is then unknown.
    """
    known = utc_ns != UNKNOWN_TIME
    t, utc = t_ns[known], utc_ns[known]
    if not len(t):
        return None
    offset_ns = utc - t
    middle_ns = int(np.sort(offset_ns)[len(offset_ns) // 2])
    late_s = (offset_ns - middle_ns) / 1e9
    agree = np.abs(late_s) <= AGREE_S
    if np.count_nonzero(agree) * 2 < len(t):
        return None
    elapsed_s, late_s = (t[agree] - t[agree][0]) / 1e9, late_s[agree]
    drift = _slope(elapsed_s, late_s) if elapsed_s[-1] > DRIFT_SPAN_S else 0.0
    residual_s = late_s - drift * elapsed_s
    base_s = float(np.median(residual_s))
    reference = int(t[agree][0])
    return TimeBase(
        reference_t_ns=reference,
        reference_utc_ns=reference + middle_ns + round(base_s * 1e9),
        drift=drift,
        sigma_s=float(np.std(residual_s)),
        n_pairs=int(np.count_nonzero(agree)),
        n_rejected=int(np.count_nonzero(~agree)),
    )


def utc_text(utc_ns: int, *, compact: bool = False) -> str:
    """ISO 8601 to the second, `20200207T021417Z` when compact."""
    when = _EPOCH + timedelta(microseconds=utc_ns // 1000)
    return when.strftime("%Y%m%dT%H%M%SZ" if compact else "%Y-%m-%dT%H:%M:%SZ")


def _slope(x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> float:
    centred = x - x.mean()
    return float(centred @ (y - y.mean()) / (centred @ centred))
