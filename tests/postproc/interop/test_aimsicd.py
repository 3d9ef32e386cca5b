import sqlite3

from logger.core.types import CellReading, Fix
from postproc.interop.formats import recognise
from postproc.interop.sighting import BadRow, NoCell

UTC_MS = 1_714_557_600_123


def _database(path):
    with sqlite3.connect(path) as database:
        database.execute(
            "CREATE TABLE DBi_bts (_id INTEGER PRIMARY KEY, MCC INT, MNC INT, LAC INT, CID INT, "
            "PSC INT, gps_lat REAL, gps_lon REAL)"
        )
        database.execute(
            "CREATE TABLE DBi_measure (_id INTEGER PRIMARY KEY, bts_id INT, time TEXT, "
            "gpsd_lat REAL, gpsd_lon REAL, gpsd_accu INT, rx_signal TEXT, RAT TEXT, BCCH TEXT, "
            "TMSI TEXT, TA INT, isNeighbour INT)"
        )
        database.execute("INSERT INTO DBi_bts VALUES (4, 262, 1, 4711, 17, NULL, 0, 0)")
        rows = [
            (4, str(UTC_MS), 52.5, 13.5, 12, "-71", "EDGE", "62", "AB12CD34", 2, 0),
            (4, str(UTC_MS), 52.5, 13.5, 12, "21", "16", "", "", 2, 1),
            (4, str(UTC_MS), 52.5, 13.5, 12, "99", "GSM", "", "", None, 0),
            (4, str(UTC_MS), 52.5, 13.5, 12, "-80", "CDMA", "", "", None, 0),
            (9, str(UTC_MS), 52.5, 13.5, 12, "-80", "LTE", "", "", None, 0),
        ]
        for row in rows:
            database.execute(f"INSERT INTO DBi_measure VALUES (NULL{',?' * len(row)})", row)


def test_the_database(tmp_path):
    _database(tmp_path / "aimsicd.db")
    form = recognise(tmp_path / "aimsicd.db")
    by_name, by_number, unknown, cdma, orphan = form.read(tmp_path / "aimsicd.db")
    assert form.name == "AIMSICD database"
    assert by_name.fix == Fix(True, UTC_MS * 10**6, 52.5, 13.5, acc_m=12.0)
    assert by_name.reading == CellReading(
        "serving", "GSM", "262", "01", lac=4711, cid=17, arfcn=62, rssi_dbm=-71.0, ta=2
    )
    assert (by_number.reading.role, by_number.rssi_dbm) == ("neighbour", -71.0)
    assert [type(unknown), type(cdma)] == [BadRow, NoCell]
    assert (orphan.reading.cell, orphan.reading.rsrp_dbm) == (None, -80.0)


def test_the_csv_names_cells_by_their_rows(tmp_path):
    (tmp_path / "m.csv").write_text(
        '"_id","bts_id","nc_list","time","gpsd_lat","gpsd_lon","gpsd_accu","rx_signal","RAT"\n'
        f'"1","4","","{UTC_MS}","52.5","13.5","12","-71","GSM"\n'
    )
    form = recognise(tmp_path / "m.csv")
    (row,) = form.read(tmp_path / "m.csv")
    assert (form.name, row.reading.cell, row.rssi_dbm) == ("AIMSICD CSV", "bts 4", -71.0)
