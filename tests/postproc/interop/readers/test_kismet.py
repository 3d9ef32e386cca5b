import json
import sqlite3

import pytest

from logger.core.errors import RunFileError
from logger.core.types import CellReading, Fix
from postproc.interop.readers import kismet
from postproc.interop.sighting import BadRow, NoCell

LTE = {
    "rat": "LTE",
    "mcc": 262,
    "mnc": 1,
    "tac": 36103,
    "cell_id": 17357057,
    "pci": 236,
    "earfcn": 1300,
    "band": 3,
    "rsrp": -101,
    "rsrq": -12,
    "sinr": 7,
    "rssi": -70,
    "is_serving": True,
    "observation_type": "serving",
}
IMEI = "490154203237518"


def _log(path, *rows, version=10, lat=52.5, lon=13.5):
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE KISMET (kismet_version TEXT, db_version INT, db_module TEXT)")
    database.execute("INSERT INTO KISMET VALUES ('2026-10', ?, 'kismetlog')", (version,))
    database.execute(
        "CREATE TABLE data (ts_sec INT, ts_usec INT, "
        "phyname TEXT, devmac TEXT, lat REAL, lon REAL, "
        "alt REAL, speed REAL, heading REAL, datasource TEXT, type TEXT, json BLOB)"
    )
    for kind, found in rows:
        text = found if isinstance(found, str) else json.dumps(found)
        values = (1_790_028_000, 250_000, "Cellular", "", lat, lon, 34.0, 0, 0, "uuid", kind, text)
        database.execute(f"INSERT INTO data VALUES ({','.join('?' * len(values))})", values)
    database.commit()
    database.close()
    return path


def test_cells_of_both_sources(tmp_path):
    gsm = LTE | {
        "rat": "GSM",
        "tac": 4711,
        "cell_id": 17,
        "earfcn": 62,
        "rssi": -71,
        "is_serving": False,
    }
    neighbour = {"rat": "LTE", "pci": 5, "earfcn": 900, "rsrp": -110}
    log = _log(
        tmp_path / "a.kismet",
        ("Cellular", LTE),
        ("Cellular", gsm),
        ("CellModem", neighbour),
        ("RawAT", {"response": IMEI}),
    )
    lte, two, unnamed = kismet.read(log)
    at = 1_790_028_000_250_000_000
    assert lte.fix == Fix(True, utc_ns=at, lat_deg=52.5, lon_deg=13.5, alt_m=34.0)
    assert lte.reading == CellReading(
        "serving",
        "LTE",
        "262",
        "01",
        tac=36103,
        cid=17357057,
        arfcn=1300,
        band=3,
        pci=236,
        rsrp_dbm=-101.0,
        rsrq_db=-12.0,
        sinr_db=7.0,
    )
    assert (two.reading.lac, two.reading.tac, two.reading.rssi_dbm, two.reading.role) == (
        4711,
        None,
        -71.0,
        "neighbour",
    )
    assert (unnamed.reading.cell, unnamed.reading.pci) == (None, 5)


def test_places_of_old_logs_are_integers(tmp_path):
    (row,) = kismet.read(
        _log(tmp_path / "a.kismet", ("Cellular", LTE), version=4, lat=5250000, lon=-1350000)
    )
    assert (row.lat_deg, row.lon_deg) == pytest.approx((52.5, -13.5))


def test_what_cannot_be_used_is_told(tmp_path):
    rows = list(
        kismet.read(
            _log(
                tmp_path / "a.kismet",
                ("Cellular", LTE | {"rsrp": 0}),
                ("Cellular", "{"),
                ("Cellular", "[]"),
                ("Cellular", LTE | {"rat": "CDMA"}),
                ("Cellular", LTE | {"mcc": "x"}),
            )
        )
    )
    assert [type(row) for row in rows] == [BadRow, BadRow, BadRow, NoCell, BadRow]
    (nowhere,) = kismet.read(_log(tmp_path / "b.kismet", ("Cellular", LTE), lat=0, lon=0))
    assert "no fix" in nowhere.why


def test_a_log_without_cells_says_what_is_missing(tmp_path):
    with pytest.raises(RunFileError, match="cellat"):
        list(kismet.read(_log(tmp_path / "a.kismet", ("rtl433", {"rat": "LTE"}))))
