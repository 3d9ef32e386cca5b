"""The cells that a modem has named, and which new name may be a known one that was damaged.

A changed or exchanged digit leaves a row in its form. But damage hits one place of a row: the rest
of the name, the channel and the code on it (BSIC, PSC, PCI) are still those of a cell that the
modem has named before. Sectors of one mast, whose names differ in one digit, differ in channel or
code, so that their names are no damage. A name that may be damage is doubtful until successive
replies repeat it, or until it came as often as the other.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import NamedTuple

from logger.core.identities import FEWEST_SCANS
from logger.core.types import CellReading
from logger.drivers.reading.number_text import NumberText
from logger.drivers.reading.rows import Registration, Row

OFTEN = 5
"""A name or number that looks like a damaged one is accepted when it came so often, and often
enough beside the other: even a line that damages every fourth reply seldom hits the same digit.
"""
_MOST_CELLS = 2000
"""Cells remembered; beyond it those named longest ago are dropped."""
_MOST_PLACES = 8
"""Channels and codes remembered of a cell: its carriers, and damaged ones."""
_USUAL = 4
"""A place is one of a cell where one of so many replies names it there."""
_OF_LATE = 300
"""Replies, some minutes, for which a channel with its code is that of one cell. Other masts use
them again.
"""


class Who(NamedTuple):
    """Network, area and cell of a row."""

    mcc: str | None
    mnc: str | None
    area: int | None
    cid: int | None


class Place(NamedTuple):
    """Technology and channel of a cell, and its code on the channel; None where not printed."""

    rat: str | None
    arfcn: int | None
    code: int | None


class Naming(NamedTuple):
    """How a reply names a cell: area and cell as printed, where, and without another doubt."""

    texts: tuple[str, str]
    place: Place
    is_sure: bool


Namings = Mapping[Who, Naming]
_NOBODY = Who(None, None, None, None)


class _Likeness(Enum):
    """What a name may be beside another one: its damaged form, or another sector as well."""

    NONE = 0
    SECTOR = 1
    DAMAGE = 2


@dataclass(frozen=True, slots=True)
class _NamedCell:
    """What the replies so far show of a cell; `latest` is the number of the last one.

    `digits` are those of name and usual place, sorted: where two characters of a row are exchanged
    and one is the comma, a digit moves from one number to the next.
    """

    texts: tuple[str, str]
    n_by_place: Mapping[Place, int] = field(default_factory=dict)
    digits: str = ""
    n: int = 0
    n_sure: int = 0
    latest: int = 0

    def named_again(self, who: Who, naming: Naming, latest: int) -> "_NamedCell":
        """The cell after one more reply."""
        n_by_place = {**self.n_by_place}
        n_here = n_by_place[naming.place] = n_by_place.pop(naming.place, 0) + 1
        if len(n_by_place) > _MOST_PLACES:
            del n_by_place[min(n_by_place, key=n_by_place.__getitem__)]
        is_usual = n_here >= max(n_by_place.values())
        digits = _digits(who, naming) if is_usual else self.digits
        return _NamedCell(naming.texts, n_by_place, digits, self.n + 1, self.n_sure, latest)

    def places(self) -> list[Place]:
        """Where the cell is usually named: not where damage or a change of the cell put it once."""
        return [place for place, n in self.n_by_place.items() if n * _USUAL >= self.n]


@dataclass(frozen=True, slots=True)
class CellHistory:
    """Cells by name, the one named last at the end, and how many replies have named any.

    `before` are the names in the last full scan (True) and in the last poll (False).
    """

    cells: Mapping[Who, _NamedCell] = field(default_factory=dict)
    n_replies: int = 0
    before: Mapping[bool, frozenset[Who]] = field(default_factory=dict)

    def with_reply(
        self, namings: Namings, *, is_scan: bool = False
    ) -> tuple["CellHistory", frozenset[Who]]:
        """The history with one more reply, and the doubtful names of that."""
        if not namings:
            return self, frozenset()
        cells, latest = {**self.cells}, self.n_replies + 1
        for who, naming in namings.items():
            cell = cells.pop(who, None) or _NamedCell(naming.texts)
            cells[who] = cell.named_again(who, naming, latest)
        after = CellHistory(cells, latest, {**self.before, is_scan: frozenset(namings)})
        doubtful = after.doubtful(namings, self.before.get(is_scan, frozenset()))
        for who, naming in namings.items():
            if naming.is_sure and who not in doubtful:
                cells[who] = replace(cells[who], n_sure=cells[who].n_sure + 1)
        for who in list(cells)[: max(0, len(cells) - _MOST_CELLS)]:
            del cells[who]
        return after, doubtful

    def doubtful(self, namings: Namings, successive: Collection[Who]) -> frozenset[Who]:
        """Names of a reply of this history that may be damage.

        `successive` are those that the reply before or after it has too. A name that two replies
        have for certain stays sure: it names a cell by then (`core.identities`).
        """
        return frozenset(
            who
            for who, naming in namings.items()
            if who not in successive
            and self.cells[who].n_sure < FEWEST_SCANS
            and self._is_doubtful(who, naming)
        )

    def _is_doubtful(self, who: Who, naming: Naming) -> bool:
        n, digits = self.cells[who].n, _digits(who, naming)
        for other, cell in reversed([*self.cells.items()]):
            if n >= max(OFTEN, cell.n):
                continue
            # a comma exchanged with a digit makes one number longer and the next one shorter
            is_moved = digits == cell.digits and _widths(who, naming) != _widths(other, cell)
            if not is_moved and other.cid != who.cid and other.area != who.area:
                continue
            is_late = self.n_replies - cell.latest < _OF_LATE
            likeness = _likeness(who, naming, other, cell, is_late=is_late, is_moved=is_moved)
            # one that may be a sector need not wait, but comes again at once or is not believed
            if likeness is _Likeness.DAMAGE or (likeness is _Likeness.SECTOR and n > 1):
                return True
        return False


def namings_of(pairs: Iterable[tuple[Row, Row]]) -> Namings:
    """How the rows of a reply name cells; a row comes as it was read, and as it was marked."""
    namings: dict[Who, Naming] = {}
    for row, marked in pairs:
        who = who_of(row)
        if who is None or not isinstance(row, CellReading | Registration):
            continue
        unsure = getattr(marked, "identity_unsure", False)
        place = Place(row.rat, None, None)
        if isinstance(row, CellReading):
            codes = (code for code in (row.bsic, row.psc, row.pci) if code is not None)
            place = Place(row.rat, row.arfcn, next(codes, None))
        is_sure = not unsure and (who not in namings or namings[who].is_sure)
        namings[who] = Naming((_text(_area(row)), _text(row.cid)), place, is_sure)
    return namings


def who_of(row: Row) -> Who | None:
    """What a row names of a cell; None where it names nothing."""
    if not isinstance(row, CellReading | Registration):
        return None
    network = (row.mcc, row.mnc) if isinstance(row, CellReading) else (None, None)
    area, cid = (None if code is None else int(code) for code in (_area(row), row.cid))
    who = Who(*network, area, cid)
    return None if who == _NOBODY else who


def _area(row: CellReading | Registration) -> int | None:
    return row.tac if row.lac is None else row.lac


def _text(number: int | None) -> str:
    text = number.text if isinstance(number, NumberText) else f"{number or ''}"
    return text.lstrip("0")


def _widths(who: Who, named: Naming | _NamedCell) -> list[int]:
    return [len(text) for text in (who.mnc or "", *named.texts)]


def _digits(who: Who, naming: Naming) -> str:
    parts = (who.mcc, who.mnc, *naming.texts, naming.place.arfcn, naming.place.code)
    digits = "".join(str(part) for part in parts if part is not None)
    return "".join(sorted(digits.replace("0", "")))  # one that leads a number is not kept


def _likeness(
    who: Who, naming: Naming, other: Who, cell: _NamedCell, *, is_late: bool, is_moved: bool
) -> _Likeness:
    changed = {
        name
        for name, a, b in zip(Who._fields, who, other, strict=True)
        if a != b and None not in {a, b}
    }
    if is_late and is_moved and changed:
        return _Likeness.DAMAGE
    here, places = naming.place, cell.places()
    shared = [place for place in places if not _differ(place, here)]
    if not shared or (len(changed) > 1 and "cid" in changed):
        return _Likeness.NONE
    is_same = is_late and here in places and None not in here
    if None in {who.cid, other.cid}:
        return _Likeness.DAMAGE if is_same and changed else _Likeness.NONE
    if "cid" not in changed:
        # a network code that was not read before may be a complete one
        gains_network = None not in {who.mnc, who.mcc} and other.mnc is None
        is_sector = gains_network and who.mcc == other.mcc
        return _Likeness.DAMAGE if changed else _Likeness.SECTOR if is_sector else _Likeness.NONE
    is_sector = not any(_tells_sectors(place, here) for place in shared)
    return _likeness_of_cid(naming.texts[1], cell.texts[1], is_sector=is_sector, is_same=is_same)


def _likeness_of_cid(text: str, known: str, *, is_sector: bool, is_same: bool) -> _Likeness:
    """Of a cell that differs in its identity alone; `is_same` for one channel and one code."""
    n_changed = sum(map(str.__ne__, text, known)) if len(text) == len(known) else None
    if n_changed == 1 and is_sector:
        return _Likeness.SECTOR
    is_damage = (is_same and n_changed is not None) or _is_slip(text, known)
    return _Likeness.DAMAGE if is_damage else _Likeness.NONE


def _differ(first: Place, second: Place) -> bool:
    return any(
        a != b and a is not None and b is not None for a, b in zip(first, second, strict=True)
    )


def _tells_sectors(first: Place, second: Place) -> bool:
    """True for places that no two sectors of a mast share: GSM has a channel for each."""
    has_channel = None not in {first.arfcn, second.arfcn}
    return has_channel and (first.rat == "GSM" or None not in {first.code, second.code})


def _is_slip(text: str, other: str) -> bool:
    """True where one digit is changed, lost, added or exchanged with the next, or an end is cut."""
    short, long = sorted((text, other), key=len)
    begin = next(
        (i for i, (a, b) in enumerate(zip(short, long, strict=False)) if a != b), len(short)
    )
    if begin == len(short):
        return True
    rest, known = short[begin:], long[begin:]
    if len(short) < len(long):
        return known[1:] == rest
    return rest[1:] == known[1:] or (rest[:2] == known[1::-1] and rest[2:] == known[2:])
