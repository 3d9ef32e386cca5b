"""One run of the service: recorded with all outputs of its status, then finished."""

import logging
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path
from time import monotonic

from logger.config import SiteConfig
from logger.core.live_settings import OWN
from logger.device.battery import BatteryWatch
from logger.device.clock import Clock
from logger.device.memory import give_back
from logger.device.notify import ServiceManager
from logger.device.service import Service
from logger.device.startup import BegunRun
from logger.device.status_sinks import status_sinks

log = logging.getLogger(__name__)


def run_service(
    config: SiteConfig,
    begun: BegunRun,
    manager: ServiceManager,
    clock: Clock,
    stop: tuple[threading.Event, list[str]],
    duration_s: float | None,
    learning: Sequence[str] = (),
) -> Path:
    """Record until a signal of `stop` or the end of the duration, and return the finished run.

    The watchdog is fed by this thread, and only while the recorder works. Under systemd another
    unit recovers earlier runs, with a low priority, and teaches them to the device; otherwise this
    does, with the command `learning` in a process of its own.
    """
    give_back()
    ended, signals = stop
    with status_sinks(config.status, manager) as sinks:
        battery = BatteryWatch(config.power, monotonic)
        service = Service(config, begun, clock, ended, battery=battery)
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
            for sink in sinks:
                sink.publish(status)

        reason, at_stop = "internal error of the logger", None
        try:
            service.wait(duration_s, publish)
            at_stop = publish
            over = service.low_battery or f"duration of {duration_s} s over"
            reason = signals[0] if signals else over
        finally:  # whatever has happened, the run is sealed and the process ends
            manager.stopping()
            run = service.stop(reason, at_stop)  # what has failed may be `publish`
        if not manager.is_present:
            recovery.join()
            _learn(teacher)
    return run


def _recover_and_learn(folder: Path, learning: list[str]) -> None:
    recover_folder(folder)
    _learn(learning)


def _learn(learning: list[str]) -> None:
    """Teach finished runs to the device; what keeps it from that is for the log."""
    if not learning:
        return
    # a Ctrl-C is for the recording; what it leaves undone the next start does
    done = subprocess.run(  # noqa: S603
        learning, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False
    )
    if done.returncode:
        log.warning("the baseline is as it was: %s", done.stderr.strip()[-200:])


def recover_folder(folder: Path) -> None:
    """Make HDF5 files of journals of earlier runs; unreadable ones are logged and left alone."""
    from logger.core.runfile import recover  # noqa: PLC0415  recording needs no HDF5

    for recovered in recover(folder):
        if recovered.run:
            log.info("recovered %s", recovered.run)
        else:
            log.error("cannot recover %s: %s", recovered.journal, recovered.error)
