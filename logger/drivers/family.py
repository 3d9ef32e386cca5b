"""What all families of modems have in common: a driver is one family's commands and the reading of
its replies.
"""

import re
from collections.abc import Iterable, Sequence
from typing import ClassVar

from logger.core.types import CellReading, Role
from logger.drivers.network_mode import ModeCommand
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading import standard_replies
from logger.drivers.reading.fields import reportable
from logger.drivers.reading.interruption import names_of, uncut
from logger.drivers.reading.rows import Row

AUTOBAUD_TRIES = 5
"""With AT+IPR=0 the first characters after power-up are lost while the modem finds the rate."""

QUIET = (Command("ATE0"), Command("ATV1"), Command("AT+CMEE=1"))
"""No echo, results in words, errors as numbers: lost at every restart."""

_RESTARTED = re.compile(
    r"RDY|QCRDY|START|\^SYSSTART|\+CFUN: ?1|\*ATREADY\b.*|(?:UNDER|OVER)-VOLTAGE.*POWER DOWN|NORMAL POWER DOWN",
    re.IGNORECASE,
)


class Family:
    """Driver of one family, stateless: one instance serves a live port, a transcript and the
    simulator alike.

    `read` gives numbers as they were printed; what the modem's earlier replies show of them is
    judged in `recognition`.

    Nothing here transmits by choice, `modes` apart, or asks who the subscriber is. A family says
    which modems are its own (`identifies`, searched in what ATI, AT+CGMI and AT+CGMM answer), what
    prepares them, what asks for the cells heard now and what for all there are; and it reads the
    lines (`rows_in`).
    """

    name: ClassVar[str]
    identifies: ClassVar[re.Pattern[str]]
    setup_commands: ClassVar[tuple[Command, ...]] = ()
    poll_commands: ClassVar[tuple[Command, ...]]
    survey_commands: ClassVar[tuple[Command, ...]] = ()
    """Full scans: each command takes long and is a scan of its own, with polls in between."""
    gnss_start_commands: ClassVar[tuple[Command, ...]] = ()
    gnss_poll_commands: ClassVar[tuple[Command, ...]] = ()
    """The modem's own receiver, used where the configuration says so."""
    mode_commands: ClassVar[tuple[ModeCommand, ...]] = ()
    """How it is made to hear GSM only, where the configuration says so; a modem knows one of
    them.
    """

    def setup(self) -> Dialogue[bool]:
        """Prepare the modem after power-up or a restart; False when it did not accept what polling
        needs.
        """
        return (yield from prepared(self.setup_commands))

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Ask once for the cells heard now; None when the answer was no answer (timeout, error,
        mode lost).
        """
        return (yield from self.ask(self.poll_commands))

    def survey(self, command: Command) -> Dialogue[tuple[Row, ...] | None]:
        """Put one command of the full scan; None when there was no answer."""
        return (yield from self.ask([command]))

    def ask(self, commands: Iterable[Command]) -> Dialogue[tuple[Row, ...] | None]:
        """Rows of the replies to some commands, read together; None when there was no answer to
        any.

        Lines that came before a time-out are as good as others: what is cut is not read as a row.
        """
        lines: list[str] = []
        answered = False
        for command in commands:
            reply = yield command
            answered |= reply.ok
            lines += [command.text, *reply.marked_lines, *filter(None, [reply.final])]
        rows = self.read(lines)
        return rows if answered or any(isinstance(row, CellReading) for row in rows) else None

    def read(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """All rows in lines of replies or of a whole transcript; lines of other kinds are passed
        over.

        A line with a command says what the following lines answer. A row that something else has
        interrupted loses its last value, which may be cut.
        """
        whole = uncut(lines, self._names())
        rows = (*self.rows_in(whole), *standard_replies.read(whole))
        return tuple(reportable(row) if isinstance(row, CellReading) else row for row in rows)

    @classmethod
    def _names(cls) -> frozenset[str]:
        commands = (
            *cls.setup_commands,
            *cls.poll_commands,
            *cls.survey_commands,
            *cls.gnss_poll_commands,
        )
        return names_of(" ".join(command.text for command in commands))

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Rows in the forms of this family."""
        raise NotImplementedError

    def role_of(self, line: str) -> Role | None:
        """Role of the cells that a line describes, also when it comes unasked; where "serving" is
        among them, that.
        """
        roles = [row.role for row in self.rows_in([line]) if isinstance(row, CellReading)]
        return "serving" if "serving" in roles else next(iter(roles), None)

    def is_restart(self, line: str) -> bool:
        """True for a line that means the modem has restarted and lost its set-up."""
        return _RESTARTED.fullmatch(line.strip()) is not None


def wake() -> Dialogue[bool]:
    """Find a modem at the other end, and its rate."""
    for _ in range(AUTOBAUD_TRIES):
        reply = yield Command("AT", timeout_s=1.0)
        if reply.ok:
            return True
    return False


def prepared(commands: Iterable[Command]) -> Dialogue[bool]:
    """Wake the modem, make it quiet and set it up; False when it refuses a command that is
    needed.
    """
    if not (yield from wake()):
        return False
    accepted = True
    for command in (*QUIET, *commands):
        reply = yield command
        accepted &= reply.ok or not command.needed
    return accepted
