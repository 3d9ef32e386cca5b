import csv
import json
from pathlib import Path

import pytest

from logger.core.errors import RunFileError
from logger.core.types import CellReading, Fix
from postproc.interop.importing import recognise
from postproc.interop.readers import tables
from postproc.interop.sighting import BadRow, NoCell, Sighting
from postproc.interop.writers import opencellid_csv, opencellid_json
from tests.postproc.interop.walks import export_of

OPENCELLID_CSV, OPENCELLID_JSON = (
    next(form for form in tables.IMPORTS if form.name == f"OpenCelliD measurements, {kind}")
    for kind in ("CSV", "JSON")
)
SAMPLES = Path(__file__).resolve().parents[5] / "shared" / "corpus" / "formats"
COLUMNS = (
    "mcc",
    "mnc",
    "lac",
    "cellid",
    "lat",
    "lon",
    "signal",
    "measured_at",
    "rating",
    "speed",
    "direction",
    "act",
    "ta",
    "psc",
    "tac",
    "pci",
    "sid",
    "nid",
    "bid",
)
AT_MS = 1_598_796_852_123


def _read(tmp_path, *rows, **changes):
    plain = {
        "mcc": 262,
        "mnc": 1,
        "lac": 4711,
        "cellid": 17,
        "lat": 52,
        "lon": 13,
        "measured_at": AT_MS,
        "act": "GSM",
    }
    with (tmp_path / "m.csv").open("w", newline="") as file:
        writer = csv.DictWriter(
            file, list(dict.fromkeys([*COLUMNS, *(n for row in rows for n in row)]))
        )
        writer.writeheader()
        writer.writerows(plain | changes | row for row in rows)
    return list(OPENCELLID_CSV.read(tmp_path / "m.csv"))


@pytest.mark.parametrize(
    ("act", "signal", "name", "level_dbm"),
    [
        ("GSM", -73, "rssi_dbm", -73),
        ("EDGE", 20, "rssi_dbm", -73),
        ("GPRS", 0, "rssi_dbm", -113),
        ("LTE", 54, "rsrp_dbm", -86),
        ("LTE+", -97, "rsrp_dbm", -97),
        ("NR", 40, "rsrp_dbm", -100),
        ("UMTS", -88, "rscp_dbm", -88),
        ("HSPA+", -88, "rscp_dbm", -88),
    ],
)
def test_dbm_and_asu(tmp_path, act, signal, name, level_dbm):
    (row,) = _read(tmp_path, {"act": act, "signal": signal})
    assert getattr(row.reading, name) == level_dbm == row.reading.level_dbm


@pytest.mark.parametrize(
    ("act", "signal"), [("GSM", 99), ("LTE", 255), ("UMTS", 20), ("GSM", ""), ("GSM", 2147483647)]
)
def test_a_level_that_is_not_known(tmp_path, act, signal):
    (row,) = _read(tmp_path, {"act": act, "signal": signal})
    assert isinstance(row, BadRow)


def test_unknown_marks_and_codes(tmp_path):
    mark = 2147483647
    gsm, lte, unnamed = _read(
        tmp_path,
        {"signal": -70, "ta": 3, "pci": mark, "tac": mark, "psc": ""},
        {
            "signal": -90,
            "act": "LTE",
            "lac": 9,
            "tac": mark,
            "pci": 269,
            "ta": 5,
            "mnc": "030",
            "mcc": 310,
        },
        {"signal": -90, "act": "LTE", "cellid": mark, "lac": mark, "tac": mark, "pci": 269},
    )
    assert gsm.reading == CellReading(
        "scan", "GSM", "262", "01", lac=4711, cid=17, rssi_dbm=-70.0, ta=3
    )
    assert lte.reading == CellReading(
        "scan", "LTE", "310", "030", tac=9, cid=17, pci=269, rsrp_dbm=-90.0
    )
    assert unnamed.reading == CellReading("scan", "LTE", "262", "01", pci=269, rsrp_dbm=-90.0)


@pytest.mark.parametrize(
    ("mcc", "mnc", "code"),
    [
        (310, 26, "026"),  # a number has lost its zero
        (310, "26", "026"),
        (310, 410, "410"),
        (262, 1, "01"),
        (262, "026", "026"),  # is another network than 26 on the air
        (405, 26, "26"),  # both lengths are in use
    ],
)
def test_a_network_code_has_at_least_the_digits_of_its_country(tmp_path, mcc, mnc, code):
    (row,) = _read(tmp_path, {"signal": -70, "mcc": mcc, "mnc": mnc})
    assert (row.reading.mcc, row.reading.mnc) == (str(mcc), code)


def test_times_and_order_of_columns(tmp_path):
    text = (
        "lon,lat,mcc,mnc,lac,cellid,signal,measured_at,act\n"
        f"13,52,262,1,1,2,-70,{AT_MS},GSM\n"
        '13,52,262,1,1,2,-70,"2020-08-30 14:14:12.123Z",GSM\n'
        f"13,52,262,1,1,2,-70,{AT_MS // 1000},GSM\n"
        "13,52,262,1,1,2,-70,,GSM\n"
        "13,52,262,1,1,2,-70,0,GSM\n"
        "13,52,262,1,1,2,-70,1598796852123,EVDO_A\n"
    )
    (tmp_path / "m.csv").write_text(text)
    rows = list(OPENCELLID_CSV.read(tmp_path / "m.csv"))
    assert [row.fix.utc_ns for row in rows[:3]] == [
        AT_MS * 10**6,
        AT_MS * 10**6,
        AT_MS // 1000 * 10**9,
    ]
    assert {(row.lat_deg, row.lon_deg) for row in rows[:3]} == {(52.0, 13.0)}
    assert [type(row) for row in rows[3:]] == [BadRow, BadRow, NoCell]


