"""The base class of all modem drivers: its modems, its commands, and how it reads replies."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

from logger.core.types import CellReading, Fix, Role, reportable
from logger.drivers.network_mode import ModeCommand
from logger.drivers.protocols.at import RESULTS_OF_CALLS, Command, Dialogue, Reply
from logger.drivers.reading.row_language import Row
from logger.drivers.reading.standard_replies import (
    COMMON_NAMES,
    drop_cut_values,
    names_of,
    standard_rows,
)

if TYPE_CHECKING:
    from logger.core.suspicion.rule import Need  # with numpy, which drivers do not need

AUTOBAUD_TRIES = 5
"""With AT+IPR=0 the first characters are lost while the modem finds the rate."""

QUIET = (Command("ATE0"), Command("ATV1"), Command("AT+CMEE=1"))
"""No echo, results in words, errors as numbers: lost at every restart."""

_RESTARTED = re.compile(
    r"RDY|QCRDY|START|\^SYSSTART.*|\+CFUN: ?1|\*ATREADY\b.*"
    r"|(?:UNDER|OVER)-VOLTAGE.*POWER DOWN|NORMAL POWER DOWN",
    re.IGNORECASE,
)

# redaction has masked what is in no form: a value of two characters or more, as `x` is unknown
_KNOWN_NUMBER = re.compile(
    r"(?<!\w)(?!(?:255|32768|65535|4294967295)\b)(?:0x)?[0-9A-F]*[1-9][0-9A-F]*(?!\w)"
    r"|[,:]\s*-?x[x.]+(?=\s*(?:,|\Z))",
    re.IGNORECASE,
)
_LEAST_OF_A_CELL = 5
"""Of an empty slot, or while the modem changes its cell, fewer numbers are known."""

_FLAGS = re.IGNORECASE | re.DOTALL

_OF_A_CELL: "frozenset[Need]" = frozenset(
    {"identity", "country code", "area code", "channel", "colour code", "level"}
)


def cells_with(*more: "Need", without: "Iterable[Need]" = ()) -> "frozenset[Need]":
    """What rules find in replies about cells: the usual, and `more`."""
    return (_OF_A_CELL | frozenset(more)) - frozenset(without)


@dataclass(frozen=True, slots=True)
class Claim:
    """Regular expressions searched in a modem's identity; an empty one claims nothing.

    The most specific claim wins, whatever the order of the drivers: `model` (one model by its
    name) before `series` (a group of models) before `maker`. Two claims of one rank on one answer
    are a mistake, which a test reports.
    """

    model: str = ""
    series: str = ""
    maker: str = ""

    def rank(self, identity: str) -> int:
        """How specific the claim is: 3 its model, 2 its series, 1 its maker, 0 none."""
        ascending = enumerate((self.maker, self.series, self.model), 1)
        ranks = [rank for rank, form in ascending if form and re.search(form, identity, _FLAGS)]
        return max(ranks, default=0)


class Family:
    """Driver of one family of modems, stateless: live ports and transcripts share it.

    A family declares the modems it serves (`claim`) and its commands; `rows_in` reads the lines of
    the replies. Numbers keep their text; `recognition` decides which of them are sure.

    No command transmits by choice, `mode_commands` apart, or asks for the subscriber's identity.
    """

    name: ClassVar[str]
    claim: ClassVar[Claim] = Claim()
    setup_commands: ClassVar[tuple[Command, ...]] = ()
    poll_commands: ClassVar[tuple[Command, ...]]
    survey_commands: ClassVar[tuple[Command, ...]] = ()
    """Full scans: each command takes long and is a scan of its own, with polls in between."""
    gnss_start_commands: ClassVar[tuple[Command, ...]] = ()
    gnss_poll_commands: ClassVar[tuple[Command, ...]] = ()
    """The modem's own receiver, used if configured."""
    # names of models that may receive satellites or cells, not both
    either_or: ClassVar[str] = "(?!)"
    mode_commands: ClassVar[tuple[ModeCommand, ...]] = ()
    """What restricts the modem to GSM, used if configured; a modem has one."""
    gives: "ClassVar[Mapping[str, frozenset[Need]]]" = MappingProxyType({})
    """What its replies have for the rules of suspicion, by technology."""
    unnamed_rows: ClassVar[Mapping[str, str]] = {}
    """Words of the rows without a name, by the name of their command.

    Redaction keeps these rows, and those named as one of the family's commands.
    """
    other_rows: ClassVar[str] = ""
    """Names of rows that are read although no command of the family has them."""
    rows_with_networks: ClassVar[str] = ""
    """Names of rows that contain names of networks, which are any words."""
    rows_in_columns: ClassVar[str] = ""
    """Names of rows in which words follow a number and a blank."""
    long_numbers: ClassVar[Mapping[str, str]] = {}
    """Patterns of numbers of more than nine digits, by the name of their row; others are masked."""
    padded_cells: ClassVar[Mapping[str, str]] = {}
    """Pattern of an unnamed row up to a cell of 9 digits; its group is the zero before."""

    @classmethod
    def sends(cls) -> Iterator[str]:
        """Texts of all commands."""
        for commands in (
            cls.setup_commands,
            cls.poll_commands,
            cls.survey_commands,
            cls.gnss_start_commands,
            cls.gnss_poll_commands,
        ):
            yield from (command.text for command in commands)
        yield from (mode.query for mode in cls.mode_commands)

    def setup(self) -> Dialogue[bool]:
        """Prepare the modem after power-up or a restart; False when a needed command is refused."""
        return (yield from prepare(self.setup_commands))

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Ask once for the cells received now; None without an answer (timeout, error)."""
        return (yield from self.ask(self.poll_commands))

    def survey(self, command: Command) -> Dialogue[tuple[Row, ...] | None]:
        """Send one command of the full scan; None when there was no answer."""
        return (yield from self.ask([command]))

    def ask(self, commands: Iterable[Command]) -> Dialogue[tuple[Row, ...] | None]:
        """Rows of the replies to some commands, read together; None without any answer.

        Lines before a time-out count as well: a cut row is not read.
        """
        lines: list[str] = []
        answered = False
        for command in commands:
            reply = yield command
            answered |= reply.ok
            lines += [command.text, *reply.marked_lines, *filter(None, [reply.final])]
        rows = self.read(lines)
        return rows if answered or any(isinstance(row, CellReading | Fix) for row in rows) else None

    def read(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """All rows in lines of replies or of a transcript; other lines are skipped.

        A line with a command shows what the lines after it answer. A row that another message
        interrupts loses its last value.
        """
        lines = drop_cut_values(lines, self._names())
        rows = (*self.rows_in(lines), *standard_rows(lines))
        return tuple(reportable(row) if isinstance(row, CellReading) else row for row in rows)

    def is_cut(self, reply: Reply) -> bool:
        """Whether something else in a reply has taken a part of a row."""
        is_torn = reply.is_torn and names_of(reply.command).isdisjoint(self.unnamed_rows)
        is_shortened = drop_cut_values(reply.marked_lines, self._names()) != list(reply.lines)
        return is_torn or is_shortened or reply.final in RESULTS_OF_CALLS

    def unread(self, replies: Iterable[Reply]) -> str | None:
        """The command of a row with numbers that is not read."""
        own = _own(replies)
        lines = [line for reply in own for line in (reply.command, *reply.lines)]
        rows = self.rows_in(lines)
        for reply in own:
            for row in reply.lines:
                if len(_KNOWN_NUMBER.findall(row)) < _LEAST_OF_A_CELL:
                    continue
                # some rows are read only beside others, as under a heading
                others = [line for line in lines if line is not row]
                if not self.rows_in([reply.command, row]) and self.rows_in(others) == rows:
                    return reply.command
        return None

    def is_foreign(self, replies: Sequence[Reply]) -> bool:
        """True where the modem refuses all commands of the family."""
        # one that had the standard ones too has no more to ask for
        own = _own(replies)
        asked = names_of(" ".join(reply.command for reply in replies))
        return bool(own) and all(one.is_refusal for one in own) and not asked >= COMMON_NAMES

    @classmethod
    def _names(cls) -> frozenset[str]:
        commands = (
            *cls.setup_commands,
            *cls.poll_commands,
            *cls.survey_commands,
            *cls.gnss_poll_commands,
        )
        return names_of(" ".join((*(command.text for command in commands), cls.other_rows)))

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Rows in the forms of this family."""
        raise NotImplementedError

    def role_of(self, line: str) -> Role | None:
        """Role of the cells in a line, also of an unsolicited one; "serving" before others."""
        roles = [row.role for row in self.rows_in([line]) if isinstance(row, CellReading)]
        return "serving" if "serving" in roles else next(iter(roles), None)

    def is_restart(self, line: str) -> bool:
        """True for a line that reports a restart, which loses the set-up."""
        return _RESTARTED.fullmatch(line.strip()) is not None


def _own(replies: Iterable[Reply]) -> list[Reply]:
    return [reply for reply in replies if names_of(reply.command) - COMMON_NAMES]


def wake() -> Dialogue[bool]:
    """True once a modem answers `AT`, by which it also finds the rate."""
    for _ in range(AUTOBAUD_TRIES):
        reply = yield Command("AT", timeout_s=1.0)
        if reply.ok:
            return True
    return False


def prepare(commands: Iterable[Command]) -> Dialogue[bool]:
    """Wake the modem, make it quiet and set it up; False when it refuses a needed command."""
    if not (yield from wake()):
        return False
    accepted = True
    for command in (*QUIET, *commands):
        reply = yield command
        accepted &= reply.ok or not command.needed
    return accepted
