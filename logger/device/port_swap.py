"""Detects that modem and receiver are at each other's ports.

A user may have swapped them, or a boot may have numbered them in another order.
"""

from logger.core.source_tables import MODEM
from logger.core.types import Fix, Note, RawBytes, Record, Scan

WAIT_S = 20.0
"""A receiver sends every second and a modem answers within a few; both need time to start."""
_MAX_WAIT_S = 640.0
_PAUSE_S = 5.0
"""A receiver on the modem's port keeps sending, also while the port is closed and opened again."""


class PortSwap:
    """Decides by the records of both links whether the ports should be swapped.

    They should if neither device has sent readable data for some time while bytes arrived on
    the modem's port. A swap that does not help is taken back, each time after twice the waiting
    time, so that a wrong guess does not lose a modem that is only disturbed. `second_ns` is a real
    second of the clock that stamps records, `modem` the name of the modem.
    """

    def __init__(self, now_ns: int, second_ns: float, modem: str = MODEM) -> None:
        self._modem = modem
        self._second_ns = second_ns
        self._wait_s = WAIT_S
        self._since_ns = now_ns
        self._byte_ns = 0
        self._bytes_since_ns: int | None = None
        self._is_swapped = False

    def feed(self, record: Record) -> None:
        match record.value:
            case RawBytes(sent=False) if record.source == self._modem:
                self._note_bytes(record.t_ns)
            case Fix():
                self._note_readable()
            case Scan(readings=readings) if readings:
                self._note_readable()
            case Note(code="modem-identified" | "modem-ready"):
                self._note_readable()

    def is_wrong(self, now_ns: int) -> bool:
        """Whether to swap the ports now."""
        is_sending = now_ns - self._byte_ns <= _PAUSE_S * self._second_ns
        since_ns = (
            self._since_ns if self._is_swapped else self._bytes_since_ns if is_sending else None
        )
        return since_ns is not None and now_ns - since_ns > self._wait_s * self._second_ns

    def swap(self, now_ns: int) -> None:
        """Note that they have been swapped."""
        if self._is_swapped:
            self._wait_s = min(2.0 * self._wait_s, _MAX_WAIT_S)
        self._is_swapped = not self._is_swapped
        self._since_ns, self._bytes_since_ns = now_ns, None

    def _note_bytes(self, t_ns: int) -> None:
        if self._bytes_since_ns is None or t_ns - self._byte_ns > _PAUSE_S * self._second_ns:
            self._bytes_since_ns = t_ns
        self._byte_ns = t_ns

    def _note_readable(self) -> None:
        self._bytes_since_ns = None
        self._is_swapped, self._wait_s = False, WAIT_S
