"""A row of any third-party format: one cell received at one position."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from logger.core.errors import GeoError
from logger.core.types import CellReading, Fix

Fields = TypeVar("Fields")


@dataclass(frozen=True, slots=True)
class Sighting:
    """One cell received at one position.

    `line` is the number of the line, row or record. `t_ns` gives the order in time; `fix.utc_ns` is
    None where the file has no UTC, and `fix.valid` is False where it has no position.
    """

    line: int
    t_ns: int
    fix: Fix
    reading: CellReading

    @property
    def lat_deg(self) -> float:
        return _number_of(self.fix.lat_deg)

    @property
    def lon_deg(self) -> float:
        return _number_of(self.fix.lon_deg)

    @property
    def rssi_dbm(self) -> float:
        """Level, whatever the technology calls it."""
        return _number_of(self.reading.level_dbm)


@dataclass(frozen=True, slots=True)
class BadRow:
    """A row that could not be used, and why."""

    line: int
    why: str


@dataclass(frozen=True, slots=True)
class NoCell:
    """A row about something else: Wi-Fi, Bluetooth, a technology without a 3GPP cell identity."""

    line: int
    why: str = "no cell"


@dataclass(frozen=True, slots=True)
class Remark:
    """What another program noticed at a time, for example a warning; it has no level."""

    line: int
    utc_ns: int
    text: str


Row = Sighting | BadRow | NoCell | Remark
Parsed = Row | Sequence[Row] | None


def parse_rows(
    rows: Iterable[tuple[int, Fields]], parse: Callable[[int, Fields], Parsed]
) -> Iterator[Row]:
    """Parsed rows with line numbers; `parse` returns None for no cell, raises for bad rows."""
    for line, fields in rows:
        try:
            parsed = parse(line, fields)
        except (ValueError, GeoError) as error:
            yield BadRow(line, str(error))
        except RecursionError:
            yield BadRow(line, "its values are nested too deeply")
        else:
            yield from parsed if isinstance(parsed, Sequence) else [parsed or NoCell(line)]


def _number_of(value: float | None) -> float:
    if value is None:
        raise TypeError("a sighting has a position and a level")
    return value
