import bz2
import gzip
import json
import lzma
import os
import re
import sqlite3
import subprocess
import sys
import zipfile
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np
import pytest

from logger.core.errors import RunFileError
from logger.core.places import UNKNOWN_SIGMA_M
from logger.core.rows import levels_dbm
from logger.core.runfile import read_run
from logger.core.types import Fix, Note, Scan
from postproc.cli import main
from postproc.foreign_file import encoding_of
from postproc.info import describe
from postproc.interop.importing import formats, import_walk, recognise
from postproc.interop.sighting import BadRow, Sighting
from postproc.pictures.survey import clock_of
from postproc.walk import observe_run
from tests.kit.sample_results import write_run

WIGLE = (
    "WigleWifi-1.4,appRelease=2\n"
    "MAC,SSID,AuthMode,FirstSeen,Channel,RSSI,"
    "CurrentLatitude,CurrentLongitude,AltitudeMeters,AccuracyMeters,Type\n"
    "26201_4711_17,,GSM;de,2025-06-21 00:25:38,62,-73,52,13,30,5,GSM\n"
    "26201_4711_18,,GSM;de,2025-06-21 00:25:37,62,-75,52,13.001,30,5,GSM\n"
    "26201_4711_18,,GSM;de,2025-06-21 00:25:37,62,-75,52,13.001,30,5,GSM\n"
    "aa:bb:cc:dd:ee:ff,home,[WPA2],2025-06-21 00:25:39,6,-60,52,13,30,5,WIFI\n"
    "26201_4711_17,,GSM;de,2025-06-21 00:25:40,62,-113,52,13,30,5,GSM\n"
)


def _write(tmp_path, text, name="source.txt"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("t_s,lat,lon,rssi_dbm\n0,1,2,-70\n", "CSV"),
        (WIGLE, "WiGLE CSV"),
        (WIGLE.partition("\n")[2], "WiGLE CSV"),
        ("lat,lon,mcc,mnc,lac,cellid,signal,measured_at,act\n", "OpenCelliD measurements, CSV"),
        (
            "\ufeffmcc,mnc,lac,cell_id,dbm,lat,lon,measured_at,net_type\n",
            "OpenCelliD measurements, CSV",
        ),
        ('\n {"measurements": []}', "OpenCelliD measurements, JSON"),
        (
            "# CSV Version=0.3.0\r\ndeviceTime,latitude,longitude,mcc,mnc,lac,ci,arfcn\r\n",
            "Network Survey CSV",
        ),
    ],
)
def test_formats_are_told_by_their_content(tmp_path, text, name):
    assert recognise(_write(tmp_path, text)).name == name


