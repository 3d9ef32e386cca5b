"""Which identities are sure: the numbers of a reply beside each other, and beside those the modem
has sent before.

A firmware pads its numbers with zeros or does not. Where it pads, a number of another width has
lost or doubled a digit; where it does not, nothing in a single number shows that. So three things
make a number doubtful:

- it is shorter than all its digits, and neither its like in the reply nor other replies show that this firmware
  prints numbers so short;
- it is shorter, and this firmware pads;
- it is what a more frequent number of the same column becomes when a digit is lost or doubled.

A number that is printed twice is what it is. An identity with a doubtful number keeps its value and
is marked; a level or a channel is too poor without its digits and is dropped.
"""

from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from logger.core.types import CellReading
from logger.drivers.reading.network_codes import mnc_digits
from logger.drivers.reading.number_text import Form, NumberText
from logger.drivers.reading.rows import Registration, Row

Key = TypeVar("Key", bound=Hashable)

MOST_TEXTS = 2000
"""Numbers remembered of a column: the cells of a long walk. The oldest half is forgotten beyond."""
OFTEN = 5
SHARE = 2
"""A number that looks like a damaged one is believed when it came so often, and at least half as
often as the other: even a line that damages every fourth reply seldom hits the same digit.
"""
SPARSE = 50
"""Digits lost make fewer than one value of so many too short; a firmware that does not pad prints
more of them.
"""

DECIMAL = 10
"""Numbers of this base are padded by no modem, so their widths tell nothing of the firmware."""

_IDENTITY = ("lac", "tac", "cid")
_AREA = frozenset({"lac", "tac"})
_VALUES: Mapping[str, tuple[str, ...]] = {
    "arfcn_raw": ("arfcn_raw", "arfcn"),
    "rxlev_raw": ("rxlev_raw", "rssi_dbm"),
    "bsic": ("bsic",),
}
"""Values that some firmware pads, and what is made of each."""

Column = tuple[bool, str, Form]
"""Numbers that are printed alike: in a scan of all networks or not, name, form."""
Texts = Mapping[str, int]
"""How often each number came, as printed."""
Network = tuple[str, str]
Print = tuple[bool, int]
"""An area (True) or a cell, in whatever base it was printed."""


@dataclass(frozen=True, slots=True)
class NumberHistory:
    """What the replies of a modem have shown so far."""

    columns: Mapping[Column, Texts] = field(default_factory=dict)
    networks: Mapping[Network, int] = field(default_factory=dict)
    prints: Mapping[Print, int] = field(default_factory=dict)

    def of(self, column: Column) -> Texts:
        """Numbers of a column."""
        return self.columns.get(column, {})


def mark_doubtful(
    rows: Sequence[Row], known: NumberHistory
) -> tuple[tuple[Row, ...], NumberHistory]:
    """Rows of one reply with doubtful identities marked and doubtful values dropped, and what is
    known with them.
    """
    (found,), after = mark_doubtful_replies([rows], known)
    return found, after


def mark_doubtful_replies(
    replies: Sequence[Sequence[Row]], known: NumberHistory
) -> tuple[list[tuple[Row, ...]], NumberHistory]:
    """The same for the replies of a whole transcript, where the later ones say something of the
    earlier ones too.
    """
    seen = [_seen(rows) for rows in replies]
    everything = known
    for reply in seen:
        everything = _with(everything, reply)
    found = []
    for rows, reply in zip(replies, seen, strict=True):
        contradicted = _contradicted(rows)
        found.append(
            tuple(_judged(row, reply, everything, unsure=id(row) in contradicted) for row in rows)
        )
    return found, everything


