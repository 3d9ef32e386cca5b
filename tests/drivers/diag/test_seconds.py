"""One reading a second and cell."""

from statistics import stdev

import pytest

from logger.core.cell_names import Identity
from logger.drivers.diag.levels import Observation
from logger.drivers.diag.seconds import Seconds

SECOND_NS = 10**9
IDENTITY = Identity("262", "01", 4711, 26_214_401)


def one(t_s, level_dbm=-80.0, code=17, role="serving", **more):
    return Observation(round(t_s * 1e9), 0, "LTE", 1300, code, role, level_dbm, **more)


def seconds_of(observations):
    seconds = Seconds()
    found = [second for heard in observations for second in seconds.feed(heard)]
    return [*found, *seconds.end()]


def test_levels_of_a_second_are_one_reading():
    levels_dbm = [-80.0 - k % 7 / 16 for k in range(25)]
    heard = [one(5.0 + k / 25, level) for k, level in enumerate(levels_dbm)]
    (second,) = seconds_of([*heard, one(5.5, -95.0, 18, "neighbour")])
    serving, neighbour = second.readings
    assert (serving.rsrp_dbm, serving.n_levels) == (sorted(levels_dbm)[12], 25)
    assert serving.level_sd_db == pytest.approx(stdev(levels_dbm))
    assert (neighbour.rsrp_dbm, neighbour.n_levels, neighbour.level_sd_db) == (-95.0, 1, None)
    assert (serving.role, serving.arfcn, serving.pci, serving.cell) == ("serving", 1300, 17, None)
    assert 5.45 < second.time_ns / 1e9 < 5.55


def test_each_receiver_and_each_second_has_its_own():
    heard = [one(t / 10)._replace(radio_id=radio) for t in range(40) for radio in (1, 2)]
    found = seconds_of(heard)
    assert sorted((s.radio_id, s.time_ns // SECOND_NS) for s in found) == [
        (radio, second) for radio in (1, 2) for second in range(4)
    ]
    assert {s.readings[0].n_levels for s in found} == {10}


def test_a_late_record_still_finds_its_second():
    found = seconds_of([one(0.1), one(1.1), one(0.9, -82.0), one(2.1), one(3.1)])
    assert [s.readings[0].n_levels for s in found] == [2, 1, 1, 1]
    assert found[0].readings[0].rsrp_dbm == -81.0


def test_a_clock_that_jumps_back_begins_new_seconds():
    found = seconds_of([one(1e9), one(1.0), one(1e9), one(1.5)])
    assert [(round(s.time_ns / 1e9), len(s.readings)) for s in found] == [
        (10**9, 1), (1, 1), (10**9, 1), (2, 1),
    ]  # fmt: skip


def test_a_serving_cell_keeps_its_identity():
    heard = [
        one(0, None, identity=IDENTITY),
        *(one(t) for t in range(1, 900, 10)),
        one(900, code=18),  # another cell serves
        one(901),
        one(902, None, identity=IDENTITY),
        one(1300),  # and this may be another cell of its channel and code
    ]
    named = {round(s.time_ns / 1e9): s.readings[0].cell for s in seconds_of(heard)}
    name = "262-01-4711-26214401"
    assert [named[t] for t in (0, 1, 891, 900, 901, 902, 1300)] == [
        name, name, name, None, None, name, None,
    ]  # fmt: skip


def test_what_was_reported_counts_only_without_a_level():
    """A report is filtered and in steps of 1 dB."""
    reported = one(0.5, -70.5, is_reported=True)
    both, alone = seconds_of([one(0.1), reported, reported._replace(time_ns=5 * SECOND_NS)])
    assert (both.readings[0].rsrp_dbm, both.readings[0].n_levels) == (-80.0, 1)
    assert (alone.readings[0].rsrp_dbm, alone.readings[0].n_levels) == (-70.5, 1)


def test_timing_advance_and_lists_are_part_of_the_reading():
    gsm = Observation(0, 0, "GSM", 16, 12, "serving", -76.75, neighbours=(4, 42))
    (second,) = seconds_of([one(0.1, ta_16ts=5), gsm])
    lte, old = second.readings
    assert lte.ta_16ts == 5
    assert (old.rssi_dbm, old.bsic, old.broadcast.neighbour_arfcns) == (-76.75, 12, (4, 42))


def test_what_says_nothing_of_a_cell_is_no_reading():
    assert seconds_of([one(0.1, None), one(0.2)._replace(channel=None)]) == []


def test_no_second_grows_without_limit():
    """A file may have any number of records and cells in a second."""
    heard = (one(0.5, code=k % 504)._replace(channel=k) for k in range(200_000))
    (second,) = seconds_of(heard)
    assert len(second.readings) == 128
