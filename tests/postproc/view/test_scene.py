"""The recording read back chunk by chunk: what is drawn is what the run and the estimators say."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from logger.core.errors import RunFileError
from logger.core.runfile import RunWriter, read_run
from logger.core.types import CellReading, Fix, Note, Record, Scan
from postproc.estimators.filters import FilterPath
from postproc.smoothing import smooth_runs
from postproc.verification.claims import Claim
from postproc.verification.run_claims import CellVerdict
from postproc.view import viewer
from postproc.view.blueprint import SHARED_AXIS
from postproc.view.rerun_writer import ellipse_axes
from postproc.view.scene import write_scene
from postproc.view.world_map import zoom_of
from tests.kit import sample_results as kit
from tests.kit.rerun_recordings import chunks, rows, static_columns, temporal_columns, times, values
from tests.kit.runs import meta
from tests.kit.sample_view import sample_story

NAME = kit.cell_name(0)
CELL, SERIES, STATES = (f"/{room}/{NAME}" for room in ("plan/cells", "series", "states"))
CLAIM = CellVerdict(
    NAME, 60, Claim(NAME, kit.LAT, kit.LON, 30.0, "somebody"), "rejected", ("too <far>",)
)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("scene") / "walk.journal", seconds=120, cells=3)
    return kit.sample_result(run, places=2, verdict="ambiguous")


@pytest.fixture(scope="module")
def told(result):
    return sample_story(result, [CLAIM])


@pytest.fixture(scope="module")
def saved(told, tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "walk.rrd"
    write_scene(told, path)
    return path


def test_verify_accepts_the_file(saved):
    done = subprocess.run(
        [viewer.binary(), "rrd", "verify", saved], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_every_part_is_there(saved):
    of_cell = {
        "levels", "levels/track", "level_scale", "key", "posterior/region95", "posterior/region50", "posterior/places",
        "posterior/heat", "ekf", "ekf/path", "ekf/ellipse", "reference", "reference/ellipse", "rts", "rts/ellipse",
        "batch", "batch/ellipse", "truth", "claims/1", "claims/1/two_sigma",
    }  # fmt: skip
    of_series = {
        "p0/ekf", "p0/reference", "p0/posterior", "p0/batch", "p0/rts", "eta/ekf", "eta/posterior", "nis/ekf",
        "nis/reference", "nis/bound0.95", "nis/bound0.999", "area/posterior", "area/ekf", "accuracy/r95",
        "accuracy/error",
    }  # fmt: skip
    others = {
        "/plan/ground/grid/fine", "/plan/ground/grid/bold", "/plan/ground/scale", "/plan/ground/north",
        "/plan/walks/walk/track", "/plan/walker", "/plan/walker/trail", f"/plan/all/{NAME}", f"/report/{NAME}",
        "/events", f"{STATES}/verdict", "/states/receiver", "/map/walker", f"/map/cells/{NAME}/region95",
    }  # fmt: skip
    expected = (
        {f"{CELL}/{name}" for name in of_cell} | {f"{SERIES}/{name}" for name in of_series} | others
    )
    assert expected - set(chunks(saved)) == set()


def check_levels(path, observations):
    for obs in observations.cells:
        columns = temporal_columns(path, f"/rssi/{obs.cell}")
        np.testing.assert_array_equal(values(columns, ":scalars")[:, 0], obs.level_dbm)
        np.testing.assert_array_equal(times(columns, "elapsed"), obs.t_ns - kit.START_NS)


def check_walker(path, track):
    columns = temporal_columns(path, "/plan/walker")
    expected = np.column_stack([track.x_m - track.x_m[0], track.y_m - track.y_m[0]])
    np.testing.assert_allclose(values(columns, ":positions"), expected, atol=1e-4)
    np.testing.assert_array_equal(times(columns, "elapsed"), track.t_ns - kit.START_NS)


def test_levels_are_those_read(saved, result):
    check_levels(saved, result.runs[0].observations)


def test_walker_is_where_the_fixes_are(saved, result):
    check_walker(saved, result.runs[0].observations.track)


def test_other_values_are_noticed(saved, result):
    """The negative control: one reading a hundredth of a dB, one fix a centimetre, one time a
    nanosecond off.
    """
    observations = result.runs[0].observations
    first, track = observations.cells[0], observations.track
    one = np.arange(len(first)) == 7
    for changed in (
        replace(first, level_dbm=first.level_dbm + 0.01 * one),
        replace(first, t_ns=first.t_ns + one),
    ):
        with pytest.raises(AssertionError):
            check_levels(saved, replace(observations, cells=(changed, *observations.cells[1:])))
    one = np.arange(len(track.t_ns)) == 7
    for moved in (
        replace(track, x_m=track.x_m + 0.01 * one),
        replace(track, t_ns=track.t_ns - one),
    ):
        with pytest.raises(AssertionError):
            check_walker(saved, moved)


def test_utc_is_that_of_the_fixes(saved, result):
    columns = temporal_columns(saved, "/plan/walker")
    np.testing.assert_array_equal(
        times(columns, "utc"), result.runs[0].run.tables["fixes"]["utc_ns"]
    )


def test_trail_ends_at_the_walker(saved):
    walker, trail = (
        values(temporal_columns(saved, "/plan/walker"), ":positions"),
        temporal_columns(saved, "/plan/walker/trail"),
    )
    np.testing.assert_array_equal([row[0][-1] for row in rows(trail, ":strips")], walker)


def test_the_way_has_the_colours_of_its_levels(saved, told):
    picture = told.subjects[0].picture
    columns = static_columns(saved, f"{CELL}/levels")
    np.testing.assert_allclose(rows(columns, ":positions")[0], picture.heard_m, atol=1e-4)
    red, blue = (np.array(rows(columns, ":colors")[0]) >> shift & 255 for shift in (24, 8))
    strong = picture.heard_dbm > np.median(picture.heard_dbm)
    assert (
        np.mean(red[strong].astype(int) - blue[strong])
        > 0
        > np.mean(red[~strong].astype(int) - blue[~strong])
    )


def test_filters_have_a_place_for_each_reading(saved, result):
    cell, track = result.cells[0], result.runs[0].observations.track
    for key, filtered in (("ekf", cell.ekf), ("reference", cell.reference)):
        columns = temporal_columns(saved, f"{CELL}/{key}")
        places = np.add(values(columns, ":positions"), (track.x_m[0], track.y_m[0]))
        np.testing.assert_allclose(places, filtered.x[:, :2], atol=1e-2)
        np.testing.assert_array_equal(times(columns, "elapsed"), filtered.t_ns - kit.START_NS)
        nis = temporal_columns(saved, f"{SERIES}/nis/{key}")
        np.testing.assert_allclose(values(nis, ":scalars")[:, 0], filtered.nis)
    band = temporal_columns(saved, f"{SERIES}/p0/ekf")
    np.testing.assert_allclose(values(band, ":values")[:, 0], cell.ekf.x[:, 2])
    np.testing.assert_allclose(values(band, ":variances")[:, 0], 4 * cell.ekf.p[:, 2, 2])


def test_regions_shrink_step_by_step(saved, told):
    subject = told.subjects[0]
    columns = temporal_columns(saved, f"{CELL}/posterior/region95")
    np.testing.assert_array_equal(
        times(columns, "elapsed"), [step.t_ns - kit.START_NS for step in subject.steps]
    )
    for row, rings in zip(rows(columns, ":strips"), subject.regions["95"], strict=True):
        assert len(row) == len(rings)
        for drawn, ring in zip(row, rings, strict=True):
            np.testing.assert_allclose(drawn, ring, atol=1e-4)
    widths = [np.ptp(np.array(row[0]), axis=0).max() for row in rows(columns, ":strips")]
    assert widths[0] > 2 * widths[-1]
    areas = values(temporal_columns(saved, f"{SERIES}/area/posterior"), ":scalars")[:, 0]
    np.testing.assert_allclose(10**areas, [step.posterior.region_area_m2 for step in subject.steps])


def test_places_carry_their_probability(saved, told):
    columns = temporal_columns(saved, f"{CELL}/posterior/places")
    modes = [mode for step in told.subjects[0].steps for mode in step.posterior.modes]
    places = [place for row in rows(columns, ":positions") for place in row]
    expected = told.local(
        np.array([mode.x_m for mode in modes]), np.array([mode.y_m for mode in modes])
    )
    np.testing.assert_allclose(places, expected, atol=1e-3)
    assert rows(columns, ":labels")[-1] == ["50%", "50%"]
    assert rows(columns, ":labels")[0] == [""]


def test_verdicts_are_states(saved):
    columns = temporal_columns(saved, f"{STATES}/verdict")
    assert [row[0] for row in rows(columns, ":state")] == ["cannot tell", "ambiguous"]


def test_claims_stand_where_they_say(saved):
    columns = static_columns(saved, f"{CELL}/claims/1")
    np.testing.assert_allclose(rows(columns, ":positions")[0], [(0.0, 0.0)], atol=1e-3)
    assert rows(columns, ":labels")[0] == ["claim: rejected"]


def test_times_rise_and_the_clock_of_the_desk_is_absent(saved):
    for parts in chunks(saved).values():
        for chunk in parts:
            assert "log_time" not in chunk.timeline_names
            if not chunk.is_static and "elapsed" in chunk.timeline_names:
                batch = chunk.to_record_batch()
                for timeline in ("elapsed", "utc"):
                    assert np.all(np.diff(batch.column(timeline).cast("int64").to_numpy()) >= 0)


def test_events_keep_their_text_and_level(saved):
    columns = temporal_columns(saved, "/events")
    assert values(columns, ":text")[:, 0].tolist() == [
        f"logger: second {i}, Grüße" for i in (0, 50, 100)
    ]
    assert values(columns, ":level")[:, 0].tolist() == ["WARN"] * 3


def test_the_report_tells_the_verdict_and_escapes_markup(saved):
    text = rows(static_columns(saved, f"/report/{NAME}"), ":text")[0][0]
    assert "SIMULATED" in text
    assert "ambiguous: 2 places fit (50%, 50%)" in text
    assert r"\<b\>not\</b\> \| markup" in text
    assert "reference EKF (wrong)" in text
    assert "from the truth" in text
    assert r"**rejected** | too \<far\>" in text


def test_linked_plots_open_on_the_whole_run(saved):
    """The viewer keeps their range at a place without a public name: see that it is written
    there.
    """
    reader = RrdReader(saved)
    (blueprint,) = reader.blueprints()
    assert f"/{SHARED_AXIS}" in {chunk.entity_path for chunk in reader.stream(store=blueprint)}


def test_the_map_shows_the_same_in_degrees(saved, result, told):
    track = result.runs[0].observations.track
    walked = np.array(values(temporal_columns(saved, "/map/walker"), ":positions"))
    np.testing.assert_allclose(
        walked, np.column_stack(track.utm.to_latlon_arrays(track.x_m, track.y_m)), atol=1e-9
    )
    marks = rows(static_columns(saved, f"/map/cells/{NAME}/estimates"), ":positions")[0]
    truth, claim = result.runs[0].run.meta.truth[0], CLAIM.claim
    np.testing.assert_allclose(
        marks[-2:], [(truth.lat_deg, truth.lon_deg), (claim.lat_deg, claim.lon_deg)], atol=1e-9
    )
    assert 15.0 < zoom_of(told) <= 18.0


def test_offline_there_is_no_map(told, tmp_path):
    write_scene(told, tmp_path / "x.rrd", online=False)
    assert not any(entity.startswith("/map") for entity in chunks(tmp_path / "x.rrd"))


def test_ellipse_is_turned_from_east_to_its_major_axis():
    # major axis to the north-east: half of 45 degrees about z
    p = np.array([[[2.0, 1.0], [1.0, 2.0]]])
    axes, turns = ellipse_axes(p)
    np.testing.assert_allclose(axes, [np.sqrt(5.991 * np.array([3.0, 1.0]))])
    np.testing.assert_allclose(turns, [[0, 0, np.sin(np.pi / 8), np.cos(np.pi / 8)]], atol=1e-12)


def write(path, records, **changes):
    writer = RunWriter(path, meta(**changes))
    for record in records:
        writer.append(record)
    writer.close(records[-1].t_ns if records else 0, "test")
    return read_run(path)


def scan(t_ns, *cids):
    cells = tuple(CellReading("scan", "GSM", "262", "01", 1, cid, rssi_dbm=-70.0) for cid in cids)
    return Record(t_ns, "modem", Scan(t_ns, cells, None))


FIX = Record(0, "gnss", Fix(True, None, 52.0, 13.0))


@pytest.mark.parametrize(
    "records",
    [
        [],
        [Record(0, "logger", Note("info", "start", "only a note"))],
        [scan(0, 1, 2), scan(10**9, 1)],
        [FIX],
        [FIX, scan(10, 1)],
        [FIX, Record(10, "modem", Scan(0, (), None))],
        [FIX, Record(10, "modem", Scan(0, (CellReading("serving", rssi_dbm=-60.0),), None))],
        [Record(0, "gnss", Fix(False)), scan(10, 1)],
    ],
    ids=[
        "nothing",
        "a note",
        "no fix",
        "only a fix",
        "one reading",
        "empty scan",
        "unknown cell",
        "invalid fix",
    ],
)
def test_runs_with_next_to_nothing(records, tmp_path):
    result = smooth_runs([write(tmp_path / "x.journal", records)])
    write_scene(sample_story(result), tmp_path / "x.rrd")
    found = chunks(tmp_path / "x.rrd")
    assert any(entity.startswith("/report") for entity in found)
    has_fix = any(isinstance(r.value, Fix) and r.value.valid for r in records)
    assert ("/plan/walker" in found) == has_fix
    assert ("/plan/missing" in found) != has_fix


def test_levels_without_any_fix(tmp_path):
    result = smooth_runs([write(tmp_path / "x.journal", [scan(0, 1, 2), scan(10**9, 1)])])
    write_scene(sample_story(result), tmp_path / "x.rrd")
    columns = temporal_columns(tmp_path / "x.rrd", "/rssi/262-01-1-1")
    assert times(columns, "elapsed").tolist() == [0, 10**9]
    assert "utc" not in columns


def test_diverged_filter_is_left_out(result, tmp_path):
    cell = result.cells[0]
    filtered = cell.reference
    lost = FilterPath(
        filtered.t_ns,
        filtered.x * np.nan,
        filtered.p * np.nan,
        *[filtered.innovation_db * np.nan] * 2,
    )
    away = FilterPath(
        filtered.t_ns, filtered.x * 1e30, filtered.p * 1e30, *[filtered.innovation_db] * 2
    )
    for odd in (lost, away):
        changed = replace(result, cells=(replace(cell, reference=odd, ekf=odd),))
        write_scene(sample_story(changed), tmp_path / "x.rrd")
        assert f"{CELL}/reference" not in chunks(tmp_path / "x.rrd")


def test_odd_names_of_cells(tmp_path):
    name = "a/b [c] *$é 漢"
    label = Record(10, "modem", Scan(0, (CellReading("scan", label=name, rssi_dbm=-60.0),), None))
    result = smooth_runs([write(tmp_path / "x.journal", [FIX, label])])
    write_scene(sample_story(result), tmp_path / "x.rrd")
    assert sum(entity.startswith("/rssi/") for entity in chunks(tmp_path / "x.rrd")) == 1


def test_missing_folder_is_one_line(told, tmp_path):
    with pytest.raises(RunFileError, match="no such folder"):
        write_scene(told, tmp_path / "absent" / "x.rrd")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_in_the_way_is_one_line(told, tmp_path):
    (tmp_path / "x.rrd").mkdir()
    with pytest.raises(RunFileError, match="cannot write"):
        write_scene(told, tmp_path / "x.rrd")
    assert [path.name for path in tmp_path.iterdir()] == ["x.rrd"]
