"""A conversation with a modem, without any I/O.

A driver yields `Command`s and is sent `Reply`s; whoever drives the generator owns the port. A
timeout is a Reply with `final` None, so a driver treats it as data.
"""

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TypeVar

INTERRUPTION = "\x18"
"""Marks where a row may have been cut; CAN, which no framer passes on."""


@dataclass(frozen=True, slots=True)
class Command:
    """One AT command line, without its carriage return.

    A modem that refuses a `needed` one cannot be polled. `silence_s` is the documented time for
    which a full scan may be silent, infinite where no manual gives one.

    `silence_s` is how long a full scan may be silent by what is documented, infinite where nothing
    is.
    """

    text: str
    timeout_s: float = 2.0
    needed: bool = False
    silence_s: float = math.inf


@dataclass(frozen=True, slots=True)
class Reply:
    """The lines between a command and its final result code, None after a time-out.

    `interrupted` are the numbers of the lines after which the modem printed something else.
    """

    command: str
    lines: tuple[str, ...]
    final: str | None
    interrupted: frozenset[int] = frozenset()

    @property
    def ok(self) -> bool:
        return self.final == "OK"

    @property
    def marked_lines(self) -> tuple[str, ...]:
        """The lines, with `INTERRUPTION` where one may have lost its end."""
        lines: list[str] = []
        for number, line in enumerate(self.lines):
            lines += [line, INTERRUPTION] if number in self.interrupted else [line]
        return tuple(lines)


T = TypeVar("T")
Dialogue = Generator[Command, Reply, T]


def run_dialogue(dialogue: Dialogue[T], ask: Callable[[Command], Reply]) -> T:
    """Result of a dialogue whose commands are sent with `ask`."""
    try:
        command = next(dialogue)
        while True:
            command = dialogue.send(ask(command))
    except StopIteration as done:
        result: T = done.value
        return result
