import json
from dataclasses import replace

import h5py
import numpy as np
import pytest

from logger.core.locator.pipeline import decide, locate
from logger.core.locator.two_source_test import LEAST_LOG_FACTOR, LIVE, divide_in_time
from logger.core.places import Places, Utm
from logger.core.runfile import RunWriter, Truth, read_run
from logger.core.types import CellReading, Fix, Record, Scan
from postproc.cli import main
from postproc.comparison.changes import compare_runs
from postproc.multi_run import (
    check_different,
    in_one_zone,
    in_order,
    merge,
    modems_of,
    named_apart,
    of_one_modem,
    parts_by_cell,
    shares_of,
    with_one_modem,
)
from postproc.result import is_equal
from postproc.smoothing import estimate_cell, smooth_runs
from postproc.summary import run_table
from postproc.survey.walk_readings import readings_of
from postproc.walk import observe_run
from tests.kit import runs
from tests.kit.runs import UTC0_NS
from tests.kit.walks import observations, path, shadowing

UTM = Utm(32)
BORDER = (52.0, 12.0)
"""Between zones 32 and 33."""
SOURCE_M = (80.0, 70.0)
"""East and north of the border point; all places of the walks are."""
CELL, OTHER = "262-01-4711-1", "262-01-4711-2"
BENT = (
    np.append(np.linspace(-90, 30, 50), np.full(50, 30.0)),
    np.append(np.zeros(50), np.linspace(0, 160, 50)),
)
LONG = np.linspace(0.0, 700.0, 300), np.zeros(300)
STREET = np.full(80, 140.0), np.linspace(-60, 180, 80)
SHIFT_DB = 9.0
DAY_NS = 86_400 * 10**9