def test_tables_tell_the_kind_of_sqlite(tmp_path):
    for name, table in (
        ("a", "KISMET (db_version INT)"),
        ("b", "LTE_MESSAGE (id INT)"),
        ("c", "wifi (id INT)"),
    ):
        database = sqlite3.connect(tmp_path / name)
        database.execute(f"CREATE TABLE {table}")
        database.execute("CREATE TABLE data (json TEXT)")
        database.commit()
        database.close()
    assert recognise(tmp_path / "a").name == "Kismet log"
    assert recognise(tmp_path / "b").name == "Network Survey GeoPackage"
    with pytest.raises(RunFileError, match="SQLite with the tables data, wifi"):
        recognise(tmp_path / "c")
    with pytest.raises(RunFileError, match="no column ts_sec, ts_usec, lat, lon, type"):
        import_walk(tmp_path / "a", tmp_path / "run.h5")


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"radio,mcc,net,area,cell,unit,lon,lat\n", "celldb import"),
        (b"GSM,208,10,1,2,0,2.35,48.8,1000,1,1,1,1,0\n", "celldb import"),
        (gzip.compress(b"x", mtime=0), "I read text that begins with 'x'"),
        (gzip.compress(b"t_s,lat\n", mtime=0)[:-9], "cannot be unpacked"),
        (b"PK\x03\x04nothing", "cannot be unpacked"),
        (b"SQLite format 3\0" + b"\xff" * 200, "damaged SQLite"),
        (b"\x89HDF\r\n\x1a\n", "needs no import"),
        (b"CWJ1\xdb\x36\x60\xad", "is the journal of a run, which needs no import"),
        (b"mcc,measured_at,lat\n", "no column mnc, lon, cell_id or cellid, act or net_type"),
        (b"t_s,lat,lon,noise\n", "no column rssi_dbm"),
        (b"date,lat,lon,strength\n", "can be read with --columns lat=...,lon=...,level=..."),
        (b"", "I read an empty file"),
        (b"\0\xff\xfe" * 50, "I read a binary file that begins with 00 ff fe"),
        (b"%PDF-1.7\n1 0 obj", "I read a PDF document"),
        (b"PK\x05\x06" + bytes(18), "I read an empty zip"),
        (b"PAR1\x15\x04", "I read a Parquet table"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Excel workbook (save its sheet as CSV)"),
        (b"7z\xbc\xaf\x27\x1c", "a file packed by 7-Zip (unpack it)"),
        (bz2.compress(b"lat,lon,level"), "a file packed by bzip2 (unpack it)"),
        (lzma.compress(b"lat,lon,level"), "a file packed by xz (unpack it)"),
        (b'<?xml version="1.0"?>\n<kml>', "I read XML or HTML that begins with <kml>"),
        (b'<?xml version="1.0"?>\n<gpx>', "is a track without cells: import the log that has them"),
        (b"<log><lat>1</lat></log>", "I read XML or HTML that begins with <log>"),
        (
            b"name;street;town\nA;B;C\n",
            "I read a table with the columns name, street, town. docs/guide/formats.md",
        ),
        (b"Dear diary,\n", "I read a table with the columns dear diary"),
        (b"one word\n", "I read text that begins with 'one word'. docs/guide/formats.md"),
        (b'{"a": 1}', "I read JSON with the keys a."),
        (b'{"measurements": [{"act": "LTE"}]}', "line 1: measured_at is empty"),
    ],
)
def test_what_is_missing_is_named_in_one_line(tmp_path, capsys, data, says):
    (tmp_path / "source").write_bytes(data)
    assert main(["import", str(tmp_path / "source"), "-o", str(tmp_path / "run.h5")]) == 2
    output = capsys.readouterr().err
    assert says in output
    assert output.count("\n") == 1
    assert not (tmp_path / "run.h5").exists()


CSV_LOG = "t_s;lat;lon;rssi_dbm;cell\r\n0;52;13;-70;a\r\n1;52;13;-71;b\r\n"
MEASUREMENT = (
    '{"mcc": 262, "mnc": 1, "lac": 1, "cellid": 2, "signal": -70, "act": "GSM", "lat": 52, '
    '"lon": 13, "measured_at": "2024-05-14 09:00:00"}'
)


def test_rows_of_another_form_are_counted_and_can_be_found(tmp_path, capsys):
    row = '{{"time": "2026-05-01T10:00:{:02d}Z", "lat": 48.1, "lon": 11.5, "rsrp": -8{}, "cid": 7}}'
    rows = [row.format(k, k) for k in range(9)]
    rows[3:3] = ['{"time": "2026-05-01T10:00:02Z", "cells": [{"rsrp": -80}]}'] * 2
    (tmp_path / "a.json").write_text("\n".join([*rows, ""]))
    assert main(["import", str(tmp_path / "a.json"), "-o", str(tmp_path / "a.h5")]) == 0
    assert "left out: 2 rows, no level (the first: line 4)\n" in capsys.readouterr().err


def test_a_table_of_a_chinese_spreadsheet_is_read_in_its_encoding(tmp_path):
    rows = [
        f"2026-05-01 10:00:{k:02d},48.10{k:02d},11.5,LTE,{7 + k},-8{k % 9},北京" for k in range(30)
    ]
    text = "\n".join(["时间,纬度,经度,网络制式,小区ID,信号强度,地点", *rows, ""])
    (tmp_path / "a.csv").write_text(text, "gbk")
    imported = import_walk(tmp_path / "a.csv", tmp_path / "a.h5")
    assert (imported.n_rows, imported.left.n_bad) == (30, 0)


