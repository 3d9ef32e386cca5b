"""The recording, read back chunk by chunk, contains the values of the run and the estimators."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from postproc.view import viewer
from postproc.view.plan import ellipse_axes, zoom_of
from postproc.view.scene import SHARED_AXIS, cell_report, empty_report, write_scene
from tests.kit import sample_results as kit
from tests.kit.rerun_recordings import chunks, rows, static_columns, temporal_columns, times, values
from tests.kit.walks import with_places

NAME = kit.cell_name(0)
CELL, SERIES, STATES = (f"/{folder}/{NAME}" for folder in ("plan/cells", "series", "states"))

OF_CELL = """
levels levels/track level_scale key posterior/region95 posterior/region50 posterior/modes
posterior/density ekf ekf/path ekf/ellipse reference reference/ellipse rts rts/ellipse
batch batch/ellipse truth claims/1 claims/1/two_sigma
"""
OF_SERIES = """
p0/ekf p0/reference p0/posterior p0/batch p0/rts eta/ekf eta/posterior nis/ekf nis/reference
nis/bound0.95 nis/bound0.999 area/posterior area/ekf accuracy/r50 accuracy/r95 accuracy/error
"""
SHARED = f"""
/plan/ground/grid/fine /plan/ground/grid/bold /plan/ground/scale /plan/ground/north
/plan/walks/walk.journal/track /plan/walker /plan/walker/trail /plan/all/{NAME} /report/{NAME}
/events {STATES}/verdict /states/receiver /map/walker /map/cells/{NAME}/posterior/region95
"""


def test_verify_accepts_the_file(recording_path):
    done = subprocess.run(
        [viewer.binary(), "rrd", "verify", recording_path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_every_part_is_there(recording_path):
    expected = {f"{CELL}/{name}" for name in OF_CELL.split()}
    expected |= {f"{SERIES}/{name}" for name in OF_SERIES.split()}
    assert expected | set(SHARED.split()) <= set(chunks(recording_path))


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


def test_levels_are_those_read(recording_path, result):
    check_levels(recording_path, result.runs[0].observations)


def test_walker_is_where_the_fixes_are(recording_path, result):
    check_walker(recording_path, result.runs[0].observations.track)


def test_other_values_are_noticed(recording_path, result):
    """The negative control: errors of a hundredth of a dB, a centimetre and a nanosecond."""
    observations = result.runs[0].observations
    first, track = observations.cells[0], observations.track
    is_seventh = np.arange(len(first)) == 7
    for changed in (
        replace(first, level_dbm=first.level_dbm + 0.01 * is_seventh),
        with_places(first, t_ns=first.t_ns + is_seventh),
    ):
        with pytest.raises(AssertionError):
            check_levels(
                recording_path, replace(observations, cells=(changed, *observations.cells[1:]))
            )
    is_seventh = np.arange(len(track.t_ns)) == 7
    for moved in (
        replace(track, x_m=track.x_m + 0.01 * is_seventh),
        replace(track, t_ns=track.t_ns - is_seventh),
    ):
        with pytest.raises(AssertionError):
            check_walker(recording_path, moved)


def test_utc_is_that_of_the_fixes(recording_path, result):
    columns = temporal_columns(recording_path, "/plan/walker")
    np.testing.assert_array_equal(
        times(columns, "utc"), result.runs[0].run.tables["fixes"]["utc_ns"]
    )


def test_trail_ends_at_the_walker(recording_path):
    walker = values(temporal_columns(recording_path, "/plan/walker"), ":positions")
    trail = temporal_columns(recording_path, "/plan/walker/trail")
    np.testing.assert_array_equal([row[0][-1] for row in rows(trail, ":strips")], walker)


def test_the_track_has_the_colours_of_its_levels(recording_path, view):
    picture = view.cell_views[0].picture
    columns = static_columns(recording_path, f"{CELL}/levels")
    np.testing.assert_allclose(rows(columns, ":positions")[0], picture.readings_m, atol=1e-4)
    red, blue = (np.array(rows(columns, ":colors")[0]) >> shift & 255 for shift in (24, 8))
    strong = picture.level_dbm > np.median(picture.level_dbm)
    redness = red.astype(int) - blue
    assert np.mean(redness[strong]) > 0 > np.mean(redness[~strong])


def test_filters_have_a_position_for_each_reading(recording_path, result):
    cell, track = result.cells[0], result.runs[0].observations.track
    for key, filtered in (("ekf", cell.ekf), ("reference", cell.reference)):
        columns = temporal_columns(recording_path, f"{CELL}/{key}")
        positions = np.add(values(columns, ":positions"), (track.x_m[0], track.y_m[0]))
        np.testing.assert_allclose(positions, filtered.x[:, :2], atol=1e-2)
        np.testing.assert_array_equal(times(columns, "elapsed"), filtered.t_ns - kit.START_NS)
        nis = temporal_columns(recording_path, f"{SERIES}/nis/{key}")
        np.testing.assert_allclose(values(nis, ":scalars")[:, 0], filtered.nis)
    band = temporal_columns(recording_path, f"{SERIES}/p0/ekf")
    np.testing.assert_allclose(values(band, ":values")[:, 0], cell.ekf.x[:, 2])
    np.testing.assert_allclose(values(band, ":variances")[:, 0], 4 * cell.ekf.p[:, 2, 2])


def test_regions_shrink_step_by_step(recording_path, view):
    cell = view.cell_views[0]
    columns = temporal_columns(recording_path, f"{CELL}/posterior/region95")
    np.testing.assert_array_equal(times(columns, "elapsed"), cell.t_ns - kit.START_NS)
    for row, regions in zip(rows(columns, ":strips"), cell.regions, strict=True):
        for drawn, ring in zip(row, regions["95"], strict=True):
            np.testing.assert_allclose(drawn, ring, atol=1e-4)
    widths = [np.ptp(np.array(row[0]), axis=0).max() for row in rows(columns, ":strips")]
    assert widths[0] > 2 * widths[-1]
    areas = values(temporal_columns(recording_path, f"{SERIES}/area/posterior"), ":scalars")[:, 0]
    np.testing.assert_allclose(10**areas, cell.of_steps("region_area_m2"))


def test_modes_have_labels_with_their_probability(recording_path, view):
    columns = temporal_columns(recording_path, f"{CELL}/posterior/modes")
    modes = [mode for step in view.cell_views[0].steps for mode in step.posterior.modes]
    positions = [position for row in rows(columns, ":positions") for position in row]
    np.testing.assert_allclose(positions, view.survey.modes_m(modes), atol=1e-3)
    assert rows(columns, ":labels")[-1] == ["50 %", "50 %"]
    assert rows(columns, ":labels")[0] == [""]


def test_verdicts_are_states(recording_path):
    columns = temporal_columns(recording_path, f"{STATES}/verdict")
    assert [row[0] for row in rows(columns, ":state")] == ["cannot tell", "ambiguous"]


def test_claims_are_at_their_positions(recording_path):
    columns = static_columns(recording_path, f"{CELL}/claims/1")
    np.testing.assert_allclose(rows(columns, ":positions")[0], [(0.0, 0.0)], atol=1e-3)
    assert rows(columns, ":labels")[0] == ["claim: rejected"]


def test_times_ascend_and_the_local_clock_is_absent(recording_path):
    for parts in chunks(recording_path).values():
        for chunk in parts:
            assert "log_time" not in chunk.timeline_names
            if not chunk.is_static and "elapsed" in chunk.timeline_names:
                batch = chunk.to_record_batch()
                for timeline in ("elapsed", "utc"):
                    assert np.all(np.diff(batch.column(timeline).cast("int64").to_numpy()) >= 0)


def test_events_keep_their_text_and_level(recording_path):
    columns = temporal_columns(recording_path, "/events")
    assert values(columns, ":text")[:, 0].tolist() == [
        f"logger: second {i}, Grüße" for i in (0, 50, 100)
    ]
    assert values(columns, ":level")[:, 0].tolist() == ["WARN"] * 3


def test_the_report_states_the_verdict_and_escapes_markup(recording_path):
    text = rows(static_columns(recording_path, f"/report/{NAME}"), ":text")[0][0]
    assert "SIMULATED" in text
    assert "ambiguous: 2 positions fit (50 %, 50 %)" in text
    assert r"\<b\>not\</b\> \| markup" in text
    assert r"reference EKF\*" in text
    assert r"\* the filter of the specification" in text
    assert "from the truth" in text
    assert r"**rejected** | too \<far\>" in text


def test_the_report_counts_one_cell(view):
    survey = view.survey
    alone = replace(survey.walks[0], levels=survey.walks[0].levels[:1])
    some = replace(view, survey=replace(survey, walks=(alone,)))
    assert "; 1 cell observed" in cell_report(some, some.cell_views[0])


def test_the_report_says_what_no_rule_could_see(view):
    some = replace(view, unnoticed="not a weak one")
    assert "not a weak one" in cell_report(some, some.cell_views[0])
    assert "not a weak one" in empty_report(some)


def test_linked_plots_open_on_the_complete_run(recording_path):
    """Their range is written where the viewer stores it, which has no public name."""
    reader = RrdReader(recording_path)
    (blueprint,) = reader.blueprints()
    assert f"/{SHARED_AXIS}" in {chunk.entity_path for chunk in reader.stream(store=blueprint)}


def test_the_map_shows_the_same_in_degrees(recording_path, result, view, claim):
    track = result.runs[0].observations.track
    walked = np.array(values(temporal_columns(recording_path, "/map/walker"), ":positions"))
    np.testing.assert_allclose(
        walked, np.column_stack(track.utm.to_latlon_arrays(track.x_m, track.y_m)), atol=1e-9
    )
    marks = rows(static_columns(recording_path, f"/map/cells/{NAME}/marks"), ":positions")[0]
    truth = result.runs[0].run.meta.truth[0]
    expected = [(one.lat_deg, one.lon_deg) for one in (truth, claim.claim)]
    np.testing.assert_allclose(marks[-2:], expected, atol=1e-9)
    assert 15.0 < zoom_of(view) <= 18.0


def test_offline_there_is_no_map(view, tmp_path):
    write_scene(view, tmp_path / "x.rrd", online=False)
    assert not any(entity.startswith("/map") for entity in chunks(tmp_path / "x.rrd"))


def test_an_ellipse_is_rotated_from_east_to_its_major_axis():
    # major axis to the north-east: half of 45 degrees about z
    p = np.array([[[2.0, 1.0], [1.0, 2.0]]])
    axes_m, quaternions = ellipse_axes(p)
    np.testing.assert_allclose(axes_m, [np.sqrt(5.991 * np.array([3.0, 1.0]))])
    expected = [[0, 0, np.sin(np.pi / 8), np.cos(np.pi / 8)]]
    np.testing.assert_allclose(quaternions, expected, atol=1e-12)
