"""Neighbour lists before the real service, also from a line that loses digits."""

from dataclasses import replace

from logger.core.runfile import read_run
from logger.device.clock import ScaledClock
from logger.sim.ptys import PtyDevice, answering
from logger.sim.scenario import scenario
from logger.sim.walk import WalkTime
from tests.device.test_lost_digits import EACH, Leaky
from tests.kit.dialects import DIALECTS
from tests.kit.recorded_runs import RecordedRun, make_service, record_until

BLOCK = scenario("clear")
BROADCASTS = {t.arfcn: t.broadcast for t in BLOCK.world.transmitters}
SPEED = 50.0
POLL_S = 1.0
FULL_SCAN_S = 70.0
ENOUGH = 3 * EACH
LISTS = rb"(array: )([0-9][0-9 ]+[0-9])"
NO_NUMBER = rb"(no such)(text)"


def walk(tmp_path, number, enough, full_scan_s=FULL_SCAN_S):
    """A walk with so many replies that have a list; the modem, and the run."""
    clock = ScaledClock(SPEED)
    modem = Leaky(BLOCK.modem(WalkTime(clock).now_s, DIALECTS["ge864"]), number)
    with PtyDevice(answering(modem)) as port:
        under_way = make_service(tmp_path, clock, port.path, full_scan_s, POLL_S)
        under_way.start()
        record_until(under_way, clock, enough)
        return modem, RecordedRun(read_run(under_way.stop("end")))


def lists_of(walked):
    """Readings with a broadcast, in the order of the scans."""
    return [one for _, scan in walked.scans() for one in scan if one.broadcast is not None]


def true(reading):
    return replace(reading.broadcast, broadcast_unsure=False) == BROADCASTS[reading.arfcn]


def test_lists_are_those_of_the_world_and_sure_from_the_second_full_scan_on(tmp_path):
    def has_all(walked):
        sure = {one.arfcn for one in lists_of(walked) if not one.broadcast.broadcast_unsure}
        return sure >= set(BROADCASTS)

    _, walked = walk(tmp_path, NO_NUMBER, has_all)
    assert has_all(walked)
    seen = set()
    for reading in lists_of(walked):
        assert true(reading)
        assert reading.role == "scan"
        assert reading.broadcast.broadcast_unsure == (reading.arfcn not in seen)
        seen.add(reading.arfcn)


def test_without_full_scans_there_are_no_lists(tmp_path):
    _, walked = walk(tmp_path, NO_NUMBER, lambda walked: len(walked.scans()) > 5, 0.0)
    assert len(walked.scans()) > 5
    assert not lists_of(walked)
    assert b"#CSURV=" not in walked.run.raw_bytes.tobytes()


def test_a_list_that_loses_digits_again_and_again_is_never_sure(tmp_path):
    modem, walked = walk(
        tmp_path,
        LISTS,
        lambda walked: len({seq for seq, scan in walked.scans() if any_list(scan)}) >= ENOUGH,
    )
    assert modem.lost >= 2
    false = [reading for reading in lists_of(walked) if not true(reading)]
    assert all(reading.broadcast.broadcast_unsure for reading in false)
    sure = [reading for reading in lists_of(walked) if not reading.broadcast.broadcast_unsure]
    assert {reading.arfcn for reading in sure} == set(BROADCASTS)


def any_list(scan):
    return any(reading.broadcast is not None for reading in scan)


def test_the_lists_of_the_world_differ_so_that_a_mix_up_shows():
    assert len({broadcast.neighbour_arfcns for broadcast in BROADCASTS.values()}) == len(BROADCASTS)
