import hashlib
import time

import numpy as np
import pytest

from logger.drivers.protocols.at import AtFramer
from logger.sim.ptys import PtyDevice, answering
from tests.kit.recorded_replies import NmeaPlayer, TranscriptModem
from tests.kit.service import LIMIT_S
from tests.kit.unflushed_serial import UnflushedSerial

LOG = b"".join(b"$GNTXT,%06d*00\r\n" % number for number in range(20_000))


def open_port(device):
    return UnflushedSerial(device.path, 115200, timeout=LIMIT_S, exclusive=True)


def test_every_byte_comes_exactly_once():
    player = NmeaPlayer(LOG)
    with PtyDevice(player) as device:
        time.sleep(0.05)  # nobody listens yet: nothing is lost
        with open_port(device) as port:
            heard = port.read(len(LOG))
            port.timeout = 0.1
            assert port.read(1) == b""
            assert player.finished.wait(LIMIT_S)
    assert hashlib.sha256(LOG).digest() == hashlib.sha256(heard).digest()


def test_slow_reader_loses_nothing():
    with PtyDevice(NmeaPlayer(LOG[:60_000])) as device, open_port(device) as port:
        heard = b""
        rng = np.random.default_rng(0)
        while len(heard) < 60_000:
            heard += port.read(min(int(rng.integers(1, 4000)), 60_000 - len(heard)))
            time.sleep(0.001)
    assert LOG[:60_000] == heard


def test_rate_is_kept():
    began_s = time.monotonic()
    with (
        PtyDevice(NmeaPlayer(LOG[:10_240], bytes_per_s=20_480.0)) as device,
        open_port(device) as port,
    ):
        assert LOG[:10_240] == port.read(10_240)
        assert time.monotonic() - began_s > 0.4


def test_player_stops_while_nothing_reads():
    with PtyDevice(NmeaPlayer(LOG)) as device, open_port(device):
        time.sleep(0.05)


def test_empty_log_is_finished_at_once():
    player = NmeaPlayer(b"")
    with PtyDevice(player):
        assert player.finished.wait(LIMIT_S)


ROWS = b'+CENG: 1,1\n+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"\n'
ON_THE_WIRE = b'\r\n+CENG: 1,1\r\n+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"\r\n'


@pytest.mark.parametrize(
    ("recorded", "played"),
    [
        (ROWS, ON_THE_WIRE + b"\r\nOK\r\n"),
        (ROWS + b"OK\n", ON_THE_WIRE + b"OK\r\n"),
        (ROWS + b"\nOK\n\n", ON_THE_WIRE + b"\r\nOK\r\n\r\n"),
        (ON_THE_WIRE, b"\r\n" + ON_THE_WIRE + b"\r\nOK\r\n"),
        (b"+CME ERROR: 3", b"\r\n+CME ERROR: 3\r\n"),
        (b'+CENG: 3,"0038', b'\r\n+CENG: 3,"0038\r\n\r\nOK\r\n'),
        (b"", b"\r\n\r\n\r\nOK\r\n"),
    ],
)
def test_recorded_replies_are_played_as_a_modem_prints_them(recorded, played):
    modem = TranscriptModem([recorded])
    modem.feed(b"ATE0\r")

    assert played == modem.feed(b"AT+CENG?\r")


def test_replies_come_in_their_order_and_then_none():
    modem = TranscriptModem([b"+CENG: 1,1\nOK\n", b"+CENG: 1,0\nOK\n"])
    modem.feed(b"ATE0\r")

    answers = [modem.feed(b"AT+CENG?\r").split()[:2] for _ in range(3)]

    assert answers == [[b"+CENG:", b"1,1"], [b"+CENG:", b"1,0"], [b"+CENG:", b"1,1"]]
    assert modem.served == 2


def test_error_after_the_last_reply_where_that_is_wanted():
    modem = TranscriptModem([], afterwards="error")

    assert modem.feed(b"AT+CENG?\r") == b"AT+CENG?\r\r\nERROR\r\n"


@pytest.mark.parametrize("command", [b"AT", b"ATE0", b"AT+CMEE=1", b"AT+CENG=1,1"])
def test_settings_are_accepted(command):
    assert command + b"\r\r\nOK\r\n" == TranscriptModem([]).feed(command + b"\r")


def test_replies_through_a_port():
    framer = AtFramer()
    with PtyDevice(answering(TranscriptModem([ROWS] * 50))) as device, open_port(device) as port:
        for _ in range(50):
            framer.send("AT+CENG?")
            port.write(b"AT+CENG?\r")
            (reply,) = framer.feed(port.read_until(b"OK\r\n"))
            assert ROWS.decode().splitlines() == list(reply.lines)
