import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import read_run
from postproc.interop.importing import Reading, import_walk
from postproc.interop.track_file import read_track
from postproc.interop.writers import gpx, opencellid_csv
from tests.postproc.interop.walks import around_a_square, export_of

T0_NS = 1_714_557_600 * 10**9


def _gpx(path, points):
    text = "".join(
        f'<trkpt lat="{lat}" lon="{lon}"><ele>{30 + i}</ele>{time}</trkpt>'
        for i, (lat, lon, time) in enumerate(points)
    )
    path.write_text(f'<gpx xmlns="x" version="1.1"><trk><trkseg>{text}</trkseg></trk></gpx>')
    return path


def _time(second):
    return f"<time>2024-05-01T10:{second // 60:02d}:{second % 60:02d}Z</time>"


def test_positions_between_points(tmp_path):
    points = [
        (52.5, 13.5, _time(0)),
        (52.5001, 13.5, _time(10)),
        (52.501, 13.5, _time(40)),
        (52.6, 13.5, _time(140)),
        (0, 0, _time(150)),
        (52.6, 13.5, ""),
    ]
    track = read_track(_gpx(tmp_path / "t.gpx", points))
    assert len(track.fixes) == 4
    middle, slow = track.at(T0_NS + 5 * 10**9), track.at(T0_NS + 25 * 10**9)
    assert (middle.lat_deg, middle.alt_m, middle.acc_m) == (pytest.approx(52.50005), 30.5, None)
    assert slow.acc_m == pytest.approx(100.1 / 4, rel=0.01)  # points half a minute apart
    assert track.at(T0_NS) == track.fixes[0]
    assert [track.at(T0_NS + s * 10**9) for s in (-1, 90, 141)] == [None] * 3


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<gpx/>", "fewer than two points"),
        ("<gpx><trk>", "damaged XML"),
        ('<!DOCTYPE x [<!ENTITY a "b">]><gpx/>', "a document type"),
        ("t_s,lat\n", "no GPX track"),
        ('{"geometry": {"coordinates": 7}}', "no GPX track"),
    ],
)
def test_what_is_no_track_is_named(tmp_path, text, says):
    (tmp_path / "t.gpx").write_text(text)
    with pytest.raises(RunFileError, match=says):
        read_track(tmp_path / "t.gpx")


def test_our_own_track_gives_our_own_log_its_positions_back(tmp_path):
    """Levels and track leave in two files and are joined again by time."""
    _, walk, _ = around_a_square(tmp_path)
    gpx.write(walk, tmp_path / "walk.gpx")
    writable = [one for one in walk.sightings if opencellid_csv.writable(one)]
    opencellid_csv.write(export_of(writable), tmp_path / "levels.csv")
    lines = (tmp_path / "levels.csv").read_text().splitlines()
    moved = [line.replace(f",{walk.sightings[0].lat_deg}", ",1.0") for line in lines]
    (tmp_path / "levels.csv").write_text("\n".join(moved) + "\n")
    reading = Reading(track=read_track(tmp_path / "walk.gpx"))
    imported = import_walk(tmp_path / "levels.csv", tmp_path / "run.h5", reading=reading)
    assert imported.n_rows >= 0.99 * len(writable)
    placed = [r.value for _, r in read_run(tmp_path / "run.h5").records("fixes")]
    there = {round(one.fix.utc_ns / 1e6): one.fix for one in writable}
    for fix in placed:
        wanted = there[round(fix.utc_ns / 1e6)]
        assert (fix.lat_deg, fix.lon_deg) == pytest.approx(
            (wanted.lat_deg, wanted.lon_deg), abs=2e-5
        )


@pytest.mark.parametrize(
    ("time", "level", "columns"),
    [("time", "rssi", {}), ("Stamp", "Signal", {"time": "Stamp", "level": "Signal"})],
)
def test_a_table_without_positions_has_those_of_a_track(tmp_path, time, level, columns):
    points = [(52.0, 13.0, _time(0)), (52.001, 13.0, _time(20))]
    track = read_track(_gpx(tmp_path / "t.gpx", points))
    table = tmp_path / "levels.csv"
    rows = [f"2024-05-01T10:00:{s:02d}Z,GSM,262,01,4711,17,{-70 - s}" for s in (0, 10, 20)]
    table.write_text("\n".join([f"{time},rat,mcc,mnc,lac,cid,{level}", *rows]) + "\n")
    with pytest.raises(RunFileError, match="no position: add the GPX track of the walk"):
        import_walk(table, tmp_path / "run.h5", reading=Reading(columns=columns))
    import_walk(table, tmp_path / "run.h5", reading=Reading(columns=columns, track=track))
    run = read_run(tmp_path / "run.h5")
    assert run.named_readings["rssi_dbm"].tolist() == [-70.0, -80.0, -90.0]
    assert run.tables["fixes"]["lat_deg"].tolist() == pytest.approx([52.0, 52.0005, 52.001])
