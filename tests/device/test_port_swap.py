from pathlib import Path

import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import read_run
from logger.core.types import Fix, Note, RawBytes, Record, Scan
from logger.device.watched_inbox import WAIT_S, PortSwap
from tests.kit import runs, service
from tests.kit.simulated_devices import simulated_devices

S = 10**9
NMEA = RawBytes(b"$GPGGA,,,,,,0,,,,,,,,*66\r\n")


class Watched:
    """A `PortSwap`, queried each second; `changes` are the seconds at which it was wrong, and
    exchanged.
    """

    def __init__(self):
        self.swap = PortSwap(0, S)
        self.now_s = 0
        self.changes = []

    def live(self, seconds, *said):
        for _ in range(seconds):
            self.now_s += 1
            for source, value in said:
                self.swap.feed(Record(self.now_s * S, source, value))
            if self.swap.is_wrong(self.now_s * S):
                self.swap.swap(self.now_s * S)
                self.changes.append(self.now_s)
        return self.changes


def test_a_receiver_on_the_modems_port_and_silence_on_its_own_is_a_swap():
    assert Watched().live(int(WAIT_S), ("modem", NMEA)) == []
    assert Watched().live(40, ("modem", NMEA)) == [WAIT_S + 2]


@pytest.mark.parametrize(
    "said",
    [
        [("modem", NMEA), ("gnss", Fix(False))],
        [("modem", RawBytes(b"x")), ("modem", Scan(0, (runs.reading(1, -70.0),)))],
        [("modem", RawBytes(b"x")), ("modem", Note("info", "modem-ready", ""))],
        [("modem", RawBytes(b"AT\r", sent=True))],
        [],
    ],
    ids=[
        "receiver understood",
        "modem understood",
        "modem ready",
        "only our own words",
        "both silent",
    ],
)
def test_one_that_is_understood_is_where_it_belongs_and_silence_says_nothing(said):
    assert Watched().live(1000, *said) == []


def test_a_word_and_then_silence_is_no_receiver():
    """A modem that restarts says so, and may then be silent for a scan."""
    watched = Watched()
    watched.live(2, ("modem", RawBytes(b"RDY\r\n")))
    assert watched.live(200) == []


def test_a_wrong_guess_is_taken_back_and_repeated_ever_more_seldom():
    """A modem that babbles, and a receiver without power: nothing is better, and half of the time
    is the modem's.
    """
    changes = Watched().live(3000, ("modem", NMEA))
    there = [back - out for out, back in zip(changes[::2], changes[1::2], strict=False)]
    home = [out - back for back, out in zip([0, *changes[1::2]], changes[::2], strict=False)]
    assert there == sorted(there)
    assert home == sorted(home)
    assert len(changes) < 14


def test_an_exchange_that_helped_stays_though_both_fall_silent():
    watched = Watched()
    watched.live(25, ("modem", NMEA))
    watched.live(100, ("gnss", Fix(True)))
    assert len(watched.live(1000)) == 1
    assert len(watched.live(19, ("modem", NMEA))) == 1, "a modem that starts is given time"
    assert len(watched.live(5, ("modem", NMEA))) == 2, "swapped once more by hand"


def test_a_word_now_and_then_is_no_receiver():
    watched = Watched()
    for _ in range(50):
        watched.live(1, ("modem", NMEA))
        watched.live(9)
    assert watched.changes == []


def _rows_of(folder, table):
    try:
        return max(
            (len(read_run(path).tables[table]) for path in folder.glob("*.journal")), default=0
        )
    except RunFileError:  # made, and not yet written for the first time
        return 0


@pytest.mark.slow
def test_the_service_exchanges_ports_that_are_swapped(tmp_path):
    with simulated_devices(rate=1.0) as (modem, gnss, _):
        site = service.site_toml(tmp_path, gnss.path, modem.path)
        site.write_text(site.read_text().replace('driver = "sim800"', 'driver = "auto"'))
        with service.running_service(site) as logger:
            service.wait_for(lambda: _rows_of(tmp_path / "runs", "fixes") > 15)
            service.wait_for(lambda: _rows_of(tmp_path / "runs", "scans") > 5)
            run = read_run(Path(service.stop_service(logger).strip()))
    codes = [row["code"].decode() for row in run.tables["notes"]]
    assert codes.count("ports-exchanged") == 1
    assert codes.index("ports-exchanged") < codes.index("modem-identified")
