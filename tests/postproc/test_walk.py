"""What is said of fixes that are moved by more than their accuracy allows."""

from dataclasses import replace

import numpy as np
import pytest

from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.runfile import read_run
from logger.core.types import CellReading, Fix, Record, Scan
from postproc.multi_run import merge
from postproc.walk import observe_run
from tests.kit import runs


def _run(tmp_path, north_m, *, origin="test", step_s=1):
    (tmp_path / "walk.journal").unlink(missing_ok=True)
    records = []
    for i, north in enumerate(north_m):
        t_ns = i * step_s * 10**9
        records.append(
            Record(t_ns, "gnss", Fix(True, None, 52.0 + north / 111_200.0, 13.0, hdop=1.0))
        )
        records.append(
            Record(
                t_ns,
                "modem",
                Scan(t_ns, (CellReading("serving", rssi_dbm=-70.0, label="x"),), i, i),
            )
        )
    runs.write_journal(tmp_path / "walk.journal", records, origin=origin)
    return read_run(tmp_path / "walk.journal")


def test_a_fix_that_was_set_aside_is_told_with_its_distance(tmp_path):
    north_m = np.arange(100) * 1.4
    north_m[50] += 500.0
    warnings = observe_run(_run(tmp_path, north_m)).warnings
    (warning,) = warnings
    assert warning.startswith("1 fix lies apart from all others, up to 50")
    assert warning.endswith("m from the track, and was set aside")


def test_an_even_walk_has_nothing_to_tell(tmp_path):
    assert observe_run(_run(tmp_path, np.arange(100) * 1.4)).warnings == ()


def test_a_recorded_run_is_smoothed_however_fast_it_was(tmp_path):
    """Its times are the clock's, so it was a fast train."""
    north_m = np.arange(100) * 80.0
    for origin, asked in (("test", False), ("import of train.csv", True)):
        warnings = observe_run(_run(tmp_path, north_m, origin=origin)).warnings
        assert any("the times cannot be right" in warning for warning in warnings) == asked


def test_only_readings_in_the_order_of_one_clock_are_timed(tmp_path):
    north_m = np.arange(100) * 1.4
    for origin, is_timed in (("test", True), ("import without times of x", False)):
        (obs,) = observe_run(_run(tmp_path, north_m, origin=origin)).observations.cells
        assert obs.is_timed == merge({0: obs}, [0]).is_timed == is_timed
        assert not merge({0: obs, 1: obs}, [0, 0]).is_timed


def test_readings_of_a_scan_whose_row_is_lost_are_placed_by_their_own_time(tmp_path):
    run = _run(tmp_path, np.arange(100) * 1.4)
    lost = replace(run, tables={**run.tables, "scans": run.tables["scans"][:-5]})
    (whole,), (partial,) = (observe_run(one).observations.cells for one in (run, lost))
    for name in ("x_m", "y_m", "position_sigma_m"):
        np.testing.assert_array_equal(getattr(partial, name), getattr(whole, name))


def test_fixes_that_fit_on_no_path_are_used_as_written_and_count_as_less_certain(tmp_path):
    """A car that turns between its few fixes: an import keeps its times, and says what it does."""
    rng = np.random.default_rng(2)
    north_m = np.cumsum(rng.choice([-1.0, 1.0], 60) * rng.uniform(60.0, 250.0, 60))
    observed = observe_run(_run(tmp_path, north_m, origin="import of car.csv", step_s=11))
    (warning,) = observed.warnings
    assert "do not fit on one path in their times" in warning
    assert "less certain" in warning
    (obs,), track = observed.observations.cells, observed.observations.track
    np.testing.assert_array_equal(obs.y_m, track.y_m)
    step_m = np.abs(np.diff(north_m))
    assert np.all(obs.position_sigma_m[1:] > 2.0 * step_m / 11.0)  # late by two seconds
    assert np.all(obs.position_sigma_m > track.sigma_m)


@pytest.mark.parametrize("scan_s", [1, 12])
def test_the_device_places_the_readings_of_its_answer_where_the_desktop_does(tmp_path, scan_s):
    rng, records, tracker = np.random.default_rng(5), [], LiveTracker(LiveSettings())
    for t_s in range(240):
        noise_m = rng.normal(0.0, 3.0, 2)
        lat_deg, lon_deg = 52.0 + noise_m[0] / 111_200.0, 13.0 + (1.4 * t_s + noise_m[1]) / 68_500.0
        fix = Fix(True, None, lat_deg, lon_deg, hdop=1.0, speed_mps=1.4, course_deg=90.0)
        records.append(Record(t_s * 10**9, "gnss", fix))
        if t_s % scan_s == 0 and t_s > scan_s:
            scan = Scan((t_s - scan_s) * 10**9, (runs.reading(1, -70.0 - t_s // 10),))
            records.append(Record(t_s * 10**9 + 10**8, "modem", scan))
    for seq, record in enumerate(records):
        tracker.feed(seq, record)
    runs.write_journal(tmp_path / "walk.journal", records)
    (desk,) = observe_run(read_run(tmp_path / "walk.journal")).observations.cells
    (cell,) = tracker._cells.values()
    device = tracker._track.walk.place(cell.locator.readings.readings())
    row = np.searchsorted(desk.t_ns, device.t_ns)
    np.testing.assert_array_equal(desk.t_ns[row], device.t_ns)
    for name, atol_m in (("x_m", 0.02), ("y_m", 0.02), ("position_sigma_m", 0.05)):
        of_desk, of_device = getattr(desk, name)[row], getattr(device, name)
        np.testing.assert_allclose(of_device, of_desk, rtol=0.0, atol=atol_m)
