"""What networks did in signalling, as listed evidence: it gives no cell a word.

An import writes a note for each signal. They are listed with their places and how often the same
operator did the same in these runs.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np

from logger.core.document import Column, Degrees, Document, Part, Table
from logger.core.errors import EstimationError, GeoError
from logger.core.places import track_of
from logger.core.runfile import Run
from logger.core.timebase import utc_clock
from logger.core.types import Note, known_utc_text

CODE = "signalling"
"""Of the notes."""
UNKNOWN = "unknown"
_NOTE = re.compile(
    r"(?P<kind>[\w ]+): (?P<value>[^;]+); cell (?P<cell>[\w-]+); operator (?P<operator>[\w-]+)",
    re.ASCII,
)
_NONE = "no signalling was recorded: only captures of a modem's diagnostic stream have some"
_NO_WORD = (
    "Networks do most of this every day: a line is no accusation and gives a cell no word. Compare "
    "it with what its operator does otherwise."
)


class Signal(NamedTuple):
    """What a cell of an operator did once: of a `kind`, such as "cipher", the `value`.

    `cell` is named by channel and code, `operator` by MCC and MNC; both may be `UNKNOWN`.
    """

    time_ns: int
    kind: str
    value: str
    cell: str
    operator: str

    @property
    def text(self) -> str:
        """As its note has it."""
        return f"{self.kind}: {self.value}; cell {self.cell}; operator {self.operator}"


@dataclass(frozen=True, slots=True)
class Listed:
    """A signal in a run, with UTC and place where known.

    Of the `n` of its kind by its operator in all these runs `n_same` have the same value.
    """

    run: str
    t_s: float
    utc: str | None
    kind: str
    value: str
    cell: str
    operator: str
    lat_deg: float | None
    lon_deg: float | None
    n_same: int
    n: int


def signals_of(runs: Sequence[Run]) -> list[Listed]:
    """All signals of runs in the order of their times."""
    found = [(run, list(_signals_in(run))) for run in runs]
    signals = [signal for _, of_run in found for signal in of_run]
    kinds = Counter((one.operator, one.kind) for one in signals)
    same = Counter((one.operator, one.kind, one.value) for one in signals)
    listed = []
    for run, of_run in found:
        utc_ns = utc_clock(run.meta.origin, run.tables["fixes"])
        for signal, place in zip(of_run, _places(run, of_run), strict=True):
            listed.append(
                Listed(
                    run.name,
                    round((signal.time_ns - run.meta.started_ns) / 1e9, 3),
                    known_utc_text(utc_ns(signal.time_ns)),
                    signal.kind,
                    signal.value,
                    signal.cell,
                    signal.operator,
                    *place,
                    same[signal.operator, signal.kind, signal.value],
                    kinds[signal.operator, signal.kind],
                )
            )
    return listed


def _signals_in(run: Run) -> Iterator[Signal]:
    for _, record in run.records("notes"):
        note = record.value
        if isinstance(note, Note) and note.code == CODE and (parts := _NOTE.fullmatch(note.text)):
            yield Signal(record.t_ns, **parts.groupdict())


def _places(run: Run, signals: Sequence[Signal]) -> list[tuple[float | None, float | None]]:
    try:
        track = track_of(run.tables["fixes"])
    except (EstimationError, GeoError):
        return [(None, None)] * len(signals)
    t_ns = np.array([one.time_ns for one in signals], np.int64)
    is_known = track.covers(t_ns)
    degrees = np.where(is_known, track.at(t_ns).lat_lon_deg.round(6), np.nan)
    return [(None, None) if np.isnan(lat) else (lat, lon) for lat, lon in degrees.T.tolist()]


def document_of(listed: Sequence[Listed]) -> Document:
    """The signals as a table, equal ones of a cell in one row, and each of them in JSON."""
    body: list[Part] = [signals_table(listed), _NO_WORD] if listed else [_NONE]
    return Document({"signalling": [asdict(one) for one in listed]}, body=body)


def signals_table(listed: Sequence[Listed]) -> Table:
    """A row for each cell, kind and value: how often, when and where first, what is ordinary."""
    rows: dict[tuple[str, ...], list[Listed]] = {}
    for one in listed:
        rows.setdefault((one.run, one.cell, one.operator, one.kind, one.value), []).append(one)
    columns = [
        Column("cell"),
        Column("operator"),
        Column("signal"),
        Column("times", "d"),
        Column("first at"),
        Column("place"),
        Column("same of its operator", is_right=True),
    ]
    return Table(
        columns,
        [
            (
                first.cell,
                first.operator,
                f"{first.kind}: {first.value}",
                len(all_),
                first.utc or f"{first.t_s:.0f} s",
                _place(first),
                f"{first.n_same} of {first.n}",
            )
            for first, all_ in ((ones[0], ones) for ones in rows.values())
        ],
        "Signalling",
        scrolls=True,
    )


def _place(one: Listed) -> Degrees | None:
    if one.lat_deg is None or one.lon_deg is None:
        return None
    return Degrees(one.lat_deg, one.lon_deg)
