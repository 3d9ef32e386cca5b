"""Damaged replies of all modems: nothing is raised, memory is bounded, and no identity is read that
is not printed.
"""

import random
import re
from collections.abc import Iterable

import pytest

from logger.core.types import HIGHEST_ARFCN, CellReading
from logger.drivers.family import Family
from logger.drivers.protocols.at import MAX_LINE, MAX_LINES, AtFramer
from logger.drivers.registry import FAMILIES
from tests.conftest import SHARED
from tests.kit.drivers import mutations, own_replies
from tests.kit.framers import merge_garbage, split_at

CHANGES, CHANGES_FOR_THE_FRAMER = 3_000, 3_000
ALL_CHANGES, ALL_CHANGES_FOR_THE_FRAMER = 75_000, 100_000
"""Damaged lines; with the 12 drivers a million."""

MOST_LINES_OF_A_FILE = 12
PRINTS_NUMBERS = {"telit"}
"""Families that print network codes as numbers, also hexadecimal ones: 01 may be a 1 in the
text.
"""
JOINS_WRAPPED_ROWS = {"quectel_gsm"}  # also within a number

REPLIES = [
    path.read_text("latin-1") for path in sorted((SHARED / "corpus" / "modem").glob("*.txt"))
]
"""The corpus, none where it is not beside this repository; long replies in pieces."""


def samples_of(driver: Family) -> list[str]:
    """Own replies, and the replies of the corpus that the driver finds something in."""
    pieces = [
        "\n".join(lines[start : start + MOST_LINES_OF_A_FILE])
        for lines in map(str.splitlines, REPLIES)
        for start in range(0, len(lines), MOST_LINES_OF_A_FILE)
    ]
    return own_replies(driver.name) + [piece for piece in pieces if driver.read(piece.split("\n"))]


def check(driver: Family, text: str) -> None:
    lines = text.split("\n")
    printed = [text]
    if driver.name in JOINS_WRAPPED_ROWS:
        printed.append(re.sub(r"\s*\n\s*", "", text))
    digits = {word for one in printed for word in re.findall("[0-9]+", one)}
    words = {word for one in printed for word in re.findall("[0-9A-Fa-f]+", one)}
    numbers = {int(word, 16) for word in words} | set(map(int, digits))
    for row in (*driver.read(lines), *driver.read([text])):
        places = {getattr(row, name, None) for name in ("lac", "tac", "cid")}
        assert places <= numbers | {None}, (row, text)
        if isinstance(row, CellReading):
            assert _is_printed(driver, row, digits, numbers), (row, text)
            channels = set(row.broadcast.neighbour_arfcns or ()) if row.broadcast else set()
            assert {str(channel) for channel in channels} <= digits, (row, text)
            assert max(channels, default=0) <= HIGHEST_ARFCN, (row, text)
    for line in lines:
        driver.role_of(line), driver.is_restart(line)


def _is_printed(driver: Family, row: CellReading, digits: set[str], numbers: set[int]) -> bool:
    """Country and network stand in the text, apart or as one."""
    codes = {code for code in (row.mcc, row.mnc) if code is not None}
    if driver.name in PRINTS_NUMBERS and {int(code) for code in codes} <= numbers:
        return True
    return codes <= digits or f"{row.mcc}{row.mnc}" in digits


def check_framer(text: str, rng: random.Random) -> None:
    """The same events and little memory, whole, byte by byte and in chunks of any size."""
    data = text.encode("latin-1", "replace")
    sizes = [rng.randint(0, 40) for _ in range(len(data) // 10)]
    ways = [
        events_of([data]),
        events_of(data[i : i + 1] for i in range(len(data))),
        events_of(split_at(data, sizes)),
    ]
    assert ways[1:] == ways[:-1], text


def events_of(chunks: Iterable[bytes]) -> list[object]:
    framer = AtFramer()
    framer.send("AT+CENG?")
    events: list[object] = []
    for chunk in chunks:
        events += framer.feed(chunk)
        assert len(framer._buffer) <= MAX_LINE
        assert len(framer._lines) <= MAX_LINES
    return [*merge_garbage(events), *framer.flush(), framer.expire()]


def check_driver(name: str, changes: int) -> None:
    driver = FAMILIES[name]
    for text in mutations(samples_of(driver), 1, changes):
        check(driver, text)


def check_framers(changes: int) -> None:
    rng = random.Random(2)
    everything = [reply for name in FAMILIES for reply in own_replies(name)] + REPLIES
    for number, text in enumerate(mutations(everything, 2, changes)):
        check_framer(text * 100 if number % 1000 == 0 else text, rng)


@pytest.mark.parametrize("name", FAMILIES)
def test_own_replies_are_read(name):
    assert all(FAMILIES[name].read(reply.split("\n")) for reply in own_replies(name))


@pytest.mark.parametrize("name", FAMILIES)
def test_replies_of_all_families_raise_nothing_and_invent_no_identity(name):
    for reply in [*REPLIES, *(own for other in FAMILIES for own in own_replies(other))]:
        check(FAMILIES[name], reply)


@pytest.mark.parametrize("name", FAMILIES)
def test_damage_raises_nothing_and_invents_no_identity(name):
    check_driver(name, CHANGES)


def test_framer_takes_damaged_bytes_in_any_chunks():
    check_framers(CHANGES_FOR_THE_FRAMER)


@pytest.mark.slow
@pytest.mark.parametrize("name", FAMILIES)
def test_many_damaged_lines(name):
    check_driver(name, ALL_CHANGES)


@pytest.mark.slow
def test_framer_takes_many_damaged_lines():
    check_framers(ALL_CHANGES_FOR_THE_FRAMER)


def test_a_made_up_identity_is_found():
    class Liar(type(FAMILIES["generic"])):
        def rows_in(self, lines):
            return (CellReading("serving", "GSM", "262", "01", 0x3C4D, 4711),)

    check(Liar(), "262,01,3c4d,4711")
    for text in ("262,01,3c4d,471", "262,1,3c4d,4711", "262,01,3c4e,4711"):
        with pytest.raises(AssertionError):
            check(Liar(), text)
