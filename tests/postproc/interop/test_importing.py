import gzip
import json
import sqlite3

import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import read_run
from logger.core.types import Fix, Note, Scan
from postproc.cli import main
from postproc.interop.importing import import_walk, recognise

WIGLE = (
    "WigleWifi-1.4,appRelease=2\n"
    "MAC,SSID,AuthMode,FirstSeen,Channel,RSSI,CurrentLatitude,CurrentLongitude,AltitudeMeters,AccuracyMeters,Type\n"
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
        ("\ufeffmcc,mnc,lac,cell_id,dbm,lat,lon,measured_at,net_type\n", "OpenCelliD measurements, CSV"),
        ('\n {"measurements": []}', "OpenCelliD measurements, JSON"),
        ("# CSV Version=0.3.0\r\ndeviceTime,latitude,longitude,mcc,mnc,lac,ci,arfcn\r\n", "Network Survey CSV"),
    ],
)
def test_formats_are_told_by_their_content(tmp_path, text, name):
    assert recognise(_write(tmp_path, text)).name == name


def test_tables_tell_the_kind_of_sqlite(tmp_path):
    for name, table in (("a", "KISMET (db_version INT)"), ("b", "LTE_MESSAGE (id INT)"), ("c", "wifi (id INT)")):
        database = sqlite3.connect(tmp_path / name)
        database.execute(f"CREATE TABLE {table}")
        database.execute("CREATE TABLE data (json TEXT)")
        database.commit()
        database.close()
    assert recognise(tmp_path / "a").name == "Kismet log"
    assert recognise(tmp_path / "b").name == "Network Survey GeoPackage"
    with pytest.raises(RunFileError, match="it has data, wifi"):
        recognise(tmp_path / "c")
    with pytest.raises(RunFileError, match="no column ts_sec, ts_usec, lat, lon, type"):
        import_walk(tmp_path / "a", tmp_path / "run.h5")


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"radio,mcc,net,area,cell,unit,lon,lat\n", "celldb import"),
        (b"GSM,208,10,1,2,0,2.35,48.8,1000,1,1,1,1,0\n", "celldb import"),
        (gzip.compress(b"x"), "gunzip"),
        (b"SQLite format 3\0" + b"\xff" * 200, "damaged SQLite"),
        (b"\x89HDF\r\n\x1a\n", "needs no import"),
        (b"mcc,measured_at,lat\n", "no column mnc, lon, cell_id or cellid, act or net_type"),
        (b"", "no column t_s or time_utc"),
        (b"\0\xff\xfe" * 50, "no column"),
        (b'{"a": 1}', "measurements"),
        (b'{"measurements": [{"act": "LTE"}]}', "line 1: measured_at is empty"),
    ],
)
def test_what_is_missing_is_named_in_one_line(tmp_path, capsys, data, says):
    (tmp_path / "source").write_bytes(data)
    assert main(["import", str(tmp_path / "source"), "-o", str(tmp_path / "run.h5")]) == 2
    told = capsys.readouterr().err
    assert says in told
    assert told.count("\n") == 1
    assert not (tmp_path / "run.h5").exists()


def test_an_import_is_in_time_order_and_counts_what_it_leaves_out(tmp_path, capsys):
    source = _write(tmp_path, WIGLE)
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["rows"], told["repeated_rows"], told["other_rows"], len(told["bad_rows"])) == (2, 1, 1, 1)
    run = read_run(tmp_path / "run.h5")
    values = [record.value for _, record in run.records("fixes", "scans")]
    assert [type(value) for value in values] == [Fix, Scan, Fix, Scan]
    assert [scan.readings[0].cell for scan in values[1::2]] == ["262-01-4711-18", "262-01-4711-17"]
    assert [scan.t_start_ns for scan in values[1::2]] == [0, 10**9]
    codes = [record.value.code for _, record in run.records("notes") if isinstance(record.value, Note)]
    assert codes == ["sorted", "no-cells", "repeated", "bad-row"]
