"""From time since boot to UTC, fitted to the times of the GPS receiver, since a Pi has no clock.

The wall clock is not used. A receiver may be wrong too: before its first fix, by a rollover of its
week counter, by leap seconds it has not received yet. If its times contradict each other, UTC is
unknown rather than wrong.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.rows import Rows
from logger.core.runfile.meta import has_times, is_import, is_simulated
from logger.core.types import EARLIEST_UTC_NS, IMPOSSIBLE_DATE, LATEST_UTC_NS, UNKNOWN_TIME

STEP_S = 0.6
"""A serial line delays by less; a leap second is more."""
DRIFT_MOST = 100e-6
"""No crystal of a computer is worse."""
AGREE_SHARE = 0.9
"""UTC is known only if this share of the pairs agrees."""
LEAP_S = 20.0
"""Smaller steps are leap seconds received late (up to 12.5 min): the last times are right."""
DRIFT_SPAN_S = 600.0
"""Shorter runs do not separate drift (some ppm) from the jitter of a serial line."""
_MOST_PAIRS = 2000
"""Pairs compared with each other; between them the result is interpolated."""
_BINS = 24
"""Of a run, for its drift: each has the promptest sentences of some minutes."""
_PROMPT = 90.0
"""Percentile of UTC minus arrival that stands for no delay: sentences never come early."""
_LATE_S, _LATE_SIMULATED_S = 10.0, 120.0
"""A busy machine reads sentences late, most of all of a walk simulated faster than real; leap
seconds, which a simulated receiver has not, are 18."""
_PROMPT_SIMULATED = 0.5
"""Share of the parts of a simulated run with a prompt sentence; of others all have one."""
_IN_BIN = 10
"""Pairs of which one came without delay, at the load of eight programs a core."""
_MIDNIGHT_S = 3.0
"""A leap second happens at midnight UTC; close to it a step may be real."""
_DAY_S = 86_400


@dataclass(frozen=True, slots=True)
class TimeBase:
    """UTC = reference_utc + (1 + drift) (t - reference_t), by `n_pairs` of both times."""

    reference_t_ns: int
    reference_utc_ns: int
    drift: float
    n_pairs: int

    def utc_ns(self, t_ns: int) -> int:
        """UTC of a time since boot."""
        elapsed = t_ns - self.reference_t_ns
        return self.reference_utc_ns + elapsed + round(self.drift * elapsed)

    def utc_ns_array(self, t_ns: IntArray) -> IntArray:
        """UTC of times since boot, shape as the argument."""
        elapsed = t_ns - self.reference_t_ns
        return self.reference_utc_ns + elapsed + np.round(self.drift * elapsed).astype(np.int64)


def fit_run(origin: str, fixes: Rows) -> TimeBase | None:
    """As `fit` for the table `fixes` of a run; `origin` is the one in its description.

    Times of an import are of another program, of any year and also without a position. An import
    without times has no UTC.
    """
    if not has_times(origin):
        return None
    is_of_program = is_import(origin)
    valid = None if is_of_program else fixes["valid"]
    return fit(
        fixes["t_ns"],
        fixes["utc_ns"],
        valid,
        any_year=is_of_program,
        simulated=is_simulated(origin),
    )


def why_unknown(origin: str, fixes: Rows, notes: Rows | None = None) -> str:
    """Why `fit_run` finds no UTC; `notes` are those of the run."""
    own = is_import(origin)
    utc_ns = fixes["utc_ns"][(fixes["utc_ns"] != UNKNOWN_TIME) & (own | (fixes["valid"] != 0))]
    is_noted = notes is not None and np.any(notes["code"] == IMPOSSIBLE_DATE.encode())
    if not len(utc_ns) and not is_noted:
        return f"the {'log' if own else 'receiver'} never reported UTC"
    if not own and not np.any((utc_ns >= EARLIEST_UTC_NS) & (utc_ns < LATEST_UTC_NS)):
        return "the receiver reported a date that cannot be"
    return "the times of the receiver contradict each other"


def utc_clock(origin: str, fixes: Rows) -> Callable[[int], int | None]:
    """UTC to the microsecond by time since boot, None where unknown; an import has it per fix."""
    timebase = fit_run(origin, fixes)
    if timebase is not None:
        return lambda t_ns: timebase.utc_ns(t_ns) // 1000 * 1000
    if not is_import(origin):
        return lambda _: None
    known = fixes[fixes["utc_ns"] != UNKNOWN_TIME]
    return dict(zip(known["t_ns"].tolist(), known["utc_ns"].tolist(), strict=True)).get


def fit(
    t_ns: IntArray,
    utc_ns: IntArray,
    valid: npt.NDArray[np.integer] | None = None,
    *,
    any_year: bool = False,
    simulated: bool = False,
) -> TimeBase | None:
    """Fit the pairs (time since boot, UTC by GPS), shape (n,); None if UTC remains unknown.

    `utc_ns` is `UNKNOWN_TIME` without a time. A pair with `valid` (n,) 0 is not used: without a
    position the receiver has the time from its own clock at best. With `any_year` a time may also
    be where a receiver with a rollover error would put it; `simulated` times may be read very late.
    """
    has_utc = utc_ns != UNKNOWN_TIME
    usable = has_utc if any_year else (utc_ns >= EARLIEST_UTC_NS) & (utc_ns < LATEST_UTC_NS)
    if valid is not None:
        usable = usable & (valid != 0)
    if not np.any(usable):
        return None
    order = np.argsort(t_ns[usable], kind="stable")
    t, utc = t_ns[usable][order], utc_ns[usable][order]
    elapsed_s, early_s = (t - t[0]) / 1e9, ((utc - utc[-1]) - (t - t[-1])) / 1e9
    agrees = _agreeing_pairs(elapsed_s, early_s, utc, simulated=simulated)
    if agrees is None:
        return None
    drift, residual_s = _line(elapsed_s[agrees], early_s[agrees])
    prompt_ns = round(float(np.percentile(residual_s, _PROMPT)) * 1e9)
    return TimeBase(
        reference_t_ns=int(t[0]),
        reference_utc_ns=int(t[0]) + int(utc[-1] - t[-1]) + prompt_ns,
        drift=drift,
        n_pairs=len(residual_s),
    )


def _agreeing_pairs(
    elapsed_s: FloatArray, early_s: FloatArray, utc_ns: IntArray, *, simulated: bool
) -> BoolArray | None:
    """Shape (n,); None if the pairs contradict each other."""
    thin = np.unique(np.linspace(0, len(elapsed_s) - 1, _MOST_PAIRS).astype(int))
    thin_early_s = early_s[thin]
    groups = _consistent_groups(elapsed_s[thin].tolist(), thin_early_s.tolist())
    group: list[int] | None = max(groups, key=len)
    if group is None or len(group) < AGREE_SHARE * len(thin):
        group = _group_after_leap(groups, thin_early_s, utc_ns[thin])
    if group is None:
        group = _prompt_pairs(elapsed_s[thin], thin_early_s, simulated=simulated)
    if group is None:
        return None
    line_s = np.interp(elapsed_s, elapsed_s[thin][group], thin_early_s[group])
    return np.asarray(np.abs(early_s - line_s) <= STEP_S)


def _consistent_groups(elapsed_s: list[float], early_s: list[float]) -> list[list[int]]:
    """Pairs that one clock may have given, as indices in order of time."""
    groups: list[list[int]] = []
    for i, (t_s, offset_s) in enumerate(zip(elapsed_s, early_s, strict=True)):
        for group in groups:
            last = group[-1]
            if abs(offset_s - early_s[last]) <= STEP_S + DRIFT_MOST * (t_s - elapsed_s[last]):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def _group_after_leap(
    groups: list[list[int]], early_s: FloatArray, utc_ns: IntArray
) -> list[int] | None:
    """None unless it differs from those before by leap seconds received late only."""
    last = max(groups, key=lambda group: group[-1])
    begin = last[0]
    near = [group for group in groups if abs(early_s[group[-1]] - early_s[begin]) <= LEAP_S]
    is_most = sum(map(len, near)) >= AGREE_SHARE * len(early_s)
    is_long = len(last) * 3 >= len(early_s)
    is_after = all(group[-1] <= begin for group in near if group is not last)
    if is_most and is_long and is_after and not _is_midnight(int(utc_ns[begin])):
        return last
    return None


def _prompt_pairs(
    elapsed_s: FloatArray, early_s: FloatArray, *, simulated: bool
) -> list[int] | None:
    """The promptest pair of each part of a run, if they agree and the others only came late.

    The parts are so short that any lasting step fills one.
    """
    if len(early_s) < _BINS * _IN_BIN:
        return None
    parts = np.array_split(np.arange(len(early_s)), _BINS)
    promptest = np.array([part[np.argmax(early_s[part])] for part in parts])
    drift_s = DRIFT_MOST * float(elapsed_s[-1] - elapsed_s[0])
    late_s = np.max(early_s) - early_s
    prompt = promptest[late_s[promptest] <= STEP_S + drift_s]
    least = _PROMPT_SIMULATED if simulated else 1.0
    is_late = late_s <= (_LATE_SIMULATED_S if simulated else _LATE_S) + drift_s
    if len(prompt) < least * _BINS or np.mean(is_late) < AGREE_SHARE:
        return None
    return [int(one) for one in prompt]


def _is_midnight(utc_ns: int) -> bool:
    """Whether a leap second may really have happened: then no group is right all the time."""
    seconds = utc_ns / 1e9 % _DAY_S
    return min(seconds, _DAY_S - seconds) < _MIDNIGHT_S


def _line(elapsed_s: FloatArray, early_s: FloatArray) -> tuple[float, FloatArray]:
    """Drift, 0 for a short run, and what it leaves in seconds."""
    is_long = elapsed_s[-1] - elapsed_s[0] > DRIFT_SPAN_S
    drift = _drift(elapsed_s, early_s) if is_long else 0.0
    return drift, early_s - drift * elapsed_s


def _drift(elapsed_s: FloatArray, early_s: FloatArray) -> float:
    """Median slope over pairs of bins, each by its promptest sentences (Theil 1950, Sen 1968)."""
    edges = np.linspace(elapsed_s[0], elapsed_s[-1], _BINS + 1)[1:-1]
    bins = np.searchsorted(edges, elapsed_s)
    members = [bins == number for number in np.unique(bins)]
    x = np.array([elapsed_s[member].mean() for member in members])
    y = np.array([np.percentile(early_s[member], _PROMPT) for member in members])
    i, j = np.triu_indices(len(x), 1)
    return float(np.median((y[j] - y[i]) / (x[j] - x[i])))
