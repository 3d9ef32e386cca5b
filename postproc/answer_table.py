"""Answers as one table, a row a cell: what is exported, and the frame of the Python interface."""

from collections.abc import Iterable, Iterator, Sequence
from math import isfinite
from typing import TYPE_CHECKING

from logger.core.answer import Answer, PathEnd
from logger.core.certainty import share_text
from logger.core.document import Column, Table, Value
from logger.core.errors import ConfigError
from logger.core.suspicion.words import strongest_reasons
from logger.core.utc import utc_text

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = (
    "cell",
    "word",
    "verdict",
    "latitude_deg",
    "longitude_deg",
    "r50_m",
    "r95_m",
    "n_places",
    "other_places",
    "n_readings",
    "runs",
    "first_utc",
    "last_utc",
    "word_reasons",
    "verdict_reasons",
)
"""Position: that of the cell, WGS 84. `r50_m` and `r95_m` about it hold 50 % and 95 % of the
probability, also of `other_places`: latitude, longitude and share of each."""
_BESIDE = ("ekf", "rts", "batch")
"""Other estimators by their key; the ellipse of the reference EKF is wrong."""
_WIDEST_M = 50_000.0
"""GSM reaches 35 km: a wider ellipse contains no information."""


def answer_table(answers: Iterable[Answer], *, every: bool = False) -> Table:
    """One row for each answer; None is what is not known.

    `every` adds the positions of the other estimators.
    """
    beside = _BESIDE if every else ()
    more = (f"{key}_{angle}" for key in beside for angle in ("latitude_deg", "longitude_deg"))
    columns = tuple(map(Column, (*COLUMNS, *more)))
    return Table(columns, [tuple(_values(answer, beside)) for answer in answers])


def frame_of(table: Table) -> "pd.DataFrame":
    """The table as a frame of pandas, times as such; raises `ConfigError` without pandas."""
    try:
        import pandas as pd  # noqa: PLC0415 (optional, and takes a second)
    except ImportError:
        raise ConfigError(
            "a frame needs pandas, which is not installed: pip install pandas"
        ) from None
    frame = pd.DataFrame(list(table.rows), columns=[column.title for column in table.columns])
    times = {name: pd.to_datetime(frame[name], utc=True) for name in ("first_utc", "last_utc")}
    return frame.assign(**times)


def _values(answer: Answer, beside: Sequence[str]) -> Iterator[Value]:
    word, made_from = answer.word, answer.provenance
    yield from (answer.cell, word.word if word else None, answer.verdict)
    yield from _place(answer)
    yield from (made_from.n, "; ".join(made_from.runs))
    for utc_ns in (made_from.first_utc_ns, made_from.last_utc_ns):
        yield None if utc_ns is None else utc_text(utc_ns)
    yield "; ".join(strongest_reasons(word)) if word else None
    yield "; ".join(answer.reasons)
    for key in beside:
        end = answer.paths.ends.get(key) if answer.paths else None
        shown = end.in_short() if end is not None and _is_bounded(end) else None
        yield from (None, None) if shown is None else (shown.lat, shown.lon)


def _place(answer: Answer) -> tuple[Value, ...]:
    if answer.place is None:
        return None, None, None, None, 0, None
    place = answer.place.in_short()
    others = (f"{share_text(one.probability)}: {one.lat} {one.lon}" for one in place.modes[1:])
    radii_m = place.r50_m, place.r95_m
    return place.lat, place.lon, *radii_m, len(place.modes), "; ".join(others) or None


def _is_bounded(end: PathEnd) -> bool:
    """Whether an estimator has a position to show."""
    major_m = end.ellipse95.semi_major_m
    return isfinite(end.lat) and end.is_bounded and major_m <= _WIDEST_M
