"""Whatever stands in a foreign file, an import says so in words: no value may raise what the
command does not catch.
"""

import csv
import json
import sqlite3
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from logger.core.errors import FieldLoggerError
from postproc.interop.importing import import_walk

ROWS = {
    "csv": {
        "t_s": 1,
        "lat": 52,
        "lon": 13,
        "rssi_dbm": -70,
        "mcc": 262,
        "mnc": 1,
        "lac": 1,
        "cid": 2,
        "c1": -3,
    },
    "wigle": {
        "MAC": "26201_1_2",
        "AuthMode": "GSM;de",
        "FirstSeen": "2025-06-21 00:25:37",
        "Channel": 62,
        "RSSI": -70,
        "CurrentLatitude": 52,
        "CurrentLongitude": 13,
        "AltitudeMeters": 30,
        "AccuracyMeters": 5,
        "Type": "GSM",
    },
    "opencellid": {
        "mcc": 262,
        "mnc": 1,
        "lac": 1,
        "cellid": 2,
        "lat": 52,
        "lon": 13,
        "signal": -70,
        "measured_at": 1598796852000,
        "act": "GSM",
        "rating": 5,
        "ta": 1,
        "psc": 2,
        "tac": 3,
        "pci": 4,
    },
    "survey": {
        "deviceTime": "2024-05-01T10:00:00Z",
        "latitude": 52,
        "longitude": 13,
        "mcc": 262,
        "mnc": 1,
        "lac": 1,
        "ci": 2,
        "arfcn": 62,
        "bsic": 10,
        "signalStrength": -70,
        "ta": 1,
        "accuracy": 5,
        "servingCell": "true",
    },
    "gnettrack": {
        "Timestamp": "2024.05.01_12.00.07",
        "Longitude": 13,
        "Latitude": 52,
        "Speed": 3,
        "Operator": 26201,
        "CGI": "1-2-3-4",
        "Node": 12,
        "CellID": 3,
        "LAC": 4,
        "NetworkTech": "4G",
        "Level": -90,
        "Qual": -10,
        "SNR": 3,
        "ARFCN": 1300,
        "PSC": 5,
        "NRxLev1": -99,
        "NCell1": 7,
    },
    "cellmapper": {
        "latitude": 52,
        "longitude": 13,
        "altitude": 30,
        "MCC": 262,
        "MNC": 1,
        "LAC": 1,
        "CID": 2,
        "signal": -70,
        "type": "GSM",
        "subtype": "EDGE",
        "ARFCN": 62,
        "PSC": 7,
    },
    "named columns": {
        "Time": "12:00:07",
        "Longitude": 13,
        "Latitude": 52,
        "MCC": 262,
        "MNC": 1,
        "LAC": 1,
        "Cell ID": 2,
        "RxLev (dBm)": -70,
        "LTE RSRP": -90,
        "Serving cell": 1,
    },
}
VALUES = st.one_of(
    st.text(max_size=20),
    st.integers(-(2**70), 2**70).map(str),
    st.floats().map(str),
    st.sampled_from(
        [
            "\0",
            "1e400",
            "-0",
            "9" * 400,
            "0001-01-01",
            "9999-12-31T23:59:59-23:59",
            "NaN",
            "\ud800",
            "_1",
            "1_0",
        ]
    ),
)


def _import(source):
    with suppress(FieldLoggerError):
        import_walk(source, source.with_name("run.h5"))


@pytest.mark.parametrize("form", ROWS)
@given(data=st.data())
@settings(max_examples=10, deadline=None)
def test_values_of_csv(form, data):
    names = list(ROWS[form])
    changed = data.draw(st.dictionaries(st.sampled_from(names), VALUES, min_size=1, max_size=2))
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "source"
        with source.open("w", newline="", encoding="utf-8", errors="surrogatepass") as file:
            writer = csv.DictWriter(file, names)
            writer.writeheader()
            writer.writerows([ROWS[form], ROWS[form] | changed])
        _import(source)


@given(
    st.dictionaries(
        st.sampled_from(list(ROWS["opencellid"])),
        st.one_of(VALUES, st.integers(), st.none(), st.just([])),
        min_size=1,
    )
)
@settings(max_examples=12, deadline=None)
def test_values_of_json(changed):
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "source"
        source.write_text(json.dumps({"measurements": [ROWS["opencellid"] | changed]}))
        _import(source)


OBJECTS = {
    "rayhunter": {
        "packet_timestamp": "2024-05-01T10:00:00Z",
        "events": [{"event_type": "High", "message": "x"}],
    },
    "survey message": {
        "messageType": "GsmRecord",
        "data": {"deviceTime": "2024-05-01T10:00:00Z", "latitude": 52, "longitude": 13},
    },
}
JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), VALUES),
    lambda inner: (
        st.lists(inner, max_size=2)
        | st.dictionaries(st.sampled_from(["lat", "rx_lev", "bcch", "events", "$x"]), inner)
    ),
    max_leaves=6,
)


@pytest.mark.parametrize("form", OBJECTS)
@given(data=st.data())
@settings(max_examples=12, deadline=None)
def test_values_of_json_lines(form, data):
    changed = data.draw(st.dictionaries(st.sampled_from(list(OBJECTS[form])), JSON, min_size=1))
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "source"
        lines = [json.dumps(OBJECTS[form]), json.dumps(OBJECTS[form] | changed)]
        source.write_text("\n".join(lines))
        _import(source)


ANY = st.one_of(
    st.none(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(),
    st.text(max_size=8),
    st.binary(max_size=8),
)


@given(
    st.lists(ANY, min_size=6, max_size=6),
    st.dictionaries(
        st.sampled_from(["rat", "mcc", "cell_id", "rsrp", "tac", "band"]),
        ANY.filter(lambda v: not isinstance(v, bytes)),
    ),
)
@settings(max_examples=12, deadline=None)
def test_values_of_kismet(columns, changed):
    observation = {
        "rat": "LTE",
        "mcc": 262,
        "mnc": 1,
        "tac": 1,
        "cell_id": 2,
        "rsrp": -100,
    } | changed
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "source"
        database = sqlite3.connect(source)
        database.execute("CREATE TABLE KISMET (db_version INT)")
        database.execute("CREATE TABLE data (ts_sec, ts_usec, lat, lon, alt, type, json)")
        *where, version = columns
        database.execute("INSERT INTO KISMET VALUES (?)", (_storable(version),))
        values = [*map(_storable, where), "Cellular", json.dumps(observation)]
        database.execute("INSERT INTO data VALUES (?, ?, ?, ?, ?, ?, ?)", values)
        good = (1_790_028_000, 0, 52.5, 13.5, 30.0, "Cellular", json.dumps(observation))
        database.execute("INSERT INTO data VALUES (?, ?, ?, ?, ?, ?, ?)", good)
        database.commit()
        database.close()
        _import(source)


def _storable(value):
    return value.encode("utf-8", "replace") if isinstance(value, str) else value
