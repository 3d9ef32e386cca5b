"""The whole service on a real gpsd, which reads a real log from a pty."""

import shutil
import socket
import subprocess
import threading
from contextlib import contextmanager
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from logger.config import parse_config
from logger.core.errors import RunFileError
from logger.core.runfile import read_run
from logger.device import gnss_source
from logger.device.clock import Clock
from logger.device.gnss_source import GpsdSource, NmeaSource
from logger.device.sources import source_of
from logger.drivers.protocols.gpsd import GpsdFixes, Tpv
from logger.sim.devices import sentence
from logger.sim.ptys import PtyDevice
from tests.kit import service
from tests.kit.recorded_replies import NmeaPlayer
from tests.kit.recorded_runs import make_service, recording

LOG = Path(__file__).parents[1] / "drivers/data/gpsd_unicore_um621_cut.nmea"
GPSD = shutil.which(
    "gpsd", path="/usr/sbin:/usr/local/sbin:/usr/bin:/usr/local/bin:/opt/homebrew/sbin"
)
needs_gpsd = pytest.mark.skipif(
    GPSD is None, reason="gpsd is not installed (Debian: apt install gpsd)"
)


def _free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


@contextmanager
def _gpsd(port, path):
    """gpsd in the foreground, reading at once (-n) and writing nothing to the receiver (-b)."""
    with subprocess.Popen(
        [GPSD, "-N", "-n", "-b", "-S", str(port), path], stderr=subprocess.DEVNULL
    ) as process:
        try:
            yield
        finally:
            process.terminate()


def _rows(folder, table):
    try:
        return [
            row for p in (folder / "runs").glob("*.journal") for row in read_run(p).tables[table]
        ]
    except RunFileError:  # made, and not yet written for the first time
        return []


@needs_gpsd
def test_a_real_log_through_a_real_gpsd(tmp_path):
    """Fixes are those of the log; gpsd may be away at the start and go in between."""
    log = LOG.read_bytes()
    port = _free_port()
    player = NmeaPlayer(log, bytes_per_s=5000)
    site = service.site_toml(tmp_path, str(tmp_path / "none"), f"gpsd://localhost:{port}")
    with PtyDevice(player) as gnss, service.running_service(site) as logger:
        service.wait_for(
            lambda: any(b"running?" in row["text"] for row in _rows(tmp_path, "notes"))
        )
        with _gpsd(port, gnss.path):
            service.wait_for(lambda: sum(row["valid"] for row in _rows(tmp_path, "fixes")) >= 4)
        service.wait_for(
            lambda: any(b"disconnected" in row["text"] for row in _rows(tmp_path, "notes"))
        )
        service.stop_service(logger)
    (path,) = (tmp_path / "runs").glob("run-*.h5")
    run = read_run(path)
    fixes = run.tables["fixes"][run.tables["fixes"]["valid"] == 1]
    assert len({*fixes["utc_ns"]}) == len(fixes)
    assert all(abs(fixes["lat_deg"] - 44.06883) < 1e-4)
    assert all(abs(fixes["lon_deg"] + 121.31410) < 1e-4)
    assert all((fixes["utc_ns"] - 1_717_891_613_000_000_000) % 10**9 == 0)
    latitudes = {float(line.split(b",")[8]) for line in log.splitlines() if b"GGA" in line}
    known = {*fixes["hdop"][~np.isnan(fixes["hdop"])].round(2).tolist()}
    assert known
    assert known <= latitudes
    raw = run.tables["raw"]
    assert raw["sent"].sum() == 1
    received = run.bytes_of(raw[raw["sent"] == 0])
    assert received.count(b'"class":"TPV"') >= len(fixes)
    assert b"gpsd-version" in {*run.tables["notes"]["code"]}


@pytest.mark.parametrize(
    ("port", "kind"),
    [
        ("/dev/ttyUSB0", NmeaSource),
        ("socket://localhost:2947", NmeaSource),
        ("gpsd://somewhere:1234/dev/ttyACM0", GpsdSource),
    ],
)
def test_the_scheme_chooses_the_kind(port, kind):
    text = f'[run]\ndirectory = "r"\n[modem]\nport = "/a"\n[gnss]\nport = "{port}"\n'
    source = source_of(parse_config(text, "site.toml").source[1])
    assert type(source) is kind
    assert (source.name, source.port) == ("gnss", port)


