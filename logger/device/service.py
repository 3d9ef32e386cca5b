"""The whole logger: a thread for each port, one recorder, one run."""

import logging
import platform
import secrets
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib.metadata import version
from pathlib import Path
from types import FrameType

from logger.config import GNSS_OF_MODEM, SiteConfig
from logger.core.errors import ConfigError, RunFileError
from logger.core.geo import Utm
from logger.core.live import LiveTracker
from logger.core.runfile import RunMeta, RunWriter, Truth, finish_journal, journal_path, unfinished
from logger.device.clock import Clock, boot_id
from logger.device.gpsd_link import receiver_session
from logger.device.link import Inbox, Link
from logger.device.modem_link import modem_session
from logger.device.port import check_url
from logger.device.recorder import Recorder
from logger.drivers.privacy import Blanker
from logger.drivers.registry import driver_of

log = logging.getLogger(__name__)

JOIN_S = 10.0
STATUS_EVERY_S = 30.0
_LIBRARIES = ("cellwalk", "numpy", "h5py", "pyproj", "pyserial", "pynmea2", "msgspec")


class Service:
    """Records one run from `start` to `stop`; the clock is an argument, so that a simulated walk can run faster.

    `ended` ends `wait`; the recorder sets it too when it fails. `config_text` is kept in the run; `truth` names the
    transmitters of a simulated world. Raises `ConfigError` for a directory or a port that can never be used.
    """

    def __init__(
        self,
        config: SiteConfig,
        clock: Clock,
        ended: threading.Event,
        *,
        config_text: str,
        origin: str = "walk",
        truth: tuple[Truth, ...] = (),
    ) -> None:
        check_url(config.modem.port)
        if config.gnss.port != GNSS_OF_MODEM:
            check_url(config.gnss.port)
        self._clock = clock
        self._ended = ended
        self._started_ns = clock.now_ns()
        self._stop = threading.Event()
        self._inbox = Inbox()
        self.folder = usable_folder(config.run.directory)
        meta = RunMeta(
            run_id=secrets.token_hex(16),
            boot_id=boot_id(),
            started_ns=self._started_ns,
            origin=origin,
            program=f"cellwalk {version('cellwalk')}",
            versions={name: version(name) for name in _LIBRARIES} | {"python": platform.python_version()},
            config_text=config_text,
            live=config.live,
            truth=truth,
        )
        self._writer = RunWriter(journal_path(self.folder, meta.boot_id), meta)
        self.recorder = Recorder(self._writer, LiveTracker(config.live), self._inbox, clock, ended)
        driver_of(config.modem.driver)
        of_modem = config.gnss.port == GNSS_OF_MODEM
        modem = partial(modem_session, settings=config.modem, locates=of_modem)
        self._threads = [
            threading.Thread(target=self.recorder.run, name="recorder"),
            self._link_thread("modem", config.modem.port, config.modem.baud, modem, Blanker()),
        ]
        if not of_modem:
            self._threads.append(
                self._link_thread("gnss", config.gnss.port, config.gnss.baud, receiver_session(config.gnss.port))
            )

    def start(self) -> None:
        log.info("recording to %s", self._writer.path)
        for thread in self._threads:
            thread.start()

    def stop(self, reason: str) -> Path:
        """End the run and make its HDF5 file; the journal stays whatever happens. Raises `RunFileError`."""
        self._stop.set()
        recorder, *links = self._threads
        for link in links:
            link.join(JOIN_S)
        self.recorder.finish(reason)
        recorder.join()
        if self.recorder.error is not None:
            raise RunFileError(f"recording to {self._writer.path} failed: {self.recorder.error}")
        return finish_journal(self._writer.path)

    def wait(self, duration_s: float | None) -> None:
        """Wait until `ended` is set or the duration has passed, telling how it goes meanwhile."""
        end_ns = None if duration_s is None else self._clock.now_ns() + round(duration_s * 1e9)
        while end_ns is None or self._clock.now_ns() < end_ns:
            left_s = STATUS_EVERY_S if end_ns is None else min(STATUS_EVERY_S, (end_ns - self._clock.now_ns()) / 1e9)
            if self._clock.wait(self._ended, max(left_s, 0.0)):
                return
            log.info("%s", self.status())

    def status(self) -> str:
        """One line for somebody who wonders whether it works."""
        counts = self.recorder.counts
        elapsed_s = (self._clock.now_ns() - self._started_ns) / 1e9
        text = f"{elapsed_s:.0f} s: {counts['Fix']} fixes, {counts['Scan']} scans, {counts['readings']} readings"
        latest = self.recorder.latest
        if latest is None:
            return text + ", no target yet"
        lat_deg, lon_deg = Utm(latest.utm_zone).to_latlon(latest.x_m, latest.y_m)
        return f"{text}; target {latest.cell}, reference EKF at {lat_deg:.5f} {lon_deg:.5f} (not to be trusted)"

    def _link_thread(
        self, source: str, url: str, baud: int, session: Callable[[Link], None], blanker: Blanker | None = None
    ) -> threading.Thread:
        link = Link(source, url, baud, self._clock, self._inbox, self._stop, blanker)
        return threading.Thread(target=link.run, args=(session,), name=source, daemon=True)


def run_service(config: SiteConfig, config_text: str, clock: Clock, duration_s: float | None) -> Path:
    """Record until SIGTERM, SIGINT or the end of the duration; returns the finished run."""
    with stop_signals() as (ended, heard):
        service = Service(config, clock, ended, config_text=config_text)
        service.start()
        recovery = threading.Thread(target=recover_folder, args=(service.folder,), name="recovery")
        recovery.start()
        service.wait(duration_s)
        run = service.stop(heard[0] if heard else f"duration of {duration_s} s over")
        recovery.join()
    return run


def recover_folder(folder: Path) -> list[Path]:
    """Make HDF5 of every journal that an earlier run left behind; what cannot be read is logged and left alone."""
    runs = []
    for journal in unfinished(folder):
        try:
            runs.append(finish_journal(journal))
            log.info("recovered %s", runs[-1])
        except RunFileError as error:
            log.error("cannot recover %s: %s", journal, error)  # noqa: TRY400
    return runs


def usable_folder(directory: str) -> Path:
    """Folder of the runs, made if need be; raises `ConfigError`."""
    folder = Path(directory).expanduser()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"[run] directory {folder} cannot be made: {error.strerror}") from error
    return folder


@contextmanager
def stop_signals() -> Iterator[tuple[threading.Event, list[str]]]:
    """Turn SIGTERM and SIGINT into an event; the handler does nothing else."""
    ended, heard = threading.Event(), list[str]()

    def hear(number: int, _frame: FrameType | None) -> None:
        heard.append(f"signal {signal.Signals(number).name}")
        ended.set()

    before = {number: signal.signal(number, hear) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield ended, heard
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
