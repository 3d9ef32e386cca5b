import re
from dataclasses import replace

import numpy as np
import pytest

from logger.drivers.protocols.at import AtFramer
from logger.drivers.sim800 import Sim800
from logger.sim.devices import SimulatedModem
from logger.sim.walk import Walk
from logger.sim.world import Radio, Transmitter, World
from tests.kit.dialects import DIALECTS

WALK = Walk(((0.0, 0.0), (1000.0, 0.0)), speed_mps=10.0)
SERVING = Transmitter(0.0, 10.0, -30.0, 3.0, "001", "01", 0x0113, 0x4E72, arfcn=666, bsic=8)
OTHER = Transmitter(1000.0, 10.0, -10.0, 3.0, "001", "01", 0x0114, 0xA53F, arfcn=25, bsic=25)


class Stopwatch:
    t_s = 0.0

    def __call__(self):
        return self.t_s


@pytest.fixture
def stopwatch():
    return Stopwatch()


@pytest.fixture
def modem(stopwatch):
    radio = Radio(shadowing_sigma_db=0.0, fading_sigma_db=0.0)
    world = World.build((OTHER, SERVING), 46.9, 7.4, radio, np.random.default_rng(0))
    modem = SimulatedModem(DIALECTS["sim800"], world, WALK, stopwatch, np.random.default_rng(0))
    modem.feed(b"ATE0\r")
    return modem


def _deaf(world, stopwatch):
    return SimulatedModem(
        DIALECTS["sim800"], world, WALK, stopwatch, np.random.default_rng(0), decode_dbm=-40.0
    )


def test_a_poll_byte_by_byte(modem):
    assert modem.feed(b"AT+CENG=1,1\r") == b"\r\nOK\r\n"
    assert modem.feed(b"AT+CENG?\r") == (
        b"\r\n+CENG: 1,1\r\n"
        b'\r\n+CENG: 0,"0666,53,00,001,01,08,4e72,05,05,0113,255"\r\n'
        b'+CENG: 1,"0025,13,25,a53f,001,01,0114"\r\n'
        b"\r\nOK\r\n"
    )


def test_engineering_mode_is_off_at_first(modem):
    assert modem.feed(b"AT+CENG?\r") == b"\r\n+CENG: 0,0\r\n\r\nOK\r\n"


def test_number_of_cells_is_kept_where_a_setting_leaves_it_out(modem):
    modem.feed(b"AT+CENG=1,1\rAT+CENG=4\r")

    assert modem.feed(b"AT+CENG?\r").startswith(b"\r\n+CENG: 4,1\r\n")


def test_header_only_where_nothing_is_decoded(modem, stopwatch):
    deaf = _deaf(modem._world, stopwatch)
    assert deaf.feed(b"ATE0\rAT+CENG=1,1\rAT+CENG?\r").endswith(
        b"\r\nOK\r\n\r\n+CENG: 1,1\r\n\r\nOK\r\n"
    )


def test_the_walk_changes_the_serving_cell(modem, stopwatch):
    modem.feed(b"AT+CENG=1,1\r")
    stopwatch.t_s = 95.0

    assert b'+CENG: 0,"0025,' in modem.feed(b"AT+CENG?\r")


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (b"AT", b"\r\nOK\r\n"),
        (b"at+csq", b"\r\n+CSQ: 27,0\r\n\r\nOK\r\n"),  # -60 dBm
        (b"ATI", b"\r\nSIM800 R14.18\r\n\r\nOK\r\n"),
        (b"AT+CGMM", b"\r\nSIMCOM_SIM800L\r\n\r\nOK\r\n"),
        (b"AT+CGMR", b"\r\nRevision:1418B05SIM800L24\r\n\r\nOK\r\n"),
        (b"AT+CPIN?", b"\r\nERROR\r\n"),
        (b"AT+CMEE=1\rAT+CPIN?", b"\r\nOK\r\n\r\n+CME ERROR: 10\r\n"),
        (b"AT+CMEE=2\rAT+CPIN?", b"\r\nOK\r\n\r\n+CME ERROR: SIM not inserted\r\n"),
        (b"AT+CENG=5,1", b"\r\nERROR\r\n"),
        (b"AT+NONSENSE", b"\r\nERROR\r\n"),
        (b"\xff\x00garbage", b""),
        (b"", b""),
    ],
)
def test_answers(modem, command, answer):
    assert answer == modem.feed(command + b"\r")


