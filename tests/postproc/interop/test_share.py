import json
from dataclasses import replace
from pathlib import Path
from typing import get_type_hints

import h5py
import msgspec
import numpy as np
import pytest

import logger
from logger.core.live import LiveTracker
from logger.core.live_settings import FOLLOW, MARK, LiveSettings
from logger.core.places import Utm, track_of
from logger.core.runfile import RunMeta, RunWriter, Truth, convert_journal, read_run
from logger.core.schema import TABLES
from logger.core.types import CellReading, Fix, LiveEstimate, Note, RawBytes, Record, Scan
from postproc.cli import main
from postproc.interop.share import EVENTS
from tests.kit.runs import UTC0_NS, meta

HOME = (52.5, 13.4)
UTM = Utm.at(*HOME)
SECRETS = (b"490154203237518", b"alice", b"boot-1234", b"ttyUSB7", b"by-id/usb-SERIAL77")
PRIVATE = {
    "config_text": "owner = alice",
    "boot_id": "boot-1234",
    "versions": {"kernel": "alice-pi"},
}


def _walk(tmp_path, xy, name="walk", live=False):
    """A walk that starts at home; a fix and a scan a second, notes, raw bytes, and the live
    estimate if wanted.
    """
    about = meta(started_ns=5 * 10**9, **PRIVATE)
    writer = RunWriter(tmp_path / f"{name}.journal", about)
    tracker = LiveTracker(about.live)
    x0, y0 = UTM.to_xy(*HOME)
    seq = None
    for i, (x, y) in enumerate(xy):
        t_ns = (5 + i) * 10**9
        lat, lon = UTM.to_latlon(x0 + x, y0 + y)
        level = -35.0 - 30.0 * np.log10(np.hypot(x - 450.0, y - 60.0))
        reading = CellReading(
            "serving", "GSM", "262", "01", 4711, 17, rssi_dbm=float(np.round(level))
        )
        writer.append(Record(t_ns, "ttyUSB7", RawBytes(b"+CGSN: 490154203237518\r\n")))
        fix = Record(t_ns, "ttyUSB7", Fix(True, UTC0_NS + t_ns, lat, lon, hdop=1.0))
        seq = writer.append(fix)
        scan = Record(t_ns + 500, "modem-alice", Scan(t_ns, (reading,), seq, seq))
        scan_seq = writer.append(scan)
        for number, record in ((seq, fix), (scan_seq, scan)) if live else ():
            for value in tracker.feed(number, record):
                if isinstance(value, LiveEstimate):
                    writer.append(Record(record.t_ns, "live", value))
        if i % 20 == 0:
            writer.append(
                Record(t_ns + 600, "logger", Note("info", "port", "/dev/serial/by-id/usb-SERIAL77"))
            )
    writer.close(t_ns, "test")
    convert_journal(tmp_path / f"{name}.journal", tmp_path / f"{name}.h5")
    return tmp_path / f"{name}.h5"


OUT_AND_BACK = [(x, 0.0) for x in [*range(0, 900, 3), *range(900, -1, -3)]]


