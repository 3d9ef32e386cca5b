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
_AGAIN = 2
"""The second naming makes a cell known, so that it counts only if it comes in the next reply: one
damage may come twice before the true name comes once, but hardly at once.
"""
_MOST_CELLS = 2000
"""Cells remembered; beyond it those named longest ago are dropped."""
_MOST_PLACES = 8
"""Channels and codes remembered of a cell: its carriers, and damaged ones."""
_USUAL = 4
"""A place is one of a cell where one of so many replies names it there, or `OFTEN` in all."""
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
    """How a reply names a cell: network code, area and cell as printed, where, and whether sure."""

    texts: tuple[str, str, str]
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

    `digits` are those of name and usual place, sorted, and `widths` those of the numbers: where two
    characters of a row are exchanged and one is the comma, a digit moves from one to the next.
    """

    texts: tuple[str, str, str]
    n_by_place: Mapping[Place, int] = field(default_factory=dict)
    digits: str = ""
    widths: tuple[int, ...] = ()
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
        digits, widths = self.digits, self.widths
        if is_usual:
            digits, widths = _digits(who, naming), _widths(naming)
        n = self.n + 1
        return _NamedCell(naming.texts, n_by_place, digits, widths, n, self.n_sure, latest)

    def is_repeated(self, run: int) -> bool:
        """True where so many replies in succession name the cell that it is no damage.

        Of a name that was doubtful after its first pair, no further pair proves it, as one damage
        may come twice at once again. Three do.
        """
        is_first_pair = self.n_sure == 0 or self.n - run <= self.n_sure
        return run > _AGAIN or (run == _AGAIN and is_first_pair)

    def places(self) -> list[Place]:
        """Where the cell is usually named: not where damage or a change of the cell put it once."""
        often = min(OFTEN, self.n / _USUAL)
        return [place for place, n in self.n_by_place.items() if n >= often]


@dataclass(frozen=True, slots=True)
class CellHistory:
    """Cells by name, the one named last at the end, and how many replies have named any.

    `runs` are the names in the last full scan (True) and in the last poll (False), and how many
    scans or polls in succession have named each.
    """

    cells: Mapping[Who, _NamedCell] = field(default_factory=dict)
    n_replies: int = 0
    runs: Mapping[bool, Mapping[Who, int]] = field(default_factory=dict)

    def with_reply(
        self, namings: Namings, *, is_scan: bool = False, is_alone: bool = True
    ) -> tuple["CellHistory", frozenset[Who]]:
        """The history with one more reply, and the doubtful names of that.

        With `is_alone` no later reply is there to compare it with, as in a session.
        """
        if not namings:
            return self, frozenset()
        cells, latest = {**self.cells}, self.n_replies + 1
        for who, naming in namings.items():
            cell = cells.pop(who, None) or _NamedCell(naming.texts)
            cells[who] = cell.named_again(who, naming, latest)
        before = self.runs.get(is_scan, {})
        runs = {who: before.get(who, 0) + 1 for who in namings}
        after = CellHistory(cells, latest, {**self.runs, is_scan: runs})
        repeated = {who for who, run in runs.items() if cells[who].is_repeated(run)}
        doubtful = after.doubtful(namings, repeated) | {
            who
            for who, n in runs.items()
            if is_alone and n == 1 and cells[who].n == _AGAIN and cells[who].n_sure == 1
        }
        for who, naming in namings.items():
            if naming.is_sure and who not in doubtful:
                cells[who] = replace(cells[who], n_sure=cells[who].n_sure + 1)
        for who in list(cells)[: max(0, len(cells) - _MOST_CELLS)]:
            del cells[who]
        return after, doubtful

    def doubtful(self, namings: Namings, repeated: Collection[Who]) -> frozenset[Who]:
        """Names of a reply of this history that may be damage.

        `repeated` are those that replies in succession have. A name that two replies have for
        certain stays sure: it names a cell by then (`core.identities`).
        """
        return frozenset(
            who
            for who, naming in namings.items()
            if who not in repeated
            and self.cells[who].n_sure < FEWEST_SCANS
            and self._is_doubtful(who, naming)
        )

    def _is_doubtful(self, who: Who, naming: Naming) -> bool:
        n, digits, widths = self.cells[who].n, _digits(who, naming), _widths(naming)
        for other, cell in reversed([*self.cells.items()]):
            if n >= max(OFTEN, cell.n):
                continue
            # a comma exchanged with a digit makes one number longer and the next one shorter
            is_moved = who != other and digits == cell.digits and widths != cell.widths
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
        texts = (_network_code(row), _text(_area(row)), _text(row.cid))
        namings[who] = Naming(texts, place, is_sure)
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
    return number.text if isinstance(number, NumberText) else f"{number or ''}"


def _network_code(row: CellReading | Registration) -> str:
    """As printed; u-blox prints a single digit where no other line completes it."""
    if isinstance(row, Registration):
        return ""
    return row.mnc or f"{row.more.get('mnc_raw', '')}"


def _widths(naming: Naming) -> tuple[int, ...]:
    return tuple(len(text.lstrip("0")) for text in (*naming.texts, f"{naming.place.arfcn or ''}"))


def _digits(who: Who, naming: Naming) -> str:
    parts = (who.mcc, *naming.texts, naming.place.arfcn, naming.place.code)
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
    if is_late and is_moved:
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
    pair = naming.texts[-1], cell.texts[-1]
    pairs = {pair, (pair[0].lstrip("0"), pair[1].lstrip("0"))}  # one may be padded, the other not
    n_changed = {_n_changed(*texts) for texts in pairs} - {None}
    if is_sector and 1 in n_changed:
        return _Likeness.SECTOR
    is_damage = (is_same and n_changed) or any(_is_slip(*texts) for texts in pairs)
    return _Likeness.DAMAGE if is_damage else _Likeness.NONE


def _n_changed(text: str, other: str) -> int | None:
    return sum(map(str.__ne__, text, other)) if len(text) == len(other) else None


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
