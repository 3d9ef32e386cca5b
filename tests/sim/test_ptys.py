import threading
import time
from pathlib import Path

import numpy as np
import pytest
import serial

from logger.device.clock import ScaledClock
from logger.sim.ptys import PtyDevice, answering, talking
from logger.sim.walk import WalkTime
from tests.kit.service import LIMIT_S, assert_ends, wait_for
from tests.kit.unflushed_serial import UnflushedSerial


class Parrot:
    """Gives back every byte, and speaks by itself when it is told to."""

    def __init__(self):
        self.pending = b""

    def feed(self, data):
        return data

    def unsolicited(self):
        sent, self.pending = self.pending, b""
        return sent


class Ticker:
    def epoch(self, t_s):
        return b"%d\r\n" % t_s


EVERY_BYTE = bytes(range(256))


def open_port(device):
    return UnflushedSerial(
        device.path, 115200, timeout=LIMIT_S, write_timeout=LIMIT_S, exclusive=True
    )


@pytest.fixture(autouse=True)
def no_thread_is_left():
    before = set(threading.enumerate())
    yield
    wait_for(lambda: set(threading.enumerate()) <= before)


def test_every_byte_comes_back_as_it_was():
    with PtyDevice(answering(Parrot())) as device, open_port(device) as port:
        port.write(EVERY_BYTE)
        assert port.read(256) == EVERY_BYTE


def test_port_can_be_closed_and_opened_again():
    with PtyDevice(answering(Parrot())) as device:
        for text in (b"once", b"twice", b"again"):
            with open_port(device) as port:
                port.write(text)
                assert text == port.read(len(text))
            time.sleep(0.06)  # so that the device notices the hang-up at least once


def test_modem_speaks_by_itself():
    parrot = Parrot()
    with PtyDevice(answering(parrot)) as device, open_port(device) as port:
        parrot.pending = b"unasked"
        assert port.read(7) == b"unasked"


def test_more_than_the_line_holds_gets_through_to_a_slow_reader():
    data = np.random.default_rng(0).bytes(200_000)
    parrot = Parrot()
    with PtyDevice(answering(parrot)) as device, open_port(device) as port:
        parrot.pending = data
        time.sleep(0.1)
        assert data == port.read(len(data))


def test_receiver_speaks_each_second_of_a_fast_clock():
    time_of_walk = WalkTime(ScaledClock(200.0))
    with PtyDevice(talking(Ticker(), time_of_walk)) as device, open_port(device) as port:
        first = int(port.readline())
        assert [first + n for n in range(1, 60)] == [int(port.readline()) for _ in range(59)]
        assert time_of_walk.now_s() >= first + 59


def test_receiver_keeps_nothing_that_is_not_read():
    time_of_walk = WalkTime(ScaledClock(200.0))
    with PtyDevice(talking(Ticker(), time_of_walk)) as device:
        while time_of_walk.now_s() < 40.0:
            time.sleep(0.01)
        with open_port(device) as port:
            assert int(port.readline()) >= 39


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("kind", ["modem", "receiver"])
def test_stops_promptly_whoever_holds_the_port(kind, held):
    session = (
        answering(Parrot()) if kind == "modem" else talking(Ticker(), WalkTime(ScaledClock(1.0)))
    )
    device = PtyDevice(session)
    device.__enter__()
    port = open_port(device) if held else None
    time.sleep(0.05)
    assert_ends(lambda: device.__exit__(None, None, None))
    if port is not None:
        port.close()


def test_stops_while_a_reader_reads_nothing():
    parrot = Parrot()
    with PtyDevice(answering(parrot)) as device, open_port(device):
        parrot.pending = bytes(1_000_000)
        time.sleep(0.1)


def test_what_is_said_from_the_opening_on_is_kept():
    with (
        PtyDevice(talking(Ticker(), WalkTime(ScaledClock(20.0)))) as device,
        Path(device.path).open("rb", buffering=0) as port,
    ):
        first = int(port.readline())
        assert int(port.readline()) == first + 1


def test_device_can_be_pulled_out_and_plugged_in_again(tmp_path):
    with PtyDevice(answering(Parrot()), tmp_path / "modem") as device:
        with open_port(device) as port:
            port.write(b"once")
            assert port.read(4) == b"once"
            device.unplug()
            assert not (tmp_path / "modem").exists()
            with pytest.raises(serial.SerialException):
                port.read(1)
        device.plug()
        with open_port(device) as port:
            port.write(b"again")
            assert port.read(5) == b"again"
