import csv
from datetime import UTC, datetime
from pathlib import Path

import pytest

from logger.core.types import CellReading, Fix
from postproc.interop.readers import wigle
from postproc.interop.sighting import BadRow, NoCell, Sighting
from postproc.interop.writers import wigle as write_wigle
from tests.postproc.interop.walks import export_of

HEAD = {
    "1.4": "MAC,SSID,AuthMode,FirstSeen,Channel,RSSI,CurrentLatitude,CurrentLongitude,"
    "AltitudeMeters,AccuracyMeters,Type",
    "1.6": "MAC,SSID,AuthMode,FirstSeen,Channel,Frequency,RSSI,CurrentLatitude,CurrentLongitude,"
    "AltitudeMeters,AccuracyMeters,RCOIs,MfgrId,Type",
}
SAMPLES = Path(__file__).resolve().parents[5] / "shared" / "corpus" / "formats"


def _file(tmp_path, version, *rows, pre=True):
    lines = [f"WigleWifi-{version},appRelease=2,model=X,release=1"] if pre else []
    (tmp_path / "w.csv").write_text("\n".join([*lines, HEAD[version], *rows]))
    return list(wigle.read(tmp_path / "w.csv"))


def test_each_technology_gets_its_own_level_and_area(tmp_path):
    gsm, lte, wcdma, nr = _file(
        tmp_path,
        "1.6",
        "26201_4711_17,Op,EDGE;de,2025-06-21 00:25:37,62,62,-73,52,13,30,5,,,GSM",
        "310410_19467_182103574,Op,LTE;us,2025-06-21 00:25:37,66986,66986,-108,52,13,30,5,,,GSM",
        "26201_4711_70000,Op,UMTS;de,2025-06-21 00:25:37,10700,0,-90,52,13,30,5,,,WCDMA",
        "26201_4711_68719476734,Op,,2025-06-21 00:25:37,0,0,-90,52,13,30,5,,,NR",
    )
    at = int(datetime(2025, 6, 21, 0, 25, 37, tzinfo=UTC).timestamp()) * 10**9
    assert gsm.fix == Fix(True, utc_ns=at, lat_deg=52.0, lon_deg=13.0, alt_m=30.0, acc_m=5.0)
    assert gsm.reading == CellReading(
        "scan", "GSM", "262", "01", lac=4711, cid=17, arfcn=62, rssi_dbm=-73.0
    )
    # Type says GSM, AuthMode what it is
    assert lte.reading == CellReading(
        "scan", "LTE", "310", "410", tac=19467, cid=182103574, arfcn=66986, rsrp_dbm=-108.0
    )
    assert (wcdma.reading.rat, wcdma.reading.lac, wcdma.reading.rscp_dbm) == ("WCDMA", 4711, -90.0)
    assert (nr.reading.rat, nr.reading.cid, nr.reading.arfcn) == ("NR", 2**36 - 2, None)


@pytest.mark.parametrize("pre", [True, False])
def test_older_columns_and_a_missing_first_line(tmp_path, pre):
    (row,) = _file(
        tmp_path, "1.4", "26201_1_2,,GSM;de,2025-06-21 00:25:37,62,-73,52,13,30,0,GSM", pre=pre
    )
    assert (row.line, row.reading.cell, row.fix.acc_m) == (3 if pre else 2, "262-01-1-2", None)


def test_what_is_no_cell_and_what_is_no_level(tmp_path):
    rows = _file(
        tmp_path,
        "1.4",
        "aa:bb:cc:dd:ee:ff,home,[WPA2],2025-06-21 00:25:37,6,-60,52,13,30,5,WIFI",
        "aa:bb:cc:dd:ee:ff,phone,Misc,2025-06-21 00:25:37,6,-60,52,13,30,5,BLE",
        "310_1_2,Op,CDMA;us,2025-06-21 00:25:37,6,-60,52,13,30,5,CDMA",
        "26201_1_2,,GSM;de,2025-06-21 00:25:37,62,-113,52,13,30,5,GSM",
        "26201_1_2,,GSM;de,1970-01-01 00:00:00,62,-80,52,13,30,5,GSM",
        "26201_1_2,,GSM;de,2025-06-21 00:25:37,62,-80,0,0,0,0,GSM",
        "26201__2,,GSM;de,2025-06-21 00:25:37,62,-80,52,13,30,5,GSM",
    )
    assert [type(row) for row in rows] == [NoCell] * 3 + [BadRow] * 4
    whys = [row.why for row in rows[3:]]
    assert [
        key in why for key, why in zip(("-113", "FirstSeen", "no fix", "MAC"), whys, strict=True)
    ] == [True] * 4


