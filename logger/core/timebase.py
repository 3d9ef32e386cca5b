"""From time since boot to UTC, fitted over what the GPS receiver said, since a Pi has no clock.

Nothing is believed of the wall clock. A receiver may be wrong too: before its first fix, by a
rollover of its week counter, by leap seconds it has not heard of yet. Where its words disagree, UTC
is unknown rather than wrong.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from logger.core.arrays import IntArray
from logger.core.column import UNKNOWN_TIME
from logger.core.provenance import has_times, is_import
from logger.core.rows import Rows
from logger.core.utc import EARLIEST_UTC_NS, LATEST_UTC_NS

STEP_S = 0.6
"""A serial line delays by less; a leap second is more."""
DRIFT_MOST = 100e-6
"""No crystal of a computer is worse."""
AGREE_SHARE = 0.9
"""Less agreement than this is no knowledge."""
LEAP_S = 20.0
"""Smaller steps are leap seconds that a receiver has heard of late (up to 12.5 min): its last word
is right.
"""
DRIFT_SPAN_S = 600.0
"""Shorter runs do not determine the drift of a crystal (some ppm) against the jitter of a serial
line.
"""
_MOST_PAIRS = 2000
_BINS = 24
_PROMPT = 90.0
"""Percentile of UTC minus time of arrival that stands for no delay: sentences come late, never
early.
"""

Floats = npt.NDArray[np.float64]
Truths = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class TimeBase:
    """UTC = reference_utc + (1 + drift) (t - reference_t); `sigma_s` is the scatter of the pairs
    used.
    """

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


def fit_run(origin: str, fixes: Rows) -> TimeBase | None:
    """As `fit` for the table `fixes` of a run; `origin` is the one in its description.

    The times of an import are those of another program, of any year: no week counter is asked about
    them. Without times there is no UTC.
    """
    if not has_times(origin):
        return None
    return fit(fixes["t_ns"], fixes["utc_ns"], fixes["valid"], any_year=is_import(origin))


def fit(
    t_ns: IntArray,
    utc_ns: IntArray,
    valid: npt.NDArray[np.integer] | None = None,
    *,
    any_year: bool = False,
) -> TimeBase | None:
    """Fit the pairs (time since boot, UTC by GPS), arrays of shape (n,) with `UNKNOWN_TIME` where
    there is none.

    `valid` (n,) is 0 where the receiver had no position: it then knows the time from its own clock
    at best, and the pair is not used. None when nothing is left, or what is left contradicts
    itself: UTC is then unknown. With `any_year` a time may also lie where a receiver that is wrong
    by a rollover would put it.
    """
    known = utc_ns != UNKNOWN_TIME
    usable = known if any_year else (utc_ns >= EARLIEST_UTC_NS) & (utc_ns < LATEST_UTC_NS)
    if valid is not None:
        usable = usable & (valid != 0)
    if not np.any(usable):
        return None
    order = np.argsort(t_ns[usable], kind="stable")
    t, utc = t_ns[usable][order], utc_ns[usable][order]
    elapsed_s, early_s = (t - t[0]) / 1e9, ((utc - utc[-1]) - (t - t[-1])) / 1e9
    believed = _believed(elapsed_s, early_s, utc)
    if believed is None:
        return None
    elapsed_s, early_s = elapsed_s[believed], early_s[believed]
    drift = _drift(elapsed_s, early_s) if elapsed_s[-1] - elapsed_s[0] > DRIFT_SPAN_S else 0.0
    residual_s = early_s - drift * elapsed_s
    prompt_ns = round(float(np.percentile(residual_s, _PROMPT)) * 1e9)
    return TimeBase(
        reference_t_ns=int(t[0]),
        reference_utc_ns=int(t[0]) + int(utc[-1] - t[-1]) + prompt_ns,
        drift=drift,
        sigma_s=float(np.std(residual_s)),
        n_pairs=int(np.count_nonzero(believed)),
        n_rejected=int(np.count_nonzero(known)) - int(np.count_nonzero(believed)),
    )


def _believed(elapsed_s: Floats, early_s: Floats, utc_ns: IntArray) -> Truths | None:
    """Which pairs tell the time, shape as given; None where they contradict each other."""
    thin = np.unique(np.linspace(0, len(elapsed_s) - 1, _MOST_PAIRS).astype(int))
    opinions = _opinions(elapsed_s[thin].tolist(), early_s[thin].tolist())
    largest = max(opinions, key=len)
    chosen = (
        largest
        if len(largest) >= AGREE_SHARE * len(thin)
        else _last_leap(opinions, early_s[thin], utc_ns[thin])
    )
    if chosen is None:
        return None
    at_s, line_s = elapsed_s[thin][chosen], early_s[thin][chosen]
    believed: Truths = np.abs(early_s - np.interp(elapsed_s, at_s, line_s)) <= STEP_S
    return believed


def _opinions(elapsed_s: list[float], early_s: list[float]) -> list[list[int]]:
    """Pairs grouped by whether one clock may have told them, in order of time."""
    opinions: list[list[int]] = []
    for i, (at_s, offset_s) in enumerate(zip(elapsed_s, early_s, strict=True)):
        for opinion in opinions:
            last = opinion[-1]
            if abs(offset_s - early_s[last]) <= STEP_S + DRIFT_MOST * (at_s - elapsed_s[last]):
                opinion.append(i)
                break
        else:
            opinions.append([i])
    return opinions


def _last_leap(opinions: list[list[int]], early_s: Floats, utc_ns: IntArray) -> list[int] | None:
    """The last opinion, where only leap seconds that were heard of late stand between it and the
    others.
    """
    last = max(opinions, key=lambda opinion: opinion[-1])
    near = [
        opinion for opinion in opinions if abs(early_s[opinion[-1]] - early_s[last[0]]) <= LEAP_S
    ]
    before = [opinion for opinion in near if opinion is not last]
    if sum(map(len, near)) < AGREE_SHARE * len(early_s) or len(last) * 3 < len(early_s):
        return None
    if any(opinion[-1] > last[0] for opinion in before) or _is_midnight(int(utc_ns[last[0]])):
        return None
    return last


def _is_midnight(utc_ns: int) -> bool:
    """True where a leap second may really have happened: then neither opinion is right all the
    time.
    """
    seconds = utc_ns / 1e9 % 86_400
    return min(seconds, 86_400 - seconds) < 3.0


def _drift(elapsed_s: Floats, early_s: Floats) -> float:
    """Slope by the median over pairs of bins, each bin by its promptest sentences (Theil 1950, Sen
    1968).
    """
    edges = np.linspace(elapsed_s[0], elapsed_s[-1], _BINS + 1)[1:-1]
    groups = np.searchsorted(edges, elapsed_s)
    filled = np.unique(groups)
    x = np.array([elapsed_s[groups == g].mean() for g in filled])
    y = np.array([np.percentile(early_s[groups == g], _PROMPT) for g in filled])
    i, j = np.triu_indices(len(x), 1)
    return float(np.median((y[j] - y[i]) / (x[j] - x[i])))