def record_walk(
    path,
    way,
    *,
    shift_db=0.0,
    seed=0,
    cid=1,
    run_id=None,
    at_deg=BORDER,
    truth=True,
    second_db=None,
    utc0_ns=UTC0_NS,
    **meta,
):
    """A run: a fix and a scan of one cell every two seconds along a way.

    With `second_db` a second modem scans too, which reads so much higher.
    """
    rng, zero = np.random.default_rng(seed), np.array(UTM.to_xy(*at_deg))
    known = (Truth(CELL, *UTM.to_latlon(*(zero + SOURCE_M))),) if truth else ()
    name = run_id or f"{path.stem:0>32}"
    writer = RunWriter(path.with_suffix(".journal"), runs.meta(run_id=name, truth=known, **meta))
    lat, lon = UTM.to_latlon_arrays(way[0] + zero[0], way[1] + zero[1])
    distance = np.hypot(way[0] - SOURCE_M[0], way[1] - SOURCE_M[1])
    level = np.round(-35 - 30 * np.log10(distance) + rng.normal(0, 2.5, len(lat)) + shift_db)
    for i, (a, b, dbm) in enumerate(zip(lat.tolist(), lon.tolist(), level.tolist(), strict=True)):
        t_ns = 2 * i * 10**9
        writer.append(Record(t_ns, "gnss", Fix(True, utc0_ns + t_ns, a, b, acc_m=2.0)))
        reading = CellReading("serving", "GSM", "262", "01", 4711, cid, rssi_dbm=dbm)
        writer.append(Record(t_ns + 5, "modem", Scan(t_ns, (reading,), None)))
        if second_db is not None:
            heard = replace(reading, rssi_dbm=float(round(dbm + second_db + rng.normal(0, 2.5))))
            writer.append(Record(t_ns + 6, "modem2", Scan(t_ns, (heard,), None)))
    writer.close(2 * len(lat) * 10**9, "test")
    return path.with_suffix(".journal")


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Two walks past one transmitter, the second by a modem that reads 9 dB higher, in another UTM
    zone.
    """
    folder = tmp_path_factory.mktemp("pair")
    return [
        record_walk(folder / "a.h5", BENT),
        record_walk(folder / "b.h5", STREET, shift_db=SHIFT_DB, seed=1),
    ]


@pytest.fixture(scope="module")
def both(pair):
    return smooth_runs([read_run(path) for path in pair])


def _at_border(way):
    zero = np.array(UTM.to_xy(*BORDER))
    return way[0] + zero[0], way[1] + zero[1]


def fails(capsys, *argv):
    assert main([str(a) for a in argv]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_runs_lie_in_different_zones(pair):
    zones = [smooth_runs([read_run(path)]).runs[0].observations.track.utm.zone for path in pair]
    assert zones == [32, 33]


def test_offset_of_the_second_modem_is_estimated(both):
    (cell,) = both.cells
    first, second = cell.shares
    assert (first.run, first.n, first.offset_db, first.sigma_db) == (0, 100, 0.0, 0.0)
    assert (second.run, second.n) == (1, 80)
    assert second.offset_db == pytest.approx(SHIFT_DB, abs=3.0 * second.sigma_db)
    assert second.sigma_db < 2.0


def test_together_they_tell_more_than_each_alone(both, pair):
    (cell,) = both.cells
    assert cell.n == 180
    areas = [result.posterior.region_area_m2 for result in cell.without.values()]
    assert cell.posterior.region_area_m2 < 0.8 * min(areas)
    # with two runs, without one of them is the other alone
    alone = smooth_runs([read_run(pair[0])]).cells[0].posterior
    assert cell.without[1].posterior.region_area_m2 == alone.region_area_m2
    assert cell.without[1].posterior.modes[0].probability == alone.modes[0].probability


def test_the_order_of_runs_in_two_zones_does_not_matter(pair):
    given = [read_run(path) for path in pair]
    one, other = (smooth_runs(order).cells[0] for order in (given, given[::-1]))
    assert one.obs.utm == other.obs.utm
    assert is_equal(one.posterior, other.posterior)


def test_other_zone_is_no_other_place(both):
    (cell,) = both.cells
    x_m, y_m = np.add(UTM.to_xy(*BORDER), SOURCE_M)
    for result in (cell, *cell.without.values()):
        assert result.obs.utm.zone == 32
    assert np.hypot(cell.posterior.x_m - x_m, cell.posterior.y_m - y_m) < 25.0
    street = cell.without[0].obs
    np.testing.assert_allclose(street.x_m, STREET[0] + UTM.to_xy(*BORDER)[0], atol=4.0)


def test_estimators_that_know_no_offset_stand_back(both):
    result = both.cells[0]
    assert (result.ekf, result.rts, result.reference) == (None, None, None)
    assert any("several modems" in warning for warning in result.warnings)
    best = result.posterior
    assert (
        np.hypot(result.batch.state[0] - best.x_m, result.batch.state[1] - best.y_m)
        < 2.0 * best.r95_m
    )
    assert result.batch.sigma_db < 3.5  # 2.5 of noise; 9 dB of offset left in would be 5


def test_json_table_and_file_of_two_runs(pair, capsys):
    before = [path.read_bytes() for path in pair]
    argv = ["smooth", *map(str, pair)]
    assert main([*argv, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [run["path"] for run in found["runs"]] == [str(path) for path in pair]
    assert found["warnings"] == []
    (cell,) = found["cells"]
    assert set(cell["offsets"][1]) == {"run", "n", "offset_db", "sigma_db"}
    assert [gave["run"] for gave in cell["without"]] == [str(path) for path in pair]
    assert set(cell["without"][0]["best"]) == {"lat", "lon", "r50_m", "r95_m"}
    assert cell["without"][0]["region95"]["area_m2"] > cell["region95"]["area_m2"]
    assert cell["truth"]["inside_region95"] is True
    assert [path.read_bytes() for path in pair] == before
    with h5py.File(pair[0].with_suffix(".together.post.h5")) as file:
        assert json.loads(file["summary"][()]) == found
        assert len(file.attrs["run_ids"]) == 2
        assert np.bincount(file["cells/0/obs/modem"][()]).tolist() == [100, 80]
    assert main([*argv, "-v"]) == 0
    output = capsys.readouterr().out
    assert f"{cell['offsets'][1]['offset_db']:+.1f} ±" in output
    assert "without it" in output


def test_one_run_keeps_its_contract(pair, capsys):
    assert main(["smooth", str(pair[0]), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {"run", "cells", "unnoticed"}
    assert not {"offsets", "without"} & set(found["cells"][0])
    assert pair[0].with_suffix(".post.h5").exists()


def test_a_run_that_never_heard_the_cell_changes_nothing(pair, tmp_path):
    deaf = record_walk(tmp_path / "c.h5", STREET, cid=2)
    alone = smooth_runs([read_run(pair[0])]).cells[0]
    together = smooth_runs([read_run(pair[0]), read_run(deaf)], [CELL])
    (cell,) = together.cells
    for name in ("x_m", "y_m", "size_m", "probability"):
        np.testing.assert_array_equal(
            getattr(cell.posterior.squares, name), getattr(alone.posterior.squares, name)
        )
    assert (cell.without, len(cell.shares)) == ({}, 1)
    assert cell.warnings == alone.warnings
    assert "no cell was observed in two" in together.warnings[0]


def test_a_run_without_a_fix_is_named(pair, tmp_path, capsys):
    runs.write_journal(
        tmp_path / "lost.journal", [Record(1, "modem", Scan(0, (runs.reading(1, -70.0),)))]
    )
    assert main(["smooth", str(tmp_path / "lost.journal"), str(pair[0]), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert "no position fix" in found["runs"][0]["warnings"][0]
    assert found["runs"][1]["warnings"] == []
    assert [cell["n"] for cell in found["cells"]] == [100]


def test_mistakes_are_one_line(pair, tmp_path, capsys):
    assert "are the same run" in fails(capsys, "smooth", pair[0], pair[1], pair[0])
    far = record_walk(tmp_path / "far.h5", STREET, at_deg=(48.0, 12.0))
    assert "2 places" in fails(capsys, "compare", pair[0], far)
    assert "was not observed" in fails(capsys, "smooth", *pair, "--cell", OTHER)
    assert "no such file" in fails(capsys, "smooth", pair[0], tmp_path / "none.h5")


def test_a_track_of_the_next_zone_keeps_its_place():
    here, there = Utm(32), Utm(33)
    lat, lon = np.array([50.0, 50.001]), np.array([12.001, 12.002])
    track = Places.of_degrees(lat, lon, utm=there)
    moved = track.in_zone(here)
    assert moved.utm == here
    np.testing.assert_allclose(here.to_latlon_arrays(moved.x_m, moved.y_m), (lat, lon), atol=1e-9)
    assert track.in_zone(there) is track


# --- which modem ---

BY_ID = '[modem]\nport = "/dev/serial/by-id/usb-SIM_0042-port0"\ndriver = "sim800"\n'
BY_NUMBER = '[modem]\nport = "/dev/ttyUSB0"\ndriver = "sim800"\n'


@pytest.mark.parametrize(
    ("first", "second", "same"),
    [
        ((BY_ID, "boot-1"), (BY_ID, "boot-2"), True),
        ((BY_ID, "boot-1"), (BY_ID.replace("0042", "0043"), "boot-1"), False),
        ((BY_NUMBER, "boot-1"), (BY_NUMBER, "boot-1"), True),
        ((BY_NUMBER, "boot-1"), (BY_NUMBER, "boot-2"), False),
        ((BY_NUMBER, ""), (BY_NUMBER, ""), False),
        (("", "boot-1"), ("", "boot-1"), False),
        (("not = [toml", "boot-1"), ("modem = 3", "boot-1"), False),
    ],
)
def test_runs_of_one_modem_are_known_by_its_port(tmp_path, first, second, same):
    found = []
    for i, (text, boot) in enumerate((first, second)):
        runs.write_journal(
            tmp_path / f"{i}.journal", runs.records(1), config_text=text, boot_id=boot
        )
        found.append(read_run(tmp_path / f"{i}.journal"))
    assert modems_of(found) == ([0, 0] if same else [0, 1])


def test_runs_of_one_modem_have_no_offset_and_all_estimators(tmp_path):
    halves = [tuple(axis[part] for axis in BENT) for part in (slice(0, 60), slice(60, None))]
    paths = [
        record_walk(tmp_path / f"{i}.h5", half, seed=i, config_text=BY_ID)
        for i, half in enumerate(halves)
    ]
    (cell,) = smooth_runs([read_run(path) for path in paths]).cells
    assert cell.posterior.offsets is None
    assert [(share.n, share.offset_db) for share in cell.shares] == [(60, 0.0), (40, 0.0)]
    assert cell.reference is not None
    assert not any("modem" in warning for warning in cell.warnings)


def test_a_modem_of_which_no_reading_counts_has_no_offset(pair):
    observed = in_one_zone([observe_run(read_run(path)) for path in pair])
    first, second = parts_by_cell(observed, [CELL])[CELL].values()
    seldom = np.zeros(len(second))
    weak = replace(second, level_dbm=second.level_dbm - 40.0, named_share=seldom)
    parts, modems = {0: first, 1: weak}, [0, 1]
    merged = merge(parts, modems)
    found = estimate_cell(merged)
    assert found.batch is not None
    assert any("80 of 180 readings do not count" in warning for warning in found.warnings)
    offsets = [share.offset_db for share in shares_of(parts, modems, found.posterior)]
    assert offsets == [0.0, None]
    of_the_first = merged.on_one_scale(np.zeros(1))  # of the second nothing is known
    np.testing.assert_array_equal(of_the_first.level_dbm, merged.level_dbm)


def test_modems_of_one_run_are_kept_apart(tmp_path):
    path = record_walk(tmp_path / "two.h5", BENT, second_db=-SHIFT_DB)
    alone = record_walk(tmp_path / "one.h5", BENT, run_id="1" * 32, seed=1)
    (cell,) = smooth_runs([read_run(path)]).cells
    first, second = cell.shares
    assert [(share.run, share.n) for share in cell.shares] == [(0, 100), (0, 100)]
    assert (first.offset_db, first.sigma_db) == (0.0, 0.0)
    assert second.offset_db == pytest.approx(-SHIFT_DB, abs=3.0 * second.sigma_db)
    assert any("several modems" in warning for warning in cell.warnings)
    with_another = smooth_runs([read_run(path), read_run(alone)]).cells[0]
    assert len(with_another.shares) == 3
    names = [row[0] for row in run_table(with_another, ["two.h5", "one.h5"]).rows]
    assert names == ["two.h5 (modem 1 of 2)", "two.h5 (modem 2 of 2)", "one.h5"]


def test_a_comparison_and_a_survey_take_the_modem_with_most_readings(tmp_path):
    run = read_run(record_walk(tmp_path / "two.h5", BENT, second_db=-SHIFT_DB))
    seen = observe_run(run).observations
    assert seen.cells[0].n_modems == 2
    (one,) = of_one_modem(seen).cells
    assert (len(one), one.modem, one.n_modems) == (100, None, 1)
    assert set(with_one_modem(run).tables["scans"]["source"]) == {b"modem"}
    assert readings_of(run, "salt").remark
    assert len(readings_of(run, "salt")) == 100


def test_a_comparison_takes_one_modem_for_all_cells(tmp_path):
    """The second misses one cell sometimes: compared by the first, it were 9 dB stronger."""
    walks = []
    for day, modems in enumerate(({"modem": 0.0}, {"modem": 0.0, "modem2": -9.0})):
        stream, random = [], np.random.default_rng(day)
        for i, (lat, lon) in enumerate(zip(*UTM.to_latlon_arrays(*_at_border(LONG)), strict=True)):
            t_ns = 2 * i * 10**9
            utc_ns = UTC0_NS + day * DAY_NS + t_ns
            stream.append(Record(t_ns, "gnss", Fix(True, utc_ns, lat, lon, acc_m=2.0)))
            for number, (modem, shift_db) in enumerate(modems.items(), 1):
                levels = np.round(shift_db - 70.0 - 5 * np.arange(4) + random.normal(0, 2.0, 4))
                heard = [runs.reading(cid, level) for cid, level in enumerate(levels.tolist(), 1)]
                if modem == "modem2":  # more scans, and fewer of the first cell
                    stream.append(Record(t_ns + 5, modem, Scan(t_ns + 4, tuple(heard[1:]))))
                    heard = heard[int(i % 3 == 0) :]
                stream.append(Record(t_ns + number, modem, Scan(t_ns, tuple(heard))))
        stream.sort(key=lambda record: record.t_ns)
        runs.write_journal(tmp_path / f"{day}.journal", stream, run_id=str(day) * 32)
        walks.append(read_run(tmp_path / f"{day}.journal"))
    compared = compare_runs(*walks).comparison
    assert len(compared.cells) == 4
    assert {cell.word for cell in compared.cells} == {"same"}
    assert compared.offset_db["GSM"] == pytest.approx(-9.0, abs=1.0)


def test_scans_of_another_modem_make_a_cell_no_less_regular(tmp_path):
    """The second modem names another cell alone."""
    stream = []
    for i, (lat, lon) in enumerate(zip(*UTM.to_latlon_arrays(*_at_border(BENT)), strict=True)):
        t_ns = 2 * i * 10**9
        stream.append(Record(t_ns, "gnss", Fix(True, UTC0_NS + t_ns, lat, lon, acc_m=2.0)))
        for number, modem in enumerate(("modem", "modem2"), 1):
            scan = Scan(t_ns, (runs.reading(number, -70.0), runs.reading(number + 2, -80.0)))
            stream.append(Record(t_ns + number, modem, scan))
    runs.write_journal(tmp_path / "a.journal", stream)
    cells = observe_run(read_run(tmp_path / "a.journal")).observations.cells
    assert len(cells) == 4
    for obs in cells:
        assert set(obs.named_share.tolist()) == {1.0}


def test_of_very_many_modems_those_heard_most_are_used(tmp_path):
    ways = [tuple(axis[k : k + 8 + (k > 0)] for axis in BENT) for k in range(0, 88, 4)]
    paths = [record_walk(tmp_path / f"{i}.h5", way, seed=i) for i, way in enumerate(ways)]
    every = [read_run(path) for path in paths]
    (cell,) = smooth_runs(every).cells
    used = [share.run for share in cell.shares]
    assert (len(used), 0 in used) == (20, False)  # the first run has a reading less
    assert used == sorted(used)
    assert (cell.n, len(cell.obs)) == (180, 180)
    assert any("2 of 22 runs are left out" in warning for warning in cell.warnings)


@pytest.fixture
def far_run(tmp_path):
    """One run of a recorder that went on 445 km farther, a day later, and heard the cell there."""
    far = record_walk(tmp_path / "far.h5", BENT, at_deg=(48.0, 12.0), truth=False)
    near = record_walk(tmp_path / "near.h5", BENT, truth=False)
    stream = [record for _, record in read_run(near).records("fixes", "scans")]
    for _, record in read_run(far).records("fixes", "scans"):
        t_ns, value = record.t_ns + DAY_NS, record.value
        if isinstance(value, Fix):
            value = replace(value, utc_ns=value.utc_ns + DAY_NS)
        else:
            value = replace(value, t_start_ns=value.t_start_ns + DAY_NS)
        stream.append(replace(record, t_ns=t_ns, value=value))
    runs.write_journal(tmp_path / "far_run.journal", stream)
    return tmp_path / "far_run.journal"


def test_an_identity_in_two_places_of_one_run_has_two_answers(far_run, tmp_path, capsys):
    result = smooth_runs([read_run(far_run)])
    lats = []
    for one in result.cells:
        assert (one.cell, one.n, one.n_scans) == (CELL, 100, 100)
        assert "heard in another place too, with 100 readings" in one.warnings[-1]
        lats.append(one.place.lat)
    assert sorted(lats) == pytest.approx([48.0, 52.0], abs=0.01)
    assert main(["smooth", str(far_run), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    (several,) = found["several_places"]
    assert [one["first_utc"][:10] for one in several["places"]] == ["2026-09-21", "2026-09-22"]
    assert len(found["cells"]) == 2
    assert main(["smooth", str(far_run)]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith(f"{CELL} is heard in 2 places, 445 km apart")


def test_everything_made_of_a_result_knows_the_two_places_of_a_cell(far_run, tmp_path, capsys):
    def run(*argv):
        assert main([str(one) for one in argv]) == 0
        return capsys.readouterr().out

    run("report", far_run, "-o", tmp_path / "a.html")
    assert (tmp_path / "a.html").read_text().count("heard in another place too") >= 2
    run("export", far_run, "--estimates", "-o", tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().count(f"\n{CELL},") == 2
    run("view", far_run, "--save", tmp_path / "a.rrd")


def test_runs_whose_files_share_a_name_are_told_apart_by_their_folders(tmp_path):
    paths = ["x/mon/1.h5", "x/tue/1.h5", "y/mon/1.h5", "y/2.h5"]
    file = tmp_path / "run.journal"
    runs.write_journal(file, runs.records(3))
    run = read_run(file)
    given = [
        replace(run, path=tmp_path / path, meta=runs.meta(run_id=f"{k:032x}"))
        for k, path in enumerate(paths)
    ]
    names = [one.name for one in named_apart(given)]
    assert names == ["x/mon/1.h5", "tue/1.h5", "y/mon/1.h5", "2.h5"]
    assert [one.name for one in named_apart(given[:1])] == ["1.h5"]


def test_a_log_that_was_imported_twice_counts_once(tmp_path, capsys):
    rows = [f"{k},{48.0 + k * 1e-5},11.0,{-60 - k % 9}" for k in range(40)]
    for name, end in (("a", "\n"), ("b", "\r\n")):
        log = tmp_path / f"{name}.csv"
        log.write_text(end.join(["t_s,lat,lon,rssi_dbm", *rows, ""]), newline="")
        assert main(["import", str(log), "-o", str(tmp_path / f"{name}.h5")]) == 0
    both = [tmp_path / "a.h5", tmp_path / "b.h5"]
    capsys.readouterr()
    for command in ("smooth", "compare", "report"):
        assert "a.h5 and" in (line := fails(capsys, command, *both))
        assert "are the same run" in line


def test_a_run_and_its_shared_copy_are_one_walk(tmp_path, capsys):
    # each level would count twice, and the region would be too small
    away_m = np.append(np.arange(0.0, 900.0, 4.0), np.arange(900.0, 0.0, -4.0))
    way = away_m, np.where(np.arange(len(away_m)) < 225, 0.0, 40.0)
    one = record_walk(tmp_path / "1.h5", way, seed=3)
    copies = [tmp_path / "copy.h5", tmp_path / "again.h5"]
    for copy in copies:
        assert main(["share", str(one), "-o", str(copy)]) == 0
    capsys.readouterr()
    for command in ("smooth", "suspect", "compare", "next"):
        line = fails(capsys, command, one, copies[0])
        assert "1.journal and" in line
        assert "are of one walk" in line
    assert "are of one walk" in fails(capsys, "smooth", *copies)


def test_a_run_and_its_exported_levels_are_one_walk(tmp_path, capsys):
    # at each level stands the position of its own time, which is that of no fix
    one, again = record_walk(tmp_path / "1.h5", BENT), tmp_path / "again.h5"
    levels = tmp_path / "levels.csv"
    assert main(["export", str(one), "-o", str(levels)]) == 0
    assert main(["import", str(levels), "-o", str(again)]) == 0
    capsys.readouterr()
    for command in ("smooth", "compare", "report"):
        assert "are of one walk" in fails(capsys, command, one, again)


def test_modems_that_share_a_receiver_are_no_copies(tmp_path):
    one, other = (
        read_run(record_walk(tmp_path / f"{k}.h5", BENT, seed=k, shift_db=SHIFT_DB * k))
        for k in range(2)
    )
    assert np.array_equal(one.tables["fixes"]["lat_deg"], other.tables["fixes"]["lat_deg"])
    check_different([one, other])


def test_runs_of_one_modem_are_in_time_order(tmp_path):
    port = "/dev/serial/by-id/usb-SimTech_123-if03"
    one_modem = f'[[source]]\nkind = "modem"\nname = "modem"\ndriver = "sim800"\nport = "{port}"\n'
    for config_text, in_time in ((one_modem, True), ("", False)):
        given = [
            read_run(
                record_walk(
                    tmp_path / f"{in_time}{day}.h5",
                    tuple(axis[:n] for axis in BENT),
                    utc0_ns=UTC0_NS + day * DAY_NS,
                    config_text=config_text,
                )
            )
            for day, n in ((2, 60), (0, 40), (1, 80))
        ]
        for order in ([0, 1, 2], [2, 1, 0], [1, 2, 0]):
            observed = [observe_run(given[k]) for k in order]
            counts = list(map(len, parts_by_cell(observed, [CELL])[CELL].values()))
            assert counts == ([40, 80, 60] if in_time else [80, 60, 40])


def test_one_run_needs_no_order(tmp_path, monkeypatch):
    monkeypatch.setattr("postproc.multi_run.fit_run", lambda *_: pytest.fail("a clock was fitted"))
    observed = [observe_run(read_run(record_walk(tmp_path / "a.h5", BENT)))]
    (obs,) = parts_by_cell(observed, [CELL])[CELL].values()
    assert len(obs) == 100


def _walks_of_days(*days):
    """Readings of one cell, by day; each day has a count and where the transmitter is."""
    rng, parts = np.random.default_rng(2), {}
    for day, (count, source_m) in enumerate(days):
        x, y = path("square", count, 840.0 / count)
        distance_m = np.maximum(np.hypot(x - source_m[0], y - source_m[1]), 10.0)
        level_dbm = -30.0 - 30.0 * np.log10(distance_m) + 2.0 * rng.normal(size=count)
        level_dbm = np.round(level_dbm + shadowing(rng, x, y, 3.0, 15.0))
        parts[day] = observations(x, y, level_dbm, 3.0)
    return parts


BEFORE_M, AFTER_M = np.array([60.0, 80.0]), np.array([190.0, 210.0])


def test_a_transmitter_that_moved_between_the_walks_is_not_located():
    parts = _walks_of_days((150, BEFORE_M), (300, AFTER_M), (220, AFTER_M))
    when = {day: ("modem", UTC0_NS + day * DAY_NS) for day in parts}
    obs = merge(in_order({day: parts[day] for day in (1, 2, 0)}, when), [0, 0, 0])
    decision = decide(locate(obs.usable()), obs)
    assert decision.verdict == "cannot tell"
    assert "seems to have moved, between" in decision.reasons[0]


def _by_other_modems(parts, apart_db):
    """The walks together, each by a modem that reads so much higher than that of the day before."""
    when = {day: (day, UTC0_NS + day * DAY_NS) for day in parts}
    louder = {
        day: replace(obs, level_dbm=obs.level_dbm + apart_db * day) for day, obs in parts.items()
    }
    return merge(in_order(louder, when), list(parts))


@pytest.mark.parametrize("apart_db", [0.0, 12.0])
def test_a_move_shows_where_each_walk_had_a_modem_of_its_own(apart_db):
    """An offset between modems explains the levels of a whole walk, and not where they are high."""
    obs = _by_other_modems(_walks_of_days((150, BEFORE_M), (300, AFTER_M)), apart_db)
    division = divide_in_time(obs, locate(obs.usable()), LIVE)
    assert division.log_factor > 2.0 * LEAST_LOG_FACTOR
    found = [place.xy_m[:, 0] for place in (division.one, division.other)]
    for source_m in (BEFORE_M, AFTER_M):
        assert min(np.hypot(*(at_m - source_m)) for at_m in found) < 60.0


@pytest.mark.parametrize("apart_db", [0.0, 12.0, 24.0])
def test_an_offset_between_modems_is_no_move(apart_db):
    obs = _by_other_modems(_walks_of_days((150, AFTER_M), (300, AFTER_M)), apart_db)
    assert divide_in_time(obs, locate(obs.usable()), LIVE).log_factor < 0.0
    two_in_one_run = replace(obs, run=None)
    assert divide_in_time(two_in_one_run, locate(obs.usable()), LIVE) is None


@pytest.mark.parametrize("modems", ["aaa", "abc"])
def test_walks_are_divided_between_days(modems):
    """Not in the middle of one, and not by modem: the first of several has most levels."""
    parts = _walks_of_days((120, BEFORE_M), (400, AFTER_M), (90, AFTER_M))
    when = {day: (modem, UTC0_NS + day * DAY_NS) for day, modem in enumerate(modems)}
    obs = merge(in_order(parts, when), [0, 0, 0])
    division = divide_in_time(obs, locate(obs.usable()), LIVE)
    for place, source_m in ((division.one, BEFORE_M), (division.other, AFTER_M)):
        assert np.hypot(*(place.xy_m[:, 0] - source_m)) < 60.0
    in_halves = divide_in_time(replace(obs, run=None), locate(obs.usable()), LIVE)
    assert division.log_factor > in_halves.log_factor + 4.0


def test_the_order_of_the_runs_is_not_that_of_the_answer(tmp_path):
    """Of two halves of a walk, both with readings at the floor of their modem's scale."""
    halves = []
    for k, part in enumerate((slice(0, 52), slice(48, 100))):
        path = record_walk(tmp_path / f"{k}.h5", tuple(axis[part] for axis in BENT), seed=k)
        halves.append(read_run(path))
    (one,), (other,) = (smooth_runs(runs).cells for runs in (halves, halves[::-1]))
    assert one.verdict == other.verdict
    # each order has the zone of its first run, and blocks of another grid
    assert one.posterior.r95_m == pytest.approx(other.posterior.r95_m, rel=0.05)
    assert [share.offset_db for share in one.shares] == pytest.approx(
        [share.offset_db for share in other.shares[::-1]], abs=0.05
    )
