"""Rows that another message interrupts: a URC begins within a value, or a reply ends within one.

    +QENG: "neighbourcell","GSM",262,01,1918,C851,59,118,-10      of -103
    +CIEV: "service",1

Nothing in such a row shows whether its last value is complete. So the value is dropped and its
comma stays.
"""

import re
from collections.abc import Iterator, Sequence

from logger.drivers.protocols.at import INTERRUPTION

_NAME = re.compile(r"[+*^$!#%][A-Z][A-Z0-9]*")
_PREFIX = re.compile(rf"\s*({_NAME.pattern})\s?:", re.IGNORECASE)
_GLUED = re.compile(rf"(?<=[\w,.\"-])({_NAME.pattern})\s?:", re.IGNORECASE)
_UNASKED = re.compile(r"\s*(?:RING|RDY|QCRDY|Call Ready|SMS Ready|SMS DONE|PB DONE|DST: .*)\s*\Z")
_RESULT = re.compile(
    r"\s*(?:OK|ERROR|\+CM[ES] ERROR\b.*|AT\b.*|AT[+^*$!#%&].*)?\s*\Z", re.IGNORECASE
)
_LAST_VALUE = re.compile(r"[^\s,]*\s*\Z")
_CLOSED = re.compile(r'"[^"]*"\s*\Z')
_COMMON = frozenset({"+CREG", "+CGREG", "+CEREG", "+C5GREG", "+COPS", "+CSQ", "+CESQ"})
"""Names of the replies that every family reads (`standard_replies`)."""


def names_of(commands: str) -> frozenset[str]:
    """Names whose lines answer the commands."""
    return frozenset(_NAME.findall(commands.upper()))


def drop_cut_values(lines: Sequence[str], names: frozenset[str]) -> list[str]:
    """The lines without last values that may be cut, and without `INTERRUPTION`.

    `names` are the result names of the family (`names_of`).
    """
    parts = [part for line in lines if line.strip() for part in _parts(line, names)]
    return [
        _without_end(line) if _interrupts(following, line, names) else line
        for line, following in zip(parts, [*parts[1:], ""], strict=False)
        if line != INTERRUPTION
    ]


def _parts(line: str, names: frozenset[str]) -> Iterator[str]:
    """The line, in two where a URC stands in the middle of it."""
    for glued in _GLUED.finditer(line):
        if glued[1].upper() not in names | _COMMON:
            yield from (line[: glued.start()], INTERRUPTION, line[glued.start() :])
            return
    yield line


def _interrupts(line: str, before: str, names: frozenset[str]) -> bool:
    """True for a line that belongs to no reply of the family."""
    if line == INTERRUPTION:
        return True
    prefix, own = _PREFIX.match(line), _PREFIX.match(before)
    if prefix is None:
        return _UNASKED.match(line) is not None
    name = prefix[1].upper()
    return (
        not _RESULT.match(line)
        and name not in names | _COMMON
        and not (own and own[1].upper() == name)
    )


def _without_end(line: str) -> str:
    """The line without its last value, unless that stands in quotation marks."""
    return line if _RESULT.match(line) or _CLOSED.search(line) else _LAST_VALUE.sub("", line)
