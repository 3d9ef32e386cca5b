"""The AT command line (ITU-T V.250, 3GPP TS 27.007): bytes in, replies and URCs out.

`AtFramer` never raises, keeps at most one line and one reply, and gives the same events however the
bytes are cut.

A reply has no number, so an answer that comes after its time-out looks like the answer to the next
command. Rules:

1. A line begun before a command was written does not belong to its reply.
2. A final code while nothing is pending is `Unsolicited`; it ends the expired command.
3. While a command is pending and an older one still owes its final code, that code belongs to the
   older one if lines of the older one have come and none of the new one, or if it is a bare OK
   where the new command asks for lines. It becomes `Unsolicited`; the new command stays pending.
4. If the new command then expires, rule 3 was wrong (the old answer is lost) and is not applied
   again.
"""

import math
import re
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from typing import TypeVar

from logger.drivers.protocols.line_noise import Garbage, goes_on, pieces, sentences, without

# A driver yields Commands and is sent each Reply; whoever drives the generator owns the port. A
# timeout is a Reply with final None, so a driver treats it as data.

INTERRUPTION = "\x18"
"""Marks where a row may have been cut; CAN, which no framer passes on."""


@dataclass(frozen=True, slots=True)
class Command:
    """One AT command line, without its carriage return.

    A modem that refuses a `needed` one cannot be polled. `silence_s` is the documented time for
    which a full scan may be silent, infinite where no manual gives one.
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
    def is_refusal(self) -> bool:
        """True for an error."""
        # a caller who hangs up is none
        return self.final not in {None, "OK", *RESULTS_OF_CALLS}

    @property
    def refusal(self) -> str:
        """The command, and why the modem refused it."""
        why = _SIM_ERRORS.get((self.final or "").removeprefix("+CME ERROR: "), "")
        return f"{self.command}: {self.final}{why}"

    @property
    def marked_lines(self) -> tuple[str, ...]:
        """The lines, with `INTERRUPTION` where one may have lost its end."""
        lines: list[str] = []
        for number, line in enumerate(self.lines):
            lines += [line, INTERRUPTION] if number in self.interrupted else [line]
        if self.final in RESULTS_OF_CALLS:
            lines.append(INTERRUPTION)
        return tuple(lines)

    @property
    def is_torn(self) -> bool:
        """True where a line without a name follows one that has a name."""
        named = [_PREFIX.match(line) is not None for line in self.lines]
        return named != sorted(named)


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


MAX_LINE = 4096  # bytes; the longest real line, a COPS scan of a big city, has less than half of it
MAX_LINES = 1000  # lines of one reply; what comes beyond is passed on as unsolicited

_LINE_END = re.compile(rb"[\r\n]")
_ECHO = re.compile(rb"\Z|[ \t]*AT", re.IGNORECASE)
_NAME = re.compile(r"[+*^#!$%][A-Z][A-Z0-9]*")
_PREFIX = re.compile(rf"\s*({_NAME.pattern})\s?:")
# no command here makes a call, but a caller who hangs up leaves one of them
RESULTS_OF_CALLS = frozenset({"NO CARRIER", "BUSY", "NO ANSWER", "NO DIALTONE"})
# Huawei's words for a command that it lacks, and V.250's for one that a byte on the line has ended
REFUSALS = frozenset({"COMMAND NOT SUPPORT", "TOO MANY PARAMETERS", "ABORTED"})
_CODES = RESULTS_OF_CALLS | {"OK", "ERROR"}
_ERROR = re.compile(r"\+CM[ES] ERROR\b.*")
_SIM_ERRORS = {"10": " (no SIM)", "11": " (SIM PIN)", "12": " (SIM PUK)", "13": " (SIM failure)"}
# 3GPP TS 27.007 9.2.1
# Result codes after ATV0. 2 is RING, which ends no reply.
_ASKS_FOR_WORDS = re.compile(r"AT(?:I\d?|\+C?GM[IMR])", re.IGNORECASE)  # and for no cell
_NUMERIC = {"0": "OK", "1": "CONNECT", "3": "NO CARRIER", "4": "ERROR"}
_NAMED = re.compile(r"\s*([+*^#!$%][A-Za-z][A-Za-z0-9]*)")
_UNASKED = re.compile(
    r"RDY|QCRDY|START|RING|Call Ready|SMS Ready|SMS DONE|PB DONE|NORMAL POWER DOWN"
    r"|(?:UNDER|OVER)-VOLTAGE.*|DST: .*|\^SYSSTART.*"
)


@dataclass(frozen=True, slots=True)
class Unsolicited:
    """A line that answers no pending command; `is_late` if it may answer the expired one."""

    line: str
    is_late: bool = field(default=False, compare=False)


AtEvent = Reply | Unsolicited | Garbage


class AtFramer:
    """Bytes of one modem to events; `send` sets which command the coming lines answer."""

    def __init__(self) -> None:
        self._buffer = b""  # the line under way
        self._after_lf = False  # the line before it ended with LF, as those of this modem do
        self._torn = b""  # a line whose rest comes after a receiver's sentence and its line end
        self._torn_blanks = 0
        self._overlong = False  # the beginning of that line has already been given up
        self._stale = False  # that line began before the pending command was written
        self._blanks = 0  # empty lines just before it
        self._verbose = False  # a final code in words has come, so the modem prints no numeric ones
        self._command: str | None = None
        self._names: frozenset[str] = frozenset()  # prefixes of its answers
        self._lines: list[str] = []
        self._interrupted: set[int] = set()  # numbers of lines after which something else came
        # prefixes of the expired command that owes a final code
        self._expired: frozenset[str] | None = None
        self._expired_answered = False  # lines of that command have come late
        self._final_reassigned = False  # rule 3 has been applied while this command was pending
        self.echo_seen = False
        """True where the last command was echoed, which shows a restart after ATE0."""

    @property
    def n_lines(self) -> int:
        """Lines of the reply to the pending command that have come."""
        return len(self._lines)

    @property
    def late_final_due(self) -> bool:
        """True while an expired command still owes its final code."""
        return self._expired is not None

    def send(self, command: str, *, is_within_line: bool = False, rows: str = "") -> None:
        """Note that `command` was written; a command that is still pending is forgotten.

        `is_within_line`: a line has begun of which no byte has come here. `rows`: names that any
        answer may have.
        """
        self._command = command.strip()
        self._names = _names(f"{command} {rows}")
        self._lines = []
        self._interrupted = set()
        self._stale = is_within_line or bool(self._buffer or self._torn)
        self._final_reassigned = False
        self.echo_seen = False

    def feed(self, data: bytes) -> Iterator[AtEvent]:
        """Events completed by `data`, all of which is consumed at the call."""
        data, begin, events = self._buffer + data, 0, list[AtEvent]()
        while (end := self._line_end(data, begin)) >= 0:
            events += self._whole_events(data[begin:end])
            self._after_lf = data[end : end + 1] == b"\n"
            begin = end + 1
        self._buffer = data[begin:]
        while len(self._buffer) > MAX_LINE:
            events.append(Garbage(self._buffer[:MAX_LINE]))
            self._buffer = self._buffer[MAX_LINE:]
            self._overlong = True
        return iter(events)

    def _line_end(self, data: bytes, begin: int) -> int:
        """Where the line from `begin` ends, -1 if that is not known yet."""
        # Where lines end with LF, a CR alone ends echoes and numeric results (V.250). Any other
        # that the rest of a row follows is a damaged byte of it: a row with a CR in it is no text.
        end = _LINE_END.search(data, begin)
        if end is None or end[0] == b"\n" or not self._after_lf:
            return end.start() if end else -1
        line = data[begin : end.start()]
        if _ECHO.match(line) or self._final(line.decode("latin-1")) is not None:
            return end.start()
        after = _LINE_END.search(data, end.end())
        if after is None:
            return -1
        rest = data[end.end() : after.start()]
        return after.start() if rest and goes_on(rest) else end.start()

    def flush(self) -> Iterator[AtEvent]:
        """Events of the incomplete last line, at the end of a transcript."""
        return self.feed(b"\n\n\n") if self._buffer or self._torn else iter(())

    def expire(self) -> Reply:
        """Close the pending command by time-out, with the lines that came."""
        self._expired = None if self._final_reassigned else self._names
        self._expired_answered = False
        return self._close(None)

    def abandon(self) -> Reply:
        """Close the pending command, whose answer will never come since the modem has restarted."""
        self._expired = None
        return self._close(None)

    def _whole_events(self, raw: bytes) -> Iterator[AtEvent]:
        # joined again around a receiver's sentence and its line end
        spans = sentences(raw)
        if self._torn and not raw:
            self._torn_blanks += 1
            if self._torn_blanks > 1:  # the first is between CR and LF of the sentence
                yield from self._end_of_torn(is_cut=False)
                yield from self._line_events(raw)
            return
        if spans and not self._torn and not spans[0][0] and goes_on(without(raw, spans)):
            yield from self._line_events(raw)  # the sentence may have torn any line before it
            return
        begin = 0
        for span in spans:
            part, begin = raw[begin : span[0]], span[1]
            if not goes_on(part) or len(self._torn) > MAX_LINE:
                yield from self._end_of_torn(is_cut=True)
            self._torn += part
            sentence = raw[slice(*span)].decode("ascii")
            event = Unsolicited(sentence) if self._torn else self._line_event(sentence)
            if event is not None:
                yield event
        self._torn_blanks = 0
        rest = raw[begin:]
        if not goes_on(rest):
            yield from self._end_of_torn(is_cut=True)
        if rest or not spans:
            line, self._torn = self._torn + rest, b""
            yield from self._line_events(line)

    def _end_of_torn(self, *, is_cut: bool) -> Iterator[AtEvent]:
        n_lines, torn, self._torn = len(self._lines), self._torn, b""
        if torn:
            yield from self._line_events(torn)
        if is_cut and len(self._lines) > n_lines:
            self._interrupted.add(len(self._lines) - 1)

    def _line_events(self, raw: bytes) -> Iterator[AtEvent]:
        if self._overlong or len(raw) > MAX_LINE:
            self._overlong = self._stale = False
            self._blanks = 0
            for start in range(0, len(raw), MAX_LINE):
                yield Garbage(raw[start : start + MAX_LINE])
            return
        if not raw.strip(b" \t"):
            self._blanks += 1
            self._stale = False
            return
        n_lines = len(self._lines)
        for piece in pieces(raw, words=_ASKS_FOR_WORDS.fullmatch(self._command or "") is not None):
            if piece.is_text:
                event = self._line_event(piece.data.decode("latin-1").rstrip(" \t"))
            else:
                event = Garbage(piece.data)
                if (
                    len(self._lines) > n_lines
                ):  # after a row of the same line, whose end it may have been
                    self._interrupted.add(len(self._lines) - 1)
            if event is not None:
                yield event
        self._blanks = 0
        self._stale = False

    def _line_event(self, line: str) -> AtEvent | None:
        final = self._final(line)
        if self._command is None or self._stale:
            late = self._is_late(line)
            if final is not None:
                self._expired = None
            return Unsolicited(line, late)
        if line.strip().casefold() == self._command.casefold():
            self.echo_seen = True
            return None  # the echo, which may come twice or in lower case
        if final is not None:
            return self._final_event(line, final)
        belongs = self._belongs(line)
        if not belongs:
            self._interrupted.add(len(self._lines) - 1)
        if not belongs or len(self._lines) >= MAX_LINES:
            return Unsolicited(line, self._is_late(line))
        self._lines.append(line)
        return None

    def _final(self, line: str) -> str | None:
        """Numeric codes become words."""
        text = line.strip()
        text = "ERROR" if text in REFUSALS else text
        if text in _CODES or _ERROR.fullmatch(text):
            self._verbose = True
            return text
        # A result in words stands between line ends, so a line "0" in such a reply has two blanks
        # before it; a numeric result follows the line end of the echo or of the text directly.
        return None if self._verbose or self._blanks > 1 else _NUMERIC.get(text)

    def _final_event(self, line: str, final: str) -> AtEvent:
        if self._expired is None:
            return self._close(final)
        bare = not self._lines
        if bare and (self._expired_answered or (final == "OK" and _asks(self._command or ""))):
            self._expired = None
            self._final_reassigned = True
            return Unsolicited(line)
        if not bare and self._names != self._expired:
            self._expired = None  # the modem answers this command, so it has done with the old one
        return self._close(final)

    def _belongs(self, line: str) -> bool:
        name = _NAMED.match(line)
        if name:
            return name[1].upper() in self._names
        return not _UNASKED.fullmatch(line.strip())

    def _is_late(self, line: str) -> bool:
        """True for a line that may answer the expired command; its name proves that it does."""
        prefix = _PREFIX.match(line)
        if prefix and self._expired and prefix[1] in self._expired:
            self._expired_answered = True
        return self._expired is not None and (prefix is None or prefix[1] in self._expired)

    def _close(self, final: str | None) -> Reply:
        interrupted = frozenset(self._interrupted - {-1})
        reply = Reply(self._command or "", tuple(self._lines), final, interrupted)
        self._command = None
        self._lines = []
        self._interrupted = set()
        return reply


def _names(command: str) -> frozenset[str]:
    """`AT+CPIN?;+CSQ` has +CPIN and +CSQ."""
    return frozenset(_NAME.findall(command.upper()))


def _asks(command: str) -> bool:
    """True for a read, test or action command, which answers with lines before its OK."""
    return command.endswith("?") or ("=" not in command and bool(_names(command)))
