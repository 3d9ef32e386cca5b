"""The inbox of the recorder, which also keeps what the status shows."""

import threading
from collections.abc import Mapping

from logger.core.live_settings import FOLLOW, STRONGEST, SUSPICIOUS
from logger.core.types import Fix, Note, Record, Scan
from logger.core.utc import utc_text
from logger.device.link import Inbox
from logger.device.live_view import CellTable
from logger.device.port_swap import PortSwap
from logger.device.status import FixStatus, PortStatus


class WatchedInbox(Inbox):
    """An inbox that keeps the latest fix, scan, cells and port events: the recorder only counts.

    `scan_ns` is the time of the latest scan by source. `n_polls` grows while the
    recorder runs; `swap` is fed with every record.
    """

    def __init__(self, ports: Mapping[str, str], swap: PortSwap | None = None) -> None:
        super().__init__()
        self._swap = swap
        self._ports_lock = threading.Lock()
        self.cells = CellTable()
        self.ports = {source: PortStatus(url) for source, url in ports.items()}
        self.fix: FixStatus | None = None
        self.valid_ns: int | None = None
        self.scan_ns: dict[str, int] = {}
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
            case Scan():
                self.scan_ns[record.source] = record.t_ns
            case Note() as note if record.source in self.ports:
                with self._ports_lock:
                    self.ports[record.source] = _with_event(self.ports[record.source], note)
            case Note(code=code, text=cell) if code == FOLLOW:
                self.followed = None if cell in {STRONGEST, SUSPICIOUS} else cell
        self.cells.feed(record)
        return super().put(record)

    def move(self, source: str, url: str) -> None:
        """Note that a link continues at another port."""
        with self._ports_lock:
            self.ports[source] = PortStatus(url)

    def get(self, timeout_s: float) -> Record | None:
        self.n_polls += 1
        return super().get(timeout_s)


def _fix_status(t_ns: int, fix: Fix) -> FixStatus:
    utc = None if fix.utc_ns is None else utc_text(fix.utc_ns)
    return FixStatus(
        t_ns,
        fix.valid,
        utc,
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
    is_open = {"port-opened": True, "port-lost": False, "internal": False}.get(
        note.code, port.is_open
    )
    return PortStatus(port.url, is_open, note.text)