@pytest.mark.parametrize(
    ("header", "encoding"),
    [
        ("Время;Широта;Долгота;Уровень;CID", "cp1251"),  # each word of an odd number of letters
        ("Дата Время;Широта;Долгота;Уровень сигнала (дБм);CID", "cp1251"),
        ("sep=;\nВРЕМЯ;ШИРОТА;ДОЛГОТА;УРОВЕНЬ СИГНАЛА;CID", "cp1251"),
        ("Время;Широта;Долгота;RSRP (дБм);CID", "cp1251"),
        ("Czas;Szerokość;Długość;RSRP;CI", "cp1250"),
        ("Horodatage;Latitude;Longitude;Niveau;ID cellule", "cp1252"),
        ("Zeit;Breite;Länge;Pegel;Zellen-ID", "cp1252"),
        ("时间;纬度;经度;信号强度;小区ID", "gbk"),
    ],
)
def test_a_spreadsheet_writes_the_encoding_of_its_country(tmp_path, header, encoding):
    rows = [f"2026-05-01 10:00:{k:02d};48,10{k:02d};11,5;-8{k % 9};{7 + k}" for k in range(30)]
    (tmp_path / "a.csv").write_text("\n".join([header, *rows, ""]), encoding)
    imported = import_walk(tmp_path / "a.csv", tmp_path / "a.h5")
    assert (imported.n_rows, imported.left.n_bad, imported.left.n_unnamed) == (30, 0, 0)
    assert imported.has_times


