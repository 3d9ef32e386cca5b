"""Whether modem and receiver are at each other's ports: swapped by hand, or by a boot that numbered
them anew.
"""

from logger.core.types import Fix, Note, RawBytes, Record, Scan

PATIENCE_S = 20.0
"""A receiver speaks each second and a modem answers within a few; both need longer to start than a
port to open.
"""
_MOST_PATIENCE_S = 640.0
_PAUSE_S = 5.0
"""A receiver on the modem's port goes on speaking, also while the port is closed and opened in
between.
"""


class Placement:
    """Judges by the records of both links: `feed` them, and ask `is_wrong` now and then.

    Wrong is: neither has been understood for some time, in which somebody went on speaking on the
    modem's port. Exchanged ports that are no better are given back, each time after twice the
    patience, so that a modem that is only ill is not lost to a wrong guess. `second_ns` is a real
    second of the clock that stamps records.
    """

    def __init__(self, now_ns: int, second_ns: float) -> None:
        self._second_ns = second_ns
        self._patience_s = PATIENCE_S
        self._since_ns = now_ns
        self._spoke_ns = 0
        self._speaks_since_ns: int | None = None
        self._guessed = False

    def feed(self, record: Record) -> None:
        match record.value:
            case RawBytes(sent=False) if record.source == "modem":
                self._hear(record.t_ns)
            case Fix():
                self._understand()
            case Scan(readings=readings) if readings:
                self._understand()
            case Note(code="modem-identified" | "modem-ready"):
                self._understand()

    def is_wrong(self, now_ns: int) -> bool:
        """Whether the ports are to be exchanged now."""
        speaks = now_ns - self._spoke_ns <= _PAUSE_S * self._second_ns
        since_ns = self._since_ns if self._guessed else self._speaks_since_ns if speaks else None
        return since_ns is not None and now_ns - since_ns > self._patience_s * self._second_ns

    def exchange(self, now_ns: int) -> None:
        """Take note that they have been exchanged."""
        if self._guessed:
            self._patience_s = min(2.0 * self._patience_s, _MOST_PATIENCE_S)
        self._guessed = not self._guessed
        self._since_ns, self._speaks_since_ns = now_ns, None

    def _hear(self, t_ns: int) -> None:
        if self._speaks_since_ns is None or t_ns - self._spoke_ns > _PAUSE_S * self._second_ns:
            self._speaks_since_ns = t_ns
        self._spoke_ns = t_ns

    def _understand(self) -> None:
        self._speaks_since_ns = None
        self._guessed, self._patience_s = False, PATIENCE_S
