"""The complete logger: a thread for each port, one recorder, one run."""

import logging
import math
import os
import subprocess
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path
from time import monotonic

from msgspec.structs import asdict, replace

from logger.config import SiteConfig
from logger.core.errors import ConfigError, DeviceError, RunFileError
from logger.core.live_settings import OWN
from logger.core.runfile import RunWriter
from logger.core.runfile.run_names import parts_of
from logger.core.types import DEAD_RECKONING, Note, Record
from logger.device.battery import BatteryWatch
from logger.device.clock import Clock
from logger.device.link import Link, Tally
from logger.device.machine import MOUNTINFO, kept_in_memory
from logger.device.memory import give_back
from logger.device.mode_switch import RESTORE_S, SavedModes, unrestored_modes
from logger.device.notify import ServiceManager
from logger.device.page_requests import page_requests
from logger.device.recorder import Recorder
from logger.device.sources import source_of
from logger.device.status import FIX_AGE_S, Sign, Status, status_folder
from logger.device.status_sinks import status_sinks
from logger.device.watched_inbox import PortSwap, WatchedInbox
from logger.drivers.registry import FAMILIES

log = logging.getLogger(__name__)

JOIN_S = 10.0
PAGE = "page"
"""Source of the notes about what the page asks."""
STATUS_EVERY_S = 30.0
TICK_S, PAGE_TICK_S = 1.0, 0.5
"""The second with a page on a phone, which should show a level within a second."""
MOST_UNNAMED = 2
"""With a modem and a receiver the text of a fault says which it is."""
ANSWER_WITHIN_S = 45.0
"""After a boot, with which a modem gets its power: some answer after 30 s."""
_DEAF_SCANS = 20
"""Without any cell: a start takes a few."""
RARE_SHARE = 0.25
"""Of its patience: the time without a scan that stands in the status."""
# longest time for an HDF5 file: a Pi Zero needs about 5 s a MB of journal
HDF5_S, HDF5_S_PER_MB = 30.0, 15.0