def test_the_encoding_of_a_long_damaged_line_is_found_at_once():
    # a pattern that may take words in pieces ends in years
    words = [b"abcdefghijklmnopqrstuvwxyz" * 40, bytes(range(0xC0, 0x100)) * 20]
    for line in (*words, b",".join(words), words[0] + b"\xd0", b"x".join(words)):
        assert encoding_of(line + b'"\xff{') in {"utf-8-sig", "cp1251"}


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "utf-16-le", "utf-16-be without"]
)
@pytest.mark.parametrize(
    ("text", "name"),
    [
        (CSV_LOG, "CSV"),
        (f"sep=;\r\n{CSV_LOG}", "CSV"),
        (CSV_LOG.replace(";", "\t"), "CSV"),
        (f"sep=\t\r\n{CSV_LOG}".replace(";", "\t"), "CSV"),
        (WIGLE, "WiGLE CSV"),
        (f"sep=,\n{WIGLE}", "WiGLE CSV"),
        ("time;lat;lon;rsrp\n2024-05-14 09:00:00;52,5;13,5;-70\n", "CSV by column names"),
        ("sep=;\nlat;lon;rsrp\n52,5;13,5;-70\n", "CSV by column names"),
        ("52.0,13.0,30,262,1,2,3,-70,LTE,LTE,1300,5\n", "CellMapper CSV"),
        ("sep=,\n52.0,13.0,30,262,1,2,3,-70,LTE,LTE,1300,5\n", "CellMapper CSV"),
        (f'{{"measurements": [{MEASUREMENT}]}}', "OpenCelliD measurements, JSON"),
        ('<?xml version="1.0"?>\n<kml/>', None),
    ],
)
def test_a_text_is_read_in_any_encoding_of_spreadsheets(tmp_path, text, name, encoding):
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    (tmp_path / "plain").write_text(text, newline="")
    (tmp_path / "x").write_bytes((mark + text).encode(encoding.removesuffix(" without")))
    if name is None:
        with pytest.raises(RunFileError, match="XML or HTML that begins with <kml>"):
            recognise(tmp_path / "x")
        return
    form, plain = recognise(tmp_path / "x"), recognise(tmp_path / "plain")
    rows = list(form.read(tmp_path / "x"))
    assert (form.name, rows) == (name, list(plain.read(tmp_path / "plain")))
    assert any(isinstance(row, Sighting) for row in rows)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ("lat,lon,level\n52,13,-70\n".encode("utf-32"), "I read a binary file"),
        (b"PAR1\x15\x04", "I read a Parquet table"),
        (b"<log><lat>1</lat></log>", "I read XML or HTML that begins with <log>"),
    ],
)
def test_columns_are_those_of_a_table_of_text(tmp_path, capsys, data, says):
    (tmp_path / "source").write_bytes(data)
    columns = "lat=lat,lon=lon,level=level"
    target = tmp_path / "run.h5"
    assert main(["import", str(tmp_path / "source"), "-o", str(target), "--columns", columns]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize(
    ("mcc", "place", "is_swapped"),
    [
        (262, (48.1, 11.5), False),
        (262, (11.5, 48.1), True),
        (310, (-74.0, 40.7), True),
        (310, (21.3, -157.8), False),
        (404, (77.2, 28.6), True),
        (655, (-26.2, 28.0), False),
        (724, (-46.6, -23.5), True),
        (547, (-17.5, -149.6), False),
        (214, (35.9, -5.3), False),
        (901, (11.5, 48.1), False),
        (250, (37.6, 55.7), False),  # fits as well
    ],
)
def test_positions_of_another_continent_are_said_to_be_swapped(
    tmp_path, capsys, mcc, place, is_swapped
):
    lat, lon = place
    rows = [f"{i},{lat + i / 1e4},{lon},GSM,{mcc},1,2,17,-70" for i in range(9)]
    head = "t_s,lat,lon,rat,mcc,mnc,lac,cid,level"
    (tmp_path / "a.csv").write_text("\n".join([head, *rows, ""]))
    assert main(["import", str(tmp_path / "a.csv"), "-o", str(tmp_path / "a.h5")]) == 0
    said = "the country codes of 9 readings are of another continent than the positions"
    assert (said in capsys.readouterr().err) == is_swapped
    codes = set(read_run(tmp_path / "a.h5").tables["notes"]["code"])
    assert (b"swapped" in codes) == is_swapped


def test_a_workbook_is_named_once(tmp_path, capsys):
    with zipfile.ZipFile(tmp_path / "a.xlsx", "w") as archive:
        for name in ("[Content_Types].xml", "xl/workbook.xml", "xl/worksheets/sheet1.xml"):
            archive.writestr(name, "<a/>")
    assert main(["import", str(tmp_path / "a.xlsx"), "-o", str(tmp_path / "run.h5")]) == 2
    output = capsys.readouterr().err
    assert "I read an Excel workbook (save its sheet as CSV)" in output
    assert output.count("\n") == 1


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_a_spreadsheet_writes_decimals_with_a_comma(tmp_path, delimiter):
    rows = ["t_s,lat,lon,rssi_dbm,cell", *(f"{k}.5,{52 + k / 1e4},13.4,-70.5,1" for k in range(9))]
    written = {}
    for name, text in (
        ("point", "\n".join(rows)),
        ("comma", "\n".join(row.replace(",", delimiter).replace(".", ",") for row in rows)),
    ):
        (tmp_path / f"{name}.csv").write_text(text)
        import_walk(tmp_path / f"{name}.csv", tmp_path / f"{name}.h5")
        tables = read_run(tmp_path / f"{name}.h5").tables
        written[name] = [
            (table[column].tolist())
            for table, column in (
                (tables["fixes"], "lat_deg"),
                (tables["readings"], "rssi_dbm"),
                (tables["scans"], "t_ns"),
            )
        ]
    assert written["comma"] == written["point"]


def test_an_import_is_in_time_order_and_counts_what_it_leaves_out(tmp_path, capsys):
    source = _write(tmp_path, WIGLE)
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5"), "--json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert (
        output["rows"],
        output["repeated_rows"],
        output["other_rows"],
        len(output["bad_rows"]),
    ) == (
        2,
        1,
        1,
        1,
    )
    run = read_run(tmp_path / "run.h5")
    values = [record.value for _, record in run.records("fixes", "scans")]
    assert [type(value) for value in values] == [Fix, Scan, Fix, Scan]
    assert [scan.readings[0].cell for scan in values[1::2]] == ["262-01-4711-18", "262-01-4711-17"]
    assert [scan.t_start_ns for scan in values[1::2]] == [0, 10**9]
    codes = [
        record.value.code for _, record in run.records("notes") if isinstance(record.value, Note)
    ]
    assert codes == ["sorted", "no-cells", "repeated", "bad-row"]


# --- times ---


def _drive(n, *, counted=False, held=1, seed=0):
    """A car at 12 m/s that is heard every four seconds; a new place every `held` rows, `counted`
    numbers the rows.
    """
    rng = np.random.default_rng(seed)
    lines = ["t_s,lat,lon,rssi_dbm"]
    for i in range(n):
        k = i - i % held
        north, east = 48.0 * min(k, n // 2), 48.0 * max(k - n // 2, 0)
        lat = 52.0 + (north + rng.normal(0.0, 2.0) * (held == 1)) / 111_200.0
        lon = 13.0 + (east + rng.normal(0.0, 2.0) * (held == 1)) / 68_500.0
        lines.append(f"{i if counted else 4 * i},{lat:.7f},{lon:.7f},{-70 - i % 9}")
    return lines


@pytest.mark.parametrize("held", [1, 4])
def test_true_times_are_taken_held_places_or_not(tmp_path, held):
    for n in (5, 80):
        source = _write(tmp_path, "\n".join(_drive(n, held=held)))
        imported = import_walk(source, tmp_path / "run.h5")
        assert (imported.n_rows, imported.has_times) == (n, True)


def _shuffle(lines):
    """The rows grouped by what they heard, as a table sorted by cell is, and counted."""
    head, *rows = lines
    rows.sort(key=lambda row: (row.split(",")[3], row))
    return [head, *(f"{i},{row.partition(',')[2]}" for i, row in enumerate(rows))]


BAD_TIMES = {  # only the first of them is refused
    "all at once": lambda: [
        line if i == 0 else f"7,{line.partition(',')[2]}" for i, line in enumerate(_drive(80))
    ],
    "ten rows a second": lambda: [
        line if i == 0 else f"{i / 10},{line.partition(',')[2]}"
        for i, line in enumerate(_drive(80))
    ],
    "sorted by level": lambda: _shuffle(_drive(80)),
}


def test_an_impossible_speed_is_asked_about(tmp_path, capsys):
    source = _write(tmp_path, "\n".join(BAD_TIMES["all at once"]()))
    target = str(tmp_path / "run.h5")
    assert main(["import", str(source), "-o", target]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "its times (t_s or time_utc) cannot be right" in line
    assert "--times none" in line
    assert not (tmp_path / "run.h5").exists()


@pytest.mark.parametrize("name", ["ten rows a second", "sorted by level"])
def test_seconds_that_count_the_rows_are_read_like_no_times(tmp_path, capsys, name):
    source = _write(tmp_path, "\n".join(BAD_TIMES[name]()))
    runs = [tmp_path / "counted.h5", tmp_path / "none.h5"]
    assert main(["import", str(source), "-o", str(runs[0]), "--json"]) == 0
    printed = capsys.readouterr()
    assert "they count the rows: imported as with --times none" in printed.err
    summary = json.loads(printed.out)
    assert (summary["times"], summary["no_clock"]) == (False, "they count the rows")
    import_walk(source, runs[1], times=False)
    counted, none = (observe_run(read_run(run)) for run in runs)
    assert counted.warnings == none.warnings
    (one,), (other,) = (observed.observations.cells for observed in (counted, none))
    np.testing.assert_array_equal(one.x_m, other.x_m)
    np.testing.assert_array_equal(one.position_sigma_m, other.position_sigma_m)
    notes = [record.value for _, record in read_run(runs[0]).records("notes")]
    assert any("they count the rows" in note.text for note in notes)


def _iso_table(lat_deg, *, pace_s=1, shown_s=1):
    """A table of ISO times, which show no less than `shown_s`."""
    times = [datetime.fromtimestamp(1.7e9 + pace_s * k // shown_s * shown_s, UTC)
             for k in range(len(lat_deg))]  # fmt: skip
    rows = [
        f"{time:%Y-%m-%dT%H:%M:%SZ},{lat:.7f},11.0,{-60 - k % 9}"
        for k, (time, lat) in enumerate(zip(times, lat_deg, strict=True))
    ]
    return "\n".join(["time,lat,lon,level", *rows])


def test_times_with_a_date_count_no_rows_whatever_one_fix_does(tmp_path):
    lat_deg = 48.0 + 1.2e-5 * np.arange(200)
    lat_deg[90] += 0.003
    found = import_walk(_write(tmp_path, _iso_table(lat_deg)), tmp_path / "run.h5")
    assert (found.has_times, found.no_clock) == (True, None)
    there_and_back = 48.0 + 20.0 * (np.arange(200) % 2)
    with pytest.raises(RunFileError, match="cannot be right"):
        import_walk(_write(tmp_path, _iso_table(there_and_back)), tmp_path / "far.h5")


def test_a_clock_that_shows_minutes_is_none(tmp_path):
    source = _write(tmp_path, _iso_table(48.0 + 1.2e-5 * np.arange(240), shown_s=60))
    found = import_walk(source, tmp_path / "run.h5")
    assert "rows have the time of another row of their cell" in found.no_clock
    (obs,) = observe_run(read_run(tmp_path / "run.h5")).observations.cells
    assert len(obs) == 240


@pytest.mark.parametrize("name", BAD_TIMES)
def test_without_times_no_place_moves_and_each_keeps_its_sigma(tmp_path, capsys, name):
    source = _write(tmp_path, "\n".join(BAD_TIMES[name]()))
    assert (
        main(["import", str(source), "-o", str(tmp_path / "run.h5"), "--times", "none", "--json"])
        == 0
    )
    assert json.loads(capsys.readouterr().out)["times"] is False
    run = read_run(tmp_path / "run.h5")
    observed = observe_run(run)
    (obs,) = observed.observations.cells
    assert len(obs) == 80
    rows = [line.split(",") for line in source.read_text().splitlines()[1:]]
    places = obs.utm.to_xy_arrays(*(np.array([float(row[i]) for row in rows]) for i in (1, 2)))
    np.testing.assert_allclose([obs.x_m, obs.y_m], places, atol=1e-6)
    np.testing.assert_array_equal(obs.position_sigma_m, UNKNOWN_SIGMA_M)
    assert "without times" in observed.warnings[0]
    info = describe(run)
    assert (info.started_utc, info.no_utc) == (None, "the log never reported UTC")
    (said,) = (event.in_short for event in info.events if event.code == "no-times")
    assert "seconds count the rows" in said
    assert ":" not in said  # of a line that begins with "import:"


@pytest.mark.parametrize("name", BAD_TIMES)
def test_an_import_of_an_earlier_version_is_not_moved_either(tmp_path, monkeypatch, name):
    """Such a run exists already: what was not asked then is said now."""
    monkeypatch.setattr("postproc.interop.importing._why_no_clock", lambda *_: None)
    source = _write(tmp_path, "\n".join(BAD_TIMES[name]()))
    import_walk(source, tmp_path / "run.h5")
    observed = observe_run(read_run(tmp_path / "run.h5"))
    (obs,) = observed.observations.cells
    assert any("the times cannot be right" in warning for warning in observed.warnings)
    track = observed.observations.track
    assert set(np.round(obs.x_m, 3)) <= set(np.round(track.x_m, 3))


def test_what_an_import_decided_of_dated_times_holds_for_the_run_and_its_copy(tmp_path):
    rows = [
        f"2026-05-01 12:{k // 60:02}:{k % 60:02},{52.5 + 1.2e-5 * k + 0.002 * (k > 60)},13.4,-80,5"
        for k in range(120)
    ]
    source = _write(tmp_path, "\n".join(["Timestamp,lat,lon,rsrp,cid", *rows]))
    assert import_walk(source, tmp_path / "run.h5").has_times
    share = ["share", str(tmp_path / "run.h5"), "--blur-m", "20", "-o", str(tmp_path / "copy.h5")]
    assert main(share) == 0
    for name in ("run.h5", "copy.h5"):
        observed = observe_run(read_run(tmp_path / name))
        assert not any("times cannot be right" in warning for warning in observed.warnings)


# --- the date ---


@pytest.mark.parametrize("year", [1975, 2007, 2017, 2019, 2025, 2041])
def test_a_walk_of_any_year_keeps_its_date(tmp_path, year):
    """The week counter of GPS, which began anew in 2019, is a matter of receivers and not of
    files.
    """
    run = tmp_path / "run.h5"
    import_walk(_write(tmp_path, WIGLE.replace("2025-06-21", f"{year}-06-21")), run)
    assert describe(read_run(run)).started_utc == f"{year}-06-21T00:25:37Z"
    assert clock_of([read_run(run)]).has_utc
    with h5py.File(run) as file:
        assert file.attrs["started_utc"] == f"{year}-06-21T00:25:37Z"
    assert main(["export", str(run), "-o", str(tmp_path / "back.csv"), "--format", "wigle"]) == 0
    assert f"{year}-06-21 00:25:37" in (tmp_path / "back.csv").read_text()


@pytest.mark.parametrize(
    ("rat", "column"),
    [("GSM", "rssi_dbm"), ("WCDMA", "rscp_dbm"), ("LTE", "rsrp_dbm"), ("NR", "rsrp_dbm")],
)
def test_the_strongest_level_of_any_technology(tmp_path, capsys, rat, column):
    text = "t_s,lat,lon,rssi_dbm,rscp_dbm,rsrp_dbm,rat,cell\n"
    cells = dict.fromkeys(("rssi_dbm", "rscp_dbm", "rsrp_dbm"), "")
    for i, level in enumerate((-93, -71, -88)):
        values = cells | {column: level}
        text += (
            f"{i},52,13,{values['rssi_dbm']},{values['rscp_dbm']},{values['rsrp_dbm']},{rat},x\n"
        )
    import_walk(_write(tmp_path, text), tmp_path / "run.h5")
    (cell,) = describe(read_run(tmp_path / "run.h5")).cells
    assert (cell.rat, cell.strongest_dbm) == (rat, -71.0)
    assert main(["info", str(tmp_path / "run.h5")]) == 0
    out = capsys.readouterr().out
    assert "strongest (dBm)\n" in out
    assert " -71\n" in out


DRIVE = "t_s,lat,lon,rat,mcc,mnc,lac_tac,cid,arfcn,pci_bsic,level_dbm,serving,ta\n"


@pytest.mark.parametrize(
    ("rat", "filler", "level"),
    [
        ("GSM", "-24", "-70"),
        ("GSM", "-46", "-47"),
        ("UMTS", "-24", "-25"),
        ("LTE", "-30", "-44"),
        ("LTE", "-200", "-140"),
        ("LTE", "0", "-90"),
        ("NR", "-30", "-31"),
    ],
)
def test_a_level_that_the_technology_cannot_report_is_none(tmp_path, capsys, rat, filler, level):
    rows = [
        f"{i},52,{13 + i * 1e-5},{rat},262,01,7,99,62,3,{filler if i == 4 else level},1,"
        for i in range(9)
    ]
    rows.append(f"9,52,13.0001,{rat},,,,,62,3,{filler},0,")
    source = _write(tmp_path, DRIVE + "\n".join(rows))
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["rows"], list(said["left_out_levels"].values())) == (9, [1])
    assert list(said["left_out"].values()) == [1]
    assert said["left_out"] == said["left_out_levels"]
    readings = read_run(tmp_path / "run.h5").tables["readings"]
    assert np.count_nonzero(np.isfinite(levels_dbm(readings))) == 8
    assert set(readings["cell"]) == {b"262-01-7-99"}


def test_nothing_but_fillers_is_no_walk(tmp_path, capsys):
    source = _write(tmp_path, DRIVE + "0,52,13,LTE,262,01,7,99,62,3,-30,1,\n")
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5")]) == 2
    assert "1 row: level outside of what LTE reports, -140 to -43 dBm" in capsys.readouterr().err


def test_a_cell_of_marks_is_no_cell(tmp_path, capsys):
    rows = [f"{i},52,{13 + i * 1e-5},GSM,262,01,0,0,62,,-70,1,\n" for i in range(9)]
    source = _write(tmp_path, DRIVE + "".join(rows))
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5")]) == 0
    assert "9 readings without a cell's name, so no cell can be located" in capsys.readouterr().err


def test_without_a_technology_every_level_counts(tmp_path, capsys):
    """Receivers of no telephone network go higher: one beside a drone reads 31 dBm."""
    rows = "".join(f"{i},52,{13 + i * 1e-5},{5 * i - 10}\n" for i in range(9))
    source = _write(tmp_path, "t_s,lat,lon,rssi_dbm\n" + rows)
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5")]) == 0
    assert capsys.readouterr().err == ""


ROOT = Path(__file__).parents[3]
SAMPLES = Path(os.environ.get("CELLWALK_FORMATS", ROOT.parent / "shared/corpus/formats"))


def _table():
    return (ROOT / "docs/guide/formats.md").read_text().partition("\n## ")[0]


def test_the_page_lists_every_format_and_no_other():
    names = re.findall(r"^\| ([^|]+?) +\|", _table(), re.MULTILINE)
    assert set(names) - {"format"} == {form.name for form in formats()}
    assert len(formats()) == len({form.name for form in formats()})


def test_the_page_says_where_no_real_file_was_tried():
    rows = [line for line in _table().splitlines() if line.startswith("| ")][1:]
    tried = [row for row in rows if "real rows" in row or "real captures" in row]
    assert tried
    assert all("no real file" in row for row in rows if row not in tried)


@pytest.mark.parametrize(
    "name",
    [
        "wigle_1.4_sample.csv",
        "wigle_1.6_sample.csv",
        "opencellid_measurements_app_export_sample.csv",
        "opencellid_measurements_app_export_sample2.csv",
        "opencellid_upload_sample.json",
        "opencellid_upload_towercollector_sample.csv",
    ],
)
def test_all_but_one_in_a_hundred_cells_of_a_real_sample_are_read(name):
    source = SAMPLES / name
    if not source.exists():
        pytest.skip("CELLWALK_FORMATS names no folder with it; it is somebody's track")
    rows = list(recognise(source).read(source))
    bad = [
        row for row in rows if isinstance(row, BadRow) and "stands for an unknown" not in row.why
    ]
    n_read = sum(isinstance(row, Sighting) for row in rows)
    assert n_read > 0
    assert len(bad) <= 0.01 * (n_read + len(bad)), bad[:3]


ONE_FILE = {
    "readers": """
from postproc.interop.sighting import Columns, level_in
from postproc.interop.contents import of_columns

IMPORTS = (
    of_columns(
        "Acme log", Columns(level_dbm=level_in("acme_dbm")), ("acme_dbm", "rat", "lat"), times=""
    ),
)
""",
    "writers": """
def write(walk, target):
    target.write_text(f"{len(walk.sightings)} levels")
""",
}
WITH_FILE = """
import sys
import zipfile
from importlib import import_module
import_module(f"postproc.interop.{sys.argv[1]}").__path__.append(sys.argv[2])
from postproc.cli import main
sys.exit(main(sys.argv[3:]))
"""


def _with_one_file(folder, room, *argv):
    (folder / room).mkdir()
    (folder / room / "acme.py").write_text(ONE_FILE[room])
    command = [sys.executable, "-c", WITH_FILE, room, str(folder / room), *map(str, argv)]
    return subprocess.run(command, capture_output=True, text=True, check=True)


def test_a_format_that_is_imported_is_one_file(tmp_path):
    rows = "".join(f"-{70 + i},LTE,52.{i},13.0,262,1,4711,17\n" for i in range(3))
    (tmp_path / "log.csv").write_text("acme_dbm,rat,lat,lon,mcc,mnc,lac,cid\n" + rows)
    argv = ("import", tmp_path / "log.csv", "-o", tmp_path / "run.h5", "--json")
    done = _with_one_file(tmp_path, "readers", *argv)
    assert json.loads(done.stdout)["format"] == "Acme log"
    assert json.loads(done.stdout)["rows"] == 3


def test_a_format_that_is_exported_is_one_file(tmp_path):
    write_run(tmp_path / "run.journal", seconds=20, cells=1)
    argv = ("export", tmp_path / "run.journal", "-o", tmp_path / "x.acme")
    assert "(acme)" in _with_one_file(tmp_path, "writers", *argv).stdout
    assert (tmp_path / "x.acme").read_text() == "10 levels"
    command = [sys.executable, "-c", WITH_FILE, "writers", str(tmp_path / "writers")]
    done = subprocess.run(
        [*command, "export", "--help"], capture_output=True, text=True, check=True
    )
    assert "acme" in done.stdout


def test_a_file_of_no_known_format_is_answered_with_how_to_read_it(tmp_path):
    with sqlite3.connect(tmp_path / "log.db") as database:
        database.execute("CREATE TABLE session_info (id, mcc, mnc, lac, cid)")
    database.close()
    (tmp_path / "log.json").write_text('{"cell": 1, "rxlev": 20}')
    for name, how in (("log.db", "sqlite3 -csv -header"), ("log.json", "as a table (CSV")):
        with pytest.raises(RunFileError, match="--columns lat=") as refused:
            recognise(tmp_path / name)
        assert how in str(refused.value)


def test_one_reading_is_counted_as_one(tmp_path, capsys):
    source = _write(tmp_path, "t_s,lat,lon,rssi_dbm\n1,48.0,11.0,-70\n")
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5")]) == 0
    assert "run.h5: 1 reading, 0 bad rows (CSV)" in capsys.readouterr().out
    assert main(["export", str(tmp_path / "run.h5"), "-o", str(tmp_path / "a.csv")]) == 0
    assert "a.csv: 1 level, 1 fix (csv)" in capsys.readouterr().out
