from dataclasses import replace

import pytest

from logger.core.answer import MultiPolygon, StrongestReading
from logger.core.places import Utm
from logger.core.types import LiveEstimate, Record, Scan
from logger.device.live_view import (
    MOST_CELLS,
    MOST_SHOWN,
    TREND_NS,
    CellTable,
    LiveView,
    PositionStatus,
    SuspicionStatus,
    TargetStatus,
    target_status,
)
from tests.kit.runs import reading

S = 10**9
FIRST, SECOND = "262-01-4711-1", "262-01-4711-2"
ESTIMATE = LiveEstimate(
    7, "locator", "262-01-4711-1", 30, 33, 400_000.0, 5_800_000.0, -40.0, 3.0,
    100.0, 0.0, 5.0, 0.1, 25.0, 4.0, 0.2, 9.0, 0.3, 0.2, 1.0, 4.0, 0.6,
)  # fmt: skip


def _table(*scans):
    table = CellTable()
    for t_s, *readings in scans:
        table.feed(Record(round(t_s * S), "modem", Scan(0, tuple(readings))))
    return table


def _rows(table, *suspicions):
    return table.fill(LiveView(suspicions=suspicions)).cells


def test_the_serving_cell_is_first_and_the_others_follow_by_level():
    neighbours = [reading(n, -70.0 - n, "neighbour") for n in (3, 2)]
    rows = _rows(_table((1, reading(1, -90.0), *neighbours)))
    assert [row.cell[-1] for row in rows] == ["1", "2", "3"]
    assert [row.is_serving for row in rows] == [True, False, False]
    assert (rows[0].rat, rows[0].channel, rows[0].n, rows[0].heard_ns) == ("GSM", 17, 1, S)


def test_average_peak_and_trend():
    levels = [(t, -80.0) for t in range(1, 9)] + [(9, -74.0), (10, -73.0), (11, -70.0), (12, -71.0)]
    (row,) = _rows(_table(*((t, reading(1, level)) for t, level in levels)))
    assert (row.level_dbm, row.average_dbm, row.peak_dbm, row.n) == (-71.0, -70.5, -70.0, 12)
    assert row.trend_db == 8.0  # warmer: -72 after -80
    (row,) = _rows(_table((1, reading(1, -60.0))))
    assert row.trend_db is None


def test_levels_are_those_of_the_first_modem_until_it_hears_the_cell_no_more():
    table = CellTable()
    for t_s in range(1, 40):
        if t_s < 20:
            table.feed(Record(t_s * S, "first", Scan(0, (reading(1, -70.0),))))
        table.feed(Record(t_s * S + 1, "second", Scan(0, (reading(1, -79.0),))))
        (row,) = _rows(table)
        at_first = t_s < 19 + TREND_NS // S
        assert (row.modem, row.level_dbm) == (("first", -70.0) if at_first else ("second", -79.0))
        assert row.trend_db in {None, 0.0}
    assert row.peak_dbm == -79.0


def test_timing_advance_is_a_distance_and_stays():
    table = _table((1, replace(reading(1, -60.0), ta=2)), (2, reading(1, -60.0)))
    assert _rows(table)[0].ta_m == pytest.approx(1107.0)


def test_words_and_verdicts():
    table = _table((1, reading(1, -60.0), reading(2, -70.0, "neighbour")))
    table.feed(Record(2, "live", replace(ESTIMATE, stage="reference-ekf", probability=1.0)))
    assert _rows(table)[0].verdict is None
    table.feed(Record(2, "live", ESTIMATE))
    first, second = _rows(table, SuspicionStatus(SECOND, "suspicious", 9.0, ("new here",)))
    assert (first.verdict, first.word) == ("several places", None)
    assert (second.verdict, second.word, second.reasons) == (None, "suspicious", ("new here",))