class Receiver:
    """A receiver that sends `data` ten times a second."""

    def __init__(self):
        self.data = b""

    def __call__(self, line):
        while not line.stop.wait(0.1):
            if line.has_listener():
                line.write(self.data)


WITHIN_S = 1.0
NOISE = bytes(range(0x80, 0xA0))
"""No line ends, as at a wrong baud rate."""


def test_a_receiver_without_epochs_is_a_fault_until_one_comes(tmp_path, monkeypatch):
    """One note about its silence, and one about bytes that cannot be read."""
    monkeypatch.setattr(gnss_source, "EPOCH_WITHIN_S", WITHIN_S)
    receiver, clock, none = Receiver(), Clock(), str(tmp_path / "none")

    def fault():
        return under_way.snapshot().ports["gnss"].fault

    with (
        PtyDevice(receiver) as gnss,
        recording(make_service(tmp_path, clock, none, 0.0, 1.0, gnss.path)) as under_way,
    ):
        service.wait_for(lambda: "sends nothing:" in fault())
        assert under_way.snapshot().state == "error"
        clock.wait(threading.Event(), 3.0 * WITHIN_S)
        receiver.data = NOISE
        service.wait_for(lambda: "sends nothing readable" in fault())
        clock.wait(threading.Event(), 3.0 * WITHIN_S)
        assert "GGA or RMC, at 9600 baud" in fault()
        receiver.data = sentence("GPGGA,000012.00,,,,,0,00,99.9,,M,,M,,")
        service.wait_for(lambda: not fault())
    (run,) = tmp_path.glob("*.h5")
    notes = read_run(run).tables["notes"]
    assert [row["source"] for row in notes if row["code"] == b"no-epochs"] == [b"gnss", b"gnss"]


def _gga_alone(n):
    lines = service.nmea_epochs(n).splitlines(keepends=True)
    return b"".join(line for line in lines if b"GGA" in line)


@pytest.mark.parametrize("epochs", [service.nmea_epochs, _gga_alone])
def test_a_receiver_that_repeats_its_last_position_has_none(tmp_path, monkeypatch, epochs):
    monkeypatch.setattr(gnss_source, "OLD_S", WITHIN_S)
    receiver, none = Receiver(), str(tmp_path / "none")
    receiver.data = epochs(1)
    with (
        PtyDevice(receiver) as gnss,
        recording(make_service(tmp_path, Clock(), none, 0.0, 1.0, gnss.path)) as under_way,
    ):
        service.wait_for(lambda: under_way.snapshot().fix and under_way.snapshot().fix.valid)
        service.wait_for(lambda: not under_way.snapshot().fix.valid)
        receiver.data = epochs(2)
        service.wait_for(lambda: under_way.snapshot().fix.valid)
    (run,) = tmp_path.glob("*.h5")
    tables = read_run(run).tables
    assert np.isnan(tables["fixes"]["lat_deg"][tables["fixes"]["valid"] == 0]).all()
    assert b"position-repeated" in tables["notes"]["code"]


def test_a_gpsd_without_a_receiver_is_a_fault(tmp_path, monkeypatch):
    monkeypatch.setattr(gnss_source, "EPOCH_WITHIN_S", WITHIN_S)
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"gpsd://127.0.0.1:{server.getsockname()[1]}"
        under_way = make_service(tmp_path, Clock(), str(tmp_path / "none"), 0.0, 1.0, url)
        with recording(under_way):
            peer, _ = server.accept()
            peer.sendall(b'{"class":"DEVICES","devices":[]}\r\n')
            service.wait_for(lambda: "gpsmon" in under_way.snapshot().ports["gnss"].fault)
            peer.sendall(b'{"class":"TPV","device":"/dev/ttyACM0","mode":1}\r\n')
            service.wait_for(lambda: not under_way.snapshot().ports["gnss"].fault)
        peer.close()


_EARLY = Tpv(3, time="2007-02-04T12:00:00Z", lat=52.5, lon=13.4)


@pytest.mark.parametrize(
    ("report", "day"),
    [
        (_EARLY, date(2007, 2, 4)),
        (Tpv(1, time=_EARLY.time), None),
        (Tpv(3, time="2026-09-21T12:00:00Z", lat=52.5, lon=13.4), None),
    ],
)
def test_of_a_gpsd_too(report, day):
    fixes = GpsdFixes()
    list(fixes.feed(report, 0))
    assert fixes.impossible_date == day
