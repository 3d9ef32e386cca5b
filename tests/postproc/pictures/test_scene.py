import os
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from logger.core.errors import ConfigError, RunFileError
from logger.core.runfile import RunWriter, read_run
from logger.core.types import CellReading, Fix, Note, Record, Scan
from postproc.estimators.filtered import Filtered
from postproc.pictures import viewer
from postproc.pictures.picture import focus_of, headline, nice_step, picture_of
from postproc.pictures.scene import open_viewer, write_scene
from postproc.pictures.scene_layout import SHARED_AXIS
from postproc.pictures.scene_sheet import ellipse_axes
from postproc.smooth import smooth_run
from tests.kit import smoothed as kit
from tests.kit.runs import meta

NAME = kit.cell_name(0)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("scene") / "walk.journal", seconds=120, cells=3)
    return kit.smoothed(run, places=2, verdict="ambiguous")


@pytest.fixture(scope="module")
def saved(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "walk.rrd"
    write_scene(result, path)
    return path


def chunks(path):
    found = {}
    for chunk in RrdReader(path).stream():
        found.setdefault(chunk.entity_path, []).append(chunk)
    return found


def moving(path, entity):
    """The chunk of an entity that changes with time, as columns by name."""
    (chunk,) = [c for c in chunks(path)[entity] if not c.is_static]
    batch = chunk.to_record_batch()
    return {name: batch.column(name) for name in batch.schema.names}


def values(columns, ending):
    (name,) = [name for name in columns if name.endswith(ending)]
    return np.array([np.ravel(row) for row in columns[name].to_pylist()])


def times(columns, timeline):
    return columns[timeline].cast("int64").to_numpy()


def escaped(cell):
    return "/rssi/" + cell


def test_verify_accepts_the_file(saved):
    done = subprocess.run([viewer.binary(), "rrd", "verify", saved], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_every_part_is_there(saved):
    expected = {
        "plan/grid", "plan/scale", "plan/north", "plan/key", "plan/levels/scale", "plan/track", "plan/readings",
        "plan/walker", "plan/trail", "plan/posterior/region95", "plan/posterior/region50", "plan/posterior/places",
        "plan/ekf", "plan/ekf/path", "plan/ekf/ellipse", "plan/reference", "plan/reference/ellipse", "plan/rts",
        "plan/batch", "plan/batch/ellipse", "plan/truth", "p0/ekf", "p0/reference", "p0/posterior", "p0/batch",
        "eta/ekf", "nis/ekf", "nis/reference", "nis/bound0.95", "accuracy/ekf/semi-major", "accuracy/ekf/error",
        "accuracy/posterior", "report", "events",
    }  # fmt: skip
    assert {f"/{name}" for name in expected} <= set(chunks(saved))


def test_levels_are_those_read(saved, result):
    for obs in result.observations.cells:
        columns = moving(saved, escaped(obs.cell))
        np.testing.assert_array_equal(values(columns, ":scalars")[:, 0], obs.level_dbm)
        np.testing.assert_array_equal(times(columns, "elapsed"), obs.t_ns - kit.START_NS)


def test_walker_is_where_the_fixes_are(saved, result):
    track = result.observations.track
    columns = moving(saved, "/plan/walker")
    expected = np.column_stack([track.x_m - track.x_m[0], track.y_m - track.y_m[0]])
    np.testing.assert_allclose(values(columns, ":positions"), expected, atol=1e-4)
    np.testing.assert_array_equal(times(columns, "elapsed"), track.t_ns - kit.START_NS)


def test_utc_is_that_of_the_fixes(saved, result):
    columns = moving(saved, "/plan/walker")
    np.testing.assert_array_equal(times(columns, "utc"), result.run.tables["fixes"]["utc_ns"])


def test_trail_ends_at_the_walker(saved):
    walker, trail = values(moving(saved, "/plan/walker"), ":positions"), moving(saved, "/plan/trail")
    (name,) = [name for name in trail if name.endswith(":strips")]
    ends = [row[0][-1] for row in trail[name].to_pylist()]
    np.testing.assert_array_equal(ends, walker)


def test_filters_have_a_place_for_each_reading(saved, result):
    cell = result.cells[0]
    for key, filtered in (("ekf", cell.ekf), ("reference", cell.reference)):
        track = result.observations.track
        places = values(moving(saved, f"/plan/{key}"), ":positions")
        np.testing.assert_allclose(np.add(places, (track.x_m[0], track.y_m[0])), filtered.x[:, :2], atol=1e-2)
    band = moving(saved, "/p0/ekf")
    np.testing.assert_allclose(values(band, ":values")[:, 0], cell.ekf.x[:, 2])
    np.testing.assert_allclose(values(band, ":variances")[:, 0], 4 * cell.ekf.p[:, 2, 2])


def test_times_rise_and_the_clock_of_the_desk_is_absent(saved):
    for parts in chunks(saved).values():
        for chunk in parts:
            assert "log_time" not in chunk.timeline_names
            if not chunk.is_static and "elapsed" in chunk.timeline_names:
                batch = chunk.to_record_batch()
                for timeline in ("elapsed", "utc"):
                    assert np.all(np.diff(batch.column(timeline).cast("int64").to_numpy()) >= 0)


def test_events_keep_their_text_and_level(saved, result):
    columns = moving(saved, "/events")
    assert values(columns, ":text")[:, 0].tolist() == [f"logger: second {i}, Grüße" for i in (0, 50, 100)]
    assert values(columns, ":level")[:, 0].tolist() == ["WARN"] * 3


def test_the_report_tells_the_verdict_and_escapes_markup(saved):
    (chunk,) = chunks(saved)["/report"]
    batch = chunk.to_record_batch()
    text = next(batch.column(n)[0].as_py()[0] for n in batch.schema.names if n.endswith(":text"))
    assert "SIMULATED" in text
    assert "ambiguous: 2 places fit (50%, 50%)" in text
    assert r"\<b\>not\</b\> \| markup" in text
    assert "reference EKF (wrong)" in text
    assert "from the truth" in text


def test_linked_plots_open_on_the_whole_run(saved):
    """The viewer keeps their range at a place without a public name: see that it is written there."""
    reader = RrdReader(saved)
    (blueprint,) = reader.blueprints()
    assert f"/{SHARED_AXIS}" in {chunk.entity_path for chunk in reader.stream(store=blueprint)}


def test_ellipse_is_turned_from_east_to_its_major_axis():
    # major axis to the north-east: half of 45 degrees about z
    p = np.array([[[2.0, 1.0], [1.0, 2.0]]])
    axes, turns = ellipse_axes(p)
    np.testing.assert_allclose(axes, [np.sqrt(5.991 * np.array([3.0, 1.0]))])
    np.testing.assert_allclose(turns, [[0, 0, np.sin(np.pi / 8), np.cos(np.pi / 8)]], atol=1e-12)


def test_focus_is_located_first_then_heard_most(result):
    a, b, c = result.cells
    assert focus_of(result).cell == NAME
    chosen = replace(result, cells=(a, replace(b, verdict="located", n=9), replace(c, n=10_000)))
    assert focus_of(chosen).cell == b.cell
    assert focus_of(replace(result, cells=())) is None


def test_headline_is_honest(result):
    cell = result.cells[0]
    assert headline(replace(cell, verdict="located")).startswith("located: 95 % of the probability lie within 29 m")
    assert headline(replace(cell, verdict="cannot tell", warnings=("too few",))) == "cannot tell: too few"


def test_region_out_of_all_proportion_leaves_the_walk_in_sight(result):
    cell = result.cells[0]
    cells = cell.posterior.cells
    x, y = cells.x_m.mean(), cells.y_m.mean()
    far = replace(cells, x_m=x + 50 * (cells.x_m - x), y_m=y + 50 * (cells.y_m - y), size_m=cells.size_m * 50)
    huge = replace(result, cells=(replace(cell, posterior=replace(cell.posterior, cells=far)),))
    box = picture_of(huge).box
    assert box.holds(0.0, 0.0)
    assert box.size < 400.0


@pytest.mark.parametrize(("span", "most", "step"), [(950, 12, 100), (120, 12, 10), (0, 5, 1), (2401, 12, 500)])
def test_steps_are_round(span, most, step):
    assert nice_step(span, most) == step


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
    ids=["nothing", "a note", "no fix", "only a fix", "one reading", "empty scan", "unknown cell", "invalid fix"],
)
def test_runs_with_next_to_nothing(records, tmp_path):
    result = smooth_run(write(tmp_path / "x.journal", records))
    write_scene(result, tmp_path / "x.rrd")
    found = chunks(tmp_path / "x.rrd")
    assert "/report" in found
    has_fix = any(isinstance(r.value, Fix) and r.value.valid for r in records)
    assert ("/plan/walker" in found) == has_fix
    assert ("/plan/missing" in found) != has_fix


def test_levels_without_any_fix(tmp_path):
    result = smooth_run(write(tmp_path / "x.journal", [scan(0, 1, 2), scan(10**9, 1)]))
    write_scene(result, tmp_path / "x.rrd")
    columns = moving(tmp_path / "x.rrd", escaped("262-01-1-1"))
    assert times(columns, "elapsed").tolist() == [0, 10**9]
    assert "utc" not in columns


def test_diverged_filter_is_left_out(result, tmp_path):
    cell = result.cells[0]
    filtered = cell.reference
    lost = Filtered(filtered.t_ns, filtered.x * np.nan, filtered.p * np.nan, *[filtered.innovation_db * np.nan] * 2)
    away = Filtered(filtered.t_ns, filtered.x * 1e30, filtered.p * 1e30, *[filtered.innovation_db] * 2)
    for odd in (lost, away):
        write_scene(replace(result, cells=(replace(cell, reference=odd, ekf=odd),)), tmp_path / "x.rrd")
        assert "/plan/reference" not in chunks(tmp_path / "x.rrd")


def test_odd_names_of_cells(tmp_path):
    name = "a/b [c] *$é 漢"
    label = Record(10, "modem", Scan(0, (CellReading("scan", label=name, rssi_dbm=-60.0),), None))
    result = smooth_run(write(tmp_path / "x.journal", [FIX, label]))
    write_scene(result, tmp_path / "x.rrd")
    assert sum(entity.startswith("/rssi/") for entity in chunks(tmp_path / "x.rrd")) == 1


def test_an_hour_fits_in_four_megabytes_and_long_walks_are_thinned(tmp_path):
    result = kit.smoothed(kit.write_run(tmp_path / "x.journal", seconds=3600, cells=8))
    write_scene(result, tmp_path / "x.rrd")
    assert (tmp_path / "x.rrd").stat().st_size < 4_000_000


def test_missing_folder_is_one_line(result, tmp_path):
    with pytest.raises(RunFileError, match="no such folder"):
        write_scene(result, tmp_path / "absent" / "x.rrd")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_in_the_way_is_one_line(result, tmp_path):
    (tmp_path / "x.rrd").mkdir()
    with pytest.raises(RunFileError, match="cannot write"):
        write_scene(result, tmp_path / "x.rrd")
    assert [path.name for path in tmp_path.iterdir()] == ["x.rrd"]


def test_without_a_screen_the_viewer_says_what_to_do(result, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ConfigError, match="--save"):
        open_viewer(result)


@pytest.mark.parametrize("code", [0, 102])
def test_viewer_runs_in_the_foreground_and_listens_here_only(result, monkeypatch, tmp_path, code):
    """A stand-in that writes down how it was called, and whether the recording was there."""
    fake = tmp_path / "rerun"
    fake.write_text(
        f"""#!/bin/sh
echo "$XDG_CONFIG_HOME $*" >> {tmp_path}/calls
[ "$1" = analytics ] && exit 0
for last; do :; done
test -s "$last" || exit 3
exit {code}
"""
    )
    fake.chmod(0o755)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(viewer, "binary", lambda: fake)
    if code:
        with pytest.raises(ConfigError, match="code 102"):
            open_viewer(result)
    else:
        assert open_viewer(result) == 0
    settings, opened = (tmp_path / "calls").read_text().splitlines()
    assert settings.endswith(" analytics disable")
    assert "--bind 127.0.0.1" in opened
    assert settings.split()[0] == opened.split()[0] != os.environ.get("XDG_CONFIG_HOME")
    assert not os.path.exists(opened.split()[-1])
