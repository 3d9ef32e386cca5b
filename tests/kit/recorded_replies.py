"""Recorded data behind a pty: an NMEA log, or a modem that gives recorded replies."""

import threading
from collections.abc import Sequence
from typing import Literal

from logger.sim.devices import AtTerminal, frame_text
from logger.sim.ptys import PAUSE_S, PtyLine

CHUNK = 1024
FINAL_CODES = (b"OK", b"ERROR")
FINAL_BEGINNINGS = (b"+CME ERROR:", b"+CMS ERROR:")


class NmeaPlayer:
    """Session of a receiver that plays `data` once, in bytes per second or at full speed.

    `finished` is set when the last byte is in the hands of the system; the reader may have some of
    them before itself.
    """

    def __init__(self, data: bytes, bytes_per_s: float | None = None) -> None:
        self._data = data
        self._bytes_per_s = bytes_per_s
        self.finished = threading.Event()

    def __call__(self, line: PtyLine) -> None:
        """Begin when a program opens the port, pause while it is closed, fall silent at the end."""
        for start in range(0, len(self._data), CHUNK):
            chunk = self._data[start : start + CHUNK]
            while not line.has_listener():
                if line.stop.wait(PAUSE_S):
                    return
            line.write(chunk)
            if self._bytes_per_s is not None:
                line.stop.wait(len(chunk) / self._bytes_per_s)
        self.finished.set()
        line.stop.wait()


class TranscriptModem:
    """A modem that answers each `AT+CENG?` with the next recorded reply.

    After the last reply it reports no cell ("empty") or answers with an error ("error").
    `served` counts the replies given.
    """

    def __init__(
        self, replies: Sequence[bytes], afterwards: Literal["empty", "error"] = "empty"
    ) -> None:
        self._replies = tuple(replies)
        self._afterwards = afterwards
        self._terminal = AtTerminal(self._answer)
        self.served = 0

    def feed(self, data: bytes) -> bytes:
        """What the modem writes after these bytes."""
        return self._terminal.feed(data)

    def unsolicited(self) -> bytes:
        return b""

    def _answer(self, command: str) -> bytes:
        if command.startswith(("AT+CMEE=", "AT+CENG=")):
            return frame_text("OK")
        if command != "AT+CENG?":
            return frame_text("ERROR")
        if self.served < len(self._replies):
            self.served += 1
            return _on_the_wire(self._replies[self.served - 1])
        return (
            frame_text("+CENG: 1,1", "OK") if self._afterwards == "empty" else frame_text("ERROR")
        )


def _on_the_wire(reply: bytes) -> bytes:
    """A listing as a modem prints it: between line ends CR LF, and with a final result code."""
    if b"\r\n" not in reply:
        reply = reply.replace(b"\n", b"\r\n")
    if not reply.endswith(b"\r\n"):
        reply += b"\r\n"
    return b"\r\n" + reply + (b"" if _ends(reply) else frame_text("OK"))


def _ends(reply: bytes) -> bool:
    """True where the last line is a final result code."""
    last = reply.strip().rpartition(b"\n")[2].strip()
    return last in FINAL_CODES or last.startswith(FINAL_BEGINNINGS)
