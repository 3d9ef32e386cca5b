import sqlite3

from logger.core.types import CellReading, Fix
from postproc.interop.formats import recognise
from postproc.interop.sighting import BadRow, NoCell

IMSI = "262011234567890"


def _database(path):
    with sqlite3.connect(path) as database:
        database.execute(
            "CREATE TABLE session_info (id INTEGER PRIMARY KEY, timestamp, rat, mcc, mnc, lac, cid,"
            " arfcn, psc, avg_power, imsi)"
        )
        database.execute(
            "CREATE TABLE location_info (_id INTEGER PRIMARY KEY, timestamp, accuracy, latitude, "
            "longitude, altitude, provider_name)"
        )
        database.execute(
            "CREATE TABLE serving_cell_info "
            "(_id INTEGER PRIMARY KEY, timestamp, mcc, mnc, lac, cid)"
        )
        database.execute(
            "INSERT INTO serving_cell_info VALUES (1, '2024-05-01 10:00:00', 262, 1, 4711, 17)"
        )
        for second, lat in ((0, 52.5), (20, 52.6)):
            database.execute(
                "INSERT INTO location_info VALUES (NULL, ?, 8.0, ?, 13.5, 34.0, 'gps')",
                (f"2024-05-01 10:00:{second:02d}", lat),
            )
        sessions = [
            ("2024-05-01 10:00:15", 0, 262, 1, 4711, 17, 62, None, -71, IMSI),
            ("2024-05-01 10:00:15", 2, 262, 1, 70, 256259, 1300, None, None, IMSI),
            ("2024-05-01 10:09:00", 0, 262, 1, 4711, 17, 62, None, -71, IMSI),
        ]
        for session in sessions:
            database.execute("INSERT INTO session_info VALUES (NULL,?,?,?,?,?,?,?,?,?,?)", session)


def test_transactions_get_the_nearest_position(tmp_path):
    _database(tmp_path / "msd.db")
    form = recognise(tmp_path / "msd.db")
    measured, no_level, far, serving = form.read(tmp_path / "msd.db")
    assert form.name == "SnoopSnitch database"
    assert measured.t_ns == 1_714_557_615 * 10**9
    assert measured.fix == Fix(True, 1_714_557_620 * 10**9, 52.6, 13.5, alt_m=34.0, acc_m=8.0)
    assert measured.reading == CellReading(
        "serving", "GSM", "262", "01", lac=4711, cid=17, arfcn=62, rssi_dbm=-71.0
    )
    assert no_level == NoCell(2, "no level in session_info")
    assert far == BadRow(3, "no position within 30 s of it")
    assert serving == NoCell(1, "no level in serving_cell_info")