def test_csq_without_a_cell(modem, stopwatch):
    deaf = _deaf(modem._world, stopwatch)

    assert deaf.feed(b"AT+CSQ\r") == b"AT+CSQ\r\r\n+CSQ: 0,0\r\n\r\nOK\r\n"


def test_echo_until_it_is_switched_off(modem):
    modem.feed(b"ATE1\r")

    assert modem.feed(b"AT\r\n") == b"AT\r\r\nOK\r\n"
    assert modem.feed(b"ATE0\r") == b"ATE0\r\r\nOK\r\n"
    assert modem.feed(b"AT\r") == b"\r\nOK\r\n"


def test_bytes_may_come_one_by_one(modem):
    modem.feed(b"ATE1\r")

    assert (
        b"".join(modem.feed(bytes([byte])) for byte in b"AT+CMEE=1\r") == b"AT+CMEE=1\r\r\nOK\r\n"
    )


def test_mode_2_prints_unsolicited_rows(modem, stopwatch):
    modem.feed(b"AT+CENG=2,1\r")

    assert modem.unsolicited() == b""
    stopwatch.t_s = 5.0
    rows = modem.unsolicited()
    assert re.fullmatch(rb'\r\n\+CENG: 0,"[^"]*"\r\n\+CENG: 1,"[^"]*"\r\n', rows)
    assert modem.unsolicited() == b""


def test_the_driver_sets_it_up_and_polls_it(modem):
    framer, driver = AtFramer(), Sim800()
    modem.feed(b"ATE1\r")

    def talk(dialogue):
        reply = None
        while True:
            try:
                command = dialogue.send(reply)
            except StopIteration as done:
                return done.value
            framer.send(command.text)
            (reply,) = framer.feed(modem.feed(command.text.encode() + b"\r"))

    assert talk(driver.setup()) is True
    assert [(r.cid, r.rssi_dbm) for r in talk(driver.poll())] == [(0x4E72, -60.0), (0xA53F, -100.0)]


def test_several_commands_in_a_line(modem):
    assert (
        modem.feed(b"AT+CMEE=1;+CSQ;+CREG?\r") == b"\r\n+CSQ: 27,0\r\n\r\n+CREG: 0,0\r\n\r\nOK\r\n"
    )
    assert modem.feed(b"AT+CSQ;+NONSENSE;+CSQ\r") == b"\r\n+CSQ: 27,0\r\n\r\nERROR\r\n"


def test_a_full_scan_takes_its_time(modem, stopwatch):
    modem.feed(b"AT+CNETSCAN=1\r")

    assert modem.feed(b"AT+CNETSCAN\rAT+CSQ\r") == b""
    stopwatch.t_s = 39.0
    assert modem.unsolicited() == b""
    stopwatch.t_s = 40.0
    said = modem.unsolicited()
    assert said.count(b"Operator:") == 2
    assert b"MCC:001,MNC:01,Rxlev:11,Cellid:A53F,Arfcn:25,Lac:0114,Bsic:19\r\n" in said
    assert said.endswith(b"\r\n\r\nOK\r\n\r\n+CSQ: 10,0\r\n\r\nOK\r\n")  # read 40 s later


def test_a_character_ends_a_full_scan_of_an_abortable_modem(stopwatch):
    radio = Radio(shadowing_sigma_db=0.0, fading_sigma_db=0.0)
    world = World.build((OTHER, SERVING), 46.9, 7.4, radio, np.random.default_rng(0))
    dialect = replace(DIALECTS["sim800"], abortable=True)
    modem = SimulatedModem(dialect, world, WALK, stopwatch, np.random.default_rng(0))
    modem.feed(b"ATE0\rAT+CNETSCAN\r")

    assert modem.feed(b"AT\r") == b"\r\nOK\r\n"  # what follows the first character is no command
    stopwatch.t_s = 50.0
    assert modem.unsolicited() == b""
    assert modem.feed(b"AT+CSQ\r").endswith(b"\r\nOK\r\n")


def test_a_restart_loses_everything(modem, stopwatch):
    modem.feed(b"AT+CENG=1,1\rAT+CNETSCAN\r")

    assert modem.restart().startswith(b"\r\nRDY\r\n")
    assert modem.feed(b"AT+CENG?\r") == b"AT+CENG?\r\r\n+CENG: 0,0\r\n\r\nOK\r\n"


def test_the_echo_comes_on(modem):
    modem.echo()

    assert modem.feed(b"AT\r") == b"AT\r\r\nOK\r\n"
