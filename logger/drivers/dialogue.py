"""The shape of a conversation with a modem, without any I/O.

A driver yields `Command`s and is sent `Reply`s; whoever drives the generator owns the port. A timeout is a Reply with
`final` None, so a driver treats it as data.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeVar

from logger.core.types import CellReading


@dataclass(frozen=True, slots=True)
class Command:
    """One AT command line, without its carriage return."""

    text: str
    timeout_s: float = 2.0


@dataclass(frozen=True, slots=True)
class Reply:
    """The lines between a command and its final result code; `final` is None when none came in time."""

    command: str
    lines: tuple[str, ...]
    final: str | None

    @property
    def ok(self) -> bool:
        return self.final == "OK"


T = TypeVar("T")
Dialogue = Generator[Command, Reply, T]


class ModemDriver(Protocol):
    """What one family of modems needs: how to set it up, how to ask it, how to read it.

    Stateless, so that one instance can serve a live port, a transcript and the simulator alike.
    """

    name: ClassVar[str]

    def setup(self) -> Dialogue[bool]:
        """Prepare the modem after power-up or a restart; False when it did not accept what polling needs."""
        ...

    def poll(self) -> Dialogue[tuple[CellReading, ...] | None]:
        """Ask once for the cells heard now; None when the answer was no answer (timeout, error, mode lost)."""
        ...

    def read_lines(self, lines: Sequence[str]) -> tuple[CellReading, ...]:
        """Readings in lines of a reply or of a whole transcript; lines of other kinds are passed over."""
        ...

    def is_row(self, line: str) -> bool:
        """True for a line that describes a cell, also when it comes unasked."""
        ...

    def opens_block(self, line: str) -> bool:
        """True for the row that begins a new block of unasked rows."""
        ...

    def says_restarted(self, line: str) -> bool:
        """True for a line that means the modem has restarted and lost its set-up."""
        ...