class Service:
    """Records a run from `start` to `stop`.

    `ended` ends `wait`; the recorder sets it too when it fails. Raises `ConfigError`, and removes
    the run, for an impossible port or driver.
    """

    def __init__(
        self,
        config: SiteConfig,
        writer: RunWriter,
        clock: Clock,
        ended: threading.Event,
        *,
        battery: BatteryWatch | None = None,
    ) -> None:
        sources = [source_of(settings) for settings in config.source]
        try:
            for source in sources:
                source.validate()
        except ConfigError:
            writer.discard()
            raise
        self._clock = clock
        self._ended = ended
        self._started_ns = self._logged_ns = writer.meta.started_ns
        self._stop = threading.Event()
        self._closing = ""
        self._is_sealed = False
        second_ns = 1e9 / clock.real_s(1.0)
        modem = next(source.name for source in config.source if source.gives_cells)
        self._swap = PortSwap(self._started_ns, second_ns, modem)
        ports = {source.name: source.port for source in sources}
        self._modems: dict[str, str] = {}
        self._modems_lock = threading.Lock()
        self._inbox = WatchedInbox(ports, self._swap, self._settle_modem)
        self._battery = battery
        self._tick_s = PAGE_TICK_S if config.page.listen else TICK_S
        self._requests = page_requests(status_folder()) if config.page.listen else None
        self._synced_ns: int | None = None
        self._n_syncs = self._n_of_page_synced = 0
        self._defects: dict[str, Tally] = {}
        self.folder, self._writer = writer.path.parent, writer
        self.recorder = Recorder(
            self._writer,
            config.live,
            self._inbox,
            clock,
            ended,
            durable=self._note_sync,
            delete_oldest=config.run.delete_oldest,
        )
        self._links = [Link(source, clock, self._inbox, self._stop) for source in sources]
        self._threads = [threading.Thread(target=self.recorder.run, name="recorder")] + [
            threading.Thread(target=link.run, args=(self.folder,), name=link.name, daemon=True)
            for link in self._links
        ]

    def start(self) -> None:
        log.info("recording to %s", self._writer.path)
        if where := kept_in_memory(self.folder.resolve(), MOUNTINFO.read_text(errors="replace")):
            log.warning("runs are stored in memory (%s) and lost at a power cut", where)
        for thread in self._threads:
            thread.start()

    def stop(
        self,
        reason: str,
        publish: Callable[[], None] | None = None,
        ask_time: Callable[[float], None] = lambda _seconds: None,
    ) -> Path:
        """End the run and make its HDF5 file; the journal stays whatever happens.

        `publish` is as for `wait`. Raises `RunFileError`.
        """
        journal = self.seal(reason, publish)
        self._closing = f"the run is closed; its HDF5 file is being made of {journal.name}"
        with suppress(OSError, RunFileError):
            n_bytes = sum(file.stat().st_size for file in parts_of(journal))
            ask_time(HDF5_S + HDF5_S_PER_MB * n_bytes / 1e6)
        with ThreadPoolExecutor(1, "hdf5") as pool:
            made = pool.submit(_finish_run, journal)
            while not wait([made], self._tick_s).done:
                self._show(publish)
        return made.result()

    def seal(self, reason: str, publish: Callable[[], None] | None = None) -> Path:
        self._stop.set()
        self._closing = "the run is being closed"
        recorder, *links = self._threads
        try:
            end_s = monotonic() + JOIN_S + RESTORE_S
            for link in links:
                self._join(link, end_s, publish)
            if left := unrestored_modes(SavedModes(self.folder), FAMILIES.get):
                self._links[0].note("warning", "mode-left", left)
        finally:
            self.recorder.finish(reason)
            # the live estimate may need some time: a silent recorder would look as if it hung
            self._join(recorder, math.inf, publish)
        if self.recorder.error is not None:
            raise RunFileError(f"recording to {self._writer.path} failed: {self.recorder.error}")
        self._is_sealed = True
        return self._writer.path

    def _join(
        self, thread: threading.Thread, end_s: float, publish: Callable[[], None] | None
    ) -> None:
        while thread.is_alive() and (left_s := end_s - monotonic()) > 0.0:
            thread.join(min(self._tick_s, left_s))
            self._show(publish)

    def _show(self, publish: Callable[[], None] | None) -> None:
        if publish is not None:
            self._attempt("status", self._clock.now_ns(), lambda _: publish())

    def wait(self, duration_s: float | None, publish: Callable[[], None] = lambda: None) -> None:
        """Wait for `ended` or the end of the duration, and call `publish` once a tick.

        A low battery ends it as well. An error in a part of a tick is counted in notes, and the
        other parts go on. Raises `DeviceError` where a thread of a port has ended: only another
        start brings it back.
        """
        end_ns = None if duration_s is None else self._clock.now_ns() + round(duration_s * 1e9)
        while end_ns is None or self._clock.now_ns() < end_ns:
            now_ns = self._clock.now_ns()
            left_s = min(self._tick_s, math.inf if end_ns is None else (end_ns - now_ns) / 1e9)
            if self._clock.wait(self._ended, max(left_s, 0.0)):
                return
            self._look_at_threads()
            self._attempt("ports", now_ns, self._check_ports)
            self._attempt("battery", now_ns, self._look_at_battery)
            if self.low_battery:
                return
            self._attempt("page", now_ns, self._take_requests)
            self._attempt("status", now_ns, lambda _: publish())
            self._attempt("log", now_ns, self._log_status)

    def _attempt(self, part: str, now_ns: int, work: Callable[[int], None]) -> None:
        # a bug in one part of a tick must not end the recording
        try:
            work(now_ns)
        except Exception as error:
            what = f"{part}: {type(error).__name__}"
            if what not in self._defects:
                log.exception("unexpected (%s); later ones are counted in the run", part)
                self._defects[what] = Tally(f"times {what}", least=1)
            self._defects[what].add(1, now_ns)
        for tally in self._defects.values():
            if text := tally.take(now_ns):
                self._inbox.put(Record(now_ns, "logger", Note("error", "internal", text)))

    def _look_at_threads(self) -> None:
        for thread in self._threads:
            if not thread.is_alive() and not self._ended.is_set():
                raise DeviceError(f"the thread of {thread.name} has ended")

    def _look_at_battery(self, now_ns: int) -> None:
        for note in self._battery.look() if self._battery else ():
            self._inbox.put(Record(now_ns, "battery", note))

    def _take_requests(self, now_ns: int) -> None:
        """Also learns which requests are on the card."""
        if self._requests is None:
            return
        self._requests.confirm(self._n_of_page_synced)
        for note in self._requests.take():
            if not self._inbox.put(Record(now_ns, PAGE, note)):
                self._requests.drop(note)
        if self.recorder.failing:
            self._requests.disown()

    def _log_status(self, now_ns: int) -> None:
        if now_ns - self._logged_ns > STATUS_EVERY_S * 1e9:
            self._logged_ns = now_ns
            log.info("%s", self.status())

    def status(self) -> str:
        """The status in one line."""
        counts = self.recorder.counts
        elapsed_s = (self._clock.now_ns() - self._started_ns) / 1e9
        records = f"{counts['Fix']} fixes, {counts['Scan']} scans, {counts['readings']} readings"
        text, fix = f"{elapsed_s:.0f} s: {records}", self._inbox.fix
        if fix is not None and fix.valid and fix.quality == DEAD_RECKONING:
            text = f"{text}; the position is by dead reckoning"
        text = f"{text}{self._rare_scans()}"
        view = self.recorder.estimator.view
        if view.position is not None and not view.no_estimate:
            return f"{text}; {view.position.cell}: {view.position.text}"
        return f"{text}; {view.no_estimate or view.target or 'no target yet'}"

    def _rare_scans(self) -> str:
        """About modems with far fewer scans than they are asked for."""
        text, now_ns = "", self._clock.now_ns()
        for link in self._links:
            scan_ns = self._inbox.scan_ns.get(link.name)
            if link.source.patience_s is not None and scan_ns is not None:
                gap_s = max(self._inbox.scan_gap_ns[link.name], now_ns - scan_ns) / 1e9
                if gap_s > RARE_SHARE * link.source.patience_s:
                    event = self._inbox.ports[link.name].event
                    text += f"; {link.name}: only one scan in {gap_s:.0f} s ({event})"
        return text

    @property
    def low_battery(self) -> str:
        """Why the battery ends the run; empty if it does not."""
        return self._battery.low if self._battery else ""

    @property
    def heartbeat(self) -> int:
        """A number that grows with each durable write, and while the recorder waits for the card.

        A restart would not repair the card, and would lose the records in memory.
        """
        return self._n_syncs + (self._inbox.n_polls if self.recorder.failing else 0)

    def snapshot(self) -> Status:
        """The status now, for all outputs."""
        counts, inbox, synced_ns = self.recorder.counts, self._inbox, self._synced_ns
        now_ns = self._clock.now_ns()  # after all times that it is compared with
        if self._is_sealed:
            synced_ns = now_ns
        faults = self._faults(now_ns)
        trouble = self._trouble(faults)
        return Status(
            state="error" if trouble else self._sign(now_ns),
            text=trouble or self._closing or self.status(),
            run=str(self._writer.path),
            pid=os.getpid(),
            now_ns=now_ns,
            since_ns=self._started_ns,
            synced_ns=synced_ns,
            fixes=counts["Fix"],
            scans=counts["Scan"],
            readings=counts["readings"],
            waiting=inbox.waiting,
            room=inbox.room,
            fix=inbox.fix,
            ports={
                name: replace(port, fault=faults.get(name, ""))
                for name, port in inbox.ports.items()
            },
            followed=inbox.followed,
            battery=self._battery.latest if self._battery else None,
            recorded=self._requests.on_card if self._requests else (),
            is_over=bool(self._closing),
            **asdict(inbox.cells.fill(self.recorder.estimator.view)),
        )

    def _trouble(self, faults: Mapping[str, str]) -> str:
        if self.recorder.failing or self.recorder.error:
            return self.recorder.state
        if len(self._links) <= MOST_UNNAMED:
            return next(iter(faults.values()), "")
        return "; ".join(f"{name}: {fault}" for name, fault in faults.items())

    def _faults(self, now_ns: int) -> dict[str, str]:
        faults = {}
        for link in () if self._stop.is_set() else self._links:
            port, patience_s = self._inbox.ports[link.name], link.source.patience_s
            scan_ns = self._inbox.scan_ns.get(link.name, self._started_ns)
            scanless_s = (now_ns - scan_ns) / 1e9
            if not port.is_open:
                if port.event:  # else it is just being opened
                    faults[link.name] = port.event
            elif patience_s is not None and scanless_s > patience_s:
                faults[link.name] = f"no scan for {scanless_s:.0f} s: {port.fault or port.event}"
            elif port.fault and now_ns > ANSWER_WITHIN_S * 1e9:
                faults[link.name] = port.fault
            elif link.source.settings.gives_cells and self._is_deaf(link.name):
                faults[link.name] = "no cell in any scan: is its antenna connected?"
        return faults

    def _is_deaf(self, name: str) -> bool:
        return self._inbox.n_scans[name] >= _DEAF_SCANS and name not in self._inbox.hearing

    def _sign(self, now_ns: int) -> Sign:
        valid_ns = self._inbox.valid_ns
        is_old = valid_ns is not None and now_ns - valid_ns > FIX_AGE_S * 1e9
        if valid_ns is None or (is_old and not self._stop.is_set()):
            return "no fix"
        words = {cell.word for cell in self.recorder.estimator.view.suspicions}
        return "suspicious" if "suspicious" in words else "recording"

    def _note_sync(self) -> None:
        """Called by the recorder's thread after each durable write."""
        self._n_of_page_synced = self.recorder.counts[PAGE]
        self._synced_ns = self._clock.now_ns()
        self._n_syncs += 1

    def _check_ports(self, now_ns: int) -> None:
        # one modem and one receiver: each may be at the other's
        one, *others = self._links
        if len(others) != 1 or not all(link.source.may_be_swapped for link in self._links):
            return
        if self._swap.is_wrong(now_ns):
            self._swap.swap(now_ns)
            self._exchange(one, others[0], "no readable data; trying")

    def _settle_modem(self, name: str) -> None:
        # the kernel numbers ports as modems are plugged in, and a name stands for the levels of one
        with self._modems_lock:
            here = self._inbox.modems
            one = next(link for link in self._links if link.name == name)
            if one.is_leaving or here[name] == self._modems.setdefault(name, here[name]):
                return
            for other in self._links:
                if self._modems.get(other.name) == here[name] != here.get(other.name):
                    self._exchange(one, other, "each modem has its name:")
                    return
        one.note("warning", "other-modem", "another modem than before; its levels may differ")

    def _exchange(self, one: Link, other: Link, why: str) -> None:
        ports = {one: other.source.port, other: one.source.port}
        where = ", ".join(f"{link.name} at {url}" for link, url in ports.items())
        one.note("warning", "ports-exchanged", f"{why} {where}")
        for link, url in ports.items():
            self._inbox.move(link.name, url)
            link.move(url)


