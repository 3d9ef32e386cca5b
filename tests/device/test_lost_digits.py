"""A line that loses a digit now and then, before the real service: no false cell is told for
certain.
"""

import re

import pytest

from logger.core.runfile import read_run
from logger.device.clock import ScaledClock
from logger.sim.ptys import PtyDevice, answering
from logger.sim.scenario import scenario
from logger.sim.walk import WalkTime
from tests.kit.dialects import DIALECTS
from tests.kit.recorded_runs import RecordedRun, make_service, record_until

BLOCK = scenario("clear")
CELLS = {(t.mcc, t.mnc, t.lac, t.cid) for t in BLOCK.world.transmitters}
AREAS = {(None, None, lac, None) for _, _, lac, _ in CELLS} | {
    (m, n, None, None) for m, n, _, _ in CELLS
}
SPEED = 20.0
EACH = 4
ENOUGH = 40
# what stands before and in the number that loses a digit: a cell of the reply, or its serving one
NUMBERS = {
    "sim800": rb'(\+CENG: 1,"\d+,\d+,\d+,[0-9a-f])([0-9a-f]{3})',
    "sim7600": rb"(\+CPSI: GSM,Online,\d+-\d+,0x[0-9A-F]+,\d)(\d+)",
    "ec25": rb'("servingcell","[A-Z]+","GSM",\d+,\d+,[0-9A-F]+,[0-9A-F])([0-9A-F]{3})',
    "m95": rb"(\+QENG: 0,\d+,\d+,[0-9a-f]+,[0-9a-f])([0-9a-f]{3})",
}


class Leaky:
    """A modem whose line loses a digit of one number in every fourth reply that has such a
    number.
    """

    def __init__(self, modem, number) -> None:
        self._modem = modem
        self._number = re.compile(number)
        self.replies = 0
        self.lost = 0

    def feed(self, data: bytes) -> bytes:
        return self._leak(self._modem.feed(data))

    def unsolicited(self) -> bytes:
        """Slow answers among it."""
        return self._leak(self._modem.unsolicited())

    def _leak(self, out: bytes) -> bytes:
        found = self._number.search(out)
        if found is None:
            return out
        self.replies += 1
        if self.replies % EACH:
            return out
        self.lost += 1
        at = found.start(2) + self.lost % len(found[2])
        return out[:at] + out[at + 1 :]


def who(reading):
    return reading.mcc, reading.mnc, reading.lac, reading.cid


@pytest.mark.parametrize("name", NUMBERS)
def test_a_digit_lost_again_and_again_makes_no_cell_that_is_sure(tmp_path, name):
    clock = ScaledClock(SPEED)
    modem = Leaky(BLOCK.modem(WalkTime(clock).now_s, DIALECTS[name]), NUMBERS[name])
    with PtyDevice(answering(modem)) as port:
        under_way = make_service(tmp_path, clock, port.path, 0.0, 0.05 * SPEED)
        under_way.start()
        record_until(under_way, clock, lambda walked: len(walked.scans()) >= ENOUGH)
        walked = RecordedRun(read_run(under_way.stop("end")))
    assert modem.lost >= ENOUGH // EACH - 1
    readings = [reading for _, found in walked.scans() for reading in found]
    false = [
        reading for reading in readings if reading.cell is not None and who(reading) not in CELLS
    ]
    assert all(reading.identity_unsure for reading in false), [
        who(r) for r in false if not r.identity_unsure
    ]
    assert all(reading.level_dbm is not None for reading in false)
    true = [reading for reading in readings if who(reading) in CELLS]
    assert len(true) > len(readings) / 2
    unsure = sum(reading.identity_unsure for reading in true)
    assert unsure <= 1 + len(true) / 100
