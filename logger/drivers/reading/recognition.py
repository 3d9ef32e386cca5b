"""Which identities are sure, by comparison with the other numbers of the reply and of the modem.

A firmware pads its numbers with zeros or does not. Where it pads, a number of another width has
lost or doubled a digit; where it does not, no single number shows that. Three things make a number
doubtful:

- it is shorter than all its digits, and neither a similar number of the reply nor another reply
  shows that this firmware prints numbers so short;
- it is shorter, and this firmware pads;
- it is what a more frequent number of the same column becomes when a digit is lost or doubled.

A number that is printed twice is sure. An identity with a doubtful number keeps its value and is
marked; such a level or channel is useless and is dropped. `CellHistory` compares whole names with
those before. What a cell broadcasts is marked until the same is printed of it twice, and half as
often as anything else.
"""

from collections import Counter
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, NamedTuple, TypeGuard, TypeVar

from logger.core.cell_names import FEWEST_SCANS, Identity, mnc_digits
from logger.core.types import Broadcast, CellReading
from logger.drivers.reading.row_language import NumberForm, NumberText, Registration, Row
from logger.drivers.reading.standard_replies import is_serving

# A changed or exchanged digit leaves a row in its form. But damage hits one place of a row: the
# rest of the name, the channel and the code on it (BSIC, PSC, PCI) are still those of a cell that
# the modem has named before. Sectors of one mast, whose names differ in one digit, differ in
# channel or code, so that their names are no damage. A name that may be damage is doubtful until
# successive replies repeat it, or until it came as often as the other.

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
_MOST_PLACES = 8  # channels and codes remembered of a cell: its carriers, and damaged ones
_USUAL = 4
"""A place is one of a cell where one of so many replies names it there, or `OFTEN` in all."""
_OF_LATE = 300
"""Replies, some minutes, for which a channel with its code is that of one cell: other masts use
them again.
"""


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


Namings = Mapping[Identity, Naming]
_NOBODY = Identity()


class _Likeness(Enum):
    NONE = 0
    SECTOR = 1
    DAMAGE = 2


