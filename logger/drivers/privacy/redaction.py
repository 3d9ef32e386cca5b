"""Redaction of everything that may be personal, before anything is recorded or read.

Nothing here asks for IMSI, IMEI, SIM or telephone numbers or for messages, but modems volunteer
them (ATI of a Sierra prints a serial number, +CLIP the caller, +CMT a message), each maker in forms
of its own. So a line passes only where its form is known (`rows`, `receivers`) or where it answers
a command that was sent (`rows`, `identity`); of all other lines the length and the name remain.
Every port is redacted alike, since a modem may be behind any of them.
"""

import re
from collections import deque

from logger.drivers.privacy import identity, receivers, rows
from logger.drivers.privacy.patterns import mask_noise, mask_text

_LONGEST = 4096
"""Bytes of a line that are held back for its end; noise may have no line end at all."""
_LONGEST_REPORT = 16_384
"""The same for gpsd."""
_LATE_COMMANDS = 8
"""A row without a name may be the late answer to one of so many commands."""
_DOUBTFUL_COMMANDS = 2
"""After an unknown report, plain words may be its text until so many commands were sent."""

_END = re.compile(rb"[\r\n]")
_AROUND = bytes(sorted({*range(256)} - {*range(0x21, 0x7F)}))
_PLAIN = re.compile(
    rb"OK|ERROR|NO|NO CARRIER|BUSY|NO ANSWER|NO DIALTONE|CONNECT|[0-9]{1,2}|>"
    rb"|Q?RDY|QCRDY|START|RING|(?:Call|SMS) Ready|(?:SMS|PB) DONE|DST: [0-9]|NORMAL POWER DOWN"
    rb"|(?:UNDER|OVER)-VOLTAGE(?: WARN+ING| WARNNING)?(?: POWER DOWN)?|\^SYSSTART[A-Z ]{0,24}"
    rb"|AT(?:I[0-9]?|[EV][01]|&F)?",
    re.IGNORECASE,
)
"""Results, reports of a start, and commands: lines of fixed words, and numbers of two digits."""
_DIAL = re.compile(rb"[ \t]*ATD", re.IGNORECASE)
_CAPITALS = re.compile(rb"[ \t]*[A-Z][A-Z_]{1,15}(?: SV)?(?=[ ]?[:=])")
"""The name of an unknown line (NMBR = 5551234)."""
_OF_MESSAGE = re.compile(rb"C(?:MT|MG|DS|BM)(?![ISW])|HCM|SMG|MSG|SMS", re.IGNORECASE)
"""In the names of results behind which a line of text comes."""


class Redactor:
    """Bytes of a device in, the same number out.

    An x stands for each letter and digit that may be personal. A line is held back until its end
    has come.
    """

    def __init__(self) -> None:
        self._line = b""
        self._is_masked = False  # the line's beginning was too long, and its rest is masked
        self._asks_identity = False
        self._sent: deque[bytes] = deque(maxlen=_LATE_COMMANDS)
        self._answered: frozenset[bytes] = frozenset()  # the commands whose rows have no name
        self._n_doubtful = 0  # commands to be sent until plain words are no text of a report
        self._text = ""  # "next": the next line is the text of a message, "rest": the others are

    @property
    def is_within_line(self) -> bool:
        """Whether a line has begun whose end has not come."""
        return self._line != b"" or self._is_masked

    def send(self, data: bytes) -> None:
        """Note a command: what comes may answer it."""
        command = data.strip().upper()
        if command == b"AT":
            return  # asked meanwhile, for a sign of life
        self._sent.append(command)
        names = (match["command"] for sent in self._sent for match in rows.SEGMENT.finditer(sent))
        self._answered = rows.commands_with_rows(names)
        self._asks_identity = command in identity.COMMANDS
        self._n_doubtful = max(self._n_doubtful - 1, 0)

    def feed(self, data: bytes) -> bytes:
        """Redacted bytes of the lines that are over."""
        out: list[bytes] = []
        start = 0
        for end in _END.finditer(data):
            line = self._line + data[start : end.start()]
            out += [mask_text(line) if self._is_masked else self._redact(line), end[0]]
            self._line, self._is_masked = b"", False
            start = end.end()
        self._line += data[start:]
        longest = _LONGEST_REPORT if receivers.REPORT.match(self._line) else _LONGEST
        if len(self._line) > longest or self._is_masked:
            out.append(mask_text(self._line))
            self._line, self._is_masked = b"", True
        return b"".join(out)

    def flush(self) -> bytes:
        """The line held back, at the end of a connection."""
        rest = mask_text(self._line) if self._is_masked else self._redact(self._line)
        self._line, self._is_masked, self._text = b"", False, ""
        return rest

    def _redact(self, line: bytes) -> bytes:
        if not line:
            return line
        if b"$" in line and receivers.SENTENCE.search(line):
            out, end = [], 0
            for found in receivers.SENTENCE.finditer(line):
                out += [self._redact(line[end : found.start()]), receivers.sentence(found[0])]
                end = found.end()
            return b"".join(out) + self._redact(line[end:])
        if receivers.REPORT.match(line):
            return receivers.report(line)
        if line.strip(_AROUND).upper() in self._sent:
            return line
        segments = list(rows.SEGMENT.finditer(line))
        if not segments:
            return self._line_without_name(line)
        head = line[: segments[0].start()]
        out = [self._line_without_name(head) if head.strip(_AROUND) else head]
        ends = [*(segment.start() for segment in segments[1:]), len(line)]
        for segment, end in zip(segments, ends, strict=True):
            out += [segment[0], self._row_or_command(segment, line[segment.end() : end])]
        return b"".join(out)

    def _row_or_command(self, segment: re.Match[bytes], body: bytes) -> bytes:
        if segment["command"]:
            return rows.command(segment["command"].upper(), body)
        name = segment["row"].upper()
        if rows.is_row(name):
            self._text = ""
            return rows.row(name, body)
        if self._asks_identity and name in identity.NAMES:
            return identity.words_of_model(body, is_sure=True) or mask_text(body)
        self._n_doubtful = _DOUBTFUL_COMMANDS
        if _OF_MESSAGE.search(name) or body.count(b'"') % 2:
            self._text = "next"
        return mask_text(body)

    def _line_without_name(self, line: bytes) -> bytes:
        plain = line.strip(_AROUND)
        if not plain:
            return mask_text(line)
        is_text, self._text = self._text == "next", "rest" if self._text else ""
        if _PLAIN.fullmatch(plain):
            return mask_noise(line)
        dial = _DIAL.match(line)
        if dial:
            return dial[0] + mask_text(line[dial.end() :])
        kept = None if is_text else self._answer(line)
        if kept is not None:
            return kept
        label = None if self._text or self._n_doubtful else _CAPITALS.match(line)
        self._n_doubtful = self._n_doubtful if label else _DOUBTFUL_COMMANDS
        end = label.end() if label else 0
        return line[:end] + mask_text(line[end:])

    def _answer(self, line: bytes) -> bytes | None:
        """A line that answers a command that was sent; None if it is none."""
        kept = rows.row_without_name(line, self._answered) if self._answered else None
        if kept is None and self._asks_identity:
            is_sure = not (self._n_doubtful or self._text)
            kept = identity.words_of_model(line, is_sure=is_sure)
        return kept


def redact(data: bytes, *commands: str) -> bytes:
    """What a device has sent after some commands, at once."""
    redactor = Redactor()
    for command in commands:
        redactor.send(command.encode())
    return redactor.feed(data) + redactor.flush()