def _finish_run(journal: Path) -> Path:
    try:
        from logger.core.runfile import finish_journal  # noqa: PLC0415  recording needs no HDF5
    except ImportError as error:
        raise RunFileError(
            f"{journal} is safe, but no HDF5 file can be made here ({error})"
        ) from error
    return finish_journal(journal)


def run_service(
    config: SiteConfig,
    writer: RunWriter,
    manager: ServiceManager,
    clock: Clock,
    stop: tuple[threading.Event, list[str]],
    duration_s: float | None,
    learning: Sequence[str] = (),
) -> Path:
    """Record until a signal of `stop` or the end of the duration, and return the finished run.

    This thread feeds the watchdog, and only while the recorder works. Under systemd another unit
    recovers earlier runs, with a low priority, and teaches them to the device; otherwise this does,
    with the command `learning` in a process of its own.
    """
    give_back()
    ended, signals = stop
    with status_sinks(config.status, manager) as sinks:
        battery = BatteryWatch(config.power, monotonic)
        service = Service(config, writer, clock, ended, battery=battery)
        service.start()
        teacher = list(learning) if config.live.baseline == OWN and not manager.is_present else []
        recovery = threading.Thread(
            target=_recover_and_learn, args=(service.folder, teacher), name="recovery"
        )
        if not manager.is_present:
            recovery.start()

        def publish() -> None:
            manager.heartbeat(service.heartbeat)
            status = service.snapshot()
            for show in sinks:
                show(status)

        reason, at_stop = "internal error of the logger", None
        try:
            service.wait(duration_s, publish)
            at_stop = publish
            over = service.low_battery or f"duration of {duration_s} s over"
            reason = signals[0] if signals else over
        finally:  # whatever has happened, the run is sealed and the process ends
            manager.stopping()
            # systemd starts the next run at once, and the HDF5 file of a day takes a Pi minutes
            goes_on = manager.is_present and not signals and not service.low_battery
            if goes_on:
                run = service.seal(reason, at_stop)  # what has failed may be `publish`
            else:
                run = service.stop(reason, at_stop, manager.ask_time)
        if not manager.is_present:
            recovery.join()
            if teacher:
                log.info("the baseline learns the run; Ctrl-C leaves that to the next start")
            _learn(teacher)
    return run


def _recover_and_learn(folder: Path, learning: list[str]) -> None:
    recover_folder(folder)
    _learn(learning)


def _learn(learning: list[str]) -> None:
    """What keeps runs from being taught is for the log."""
    if not learning:
        return
    # a Ctrl-C is for the recording; what it leaves undone the next start does
    done = subprocess.run(  # noqa: S603
        learning, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False
    )
    if done.returncode:
        why = done.stderr.strip()[-200:] or "learning was interrupted"
        log.warning("the baseline is as it was: %s", why)


def recover_folder(folder: Path) -> None:
    """Make HDF5 files of journals of earlier runs; unreadable ones are logged and stay."""
    from logger.core.runfile import recover  # noqa: PLC0415  recording needs no HDF5

    for recovered in recover(folder):
        if recovered.run:
            log.info("recovered %s", recovered.run)
        else:
            log.error("cannot recover %s: %s", recovered.journal, recovered.error)
