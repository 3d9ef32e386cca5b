"""A neighbour known by channel and code alone is a cell: at the desk, live and in files."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.runfile import read_run
from logger.core.types import LiveEstimate, Record
from postproc.cli import main
from postproc.scan_counts import joined_of, scans_of
from postproc.smoothing import smooth_runs
from tests.kit.nameless import (
    BY_CHANNEL,
    M_PER_DEG_LAT,
    M_PER_DEG_LON,
    NAMED,
    at_deg,
    level_dbm,
    neighbour,
    records,
    serving,
    square,
)
from tests.kit.runs import write_journal

STATION_M, OTHER_M = (220.0, 130.0), (60.0, 250.0)
OTHER = "262-01-4711-8"


def alone(seed=1):
    """A cell of channel and code alone beside one that the modem names."""
    rng = np.random.default_rng(seed)

    def heard(_i, place_m):
        return [
            serving(level_dbm(place_m, OTHER_M, rng), cid=8, pci=99),
            neighbour(level_dbm(place_m, STATION_M, rng)),
        ]

    return records(square(), heard)


def in_turn(seed=1):
    """One cell, named in full in each fourth scan."""
    rng = np.random.default_rng(seed)

    def heard(i, place_m):
        level = level_dbm(place_m, STATION_M, rng)
        return [serving(level) if i % 4 == 0 else neighbour(level)]

    return records(square(), heard)


def away_m(lat_deg, lon_deg, place_m):
    lat, lon = at_deg(*place_m)
    return math.hypot((lat_deg - lat) * M_PER_DEG_LAT, (lon_deg - lon) * M_PER_DEG_LON)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("alone") / "a.journal"
    write_journal(path, alone())
    return path


@pytest.fixture(scope="module")
def joined_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("joined") / "a.journal"
    write_journal(path, in_turn())
    return path


def output(capsys, *argv, code=0):
    assert main([str(one) for one in argv]) == code
    return capsys.readouterr()


def test_it_is_located_under_its_name(path, capsys):
    said = json.loads(output(capsys, "smooth", path, "--cell", BY_CHANNEL, "--json").out)
    (cell,) = said["cells"]
    assert (cell["cell"], cell["verdict"], cell["n"], cell["n_scans"]) == (
        BY_CHANNEL, "located", 240, 240,
    )  # fmt: skip
    r95_m = cell["best"]["r95_m"]
    assert away_m(cell["best"]["lat"], cell["best"]["lon"], STATION_M) < r95_m < 150.0
    assert any("known by channel and code alone" in text for text in cell["warnings"])


def test_it_breaks_no_rule_of_identities(path, capsys):
    said = json.loads(output(capsys, "suspect", path, "--json").out)
    assert [cell["cell"] for cell in said["cells"]] == [OTHER]


def test_a_wrong_name_is_one_clear_line(path, capsys):
    err = output(capsys, "smooth", path, "--cell", "LTE-5780-504", code=2).err
    assert err.count("\n") == 1
    assert "the channel is at most 262143, the PCI at most 503" in err
    err = output(capsys, "smooth", path, "--cell", "LTE-5780-211", code=2).err
    assert "cell LTE-5780-211 was not observed" in err


def test_info_lists_it(path, capsys):
    said = json.loads(output(capsys, "info", path, "--json").out)
    assert {cell["cell"]: cell["n"] for cell in said["cells"]} == {BY_CHANNEL: 240, OTHER: 240}
    assert said["n_readings_without_identity"] == 240


def test_a_reading_of_its_channel_and_code_joins_the_identity(joined_path):
    (cell,) = smooth_runs([read_run(joined_path)]).cells
    assert (cell.cell, cell.n, cell.verdict) == (NAMED, 240, "located")
    assert "180 readings without an identity are joined by their channel and code" in cell.warnings


def test_a_joined_reading_is_no_scan_that_named_it(joined_path):
    run = read_run(joined_path)
    assert scans_of([run]) == {NAMED: 60}
    assert joined_of([run]) == {NAMED: 180}


def test_an_identity_named_once_does_not_exist(tmp_path):
    rows = in_turn()
    first, *rest = [record for record in rows if record.source == "modem"]
    once = [replace(r.value.readings[0], mcc=None, mnc=None, tac=None, cid=None) for r in rest]
    stream = iter([first, *(replace(r, value=replace(r.value, readings=(one,)))
                            for r, one in zip(rest, once, strict=True))])  # fmt: skip
    given = [next(stream) if record.source == "modem" else record for record in rows]
    write_journal(tmp_path / "a.journal", given)
    cells = {cell.cell: cell for cell in smooth_runs([read_run(tmp_path / "a.journal")]).cells}
    assert (cells[BY_CHANNEL].n, cells[BY_CHANNEL].verdict) == (239, "located")
    assert cells[NAMED].warnings == ("observed in one scan only",)


def test_a_table_that_is_written_and_read_keeps_the_name(path, tmp_path, capsys):
    output(capsys, "export", path, "-o", tmp_path / "a.csv", "--cell", BY_CHANNEL)
    output(capsys, "import", tmp_path / "a.csv", "-o", tmp_path / "b.h5")
    again = read_run(tmp_path / "b.h5")
    assert scans_of([again]) == {BY_CHANNEL: 240}
    first, second = (smooth_runs([run], [BY_CHANNEL]).cells[0] for run in (read_run(path), again))
    assert second.verdict == first.verdict == "located"


def test_a_table_marks_joined_readings_as_unsure(joined_path, tmp_path, capsys):
    output(capsys, "export", joined_path, "-o", tmp_path / "a.csv")
    output(capsys, "import", tmp_path / "a.csv", "-o", tmp_path / "b.h5")
    assert scans_of([read_run(tmp_path / "b.h5")]) == {NAMED: 60}


def live(given, **settings):
    tracker = LiveTracker(LiveSettings(**settings))
    values = [value for seq, record in enumerate(given) for value in tracker.feed(seq, record)]
    return tracker, [one for one in values if isinstance(one, LiveEstimate)]


def test_the_device_locates_it_and_may_follow_it():
    tracker, estimates = live(alone(), target=BY_CHANNEL)
    assert tracker.target == BY_CHANNEL
    last = [one for one in estimates if one.cell == BY_CHANNEL and one.stage != "reference-ekf"][-1]
    assert last.n > 200
    lat_lon = tracker.answer.place.lat, tracker.answer.place.lon
    assert away_m(*lat_lon, STATION_M) < tracker.answer.place.r95_m


def test_the_device_joins_what_it_has_heard():
    _, estimates = live(in_turn())
    assert {one.cell for one in estimates} == {NAMED, BY_CHANNEL}
    assert max(one.n for one in estimates if one.cell == NAMED) > 200
    assert max(one.n for one in estimates if one.cell == BY_CHANNEL) < 10


def test_a_run_of_an_earlier_version_replays_without_such_cells():
    _, estimates = live(alone(), by_channel=False)
    assert {one.cell for one in estimates} == {OTHER}


@pytest.mark.parametrize("by_channel", [True, False])
def test_a_run_replays_as_it_was_recorded(by_channel, tmp_path, capsys):
    settings = LiveSettings(by_channel=by_channel)
    tracker = LiveTracker(settings)

    stream, seq = [], 0
    for record in alone():
        values = tracker.feed(seq, record)
        stream += [record, *(Record(record.t_ns, "live", value) for value in values)]
        seq = len(stream)
    write_journal(tmp_path / "a.journal", stream, live=settings)
    said = json.loads(output(capsys, "replay", tmp_path / "a.journal", "--json").out)
    assert said["equal"]
    assert said["n_replayed"] == said["n_recorded"] > 200


def test_a_code_that_is_heard_again_far_away_is_another_cell():
    near = alone()
    far = [(x + 20_000.0, y) for x, y in square()]
    there = (STATION_M[0] + 20_000.0, STATION_M[1])
    rng = np.random.default_rng(5)
    later = records(far, lambda _i, at: [neighbour(level_dbm(at, there, rng))], t0_s=600)
    tracker, estimates = live([*near, *later], target=BY_CHANNEL)
    assert [one.n for one in estimates if one.cell == BY_CHANNEL][-1] < 250
    lat_lon = tracker.answer.place.lat, tracker.answer.place.lon
    assert away_m(*lat_lon, there) < tracker.answer.place.r95_m
