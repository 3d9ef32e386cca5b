"""Helpers for tests of modem drivers: identities of readings, a modem that answers, and damage."""

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

from logger.core.types import CellReading
from logger.drivers.family import Family
from logger.drivers.protocols import at
from logger.drivers.protocols.at import AtFramer, Command, Dialogue, Reply
from logger.drivers.protocols.redaction import Redactor

Answer = tuple[Sequence[str], str | None]
"""Lines of a reply and its final result code, None for a time-out."""

DATA = Path(__file__).parents[1] / "drivers" / "data" / "own"
NO_IDENTITY = (None, None, None, None)


def own_replies(family: str) -> list[str]:
    """Replies of one family with values of our own in the layouts of its firmware notes."""
    return (DATA / f"{family}.txt").read_text("latin-1").removesuffix("\n").split("\n\n")


def identity_of(reading: CellReading) -> tuple[str | None, str | None, int | None, int | None]:
    """Network, area and cell of a reading."""
    return (
        reading.mcc,
        reading.mnc,
        reading.tac if reading.lac is None else reading.lac,
        reading.cid,
    )


def cells_of(driver: Family, lines: Sequence[str]) -> list[CellReading]:
    """Readings among the rows in the lines."""
    return [row for row in driver.read(lines) if isinstance(row, CellReading)]


def only_cell_of(driver: Family, lines: Sequence[str]) -> CellReading | None:
    """The only reading among the rows in the lines, None without one."""
    found = cells_of(driver, lines)
    assert len(found) <= 1
    return found[0] if found else None


def check_cuts(driver: Family, text: str) -> None:
    """However early a reply ends, what it names of a cell is that of a cell of the whole reply."""
    whole = [NO_IDENTITY, *map(identity_of, cells_of(driver, text.split("\n")))]
    for end in range(len(text)):
        for cell in cells_of(driver, text[:end].split("\n")):
            parts = identity_of(cell)
            assert any(_is_part(parts, identity) for identity in whole), text[:end]


def _is_part(parts: Sequence[Any], identity: Sequence[Any]) -> bool:
    return all(part in {None, known} for part, known in zip(parts, identity, strict=True))


def run_dialogue(
    dialogue: Dialogue[Any], replies: Mapping[str, Answer], default: Answer = ((), "ERROR")
) -> Any:
    """Result of a dialogue with a modem that has these answers, and the commands it was sent."""
    sent: list[str] = []

    def answer(command: Command) -> Answer:
        sent.append(command.text)
        return replies.get(command.text, default)

    return _drive(dialogue, answer), sent


def run_exchange(
    dialogue: Dialogue[Any], exchange: Sequence[tuple[str, Sequence[str], str | None]]
) -> Any:
    """Result of a dialogue that sends exactly these commands; each has its lines and final code."""
    coming = iter(exchange)

    def answer(command: Command) -> Answer:
        text, lines, final = next(coming, ("nothing more", (), None))
        assert command.text == text
        return lines, final

    result = _drive(dialogue, answer)
    assert not list(coming)
    return result


def _drive(dialogue: Dialogue[Any], answer: Any) -> Any:
    try:
        command = next(dialogue)
        while True:
            lines, final = answer(command)
            command = dialogue.send(Reply(command.text, tuple(lines), final))
    except StopIteration as done:
        return done.value


_MARKS = [*"0123456789abcdefFxX,:\"'-+. ()[]\\\n\r\t\x00\xff²٣"]
_WORDS = ["\\r\\n", "OK", "AT+", "+CENG: ", "^SMONI: ", "#MONI: ", "+UCGED: 2\n"]


def mutations(samples: Sequence[str], seed: int, changes: int) -> Iterator[str]:
    """Damaged texts with the given number of changes in total.

    Each sample is used in turn, followed by up to two others, with half of the lines changed: bits
    flip, pieces are lost or repeated, characters, words and line ends are inserted or removed, and
    rows run into each other.
    """
    rng = random.Random(seed)
    for sample in cycle(samples):
        text = "\n".join([sample, *rng.choices(samples, k=rng.randint(0, 2))])
        count = rng.randint(1, text.count("\n") + 2)
        for _ in range(count):
            at = rng.randrange(len(text))
            text = rng.choice(_CHANGES)(text[:at], text[at:], rng) or rng.choice(samples)
        yield text
        changes -= count
        if changes <= 0:
            return


_CHANGES: tuple[
    Callable[[str, str, random.Random], str], ...
] = (  # of a text before and after some place
    lambda before, after, rng: (
        before + chr(ord(after[0]) % 256 ^ 1 << rng.randrange(8)) + after[1:]
    ),
    lambda before, after, rng: before + after[rng.randint(1, 20) :],
    lambda before, after, rng: before + rng.choice(_MARKS) + after,
    lambda before, after, rng: before + rng.choice(_WORDS) + after,
    lambda before, after, rng: before + after[: rng.randint(1, 40)] + after,
    lambda before, after, rng: before[: -rng.randint(1, 40)] + after,
    lambda before, after, rng: before + after.replace(rng.choice(',"\n:'), "", 1),
    lambda before, after, rng: before + after[after.find("\n", rng.randint(0, 80)) :],
)


def poll_on_the_wire(driver: Family, replies: Mapping[str, str]) -> Any:
    """Rows of a poll whose replies come as bytes, through redaction and the framer.

    A command without a reply is an error; a reply without a final code expires.
    """
    return on_the_wire(driver, driver.poll(), replies)


def on_the_wire(driver: Family, dialogue: Dialogue[Any], replies: Mapping[str, str]) -> Any:
    framer, redactor = AtFramer(), Redactor()

    def answer(command: Command) -> Reply:
        framer.send(command.text, rows=driver.other_rows)
        redactor.send(command.text.encode())
        reply = replies.get(command.text, "ERROR").replace("\n", "\r\n")
        data = redactor.feed(f"\r\n{reply}\r\n".encode("latin-1"))
        found = [event for event in framer.feed(data) if isinstance(event, Reply)]
        return found[0] if found else framer.expire()

    return at.run_dialogue(dialogue, answer)