def test_memory_is_bounded_and_doubtful_names_do_not_count():
    table = _table(*((n, reading(n, -60.0 - n % 30)) for n in range(1000)))
    assert len(table._cells) == MOST_CELLS
    assert len(_rows(table)) == MOST_SHOWN
    assert _rows(_table((1, replace(reading(1, -60.0), identity_unsure=True)))) == ()


def test_cells_that_were_passed_long_ago_make_room_for_those_heard_now():
    passed = [(n, reading(n, -50.0, "neighbour")) for n in range(10, 10 + MOST_SHOWN)]
    now = 1000, reading(1, -90.0), *(reading(n, -95.0 - n, "neighbour") for n in (2, 3, 4))
    rows = _rows(_table(*passed, now))
    assert [row.cell[-2:] for row in rows[:4]] == ["-1", "-2", "-3", "-4"]
    assert len(rows) == MOST_SHOWN
    assert {row.heard_ns for row in rows[4:]} == {n * S for n in range(14, 10 + MOST_SHOWN)}


def test_what_is_searched_for_and_what_is_suspicious_is_always_shown():
    table = _table(*((n, reading(n, -110.0 + n)) for n in range(1, MOST_CELLS + 1)))
    names = [f"262-01-4711-{n}" for n in (1, 2, 3)]
    view = LiveView(
        target=TargetStatus(names[0], "cannot tell"),
        offer=names[1],
        suspicions=(SuspicionStatus(names[2], "suspicious", 5.0, ("why",)),),
    )
    rows = table.fill(view).cells
    assert len(rows) == MOST_SHOWN
    assert set(names) < {row.cell for row in rows}


def test_the_target_is_said_as_sure_as_it_is():
    assert target_status(None, ESTIMATE) is None
    assert target_status(ESTIMATE.cell, None).lat_deg is None
    several = target_status(ESTIMATE.cell, ESTIMATE)
    assert several.verdict == "several places"
    assert (several.semi_major_m, several.semi_minor_m, several.azimuth_deg) == (24.5, 12.2, 90.0)
    assert (several.lat_deg, several.lon_deg) == pytest.approx(
        Utm(33).to_latlon(400_000.0, 5_800_000.0), abs=1e-6
    )
    # the mode alone says nothing of how large the region is
    assert target_status(ESTIMATE.cell, replace(ESTIMATE, probability=0.99)).verdict == (
        "cannot tell"
    )
    one = target_status(ESTIMATE.cell, replace(ESTIMATE, probability=0.99))
    assert several.r95_m is None  # the other places have too much of it
    assert one.r50_m < 0.5 * one.r95_m < 0.5 * 1.3 * one.semi_major_m
    radii = f"most likely within {one.r50_m:.0f} m, surely within {one.r95_m:.0f} m"
    assert str(one).endswith(f", {radii}")
    assert str(several).startswith(f"target {ESTIMATE.cell}: several places, ")
    assert str(target_status(ESTIMATE.cell, None)) == f"target {ESTIMATE.cell}: cannot tell"
    assert (
        target_status(ESTIMATE.cell, replace(ESTIMATE, stage="ekf", probability=1.0)).verdict
        == "one close place"
    )


@pytest.mark.parametrize(
    ("area", "is_far", "supposed"),
    [("", True, "if it is no distant mast"), ("within 300 m", False, "if it is within 300 m")],
)
def test_the_target_supposes_what_its_position_does(area, is_far, supposed):
    position = PositionStatus(
        cell=ESTIMATE.cell, verdict="cannot tell", lat=52.0, lon=13.0, r95_m=88.0, r50_m=31.0,
        drms_m=40.0, area_m2=20_000.0, modes=(), area=area, may_be_distant=is_far,
        region=MultiPolygon(type="MultiPolygon", coordinates=[]),
        strongest=StrongestReading(lat=52.0, lon=13.0, level_dbm=-60.0),
    )  # fmt: skip
    target = target_status(ESTIMATE.cell, ESTIMATE, position)
    assert target.supposition == supposed
    assert str(target).endswith(f"surely within 88 m, {supposed}")
