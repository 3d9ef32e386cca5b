"""One run of the service: recorded with all outputs of its status, then finished."""

import logging
import threading
from pathlib import Path
from time import monotonic

from logger.config import SiteConfig
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
) -> Path:
    """Record until a signal of `stop` or the end of the duration, and return the finished run.

    The watchdog is fed by this thread, and only while the recorder works. Under systemd another
    unit recovers earlier runs, with a low priority; otherwise this does.
    """
    give_back()
    ended, signals = stop
    with status_sinks(config.status, manager) as sinks:
        battery = BatteryWatch(config.power, monotonic)
        service = Service(config, begun, clock, ended, battery=battery)
        service.start()
        recovery = threading.Thread(target=recover_folder, args=(service.folder,), name="recovery")
        if not manager.is_present:
            recovery.start()

        def publish() -> None:
            manager.heartbeat(service.heartbeat)
            status = service.snapshot()
            for sink in sinks:
                sink.publish(status)

        reason = "internal error of the logger"
        try:
            service.wait(duration_s, publish)
            over = service.low_battery or f"duration of {duration_s} s over"
            reason = signals[0] if signals else over
        finally:  # whatever has happened, the run is sealed and the process ends
            manager.stopping()
            run = service.stop(reason)
        if not manager.is_present:
            recovery.join()
    return run


def recover_folder(folder: Path) -> None:
    """Make HDF5 files of journals of earlier runs; unreadable ones are logged and left alone."""
    from logger.core.runfile import recover  # noqa: PLC0415  recording needs no HDF5

    for recovered in recover(folder):
        if recovered.run:
            log.info("recovered %s", recovered.run)
        else:
            log.error("cannot recover %s: %s", recovered.journal, recovered.error)