def _seen(rows: Iterable[Row]) -> NumberHistory:
    """What one reply shows; a number that a driver has copied from one row to another was printed
    once.
    """
    columns: dict[Column, Counter[str]] = {}
    networks: Counter[Network] = Counter()
    prints: Counter[Print] = Counter()
    counted: set[int] = set()
    for row in rows:
        for name, number in _numbers(row):
            if id(number) not in counted:
                columns.setdefault(_column(row, name, number), Counter())[number.text] += 1
                prints[name in _AREA, int(number)] += name in _IDENTITY
            counted.add(id(number))
        network = _network(row)
        if network is not None:
            networks[network] += 1
    return NumberHistory(columns, networks, prints)


def _with(known: NumberHistory, reply: NumberHistory) -> NumberHistory:
    columns = dict(known.columns)
    for column, texts in reply.columns.items():
        columns[column] = _sum(known.of(column), texts)
    return NumberHistory(
        columns, _sum(known.networks, reply.networks), _sum(known.prints, reply.prints)
    )


def _sum(known: Mapping[Key, int], more: Mapping[Key, int]) -> Mapping[Key, int]:
    counts = {**known, **{key: known.get(key, 0) + count for key, count in more.items()}}
    return counts if len(counts) <= MOST_TEXTS else dict(list(counts.items())[len(counts) // 2 :])


def _numbers(row: Row) -> Iterator[tuple[str, NumberText]]:
    if isinstance(row, CellReading | Registration):
        for name in (*_IDENTITY, *_VALUES):
            number = getattr(row, name, None)
            if isinstance(number, NumberText):
                yield name, number


def _column(row: Row, name: str, number: NumberText) -> Column:
    return getattr(row, "role", None) == "scan", name, number.form


def _network(row: Row) -> Network | None:
    if isinstance(row, CellReading) and row.mcc is not None and row.mnc is not None:
        return row.mcc, row.mnc
    return None


def _contradicted(rows: Sequence[Row]) -> set[int]:
    """Readings of one reply that name the serving cell of one channel differently: only the past
    tells who is right.
    """
    serving: dict[tuple[str, int], list[CellReading]] = {}
    for row in rows:
        if (
            isinstance(row, CellReading)
            and row.role == "serving"
            and row.rat
            and row.arfcn is not None
        ):
            serving.setdefault((row.rat, row.arfcn), []).append(row)
    return {
        id(row)
        for alike in serving.values()
        if any(_differ(alike[0], row) for row in alike)
        for row in alike
    }


def _differ(first: CellReading, second: CellReading) -> bool:
    pairs = ((getattr(first, name), getattr(second, name)) for name in ("mcc", "mnc", *_IDENTITY))
    return any(one is not None and other is not None and one != other for one, other in pairs)


def _judged(row: Row, reply: NumberHistory, everything: NumberHistory, *, unsure: bool) -> Row:
    """The row with plain numbers."""
    if not isinstance(row, CellReading | Registration):
        return row
    changes: dict[str, Any] = {}
    unsure = unsure and not _heard_before(row, reply, everything)
    unsure = unsure or row.identity_unsure or not _is_network_sure(_network(row), everything)
    for name, number in _numbers(row):
        changes[name] = int(number)
        if name in _IDENTITY:
            unsure |= not _is_sure(row, name, number, reply, everything)
        elif not _is_whole(number, _others(_column(row, name, number), number, everything)):
            changes |= dict.fromkeys(_VALUES[name])
    return replace(row, **changes, identity_unsure=unsure) if changes or unsure else row


def _heard_before(row: Row, reply: NumberHistory, everything: NumberHistory) -> bool:
    """True where the area and the cell of a row stand in another reply too."""
    prints = [(name in _AREA, int(number)) for name, number in _numbers(row) if name in _IDENTITY]
    return bool(prints) and all(everything.prints.get(one, 0) > reply.prints[one] for one in prints)


def _is_sure(
    row: Row, name: str, number: NumberText, reply: NumberHistory, everything: NumberHistory
) -> bool:
    """True where no digit of a part of an identity seems to be lost or doubled."""
    if number.proven:
        return True
    column = _column(row, name, number)
    text, whole = number.text, number.form.whole
    texts = everything.of(column)
    if _slipped(text, texts, whole):
        return reply.of(column)[text] > 1
    again = everything.prints.get((name in _AREA, int(number)), 0) > 1
    others = _others(column, number, everything)
    if text.startswith("0"):
        all_there = len(text) in whole and len(text) + 1 not in whole
        return again or all_there or _pads(others, {len(text)}) > 0
    if len(text) in whole:
        return True
    pads = _pads(others, whole)
    if pads and pads > _short(others, whole):
        return False
    return again or _is_free(column, number, reply, everything)


def _is_free(
    column: Column, number: NumberText, reply: NumberHistory, everything: NumberHistory
) -> bool:
    """True where short numbers are shown to be nothing odd.

    Of decimal numbers any other reply shows it. For hexadecimal ones it takes a short one, which in
    the same reply must be of the same column: a byte is lost in one number only.
    """
    whole = number.form.whole
    if number.form.base == DECIMAL:
        return sum(everything.of(column).values()) > sum(reply.of(column).values())
    if _short(_others(column, number, everything), whole):
        return True
    for other, texts in everything.columns.items():
        if other[0] == column[0] and other[1] in _IDENTITY and other[2].base == number.form.base:
            mine = reply.of(other)
            if _short(
                {text: count - mine.get(text, 0) for text, count in texts.items()}, other[2].whole
            ):
                return True
    return False


def _is_whole(number: NumberText, others: Texts) -> bool:
    """True for a level or a channel that has all its digits, or comes from firmware that does not
    pad.
    """
    text, whole = number.text, number.form.whole
    if len(text) in whole:
        return True
    short = sum(count for other, count in others.items() if len(other) not in whole)
    total = sum(others.values())
    return not text.startswith("0") and not _pads(others, whole) and short > total / SPARSE


def _others(column: Column, number: NumberText, everything: NumberHistory) -> Texts:
    """All numbers of the column but this one."""
    texts = dict(everything.of(column))
    texts[number.text] = texts.get(number.text, 1) - 1
    return {text: count for text, count in texts.items() if count}


def _pads(texts: Texts, widths: Iterable[int]) -> int:
    """How many of the texts show padding to one of the widths: zeros stand in front."""
    return sum(
        count for text, count in texts.items() if text.startswith("0") and len(text) in widths
    )


def _short(texts: Texts, whole: frozenset[int]) -> int:
    """How many of the texts lack digits and no zeros, and are not another number with a digit
    lost.
    """
    return sum(
        count
        for text, count in texts.items()
        if len(text) not in whole and not text.startswith("0") and not _slipped(text, texts, whole)
    )


def _slipped(text: str, texts: Texts, whole: frozenset[int]) -> bool:
    """True for a number that another becomes when one digit is lost or doubled, unless it came too
    often for that.
    """
    own = texts.get(text, 1)
    rival = max((texts.get(other, 0) for other in _one_slip_before(text)), default=0)
    often = own >= OFTEN and own * SHARE >= rival
    return not often and (rival > own or (rival == own and len(text) not in whole))


def _one_slip_before(text: str) -> Iterator[str]:
    """What was printed if one digit of the text is missing, or stands twice."""
    for at in range(len(text) + 1):
        for digit in "0123456789abcdef":
            yield text[:at] + digit + text[at:]
    for at in range(1, len(text)):
        if text[at] == text[at - 1]:
            yield text[:at] + text[at + 1 :]


def _is_network_sure(network: Network | None, everything: NumberHistory) -> bool:
    """True where the network code has the digits that its country uses, or has been printed more
    than once.
    """
    if network is None:
        return True
    mcc, mnc = network
    digits = mnc_digits(mcc)
    if len(mnc) == digits:
        return True
    codes = {
        code: count for (country, code), count in everything.networks.items() if country == mcc
    }
    if _slipped(mnc, codes, frozenset()):
        return False
    return digits is None or codes[mnc] > 1