def test_tower_collectors_own_export(tmp_path):
    text = (
        "mcc,mnc,lac,cell_id,short_cell_id,rnc,psc,asu,"
        "dbm,ta,lat,lon,accuracy,speed,bearing,altitude,measured_at,"
        "net_type,neighboring,discovered_at,device,arfcn\n"
        '262,1,4711,17,,,,20,-73,2,52.5,13.5,4.5,1.25,90,34,"2024-05-01T10:00:00Z",'
        "GSM,false,,phone,62\n"
        '262,1,4711,18,,,,31,,2,52.5,13.5,4.5,1.25,90,34,"2024-05-01T10:00:00Z",'
        "GSM,true,,phone,62\n"
    )
    (tmp_path / "m.csv").write_text(text)
    serving, neighbour = OPENCELLID_CSV.read(tmp_path / "m.csv")
    assert serving.reading == CellReading(
        "serving", "GSM", "262", "01", lac=4711, cid=17, arfcn=62, rssi_dbm=-73.0, ta=2
    )
    assert (neighbour.reading.role, neighbour.reading.rssi_dbm) == ("neighbour", -51.0)
    fix = serving.fix
    assert (fix.acc_m, fix.speed_mps, fix.course_deg, fix.alt_m) == (4.5, 1.25, 90.0, 34.0)


@pytest.mark.parametrize("form", ["csv", "json"])
def test_written_measurements_are_read_by_a_plain_reader_and_by_ours(tmp_path, form):
    fix = Fix(
        True,
        utc_ns=AT_MS * 10**6,
        lat_deg=-1.5,
        lon_deg=2.25,
        acc_m=3.5,
        speed_mps=1.5,
        course_deg=10.0,
    )
    cells = [
        CellReading("scan", "GSM", "262", "01", lac=1, cid=2, rssi_dbm=-73.0, ta=3),
        CellReading("scan", "LTE", "310", "410", tac=4, cid=5, pci=6, rsrp_dbm=-101.0),
        CellReading("scan", "WCDMA", "262", "03", lac=6, cid=70000, psc=9, rscp_dbm=-99.0),
    ]
    heard = [Sighting(0, fix.utc_ns, fix, cell) for cell in cells]
    path = tmp_path / f"m.{form}"
    if form == "csv":
        opencellid_csv.write(export_of(heard), path)
        back = list(OPENCELLID_CSV.read(path))
        with path.open(newline="") as file:
            plain = list(csv.DictReader(file))
        assert tuple(plain[0]) == COLUMNS
    else:
        opencellid_json.write(export_of(heard), path)
        back = list(OPENCELLID_JSON.read(path))
        plain = json.loads(path.read_text())["measurements"]
        assert all(isinstance(row["mcc"], int) and isinstance(row["mnc"], int) for row in plain)
    names = ("mcc", "mnc", "lac", "cellid", "signal")
    assert [(*(int(row[name]) for name in names), row["act"]) for row in plain] == [
        (262, 1, 1, 2, -73, "GSM"),
        (310, 410, 4, 5, -101, "LTE"),
        (262, 3, 6, 70000, -99, "UMTS"),
    ]
    assert {int(row["measured_at"]) for row in plain} == {AT_MS}
    assert [row.fix for row in back] == [fix] * 3
    assert [row.reading for row in back] == cells


def test_other_json_is_named(tmp_path):
    for text in ("{}", "[]", "{", '{"measurements": 3}'):
        (tmp_path / "m.json").write_text(text)
        with pytest.raises(RunFileError, match="JSON"):
            list(OPENCELLID_JSON.read(tmp_path / "m.json"))


@pytest.mark.skipif(not SAMPLES.exists(), reason="the shared samples are not here")
def test_real_measurements_say_the_same_in_both_ways_to_write_them():
    app = list(OPENCELLID_CSV.read(SAMPLES / "opencellid_measurements_app_export_sample.csv"))
    collector = list(OPENCELLID_CSV.read(SAMPLES / "opencellid_upload_towercollector_sample.csv"))
    assert not any(isinstance(row, BadRow) for row in (*app, *collector))
    by_time = {row.t_ns: row for row in app}
    assert collector
    for row in collector:  # one wrote dBm, the other the ASU of the same measurement
        assert row.reading.rsrp_dbm == by_time[row.t_ns].reading.rsrp_dbm
        assert row.reading.cell == by_time[row.t_ns].reading.cell


def test_a_time_of_twelve_digits_is_none(tmp_path):
    """It is 14 May 2024 without the century; as milliseconds it would be of 1977."""
    (tmp_path / "a.csv").write_text(
        "lon,lat,mcc,mnc,lac,cellid,signal,measured_at,act\n11,48,262,1,5,7,-80,240514090000,GSM\n"
    )
    (row,) = recognise(tmp_path / "a.csv").read(tmp_path / "a.csv")
    assert "measured_at is no ISO 8601 time: '240514090000'" in row.why
