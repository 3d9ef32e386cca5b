"""The inbox of the recorder, which also keeps what the status shows."""

import threading
from collections import Counter
from collections.abc import Callable, Mapping

from msgspec.structs import replace

from logger.core.live_settings import FOLLOW, STRONGEST, SUSPICIOUS
from logger.core.source_tables import MODEM
from logger.core.types import Fix, Note, RawBytes, Record, Scan, known_utc_text
from logger.device.link import DRIVER, NO_EPOCHS, Inbox
from logger.device.live_view import CellTable
from logger.device.status import FixStatus, PortStatus

WAIT_S = 20.0
"""A receiver sends every second and a modem answers soon; both need time to start."""
_MAX_WAIT_S = 640.0
_PAUSE_S = 5.0
"""A receiver on the modem's port keeps sending while the port is opened again."""


class PortSwap:
    """Decides by the records of both links whether the ports should be swapped.

    They should if neither device has sent readable data for some time while bytes arrived on the
    modem's port. A swap that does not help is taken back, each time after twice the waiting time,
    so that a modem that is only disturbed is not lost. `second_ns` is a real second of the clock
    that stamps records, `modem` the name of the modem.
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


class WatchedInbox(Inbox):
    """An inbox that keeps the latest fix, scan, cells and port events: the recorder only counts.

    By source, `scan_ns` is the time of the latest of `n_scans`, `scan_gap_ns` that since the one
    before; those in `hearing` have named a cell. A fault lasts until the port's next fix or scan.
    `n_polls` grows while the recorder runs; `swap` is fed with every record, `identified` with the
    source of each name that `modems` gets.
    """

    def __init__(
        self,
        ports: Mapping[str, str],
        swap: PortSwap | None = None,
        identified: Callable[[str], None] = lambda _: None,
    ) -> None:
        super().__init__()
        self._swap = swap
        self._identified = identified
        self._ports_lock = threading.Lock()
        self.cells = CellTable()
        self.ports = {source: PortStatus(url) for source, url in ports.items()}
        self.fix: FixStatus | None = None
        self.valid_ns: int | None = None
        self.scan_ns: dict[str, int] = {}
        self.scan_gap_ns: dict[str, int] = {}
        self.n_scans = Counter[str]()
        self.hearing = set[str]()
        self.modems: dict[str, str] = {}
        self.n_polls = 0
        self.followed: str | None = None

    @property
    def waiting(self) -> int:
        return self._queue.qsize()

    @property
    def room(self) -> int:
        return self._queue.maxsize

    def put(self, record: Record) -> bool:
        if self._swap is not None:
            self._swap.feed(record)
        match record.value:
            case Fix() as fix:
                self.fix = _fix_status(record.t_ns, fix)
                self.valid_ns = record.t_ns if fix.valid else self.valid_ns
                self._clear_fault(record.source)
            case Scan(readings=readings):
                before_ns = self.scan_ns.get(record.source, record.t_ns)
                self.scan_gap_ns[record.source] = record.t_ns - before_ns
                self.scan_ns[record.source] = record.t_ns
                self.n_scans[record.source] += 1
                if readings:
                    self.hearing.add(record.source)
                self._clear_fault(record.source)
            case Note() as note if record.source in self.ports:
                with self._ports_lock:
                    self.ports[record.source] = _with_event(self.ports[record.source], note)
                if note.code == "port-lost":
                    self.modems.pop(record.source, None)
                elif note.code == "modem-identified":
                    self.modems[record.source] = note.text.rpartition(DRIVER)[0]
                    self._identified(record.source)
            case Note(code=code, text=cell) if code == FOLLOW:
                self.followed = None if cell in {STRONGEST, SUSPICIOUS} else cell
        self.cells.feed(record)
        return super().put(record)

    def _clear_fault(self, source: str) -> None:
        with self._ports_lock:
            if source in self.ports and self.ports[source].fault:
                self.ports[source] = replace(self.ports[source], fault="")

    def move(self, source: str, url: str) -> None:
        """Note that a link continues at another port."""
        with self._ports_lock:
            self.ports[source] = PortStatus(url)

    def get(self, timeout_s: float) -> Record | None:
        self.n_polls += 1
        return super().get(timeout_s)


def _fix_status(t_ns: int, fix: Fix) -> FixStatus:
    return FixStatus(
        t_ns,
        fix.valid,
        known_utc_text(fix.utc_ns),
        fix.lat_deg,
        fix.lon_deg,
        fix.acc_m,
        fix.hdop,
        fix.sats_used,
        fix.quality,
        fix.speed_mps,
        fix.course_deg,
    )


def _with_event(port: PortStatus, note: Note) -> PortStatus:
    """A loss in a session is a fault also after the port is opened again."""
    match note.code:
        case "port-opened":
            return replace(port, is_open=True, event=note.text)
        case "port-lost" | "internal":
            return PortStatus(port.url, event=note.text, fault=note.text if port.is_open else "")
        case code:
            fault = note.text if code == NO_EPOCHS else port.fault
            return replace(port, event=note.text, fault=fault)