@dataclass(frozen=True, slots=True)
class _NamedCell:
    """What the replies so far show of a cell; `latest` is the number of the last one.

    `digits` are those of name and usual place, sorted, and `widths` those of the numbers: where a
    comma is exchanged with a digit, that moves to the next number.
    """

    texts: tuple[str, str, str]
    n_by_place: Mapping[Place, int] = field(default_factory=dict)
    digits: str = ""
    widths: tuple[int, ...] = ()
    n: int = 0
    n_sure: int = 0
    latest: int = 0

    def named_again(self, who: Identity, naming: Naming, latest: int) -> "_NamedCell":
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

        A name that was doubtful after its first pair needs three in succession: one damage may come
        twice at once again.
        """
        is_first_pair = self.n_sure == 0 or self.n - run <= self.n_sure
        return run > _AGAIN or (run == _AGAIN and is_first_pair)

    def places(self) -> list[Place]:
        """Where the cell is usually named, without places where damage put it."""
        often = min(OFTEN, self.n / _USUAL)
        return [place for place, n in self.n_by_place.items() if n >= often]


@dataclass(frozen=True, slots=True)
class CellHistory:
    """Cells by name, the one named last at the end, and how many replies have named any.

    `runs` are the names in the last full scan (True) and in the last poll (False), and how many in
    succession have named each.
    """

    cells: Mapping[Identity, _NamedCell] = field(default_factory=dict)
    n_replies: int = 0
    runs: Mapping[bool, Mapping[Identity, int]] = field(default_factory=dict)

    def with_reply(
        self, namings: Namings, *, is_scan: bool = False, is_alone: bool = True
    ) -> tuple["CellHistory", frozenset[Identity]]:
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

    def doubtful(self, namings: Namings, repeated: Collection[Identity]) -> frozenset[Identity]:
        """Names of a reply of this history that may be damage.

        `repeated` are those that replies in succession have. A name that two replies have for
        certain stays sure: it names a cell by then (`core.cell_names`).
        """
        return frozenset(
            who
            for who, naming in namings.items()
            if who not in repeated
            and self.cells[who].n_sure < FEWEST_SCANS
            and self._is_doubtful(who, naming)
        )

    def _is_doubtful(self, who: Identity, naming: Naming) -> bool:
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
    """How the rows of a reply name cells; each as read, and as marked."""
    namings: dict[Identity, Naming] = {}
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


def who_of(row: Row) -> Identity | None:
    """What a row names of a cell; None where it names nothing."""
    if not isinstance(row, CellReading | Registration):
        return None
    network = (row.mcc, row.mnc) if isinstance(row, CellReading) else (None, None)
    area, cid = (None if code is None else int(code) for code in (_area(row), row.cid))
    who = Identity(*network, area, cid)
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


def _digits(who: Identity, naming: Naming) -> str:
    parts = (who.mcc, *naming.texts, naming.place.arfcn, naming.place.code)
    digits = "".join(str(part) for part in parts if part is not None)
    return "".join(sorted(digits.replace("0", "")))  # one that leads a number is not kept


def _likeness(
    who: Identity,
    naming: Naming,
    other: Identity,
    cell: _NamedCell,
    *,
    is_late: bool,
    is_moved: bool,
) -> _Likeness:
    changed = {
        name
        for name, a, b in zip(Identity._fields, who, other, strict=True)
        if a != b and None not in {a, b}
    }
    if is_late and is_moved:
        return _Likeness.DAMAGE
    here, places = naming.place, cell.places()
    shared = [place for place in places if not _places_differ(place, here)]
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
    is_damage = (is_same and n_changed) or any(_is_slip_of(*texts) for texts in pairs)
    return _Likeness.DAMAGE if is_damage else _Likeness.NONE


def _n_changed(text: str, other: str) -> int | None:
    return sum(map(str.__ne__, text, other)) if len(text) == len(other) else None


def _places_differ(first: Place, second: Place) -> bool:
    return any(
        a != b and a is not None and b is not None for a, b in zip(first, second, strict=True)
    )


def _tells_sectors(first: Place, second: Place) -> bool:
    """True for places that no two sectors of a mast share: GSM has a channel for each."""
    has_channel = None not in {first.arfcn, second.arfcn}
    return has_channel and (first.rat == "GSM" or None not in {first.code, second.code})


def _is_slip_of(text: str, other: str) -> bool:
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
LevelKind = tuple[str | None, str, bool]
# technology and role; whether it is the level of the cell (RSRP, RSCP) or of its carrier


@dataclass(frozen=True, slots=True)
class NumberHistory:
    """What the replies of a modem have shown so far."""

    columns: Mapping[Column, Texts] = field(default_factory=dict)
    networks: Mapping[Network, int] = field(default_factory=dict)
    codes: Mapping[Code, int] = field(default_factory=dict)
    broadcasts: Mapping[CellBroadcast, int] = field(default_factory=dict)
    levels: Mapping[LevelKind, int] = field(default_factory=dict)
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
        levels = Counter(filter(None, map(level_kind_of, rows)))
        return cls(columns, networks, codes, broadcasts, levels)

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
            _add(self.levels, reply.levels),
            self.cells,
        )


def _add(counts: Mapping[Key, int], more: Mapping[Key, int]) -> Mapping[Key, int]:
    total = {**counts, **{key: counts.get(key, 0) + count for key, count in more.items()}}
    return total if len(total) <= MOST_TEXTS else dict(list(total.items())[len(total) // 2 :])


def has_identity(row: Row) -> TypeGuard[CellReading | Registration]:
    """True for rows of a kind that can name a cell."""
    return isinstance(row, CellReading | Registration)


def level_kind_of(row: Row) -> LevelKind | None:
    """The kind of a level, where the technology has two."""
    if not isinstance(row, CellReading) or row.rat in {None, "GSM"} or row.level_dbm is None:
        return None
    if (row.cid, row.pci, row.psc) == (None, None, None):
        return None  # a carrier of no cell
    return row.rat, row.role, (row.rsrp_dbm, row.rscp_dbm) != (None, None)


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


SHARE = 2
"""A number that looks like a damaged one must come at least half as often as the other."""
SPARSE = 50
"""Lost digits shorten less than one value in so many; firmware without padding prints more."""
DECIMAL = 10
"""No modem pads numbers of this base, so their widths show nothing of the firmware."""


def mark_doubtful(
    rows: Sequence[Row], history: NumberHistory
) -> tuple[tuple[Row, ...], NumberHistory]:
    """Rows of one reply, doubtful identities marked and values dropped; the new history."""
    (marked,), after = mark_doubtful_replies([rows], history)
    return marked, after


def mark_doubtful_replies(
    replies: Sequence[Sequence[Row]], history: NumberHistory
) -> tuple[list[tuple[Row, ...]], NumberHistory]:
    """The same for the replies of a transcript, where later ones count for earlier ones."""
    of_replies = [NumberHistory.of_reply(rows) for rows in replies]
    for reply in of_replies:
        history = history.with_reply(reply)
    marked = []
    for rows, reply in zip(replies, of_replies, strict=True):
        contradictory = _contradictory_rows(rows)
        marked.append(
            tuple(_mark(row, reply, history, unsure=id(row) in contradictory) for row in rows)
        )
    cells, doubtful = _doubtful_names(replies, marked, history.cells)
    marked = [
        tuple(
            replace(row, identity_unsure=True)
            if has_identity(row) and who_of(row) in names
            else row
            for row in rows
        )
        for rows, names in zip(marked, doubtful, strict=True)
    ]
    return marked, replace(history, cells=cells)


def _doubtful_names(
    replies: Sequence[Sequence[Row]], marked: Sequence[Sequence[Row]], cells: CellHistory
) -> tuple[CellHistory, list[frozenset[Identity]]]:
    namings = [namings_of(zip(*rows, strict=True)) for rows in zip(replies, marked, strict=True)]
    doubtful = []
    for rows, naming in zip(replies, namings, strict=True):
        is_scan = any(getattr(row, "role", None) == "scan" for row in rows)
        is_alone = len(namings) == 1
        cells, names = cells.with_reply(naming, is_scan=is_scan, is_alone=is_alone)
        doubtful.append(names)
    if len(namings) == 1:
        return cells, doubtful
    beside = zip([{}, *namings], namings, [*namings[1:], {}], strict=False)
    return cells, [
        cells.doubtful(naming, naming.keys() & (before.keys() | after.keys()))
        for before, naming, after in beside
    ]


def _contradictory_rows(rows: Sequence[Row]) -> set[int]:
    """Ids of readings that name the serving cell of one channel differently."""
    serving: dict[tuple[str, int], list[CellReading]] = {}
    for row in rows:
        if is_serving(row) and row.rat and row.arfcn is not None:
            serving.setdefault((row.rat, row.arfcn), []).append(row)
    return {
        id(row)
        for alike in serving.values()
        if any(_differ(alike[0], row) for row in alike)
        for row in alike
    }


def _differ(first: CellReading, second: CellReading) -> bool:
    pairs = ((getattr(first, name), getattr(second, name)) for name in ("mcc", "mnc", *IDENTITY))
    return any(a is not None and b is not None and a != b for a, b in pairs)


def _mark(row: Row, reply: NumberHistory, history: NumberHistory, *, unsure: bool) -> Row:
    if not has_identity(row):
        return row
    changes: dict[str, Any] = {}
    if isinstance(row, CellReading) and row.broadcast and _is_broadcast_unsure(row, history):
        changes["broadcast"] = replace(row.broadcast, broadcast_unsure=True)
    if _is_level_lost(row, history):
        changes["rssi_dbm"] = None
    unsure = unsure and not _is_in_other_reply(row, reply, history)
    unsure = unsure or row.identity_unsure or not _is_network_sure(network_of(row), history)
    for name, number in numbers(row):
        changes[name] = int(number)
        column = column_of(row, name, number)
        if name in IDENTITY:
            unsure |= not _is_sure(column, number, reply, history)
        elif not _is_complete(number, _others(column, number, history)):
            changes |= dict.fromkeys(PADDED_VALUES[name])
    return replace(row, **changes, identity_unsure=unsure) if changes or unsure else row


def _is_broadcast_unsure(row: Row, history: NumberHistory) -> bool:
    """Whether it was printed once, or another one of the cell far more often."""
    printed = broadcast_of(row)
    if printed is None:
        return False
    count = history.broadcasts.get(printed, 0)
    rivals = (n for other, n in history.broadcasts.items() if other[:-1] == printed[:-1])
    return count <= 1 or count * SHARE < max(rivals, default=0)


def _is_level_lost(row: Row, history: NumberHistory) -> bool:
    """Whether the reply has lost the level of the cell: that of the carrier is of another scale."""
    kind = level_kind_of(row)
    if kind is None or kind[-1]:
        return False
    return history.levels.get((*kind[:-1], True), 0) >= history.levels.get(kind, 0)


def _is_in_other_reply(row: Row, reply: NumberHistory, history: NumberHistory) -> bool:
    codes = [(name in AREA, int(number)) for name, number in numbers(row) if name in IDENTITY]
    return bool(codes) and all(history.codes.get(code, 0) > reply.codes[code] for code in codes)


def _is_sure(
    column: Column, number: NumberText, reply: NumberHistory, history: NumberHistory
) -> bool:
    if number.confirmed:
        return True
    text, form = number.text, number.form
    texts = history.texts(column)
    if _is_slip(text, texts, form):
        return reply.texts(column)[text] > 1
    again = history.codes.get((column[1] in AREA, int(number)), 0) > 1
    others = _others(column, number, history)
    if text.startswith("0"):
        full = form.is_full(text) and len(text) + 1 not in form.full_widths
        return again or full or _n_padded(others, {len(text)}) > 0
    if form.is_full(text):
        return True
    n_padded = _n_padded(others, form.full_widths)
    if n_padded and n_padded > _n_short(others, form):
        return False
    return again or _prints_short_numbers(column, number, reply, history)


def _prints_short_numbers(
    column: Column, number: NumberText, reply: NumberHistory, history: NumberHistory
) -> bool:
    """True where the firmware is shown to print short numbers."""
    # Of decimal numbers any other reply shows it. For hexadecimal ones it takes a short one, which
    # in the same reply must be of the same column: a lost byte shortens one number only.
    if number.form.base == DECIMAL:
        return sum(history.texts(column).values()) > sum(reply.texts(column).values())
    if _n_short(_others(column, number, history), number.form):
        return True
    for other, texts in history.columns.items():
        is_scan, name, form = other
        if is_scan == column[0] and name in IDENTITY and form.base == number.form.base:
            of_reply = reply.texts(other)
            before = {text: count - of_reply.get(text, 0) for text, count in texts.items()}
            if _n_short(before, form):
                return True
    return False


def _is_complete(number: NumberText, others: Texts) -> bool:
    """True for a level or a channel with all its digits, or from firmware that does not pad."""
    text, form = number.text, number.form
    if form.is_full(text):
        return True
    short = sum(count for other, count in others.items() if not form.is_full(other))
    total = sum(others.values())
    unpadded = not text.startswith("0") and not _n_padded(others, form.full_widths)
    return unpadded and short > total / SPARSE


def _others(column: Column, number: NumberText, history: NumberHistory) -> Texts:
    texts = dict(history.texts(column))
    texts[number.text] = texts.get(number.text, 1) - 1
    return {text: count for text, count in texts.items() if count}


def _n_padded(texts: Texts, widths: Iterable[int]) -> int:
    return sum(
        count for text, count in texts.items() if text.startswith("0") and len(text) in widths
    )


def _n_short(texts: Texts, form: NumberForm) -> int:
    return sum(
        count
        for text, count in texts.items()
        if not form.is_full(text) and not text.startswith("0") and not _is_slip(text, texts, form)
    )


def _is_slip(text: str, texts: Texts, form: NumberForm | None) -> bool:
    """True for a number that another one becomes by one lost or doubled digit, unless frequent."""
    count = texts.get(text, 1)
    rival = max((texts.get(other, 0) for other in _one_slip_before(text)), default=0)
    often = count >= OFTEN and count * SHARE >= rival
    is_full = form is not None and form.is_full(text)
    return not often and (rival > count or (rival == count and not is_full))


def _one_slip_before(text: str) -> Iterator[str]:
    """What was printed if one digit of the text is missing, or stands twice."""
    for at in range(len(text) + 1):
        for digit in "0123456789abcdef":
            yield text[:at] + digit + text[at:]
    for at in range(1, len(text)):
        if text[at] == text[at - 1]:
            yield text[:at] + text[at + 1 :]


def _is_network_sure(network: Network | None, history: NumberHistory) -> bool:
    """True where the network code has the digits of its country, or was printed more than once."""
    if network is None:
        return True
    mcc, mnc = network
    digits = mnc_digits(mcc)
    if len(mnc) == digits:
        return True
    codes = {code: n for (country, code), n in history.networks.items() if country == mcc}
    return not _is_slip(mnc, codes, None) and (digits is None or codes[mnc] > 1)