def test_written_sightings_are_read_by_a_plain_reader_and_by_ours(tmp_path):
    fix = Fix(True, utc_ns=1_750_465_537 * 10**9, lat_deg=-33.5, lon_deg=179.25, acc_m=5.5)
    cells = [
        CellReading("serving", "GSM", "262", "01", lac=1, cid=2, arfcn=62, rssi_dbm=-73.0, ta=3),
        CellReading("scan", "LTE", "310", "030", tac=4, cid=5, rsrp_dbm=-101.0),
        CellReading("scan", "WCDMA", "262", "03", lac=6, cid=70000, rscp_dbm=-99.0),
    ]
    heard = [Sighting(0, fix.utc_ns, fix, cell) for cell in cells]
    assert all(map(write_wigle.writable, heard))
    write_wigle.write(export_of(heard), tmp_path / "w.csv")
    first, *rest = (tmp_path / "w.csv").read_text().splitlines()
    assert first.startswith("WigleWifi-1.6,")
    plain = list(csv.DictReader(rest))
    assert ",".join(plain[0]) == HEAD["1.6"]
    assert [(row["MAC"], row["Type"], row["RSSI"], row["AuthMode"]) for row in plain] == [
        ("26201_1_2", "GSM", "-73", "GSM;26201"),
        ("310030_4_5", "LTE", "-101", "LTE;310030"),
        ("26203_6_70000", "WCDMA", "-99", "WCDMA;26203"),
    ]
    assert {row["FirstSeen"] for row in plain} == {"2025-06-21 00:25:37"}
    back = list(wigle.read(tmp_path / "w.csv"))
    assert [row.fix for row in back] == [fix] * 3
    assert [row.reading.cell for row in back] == [cell.cell for cell in cells]
    assert [row.reading.level_dbm for row in back] == [cell.level_dbm for cell in cells]


def test_without_identity_or_utc_nothing_is_written():
    fix = Fix(True, utc_ns=10**18, lat_deg=1.0, lon_deg=2.0)
    unnamed = CellReading("neighbour", "GSM", arfcn=3, rssi_dbm=-80.0)
    named = CellReading("neighbour", "GSM", "262", "01", lac=1, cid=2, rssi_dbm=-80.0)
    assert not write_wigle.writable(Sighting(0, 0, fix, unnamed))
    assert not write_wigle.writable(Sighting(0, 0, Fix(True, lat_deg=1.0, lon_deg=2.0), named))


@pytest.mark.skipif(not SAMPLES.exists(), reason="the shared samples are not here")
@pytest.mark.parametrize("version", ["1.4", "1.6"])
def test_real_sightings(version):
    rows = list(wigle.read(SAMPLES / f"wigle_{version}_sample.csv"))
    cells = [row for row in rows if isinstance(row, Sighting)]
    assert {cell.reading.rat for cell in cells} == {"GSM", "LTE"}
    assert all(cell.reading.cell and cell.reading.level_dbm > -113 for cell in cells)
    assert all("-113" in row.why for row in rows if isinstance(row, BadRow))


def test_every_row_is_read_or_counted_whatever_the_names_of_networks_are(tmp_path):
    """The app writes names as they are; one quotation mark takes no other row in."""
    rows = [
        'aa:bb:cc:dd:ee:f0,"guest,[WPA2][ESS],2025-06-21 00:25:37,6,-60,52,13,30,5,WIFI',
        "26201_4711_17,,GSM;de,2025-06-21 00:25:38,62,-73,52,13,30,5,GSM",
        'aa:bb:cc:dd:ee:f1,"pub"lic",[WPA2][ESS],2025-06-21 00:25:39,6,-60,52,13,30,5,WIFI',
        '26201_4711_18,"Op,GSM;de,2025-06-21 00:25:40,62,-73,52,13,30,5,GSM',
        '26201_4711_19,"Op, Ltd.",GSM;de,2025-06-21 00:25:41,62,-73,52,13,30,5,GSM',
        'aa:bb:cc:dd:ee:f2,a"b,Misc [LE],2025-06-21 00:25:42,6,-60,52,13,30,5,BLE',
        ",,,,,,,,,,",
    ]
    read = _file(tmp_path, "1.4", *rows)
    assert [type(row) for row in read] == [
        NoCell, Sighting, NoCell, Sighting, Sighting, NoCell,
    ]  # fmt: skip
    assert [row.line for row in read] == [3, 4, 5, 6, 7, 8]
    assert [row.why for row in read if isinstance(row, NoCell)] == [
        "no cell but WIFI",
        "no cell but WIFI",
        "no cell but BLE",
    ]
