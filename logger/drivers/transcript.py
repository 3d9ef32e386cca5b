"""A transcript of a modem: its rows, and which of them came in one reply."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence

from logger.drivers.family import Family
from logger.drivers.protocols.at import INTERRUPTION
from logger.drivers.reading.recognition import NumberHistory, mark_doubtful_replies
from logger.drivers.reading.row_language import Row

_FINAL = re.compile(r"(?:OK|ERROR|\+CM[ES] ERROR\b.*)\s*\Z")
_COMMAND = re.compile(r"AT[+^*$#!&A-Z]", re.IGNORECASE)


def rows_of(driver: Family, lines: Sequence[str]) -> tuple[Row, ...]:
    """All rows of a transcript; each reply is evidence for the numbers of the others.

    A last line without its line end is cut where the transcript shows what ends a reply.
    """
    divided = any(_FINAL.match(line.strip()) or _COMMAND.match(line.strip()) for line in lines)
    lines = [*lines, INTERRUPTION] if divided and lines[-1].strip() else lines
    rows = driver.read(lines)
    replies = _group_rows(rows, [driver.read(reply) for reply in replies_of(driver, lines)])
    found, _ = mark_doubtful_replies(replies, NumberHistory())
    marked_rows = {
        id(row): marked
        for reply, marked_reply in zip(replies, found, strict=True)
        for row, marked in zip(reply, marked_reply, strict=True)
    }
    return tuple(marked_rows[id(row)] for row in rows)


def replies_of(driver: Family, lines: Sequence[str]) -> Iterator[list[str]]:
    """Lines by reply, from a command (or an unsolicited serving cell) to a final code."""
    unsolicited = not any(
        _FINAL.match(line.strip()) or _COMMAND.match(line.strip()) for line in lines
    )
    reply: list[str] = []
    for line in lines:
        begins = driver.role_of(line) == "serving" if unsolicited else _COMMAND.match(line.strip())
        if begins and reply:
            yield reply
            reply = []
        reply.append(line)
        if _FINAL.match(line.strip()):
            yield reply
            reply = []
    yield reply


def _group_rows(rows: Sequence[Row], replies: Sequence[Sequence[Row]]) -> list[list[Row]]:
    """The rows by reply; as one reply where the replies alone read differently."""
    if Counter(map(repr, rows)) != Counter(repr(row) for reply in replies for row in reply):
        return [list(rows)]
    left: dict[str, list[Row]] = {}
    for row in reversed(rows):
        left.setdefault(repr(row), []).append(row)
    return [[left[repr(row)].pop() for row in reply] for reply in replies]
