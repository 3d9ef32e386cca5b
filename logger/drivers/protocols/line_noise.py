"""Lines with noise around them: what can be read without guessing.

Noise before a line has taken nothing of it where the line begins with its name (`+CENG:`, `arfcn:`)
or is a final code. Noise after a line may replace its end, and noise in the middle any part
of it: such a line is no text. A complete sentence of NMEA 0183 has taken nothing.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from operator import xor
from typing import NamedTuple

# High bytes are text only between quotation marks, where modems print operator names; outside they
# are line noise.
_TEXT = re.compile(rb'(?:[\t !#-~]++|"[\t !#-~\x80-\xff]*+(?:"|\Z))*+')
_AROUND = bytes(sorted({*range(256)} - {*range(0x20, 0x7F), 0x09}))
_NAMED = re.compile(
    rb"(?:\A|(?<=[^\t -~]))"
    rb"(?:[+*^#!$%][A-Z][A-Z0-9]+[ ]?:"
    rb"|(?![x_ ()/]+:)[A-Za-z][A-Za-z_ ()/]{1,19}:|\+CM[ES] ERROR\b)"  # x: a redacted name
)
_FINAL = re.compile(rb"OK|ERROR|NO CARRIER")
_SENTENCE = re.compile(rb"\$([A-Z][A-Z0-9]{2,9},[ -#%-)+-~]*)\*([0-9A-Fa-f]{2})")
_SENTENCE_BEGINS = re.compile(rb"(?<=[!-~])[ ]*\$[A-Z][A-Z0-9]{4,9},")
_OWN_LINE = re.compile(rb"[ \t]*(?:[+*^#!$%][A-Z]|(?:OK|ERROR|NO CARRIER|RING|[0-9])[ \t]*\Z)")


@dataclass(frozen=True, slots=True)
class Garbage:
    """Bytes that are no text of the device, without line ends: noise or an endless line."""

    data: bytes


class Piece(NamedTuple):
    """A part of a line: text of the device, or noise."""

    data: bytes
    is_text: bool


def sentences(line: bytes) -> list[tuple[int, int]]:
    """Begin and end of sentences with a right checksum."""
    return [
        found.span()
        for found in (_SENTENCE.finditer(line) if b"$" in line else ())
        if reduce(xor, found[1]) == int(found[2], 16)
    ]


def without(line: bytes, spans: list[tuple[int, int]]) -> bytes:
    """The rest."""
    ends = [0, *(end for _, end in spans)]
    begins = [*(begin for begin, _ in spans), len(line)]
    return b"".join(line[end:begin] for end, begin in zip(ends, begins, strict=True))


def goes_on(line: bytes) -> bool:
    """Whether a line may be the rest of another."""
    return not _OWN_LINE.match(line)


def pieces(line: bytes, *, words: bool = False) -> Iterator[Piece]:
    """The parts of a line; `words` for replies of plain words without a name."""
    broken = _SENTENCE_BEGINS.search(line) if b"$" in line else None
    if broken:
        yield from pieces(line[: broken.start()], words=words)
        yield Piece(line[broken.start() :], is_text=False)
        return
    if _TEXT.fullmatch(line):
        yield Piece(line, is_text=True)
        return
    begins = [found.start() for found in _NAMED.finditer(line)]
    inner = line.strip(_AROUND)
    if not begins and (
        _FINAL.fullmatch(inner.strip()) or (words and inner and _TEXT.fullmatch(inner))
    ):
        begins = [line.index(inner)]
    if not begins:
        yield Piece(line, is_text=False)
        return
    if begins[0]:
        yield Piece(line[: begins[0]], is_text=False)
    for begin, end in zip(begins, [*begins[1:], len(line)], strict=True):
        yield from _named_pieces(line[begin:end])


def _named_pieces(part: bytes) -> Iterator[Piece]:
    text = part.rstrip(_AROUND)
    if not _TEXT.fullmatch(text):
        yield Piece(part, is_text=False)
        return
    yield Piece(text, is_text=True)
    if len(text) < len(part):
        yield Piece(part[len(text) :], is_text=False)
