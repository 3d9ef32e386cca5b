"""The numbers that a modem has printed so far, by column, and how often each came."""

from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeGuard, TypeVar

from logger.core.types import Broadcast, CellReading
from logger.drivers.reading.cell_history import CellHistory
from logger.drivers.reading.number_text import NumberForm, NumberText
from logger.drivers.reading.rows import Registration, Row

Key = TypeVar("Key", bound=Hashable)

MOST_TEXTS = 2000
"""Numbers remembered of a column; beyond it the oldest half is dropped."""

AREA = frozenset({"lac", "tac"})
IDENTITY = ("lac", "tac", "cid")
PADDED_VALUES: Mapping[str, tuple[str, ...]] = {
    "arfcn_raw": ("arfcn_raw", "arfcn"),
    "rxlev_raw": ("rxlev_raw", "rssi_dbm"),
    "bsic": ("bsic",),
}
"""Values that some firmware pads, and the attributes that are derived from each."""

Column = tuple[bool, str, NumberForm]
"""Numbers that are printed alike: in a scan of all networks or not, name, form."""
Texts = Mapping[str, int]
"""How often each number came, as printed."""
Network = tuple[str, str]
CellBroadcast = tuple[int | None, str | None, Broadcast]
"""Channel and name of a cell, and what it broadcasts."""
Code = tuple[bool, int]
"""An area (True) or a cell, in whatever base it was printed."""


@dataclass(frozen=True, slots=True)
class NumberHistory:
    """What the replies of a modem have shown so far."""

    columns: Mapping[Column, Texts] = field(default_factory=dict)
    networks: Mapping[Network, int] = field(default_factory=dict)
    codes: Mapping[Code, int] = field(default_factory=dict)
    broadcasts: Mapping[CellBroadcast, int] = field(default_factory=dict)
    cells: CellHistory = field(default_factory=CellHistory)

    @classmethod
    def of_reply(cls, rows: Sequence[Row]) -> "NumberHistory":
        """What one reply shows; a number that a driver has copied to another row counts once."""
        columns: dict[Column, Counter[str]] = {}
        networks: Counter[Network] = Counter()
        codes: Counter[Code] = Counter()
        counted: set[int] = set()
        for row in rows:
            for name, number in numbers(row):
                if id(number) not in counted:
                    columns.setdefault(column_of(row, name, number), Counter())[number.text] += 1
                    codes[name in AREA, int(number)] += name in IDENTITY
                counted.add(id(number))
            networks.update(filter(None, [network_of(row)]))
        broadcasts = Counter(filter(None, map(broadcast_of, rows)))
        return cls(columns, networks, codes, broadcasts)

    def texts(self, column: Column) -> Texts:
        """Numbers of a column."""
        return self.columns.get(column, {})

    def with_reply(self, reply: "NumberHistory") -> "NumberHistory":
        """The history with one more reply."""
        return NumberHistory(
            {
                **self.columns,
                **{
                    column: _add(self.texts(column), texts)
                    for column, texts in reply.columns.items()
                },
            },
            _add(self.networks, reply.networks),
            _add(self.codes, reply.codes),
            _add(self.broadcasts, reply.broadcasts),
            self.cells,
        )


def _add(counts: Mapping[Key, int], more: Mapping[Key, int]) -> Mapping[Key, int]:
    total = {**counts, **{key: counts.get(key, 0) + count for key, count in more.items()}}
    return total if len(total) <= MOST_TEXTS else dict(list(total.items())[len(total) // 2 :])


def has_identity(row: Row) -> TypeGuard[CellReading | Registration]:
    """True for rows of a kind that can name a cell."""
    return isinstance(row, CellReading | Registration)


def numbers(row: Row) -> Iterator[tuple[str, NumberText]]:
    """The numbers of a row that still have their text, by attribute."""
    if has_identity(row):
        for name in (*IDENTITY, *PADDED_VALUES):
            number = getattr(row, name, None)
            if isinstance(number, NumberText):
                yield name, number


def column_of(row: Row, name: str, number: NumberText) -> Column:
    """The column of a number."""
    return getattr(row, "role", None) == "scan", name, number.form


def broadcast_of(row: Row) -> CellBroadcast | None:
    """What a reading contains of its cell's broadcast, None where nothing is printed."""
    if isinstance(row, CellReading) and row.broadcast is not None:
        return row.arfcn, row.cell, row.broadcast
    return None


def network_of(row: Row) -> Network | None:
    """Country and network code of a reading, None where it names none."""
    if isinstance(row, CellReading) and row.mcc is not None and row.mnc is not None:
        return row.mcc, row.mnc
    return None
