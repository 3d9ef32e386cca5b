import sqlite3
import struct

import pytest
import shapely

from logger.core.types import CellReading, Fix
from postproc.interop.readers import network_survey
from postproc.interop.sighting import BadRow

UTC_MS = 1_714_557_600_123
SERIAL = "R58M1234567"


def _csv(tmp_path, header, *rows):
    lines = ["# CSV Version=0.3.0", header, *rows]
    (tmp_path / "s.csv").write_text("\n".join(lines))
    return list(network_survey.read_csv(tmp_path / "s.csv"))


def test_gsm(tmp_path):
    (row,) = _csv(
        tmp_path,
        "deviceTime,latitude,longitude,altitude,speed,accuracy,missionId,recordNumber,"
        "groupNumber,mcc,mnc,lac,ci,arfcn,"
        "bsic,signalStrength,ta,servingCell,provider,slot,deviceSerialNumber,locationAge",
        "2024-05-01T12:00:00.123+02:00,52.5,13.5,34,1.2,5,NS,1,2,"
        f"262,1,4711,17,62,10,-71.0,2,true,Op,0,{SERIAL},",
    )
    assert row.fix == Fix(
        True,
        utc_ns=UTC_MS * 10**6,
        lat_deg=52.5,
        lon_deg=13.5,
        alt_m=34.0,
        acc_m=5.0,
        speed_mps=1.2,
    )
    assert row.reading == CellReading(
        "serving", "GSM", "262", "01", lac=4711, cid=17, arfcn=62, bsic=10, rssi_dbm=-71.0, ta=2
    )


def test_umts_lte_and_nr(tmp_path):
    head, place = (
        "deviceTime,latitude,longitude,mcc,mnc,servingCell,",
        "2024-05-01T10:00:00Z,52.5,13.5,262,01,false,",
    )
    (umts,) = _csv(
        tmp_path,
        head + "lac,cid,uarfcn,psc,rscp,ecno,signalStrength",
        place + "1,70000,10700,7,-91,-8,-79",
    )
    (weak,) = _csv(
        tmp_path,
        head + "lac,cid,uarfcn,psc,rscp,ecno,signalStrength",
        place + "1,70000,10700,7,,,-79",
    )
    (lte,) = _csv(
        tmp_path, head + "tac,eci,earfcn,pci,rsrp,rsrq,ta,snr", place + "3,4,1300,5,-99,-11,6,12"
    )
    (nr,) = _csv(
        tmp_path,
        head + "tac,nci,narfcn,pci,ssRsrp,ssRsrq,ssSinr",
        place + "3,9876543210,640000,5,-98,-12,9",
    )
    common = ("neighbour",)
    assert umts.reading == CellReading(
        *common,
        "WCDMA",
        "262",
        "01",
        lac=1,
        cid=70000,
        arfcn=10700,
        psc=7,
        rscp_dbm=-91.0,
        ecio_db=-8.0,
        rssi_dbm=-79.0,
    )
    assert weak.reading.level_dbm == -79.0
    assert lte.reading == CellReading(
        *common,
        "LTE",
        "262",
        "01",
        tac=3,
        cid=4,
        arfcn=1300,
        pci=5,
        rsrp_dbm=-99.0,
        rsrq_db=-11.0,
        sinr_db=12.0,
    )
    assert (nr.reading.cid, nr.reading.rsrp_dbm, nr.reading.sinr_db) == (9876543210, -98.0, 9.0)


def test_without_level_or_fix_it_is_a_bad_row(tmp_path):
    header = "deviceTime,latitude,longitude,mcc,mnc,lac,ci,arfcn,signalStrength"
    level, place, when = _csv(
        tmp_path,
        header,
        "2024-05-01T10:00:00Z,52.5,13.5,262,1,1,2,3,",
        "2024-05-01T10:00:00Z,0,0,262,1,1,2,3,-70",
        "soon,52.5,13.5,262,1,1,2,3,-70",
    )
    assert [type(row) for row in (level, place, when)] == [BadRow] * 3
    assert ("signalstrength" in level.why, "no fix" in place.why, "deviceTime" in when.why) == (
        True,
        True,
        True,
    )


