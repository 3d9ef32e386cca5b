"""Redaction of personal numbers and messages, before anything is recorded or read.

Nothing here asks for IMSI, IMEI, SIM or telephone numbers or for messages, but modems volunteer
them (ATI of a SIM5360 prints the IMEI, +CLIP the caller, +CMT a message). `patterns` has their
forms. Every port is redacted, since a modem may be behind any of them; GNSS receivers print none of
these forms.
"""

import re
from typing import Literal

from logger.drivers.privacy.patterns import (
    LISTED,
    MESSAGES,
    OF_DEVICE,
    RESULT,
    ROW,
    UNDER_WAY,
    is_private,
    mask_text,
    name_of,
    redact_line,
)

_LONGEST = 2048
"""Bytes of a line that are looked at together; noise may have no line end at all."""
_CONTEXT = 256
"""Bytes that remain of a longer one: more than any number has."""
_LONGEST_TEXT = 700
"""A message has 160 characters, or in hexadecimal 350 digits; a line under way in one is held back
so long.
"""
_END = re.compile(rb"\r\n|\r|\n")

_Text = Literal["", "message", "listed", "quoted"]


class Redactor:
    """Bytes of a device in; the same out with an x for each private digit or letter.

    What may be the beginning of something private is held back until its end has come.
    """

    def __init__(self) -> None:
        self._line = b""  # the line under way, with a carriage return that a line feed may follow
        self._n_passed = 0  # bytes of it that have been given out
        self._private = False  # it is private to its end, by a beginning that has been dropped
        self._text: _Text = ""  # lines that come are the text of a message
        self._begun = False  # of which one has come

    def feed(self, data: bytes) -> bytes:
        """Redacted bytes that are decided by now."""
        out = bytearray()
        data = self._line + data
        start = 0
        for end in _END.finditer(data):
            if end[0] == b"\r" and end.end() == len(data):
                break
            out += self._finish_line(data[start : end.start()], end[0])
            start = end.end()
        self._line = data[start:]
        out += self._under_way()
        return bytes(out)

    def flush(self) -> bytes:
        """The bytes held back, at the end of a connection."""
        rest = self._redact(self._line)[self._n_passed :]
        self._line, self._n_passed, self._private, self._text = b"", 0, False, ""
        return rest

    def _finish_line(self, line: bytes, end: bytes) -> bytes:
        """What is still to be passed on of a line that is over."""
        rest = (self._redact(line) + end)[self._n_passed :]
        self._n_passed, self._private = 0, False
        self._follow(line)
        return rest

    def _under_way(self) -> bytes:
        """What may already be passed on of an unfinished line."""
        line = self._line
        if self._text and not RESULT.match(line):
            end = len(line) if len(line) > _LONGEST_TEXT else self._n_passed
        else:
            held = UNDER_WAY.search(line)
            end = max(held.start() if held else len(line), self._n_passed)
        out = self._redact(line)[self._n_passed : end]
        self._n_passed = end
        if len(line) > _LONGEST:
            cut = min(len(line) - _CONTEXT, end)
            self._private |= is_private(line)
            self._line, self._n_passed = line[cut:], end - cut
        return out

    def _redact(self, line: bytes) -> bytes:
        return mask_text(line) if self._private or self._is_text(line) else redact_line(line)

    def _is_text(self, line: bytes) -> bool:
        """True for a line of a message; a row of a table ends the message."""
        if not self._text or OF_DEVICE.match(line):
            return False
        return not (self._text == "message" and self._begun and ROW.match(line))

    def _follow(self, line: bytes) -> None:
        """Update the state by a line, for the lines that follow it."""
        if not self._text or OF_DEVICE.match(line):
            name = name_of(line)
            self._text = "message" if name in MESSAGES else "listed" if name in LISTED else ""
            self._begun = False
            if not self._text and name and line.count(b'"') % 2:
                self._text = "quoted"
        elif not line.strip():
            if self._text == "message" and self._begun:
                self._text = ""
        elif self._text == "quoted" and b'"' in line:
            self._text = ""
        else:
            self._begun = True


def redact(data: bytes) -> bytes:
    """The same bytes with an x for each private digit or letter."""
    redactor = Redactor()
    return redactor.feed(data) + redactor.flush()
