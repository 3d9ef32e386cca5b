"""Line noise before, after and between the lines of a reply, and in place of their ends: what is
whole is read.
"""

import random
import re

import pytest

from logger.drivers.protocols.at import AtFramer, Reply, Unsolicited
from logger.drivers.protocols.line_noise import Piece, pieces
from logger.drivers.registry import FAMILIES
from tests.kit.drivers import cells_of, identity_of, own_replies

NOT_TEXT = bytes([*range(9), *range(14, 32), *range(127, 256)])
NAME = re.compile(r"^[+*^#!$%][A-Z]+(?=\s?:)", re.MULTILINE)


def _noise(rng):
    return bytes(rng.choices(NOT_TEXT, k=rng.randint(1, 6)))


BEFORE = {
    "before each line": lambda lines, rng: [_noise(rng) + line for line in lines],
    "between the lines": lambda lines, rng: [
        piece for line in lines for piece in (_noise(rng), line)
    ],
    "with printable bytes in it": lambda lines, rng: [
        _noise(rng) + b"x~" + _noise(rng) + line for line in lines
    ],
}
AFTER = {
    "after each line": lambda lines, rng: [line + _noise(rng) for line in lines],
    "on both sides": lambda lines, rng: [_noise(rng) + line + _noise(rng) for line in lines],
    "in place of the last bytes": lambda lines, rng: [
        line[: -rng.randint(1, 3)] + _noise(rng) for line in lines
    ],
    "in place of the first bytes": lambda lines, rng: [
        _noise(rng) + line[rng.randint(1, 12) :] for line in lines
    ],
    "in the middle": lambda lines, rng: [_in_the_middle(line, rng) for line in lines],
    "in place of line ends": lambda lines, rng: [_noise(rng).join(lines)],
}


def _in_the_middle(line, rng):
    at = rng.randrange(len(line) + 1)
    return line[:at] + _noise(rng) + line[at + rng.randint(0, 2) :]


def _lines_of(reply, damage, rng):
    """The lines of a reply as the framer gives them, noise and all."""
    lines = [line.encode("latin-1") for line in reply.split("\n") if line.strip()]
    framer = AtFramer()
    framer.send("AT" + ";".join(name + "?" for name in sorted(set(NAME.findall(reply)))))
    events = [*framer.feed(b"\r\n".join([*damage(lines, rng), b"", b"OK", b""]))]
    (answer,) = [event for event in events if isinstance(event, Reply)] or [framer.expire()]
    return [
        *answer.marked_lines,
        *(event.line for event in events if isinstance(event, Unsolicited)),
    ]


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("kind", BEFORE)
def test_noise_before_and_between_lines_takes_no_row(name, kind):
    driver, rng = FAMILIES[name], random.Random(1)
    for reply in own_replies(name):
        if all(NAME.match(line) for line in reply.split("\n") if line.strip()):
            assert cells_of(driver, _lines_of(reply, BEFORE[kind], rng)) == cells_of(
                driver, reply.split("\n")
            )


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("kind", BEFORE | AFTER)
def test_noise_anywhere_invents_no_cell(name, kind):
    driver, rng = FAMILIES[name], random.Random(2)
    for reply in own_replies(name):
        honest = {identity_of(cell) for cell in cells_of(driver, reply.split("\n"))}
        places = [{cell[i] for cell in honest} | {None} for i in range(4)]
        for _ in range(20):
            for cell in cells_of(driver, _lines_of(reply, (BEFORE | AFTER)[kind], rng)):
                assert cell.identity_unsure or all(
                    value in known for value, known in zip(identity_of(cell), places, strict=False)
                ), cell


def test_a_modem_with_noise_before_every_line_is_still_polled():
    """Its final codes are read as well, and the words by which it says who it is."""
    framer = AtFramer()
    framer.send("ATI")
    said = b"\xff\xfe\r\n\xff\xfeSIM800 R14.18\r\n\xff\xfe\r\n\xff\xfeOK\r\n"
    (reply,) = [event for event in framer.feed(said) if isinstance(event, Reply)]
    assert reply == Reply("ATI", ("SIM800 R14.18",), "OK")
    framer.send("AT+CENG?")
    (reply,) = [
        event for event in framer.feed(b"\xff\xfe+CME ERROR: 3\r\n") if isinstance(event, Reply)
    ]
    assert reply.final == "+CME ERROR: 3"


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        (b"+CSQ: 19,99", [(b"+CSQ: 19,99", True)]),
        (b"\xff\xfe+CENG: 1,1", [(b"\xff\xfe", False), (b"+CENG: 1,1", True)]),
        (b"+CENG: 1,1\xff", [(b"+CENG: 1,1", True), (b"\xff", False)]),
        (
            b"+CENG: 1,1\xff+CENG: 2,2",
            [(b"+CENG: 1,1", True), (b"\xff", False), (b"+CENG: 2,2", True)],
        ),
        (b"+CENG: 1,\xff1", [(b"+CENG: 1,\xff1", False)]),
        (b"\xff23,45", [(b"\xff23,45", False)]),  # a digit may be missing
        (b"\xffOK\x00", [(b"\xff", False), (b"OK", True), (b"\x00", False)]),
        (b"O\xffK", [(b"O\xffK", False)]),
        (b"\xff", [(b"\xff", False)]),
    ],
)
def test_parts_of_a_line(line, wanted):
    assert [*pieces(line)] == [Piece(*piece) for piece in wanted]
