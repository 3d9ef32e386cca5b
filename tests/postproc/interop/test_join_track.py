from dataclasses import replace
from datetime import datetime

import pytest

from logger.core.errors import ConfigError
from logger.core.runfile import read_run
from logger.core.types import CellReading, Fix
from postproc.cli import main
from postproc.interop.sighting import BadRow, NoCell, Sighting
from postproc.interop.track_file import GpsTrack, in_zone, on_track, with_position, zone_named

LOCAL_NS = 1_714_564_807 * 10**9
READING = CellReading("scan", "GSM", rssi_dbm=-70.0)
LOCAL = Sighting(2, LOCAL_NS, Fix(True, None, 1.0, 2.0), READING)


def test_a_zone_makes_local_times_utc():
    utc_ns = LOCAL_NS - 2 * 3600 * 10**9
    known = Sighting(3, 7, Fix(True, 7, 1.0, 2.0), READING)
    summer, same = in_zone([LOCAL, known], zone_named("Europe/Berlin"))
    assert (summer.t_ns, summer.fix.utc_ns) == (utc_ns, utc_ns)
    assert same == known


@pytest.mark.parametrize(
    ("local", "is_one"),
    [
        ("2024-10-27T01:59", True),
        ("2024-10-27T02:30", False),
        ("2024-10-27T03:00", True),
        ("2024-03-31T02:30", False),
    ],
)
def test_an_hour_that_came_twice_or_never_is_no_time(local, is_one):
    local_ns = int(datetime.fromisoformat(f"{local}Z").timestamp()) * 10**9
    (row,) = in_zone([replace(LOCAL, t_ns=local_ns)], zone_named("Europe/Berlin"))
    assert isinstance(row, Sighting if is_one else BadRow)
    assert is_one or "twice or never" in row.why


@pytest.mark.parametrize("name", ["Europe/Nowhere", "", "/etc/passwd", "../x"])
def test_no_zone(name):
    with pytest.raises(ConfigError, match="no time zone"):
        zone_named(name)


def test_a_track_needs_utc_and_a_point_near():
    track = GpsTrack([Fix(True, n * 10**9, 52.0 + n / 1e5, 13.0) for n in range(5)])
    inside = Sighting(4, 0, Fix(False, 2 * 10**9), READING)
    outside = Sighting(5, 0, Fix(False, 9 * 10**9), READING)
    placed, far, local, other = on_track([inside, outside, LOCAL, NoCell(6)], track)
    assert (placed.t_ns, placed.fix) == (2 * 10**9, track.fixes[2])
    assert far == BadRow(5, "the track has no points before and after it, at most 60 s apart")
    assert "--zone" in local.why
    assert other == NoCell(6)


def test_without_a_track_a_row_needs_its_own_position():
    rows = list(with_position([LOCAL, Sighting(4, 0, Fix(False, 7), READING)]))
    assert rows[0] == LOCAL
    assert "--track" in rows[1].why


def test_a_telephones_log_on_another_receivers_track(tmp_path, capsys):
    """The whole way: local times, a zone, a GPX track, and positions of the telephone replaced."""
    rows = "".join(
        f"2024.05.01_12.00.{s:02d}\t13.9\t52.9\t0\t26201\t17\t4711\t2G\t-7{s % 10}\n"
        for s in range(0, 30, 3)
    )
    head = "Timestamp\tLongitude\tLatitude\tSpeed\tOperator\tCellID\tLAC\tNetworkTech\tLevel\n"
    (tmp_path / "log.txt").write_text(head + rows)
    times = {s: f"<time>2024-05-01T10:00:{s:02d}Z</time>" for s in range(0, 31, 5)}
    points = "".join(
        f'<trkpt lat="{52.5 + s * 1e-5:.5f}" lon="13.5">{time}</trkpt>' for s, time in times.items()
    )
    (tmp_path / "walk.gpx").write_text(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>")
    command = ["import", str(tmp_path / "log.txt"), "--track", str(tmp_path / "walk.gpx")]
    target = ["-o", str(tmp_path / "run.h5")]
    assert main([*command, *target]) == 2
    assert "--zone" in capsys.readouterr().err
    assert main([*command, "--zone", "Europe/Berlin", *target]) == 0
    fixes = [r.value for _, r in read_run(tmp_path / "run.h5").records("fixes")]
    wanted = [52.5 + s * 1e-5 for s in range(0, 30, 3)]
    assert [fix.lat_deg for fix in fixes] == pytest.approx(wanted)
