"""Runs with a modem whose mode is watched, on real ports."""

import threading
from contextlib import contextmanager
from dataclasses import replace

from logger.config import parse_config
from logger.core.runfile import read_run
from logger.device.clock import Clock
from logger.device.mode_switch import FILE
from logger.device.service import Service
from logger.device.startup import begin_run
from logger.sim.dialects import identity_replies
from logger.sim.ptys import PtyDevice, answering
from tests.kit import service
from tests.kit.dialects import DIALECTS
from tests.kit.mode_modems import ObservedModem

LIMIT_S = 60.0
SIM7100 = replace(
    DIALECTS["sim7600"], identity=identity_replies(["SIM7100"], "SIMCOM", "SIMCOM_SIM7100E", "1.0")
)


def config(folder, port, set_mode="gsm", more=""):
    mode = f'set_mode = "{set_mode}"\n' if set_mode else ""
    text = (
        f'[run]\ndirectory = "{folder}"\n[modem]\nport = "{port}"\n'
        f"poll_interval_s = 0.05\n{mode}{more}"
        f'[gnss]\nport = "{folder / "none"}"\n'
    )
    return parse_config(text, "site.toml")


@contextmanager
def recording(folder, port, set_mode="gsm"):
    """A run under way; it is stopped at the end, and read into the list that this gives."""
    found = []
    site, clock = config(folder, port, set_mode), Clock()
    under_way = Service(site, begin_run(site, "", clock), clock, threading.Event())
    under_way.start()
    scans = under_way.recorder.counts
    try:
        yield found, lambda: scans["Scan"]
    finally:
        found.append(read_run(under_way.stop("end")))


def notes(run):
    return {
        row["code"].decode(): row["text"].decode()
        for row in run.tables["notes"]
        if row["source"] == b"modem"
    }


def run_once(folder, dialect, set_mode="gsm", until=None, watched=None):
    """A run with a modem until a condition holds or it has scanned; its notes, and the modem."""
    modem = watched or ObservedModem(dialect, folder)
    with (
        PtyDevice(answering(modem)) as port,
        recording(folder, port.path, set_mode) as (found, scans),
    ):
        service.wait_for(lambda: until(modem) if until else scans() > 2, LIMIT_S)
    return notes(found[0]), modem


def file_of(folder):
    return folder / FILE
