"""Which identities are sure, by comparison with the other numbers of the reply and of the modem.

A firmware pads its numbers with zeros or does not. Where it pads, a number of another width has
lost or doubled a digit; where it does not, no single number shows that. Three things make a number
doubtful:

- it is shorter than all its digits, and neither a similar number of the reply nor another reply
  shows that this firmware prints numbers so short;
- it is shorter, and this firmware pads;
- it is what a more frequent number of the same column becomes when a digit is lost or doubled.

A number that is printed twice is sure. An identity with a doubtful number keeps its value and is
marked; a level or a channel without one of its digits is useless and is dropped. `cell_history`
compares whole names with those before. What a cell broadcasts is marked until the same is printed
of it twice, and half as often as anything else.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from logger.core.types import CellReading
from logger.drivers.reading.cell_history import OFTEN, CellHistory, Who, namings_of, who_of
from logger.drivers.reading.number_history import (
    AREA,
    IDENTITY,
    PADDED_VALUES,
    Column,
    Network,
    NumberHistory,
    Texts,
    broadcast_of,
    column_of,
    has_identity,
    network_of,
    numbers,
)
from logger.drivers.reading.number_text import NumberForm, NumberText
from logger.drivers.reading.rows import Row
from logger.drivers.reading.serving_cell import is_serving

SHARE = 2
"""A number that looks like a damaged one must come at least half as often as the other."""
SPARSE = 50
"""Lost digits make less than one value in so many too short; firmware without padding prints
more."""
DECIMAL = 10
"""No modem pads numbers of this base, so their widths show nothing of the firmware."""
_THREE = frozenset({"302", *map(str, range(310, 317))})  # Canada, USA
_EITHER = frozenset({"001", "405", "502", "706", "708", "714", "722", "732", "750", "999"})
"""Tests, India, Malaysia, El Salvador, Honduras, Panama, Argentina, Colombia, Falkland Islands,
private networks.
"""


def mark_doubtful(
    rows: Sequence[Row], history: NumberHistory
) -> tuple[tuple[Row, ...], NumberHistory]:
    """Rows of one reply, doubtful identities marked and values dropped; the new history."""
    (marked,), after = mark_doubtful_replies([rows], history)
    return marked, after


def mark_doubtful_replies(
    replies: Sequence[Sequence[Row]], history: NumberHistory
) -> tuple[list[tuple[Row, ...]], NumberHistory]:
    """The same for the replies of a transcript, where later replies count for earlier ones too."""
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
) -> tuple[CellHistory, list[frozenset[Who]]]:
    """The cells after the replies, and the doubtful names of each reply."""
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
    """Ids of readings of one reply that name the serving cell of one channel differently."""
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
    """The row with plain numbers."""
    if not has_identity(row):
        return row
    changes: dict[str, Any] = _broadcast_marked(row, history)
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


def _broadcast_marked(row: Row, history: NumberHistory) -> dict[str, Any]:
    """The broadcast of a row, marked where it was printed once or another one far more often."""
    printed = broadcast_of(row)
    if printed is None:
        return {}
    count = history.broadcasts.get(printed, 0)
    rivals = (n for other, n in history.broadcasts.items() if other[:-1] == printed[:-1])
    if count > 1 and count * SHARE >= max(rivals, default=0):
        return {}
    return {"broadcast": replace(printed[-1], broadcast_unsure=True)}


def _is_in_other_reply(row: Row, reply: NumberHistory, history: NumberHistory) -> bool:
    """True where another reply too has the area and the cell of a row."""
    codes = [(name in AREA, int(number)) for name, number in numbers(row) if name in IDENTITY]
    return bool(codes) and all(history.codes.get(code, 0) > reply.codes[code] for code in codes)


def _is_sure(
    column: Column, number: NumberText, reply: NumberHistory, history: NumberHistory
) -> bool:
    """True where no digit of a part of an identity seems to be lost or doubled."""
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
    """True where the firmware is shown to print short numbers.

    Of decimal numbers any other reply shows it. For hexadecimal ones it takes a short one, which in
    the same reply must be of the same column: a lost byte shortens one number only.
    """
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
    """All numbers of the column but this one."""
    texts = dict(history.texts(column))
    texts[number.text] = texts.get(number.text, 1) - 1
    return {text: count for text, count in texts.items() if count}


def _n_padded(texts: Texts, widths: Iterable[int]) -> int:
    """How many of the texts begin with zeros and have one of the widths."""
    return sum(
        count for text, count in texts.items() if text.startswith("0") and len(text) in widths
    )


def _n_short(texts: Texts, form: NumberForm) -> int:
    """How many texts are short, begin with no zero and are no other number with a lost digit."""
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
    digits = _mnc_digits(mcc)
    if len(mnc) == digits:
        return True
    codes = {code: n for (country, code), n in history.networks.items() if country == mcc}
    return not _is_slip(mnc, codes, None) and (digits is None or codes[mnc] > 1)


def _mnc_digits(mcc: str) -> int | None:
    """Digits of the network codes of a country (ITU-T E.212 and its list of networks).

    None where two and three are in use, as on many islands of zone 3.
    """
    if mcc in _THREE:
        return 3
    return None if mcc in _EITHER or mcc.startswith("3") else 2