def _geometry(point, order, envelope):
    head = (
        b"GP"
        + bytes([0, (1 if order == "<" else 0) | (envelope << 1)])
        + struct.pack(f"{order}i", 4326)
    )
    extent = b"\0" * (0, 32, 48, 48, 64)[envelope]
    return head + extent + shapely.to_wkb(point, byte_order=1 if order == "<" else 0, flavor="iso")


def _geopackage(path, geometry, rows=1):
    database = sqlite3.connect(path)
    database.execute(
        "CREATE TABLE GSM_MESSAGE (id INTEGER PRIMARY KEY, geom BLOB, deviceSerialNumber TEXT, "
        '"Time" INT, speed REAL, '
        'Accuracy MEDIUMINT, "Serving Cell" BOOLEAN, MCC SMALLINT, MNC SMALLINT, '
        "LAC MEDIUMINT, CID MEDIUMINT, "
        'ARFCN SMALLINT, BSIC SMALLINT, "Signal Strength" FLOAT, TA SMALLINT)'
    )
    database.execute(
        'CREATE TABLE LTE_MESSAGE (id INTEGER PRIMARY KEY, geom BLOB, "Time" INT, '
        "MCC SMALLINT, MNC SMALLINT, TAC MEDIUMINT, ECI MEDIUMINT, "
        "DL_EARFCN MEDIUMINT, Phys_Cell_ID SMALLINT, "
        "RSRP FLOAT, RSRQ FLOAT)"
    )
    for _ in range(rows):
        gsm = (geometry, SERIAL, UTC_MS, 1.2, 5, 1, 262, 1, 4711, 17, 62, 10, -71.0, None)
        database.execute(f"INSERT INTO GSM_MESSAGE VALUES (NULL{',?' * len(gsm)})", gsm)
    lte = (geometry, UTC_MS, 310, 410, 3, 4, 1300, 5, -99.0, -11.0)
    database.execute(f"INSERT INTO LTE_MESSAGE VALUES (NULL{',?' * len(lte)})", lte)
    database.commit()
    database.close()


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("envelope", [0, 1, 4])
@pytest.mark.parametrize("point", [shapely.Point(13.5, -52.5), shapely.Point(13.5, -52.5, 34.0)])
def test_geopackage(tmp_path, order, envelope, point):
    _geopackage(tmp_path / "s.gpkg", _geometry(point, order, envelope))
    gsm, lte = network_survey.read_geopackage(tmp_path / "s.gpkg")
    assert (gsm.lat_deg, gsm.lon_deg, gsm.fix.utc_ns, gsm.fix.acc_m) == (
        -52.5,
        13.5,
        UTC_MS * 10**6,
        5.0,
    )
    assert gsm.fix.alt_m == (34.0 if point.has_z else None)
    assert gsm.reading == CellReading(
        "serving", "GSM", "262", "01", lac=4711, cid=17, arfcn=62, bsic=10, rssi_dbm=-71.0
    )
    assert lte.reading == CellReading(
        "scan", "LTE", "310", "410", tac=3, cid=4, arfcn=1300, pci=5, rsrp_dbm=-99.0, rsrq_db=-11.0
    )


@pytest.mark.parametrize(
    "geometry", [b"GP", b"GP\0\1\0\0\0\0", b"nonsense", b"GP\0\xff" + b"\0" * 40, "text"]
)
def test_a_damaged_geometry_is_a_bad_row(tmp_path, geometry):
    _geopackage(tmp_path / "s.gpkg", geometry)
    assert [type(row) for row in network_survey.read_geopackage(tmp_path / "s.gpkg")] == [
        BadRow
    ] * 2
