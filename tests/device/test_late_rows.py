"""Replies that come slowly, late or not to their end: each row is recorded, with the time in which
it was heard.
"""

import os
import re
import threading
import time
import tty
from contextlib import contextmanager, suppress

import pytest

from logger.config import ModemSettings, NmeaSettings
from logger.core.types import Fix, Note, RawBytes, Scan
from logger.device import modem_source, scan_timeout
from logger.device.clock import Clock
from logger.device.gnss_source import NmeaSource
from logger.device.link import Inbox, Link
from logger.device.modem_source import ModemSource
from logger.drivers.protocols.at import Command
from logger.drivers.sim800 import Sim800
from tests.kit import service

ROWS = [
    b'+CENG: 0,"0017,45,00,262,01,09,3039,05,05,1267,255"\r\n',
    *(
        b'+CENG: %d,"00%d,%d,12,30%da,262,01,1267"\r\n' % (i, 20 + i, 40 - i, i)
        for i in range(1, 6)
    ),
]
LEVELS = [45, 39, 38, 37, 36, 35]


class Device:
    """The far end of a port, in the hands of the test.

    `written_ns` is the time before and after each of its rows was written: a busy machine may let
    a part of a second pass between.
    """

    def __init__(self):
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self.written_ns = {}
        self._received = b""

    def say(self, data):
        before_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
        os.write(self._master, data)
        self.written_ns[data] = before_ns, time.clock_gettime_ns(time.CLOCK_BOOTTIME)

    def is_asked(self, command):
        """True once for each time that the command has come; everything else is answered OK."""
        with suppress(BlockingIOError):
            self._received += os.read(self._master, 4096)
        for line in re.findall(rb"[^\r]+\r", self._received):
            self._received = self._received.removeprefix(line)
            if line == command:
                return True
            self.say(b"\r\nOK\r\n")
        return False

    def hang_up(self, records_of, last_row):
        """Go away once this was read: a hang-up takes what was not."""
        service.wait_for(
            lambda: last_row in b"".join(record.value.data for record in records_of(RawBytes))
        )
        os.close(self._slave)
        os.close(self._master)


@contextmanager
def link_to(source, folder):
    """A link that is run until the end; gives the values that come, and stops it."""
    inbox, stop = Inbox(), threading.Event()
    link = Link(source, Clock(), inbox, stop)
    thread = threading.Thread(target=link.run, args=(folder,))
    values = []

    def records_of(kind):
        while (record := inbox.get(0.0)) is not None:
            values.append(record)
        return [record for record in values if isinstance(record.value, kind)]

    thread.start()
    try:
        yield records_of
    finally:
        stop.set()
        thread.join()


def _modem(device):
    settings = ModemSettings(name="modem", port=device.path, driver="sim800", poll_interval_s=0.05)
    return ModemSource(settings)


def _levels(records_of):
    return sorted(reading.rxlev_raw for scan in records_of(Scan) for reading in scan.value.readings)


@pytest.mark.parametrize("n_rows", range(1, 5))
@pytest.mark.parametrize("cut", [b"", b'+CENG: 5,"00', b'+CENG: 5,"0025,35,12,305a,262,01,1267"'])
def test_rows_before_a_hang_up_are_readings(tmp_path, n_rows, cut):
    device = Device()
    with link_to(_modem(device), tmp_path) as records_of:
        service.wait_for(lambda: device.is_asked(b"AT+CENG?\r"))
        device.say(b"\r\n+CENG: 1,1\r\n\r\n" + b"".join(ROWS[:n_rows]) + cut)
        device.hang_up(records_of, ROWS[n_rows - 1])
        service.wait_for(lambda: any(note.value.code == "port-lost" for note in records_of(Note)))
        assert _levels(records_of) == sorted(LEVELS[:n_rows])
        assert len(records_of(Scan)) == 1
        assert "internal" not in [note.value.code for note in records_of(Note)]


def test_rows_that_came_unasked_before_a_hang_up_are_readings(tmp_path):
    device = Device()
    with link_to(_modem(device), tmp_path) as records_of:
        service.wait_for(lambda: device.is_asked(b"AT+CENG?\r"))
        device.say(b"\r\nOK\r\n")
        device.say(b"".join(ROWS[:3]))
        device.hang_up(records_of, ROWS[2])
        service.wait_for(lambda: any(note.value.code == "port-lost" for note in records_of(Note)))
        assert _levels(records_of) == sorted(LEVELS[:3])


def test_the_epoch_before_a_hang_up_is_a_fix(tmp_path):
    device = Device()
    with link_to(NmeaSource(NmeaSettings(name="gnss", port=device.path)), tmp_path) as records_of:
        last_row = service.nmea_epochs(3).rpartition(b"$GNGGA")[
            0
        ]  # of the last one only the RMC has come
        device.say(last_row)
        device.hang_up(records_of, last_row)
        service.wait_for(lambda: any(note.value.code == "port-lost" for note in records_of(Note)))
        assert len(records_of(Fix)) == 3


@pytest.mark.parametrize("pause_s", [0.1, 0.7])
def test_rows_of_a_slow_reply_have_the_time_in_which_they_were_heard(
    tmp_path, monkeypatch, pause_s
):
    """Some come in time, some after the time-out, some into the next polls: none is told of a later
    time only.
    """
    monkeypatch.setattr(Sim800, "poll_commands", (Command("AT+CENG?", timeout_s=0.3),))
    monkeypatch.setattr(scan_timeout, "LATE_S", 0.2)
    # on a busy machine the rows come so late that the port would be opened again
    monkeypatch.setattr(modem_source, "SILENT_POLLS", 1000)
    device = Device()
    with link_to(_modem(device), tmp_path) as records_of:
        service.wait_for(lambda: device.is_asked(b"AT+CENG?\r"))
        device.say(b"\r\n+CENG: 1,1\r\n\r\n")
        for row in ROWS:
            device.say(row)
            end_s = time.monotonic() + pause_s
            while time.monotonic() < end_s:
                device.is_asked(b"AT+CENG?\r")  # further polls are not answered
                time.sleep(0.01)
        device.say(b"\r\nOK\r\n")
        service.wait_for(lambda: _levels(records_of) == sorted(LEVELS))
        written_ns = dict(zip(LEVELS, (device.written_ns[row] for row in ROWS), strict=True))
        for scan in records_of(Scan):
            for reading in scan.value.readings:
                before_ns, after_ns = written_ns[reading.rxlev_raw]
                assert scan.value.t_start_ns <= after_ns
                assert before_ns <= scan.t_ns
        device.hang_up(records_of, ROWS[-1])