def _share(capsys, *argv):
    assert main(["share", *map(str, argv), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def _away_m(path):
    track = track_of(read_run(path).tables["fixes"])
    return np.hypot(track.x_m - UTM.to_xy(*HOME)[0], track.y_m - UTM.to_xy(*HOME)[1])


def test_nothing_near_the_ends_is_left_at_any_time(tmp_path, capsys):
    # home, out, past home in the middle of the walk, out again, and an end elsewhere
    way = [*range(0, 900, 6), *range(900, -901, -6), *range(-900, 600, 6)]
    output = _share(capsys, _walk(tmp_path, [(x, 0.0) for x in way]), "-o", tmp_path / "copy.h5")
    run = read_run(tmp_path / "copy.h5")
    x_m = track_of(run.tables["fixes"]).x_m - UTM.to_xy(*HOME)[0]
    assert np.all(np.abs(x_m) > 200.0)
    assert np.all(np.abs(x_m - 594.0) > 200.0)
    assert len(x_m) == output["n_fixes"] > 100
    assert len(run.tables["readings"]) == output["n_readings"]
    # what is left is what it was
    assert np.all(
        np.isin(
            run.tables["fixes"]["lat_deg"],
            read_run(tmp_path / "walk.h5").tables["fixes"]["lat_deg"],
        )
    )


def test_no_level_is_left_of_a_time_when_the_walker_was_near(tmp_path, capsys):
    source = read_run(_walk(tmp_path, OUT_AND_BACK))
    _share(capsys, source.path, "-o", tmp_path / "copy.h5")
    run = read_run(tmp_path / "copy.h5")
    fixes, scans = run.tables["fixes"], run.tables["scans"]
    assert set(scans["t_start_ns"]) <= set(fixes["t_ns"])
    assert fixes["t_ns"][0] == 0
    # scans name the fixes of the copy
    at = dict(zip(fixes["seq"].tolist(), fixes["t_ns"].tolist(), strict=True))
    assert [at[seq] for seq in scans["fix_seq"].tolist()] == scans["t_start_ns"].tolist()


def test_the_circle_does_not_show_its_centre(tmp_path, capsys):
    walk = _walk(tmp_path, OUT_AND_BACK)
    nearest = set()
    for i in range(5):
        _share(capsys, walk, "-o", tmp_path / f"copy{i}.h5", "--blur-m", 100)
        away_m = _away_m(tmp_path / f"copy{i}.h5")
        assert 100.0 < away_m.min() <= 293.0
        nearest.add(round(float(away_m.min())))
    assert len(nearest) > 1


def test_secrets_are_gone_and_it_is_told(tmp_path, capsys):
    walk = _walk(tmp_path, OUT_AND_BACK)
    output = _share(capsys, walk, "-o", tmp_path / "copy.h5")
    run, data = read_run(tmp_path / "copy.h5"), (tmp_path / "copy.h5").read_bytes()
    assert len(run.raw_bytes) == len(run.tables["raw"]) == 0
    assert (run.meta.config_text, run.meta.boot_id, run.meta.versions) == ("", "", {})
    assert run.meta.run_id != read_run(walk).meta.run_id
    everything = data + b"".join(rows.tobytes() for rows in run.tables.values())
    assert not [secret for secret in SECRETS if secret in everything]
    assert set(run.tables["scans"]["source"]) == {b"modem"}
    text = " ".join(output["removed"])
    for what in ("raw bytes", "configuration", "notes", "boot", "fixes", "versions"):
        assert what in text
    assert (
        main(["share", str(walk), "-o", str(tmp_path / "copy.h5")]) == 0
    )  # a copy may be made again
    assert "removed" in capsys.readouterr().out


MARKER = "/home/alice/by-id/usb-SERIAL77-if00"
_WORDS = {"role", "rat", "level"}
"""Columns of a fixed set of words."""


def _columns_of_text(table):
    return {
        column.name: MARKER[: int(column.dtype[1:])]
        for column in TABLES[table]
        if column.dtype.startswith("S") and column.name not in _WORDS
    }


def _fields_of_text(kind):
    hints = get_type_hints(kind)
    return {
        field.name: MARKER for field in msgspec.structs.fields(kind) if hints[field.name] is str
    }


def _marked_walk(tmp_path):
    """A run with a path of its owner in every text of its description and its tables."""
    live = LiveSettings(**_fields_of_text(LiveSettings))
    about = RunMeta(
        **_fields_of_text(RunMeta) | {"origin": f"import of {MARKER}"},
        started_ns=0, versions={MARKER: MARKER}, live=live, truth=(Truth(MARKER, *HOME),),
    )  # fmt: skip
    columns = {table: _columns_of_text(table) for table in TABLES}
    source = columns["fixes"]["source"]
    of_reading = columns["readings"]
    label = of_reading.pop("cell")
    for of_table in columns.values():
        of_table.pop("source")
    writer = RunWriter(tmp_path / "marked.journal", about)
    x0, y0 = UTM.to_xy(*HOME)
    estimate = dict.fromkeys(get_type_hints(LiveEstimate), 1.0) | columns["live"]
    estimate |= dict.fromkeys(("scan_seq", "n", "utm_zone"), 1)
    for i in range(180):  # the circles around its ends, whose place is drawn, leave a part
        t_ns = i * 10**9
        lat, lon = UTM.to_latlon(x0 + 12.0 * i, y0)
        seq = writer.append(Record(t_ns, source, Fix(True, UTC0_NS + t_ns, lat, lon, hdop=1.0)))
        reading = CellReading("serving", "GSM", cid=17, rssi_dbm=-60.0, label=label, **of_reading)
        whole = replace(reading, mcc="262", mnc="01", lac=1, label=None)
        writer.append(Record(t_ns, source, Scan(t_ns, (reading, whole), seq, seq)))
        writer.append(Record(t_ns, source, RawBytes(MARKER.encode())))
        for code in (columns["notes"]["code"], MARK, FOLLOW):
            writer.append(Record(t_ns, source, Note("info", code, columns["notes"]["text"])))
        writer.append(Record(t_ns, source, LiveEstimate(**estimate)))
    writer.close(t_ns, MARKER)
    convert_journal(tmp_path / "marked.journal", tmp_path / "marked.h5")
    return tmp_path / "marked.h5"


def _contents(path):
    """All bytes of a file, and those of its datasets and attributes as a reader sees them."""
    yield path.read_bytes()
    with h5py.File(path) as file:
        for name, dataset in file.items():
            yield name.encode()
            yield np.asarray(dataset[()]).tobytes()
            yield repr(dict(dataset.attrs)).encode()
        yield repr(dict(file.attrs)).encode()


def test_no_text_of_the_owner_is_in_a_copy(tmp_path, capsys):
    walk = _marked_walk(tmp_path)
    planted = {MARKER[:n].encode() for n in (4, 12, 16, 24, len(MARKER))}
    in_source = b"".join(_contents(walk))
    assert all(marker in in_source for marker in planted)  # also in the shortest column
    output = _share(capsys, walk, "-o", tmp_path / "copy.h5")
    assert not [marker for marker in planted if marker in b"".join(_contents(tmp_path / "copy.h5"))]
    run = read_run(tmp_path / "copy.h5")
    assert set(run.tables["readings"]["cell"]) == {b"cell-1", b"262-01-1-17"}
    assert set(run.tables["notes"]["code"]) == {b"mark", b"follow"}
    assert len(run.tables["live"])
    assert any("no identity (1)" in text for text in output["removed"])
    assert main(["replay", str(run.path)]) == 0


def test_what_a_copy_needs_is_kept(tmp_path, capsys):
    """Settings, bands and the cell that the walker followed; the copy is replayed equally."""
    about = meta(
        live=LiveSettings(target="262-01-4711-18", height_m=7.5, baseline="b", streets="s")
    )
    writer = RunWriter(tmp_path / "walk.journal", about)
    x0, y0 = UTM.to_xy(*HOME)
    tracker = LiveTracker(about.live)
    for i in range(150):
        t_ns = i * 10**9
        lat, lon = UTM.to_latlon(x0 + 9.0 * i, y0)
        readings = tuple(
            CellReading("serving", "GSM", "262", "01", 4711, cid, rssi_dbm=-60.0 - i % 5, band=band)
            for cid, band in ((17, "EGSM 900"), (18, "B20"), (19, 3))
        )
        seq = writer.append(Record(t_ns, "gnss", Fix(True, UTC0_NS + t_ns, lat, lon, hdop=1.0)))
        records = [(seq, Record(t_ns, "gnss", Fix(True, UTC0_NS + t_ns, lat, lon, hdop=1.0)))]
        scan = Record(t_ns, "modem", Scan(t_ns, readings, seq, seq))
        records.append((writer.append(scan), scan))
        if i == 75:
            note = Record(t_ns, "logger", Note("info", FOLLOW, "262-01-4711-19"))
            records.append((writer.append(note), note))
        for number, record in records:
            for value in tracker.feed(number, record):
                writer.append(Record(record.t_ns, "live", value))
    writer.close(t_ns, "test")
    _share(capsys, tmp_path / "walk.journal", "-o", tmp_path / "copy.h5")
    run = read_run(tmp_path / "copy.h5")
    assert run.meta.live == LiveSettings(target="262-01-4711-18", height_m=7.5)
    assert set(run.tables["readings"]["band"]) == {b"EGSM 900", b"B20", b"3"}
    notes = run.tables["notes"]
    assert notes["text"][notes["code"] == b"follow"].tolist() == [b"262-01-4711-19"]
    assert main(["replay", str(run.path)]) == 0
    assert "replay equals live" in capsys.readouterr().out


def test_the_events_of_a_copy_are_those_of_the_recorder():
    source = "".join(path.read_text() for path in Path(logger.__file__).parent.rglob("*.py"))
    assert [code for code in EVENTS if f'"{code}"' not in source] == []


def test_the_copy_opens_with_every_command(tmp_path, capsys):
    _share(
        capsys,
        _walk(tmp_path, OUT_AND_BACK[:-1:6], live=True),
        "-o",
        tmp_path / "copy.h5",
        "--blur-m",
        "100",
    )
    copy = str(tmp_path / "copy.h5")
    assert len(read_run(copy).tables["live"])
    for argv in (
        ["info", copy],
        ["info", "--verify", copy],
        ["replay", copy],
        ["smooth", copy],
        ["export", copy, "-o", str(tmp_path / "a.kml")],
        ["share", copy, "-o", str(tmp_path / "again.h5"), "--blur-m", "50"],
    ):
        assert main(argv) == 0, argv
    assert "replay equals live" in capsys.readouterr().out


@pytest.mark.parametrize("blur_m", ["5000", "-1", "0", "nan"])
def test_what_cannot_be_shared(tmp_path, capsys, blur_m):
    walk = _walk(tmp_path, OUT_AND_BACK[:100])
    assert main(["share", str(walk), "-o", str(tmp_path / "copy.h5"), f"--blur-m={blur_m}"]) == 2
    assert "--blur-m" in capsys.readouterr().err
    assert not (tmp_path / "copy.h5").exists()


def test_a_recorded_run_is_never_replaced(tmp_path, capsys):
    walk = _walk(tmp_path, OUT_AND_BACK)
    before = walk.read_bytes()
    assert main(["share", str(walk), "-o", str(walk)]) == 2
    assert "recorded run" in capsys.readouterr().err
    assert walk.read_bytes() == before


def test_texts_of_no_note_are_not_told(tmp_path, capsys):
    output = _share(capsys, _walk(tmp_path, OUT_AND_BACK), "-o", tmp_path / "copy.h5")
    (notes,) = [text for text in output["removed"] if "note" in text]
    assert "other 0" not in notes
