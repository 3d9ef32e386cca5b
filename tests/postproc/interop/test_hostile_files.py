"""Files made to hurt: each ends in a sentence, in little memory and time."""

import gzip
import json
import sqlite3
import zipfile
from io import BytesIO

import pytest

from logger.core.runfile import read_run
from postproc import progress
from postproc.cli import main
from tests.kit.own_memory import run_alone

HEADER = "t_s,lat,lon,rssi_dbm\n"
LOG = HEADER + "0,52,13,-70\n1,52,13,-71\n"
MORE_MB = 250


def import_quietly(arguments):
    """The command, without lines about how far it is: the machine may be busy."""
    progress._SILENCE_S = 3600.0
    return main(arguments)


GPX = '<gpx creator="Tower Collector">'
POINT = (
    '<trkpt lat="52" lon="13"><time>2024-01-01T00:00:01Z</time><name>(MCC 262, MNC 1, LAC 1, '
    "CID 2, Signal strength -70 dBm, Network GSM)</name></trkpt>"
)
MEASUREMENT = {"mcc": 262, "mnc": 1, "lac": 1, "cellid": 2, "lat": 52, "lon": 13, "signal": -70}
MEASUREMENT |= {"measured_at": 1598796852000, "act": "GSM"}
ENTITIES = '<!DOCTYPE x [<!ENTITY a "xxxx">' + "".join(
    f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(9)
)


def _json(*objects):
    return b'{"measurements": [' + b",".join(objects) + b"]}"


def _pack(data):
    return gzip.compress(data, 1)


def _zip(*entries, packing=zipfile.ZIP_DEFLATED):
    file = BytesIO()
    with zipfile.ZipFile(file, "w", packing) as archive:
        for name, data in entries:
            archive.writestr(name, data)
    return file.getvalue()


def _overlapping():
    """400 names of the same bytes, 120 MB each."""
    data = _zip(("a.csv", b"0,52,13,-70\n" * 10_000_000))
    table, end = data.rfind(b"PK\1\2"), data.rfind(b"PK\5\6")
    entries = b"".join(data[table:end].replace(b"a.csv", b"%05d" % i) for i in range(400))
    counts = (400).to_bytes(2, "little") * 2 + len(entries).to_bytes(4, "little")
    return data[:table] + entries + data[end : end + 8] + counts + data[end + 16 :]


def _encrypt():
    data = bytearray(_zip(("a.csv", LOG)))
    data[6] |= 1
    data[data.rfind(b"PK\1\2") + 8] |= 1
    return bytes(data)


REFUSED = {
    "a line without an end": lambda: _pack(HEADER.encode() + b"x" * (50 << 20)),
    "a row of quoted lines": lambda: HEADER.encode() + b'"\n",' * 1_000_000,
    "columns": lambda: ",".join(map(str, range(100_000))).encode() + b"," + LOG.encode(),
    "a line of UTF-16 without an end": lambda: _pack((HEADER + "x" * (20 << 20)).encode("utf-16")),
    "UTF-16 of bytes that are none": lambda: b"\xff\xfe" + b"\x00\xd8" * 5_000_000,
    "UTF-32": lambda: LOG.encode("utf-32"),
    "an attribute": lambda: f'{GPX}<trkpt lat="'.encode() + b"1" * (10 << 20),
    "a text": lambda: f"{GPX}<trkpt><name>".encode() + b"1" * (10 << 20),
    "a comment": lambda: f"{GPX}<!-- ".encode() + b"1" * (10 << 20),
    "elements of one": lambda: f"{GPX}<trkpt>".encode() + b"<a/>" * 2_000_000,
    "depth of XML": lambda: GPX.encode() + b"<a>" * 100_000,
    "depth of a point": lambda: f"{GPX}<trkpt>".encode() + b"<a>" * 100_000,
    "entities": f"{ENTITIES}]>{GPX}&j;</gpx>".encode,
    "entities after the head": lambda: (
        f"<!-- <gpx Tower Collector {' ' * 70_000}-->".encode() + REFUSED["entities"]()
    ),
    "UTF-7 declared": f'<?xml version="1.0" encoding="UTF-7"?>{GPX}{POINT}</gpx>'.encode,
    "hex declared": f'<?xml version="1.0" encoding="hex"?>{GPX}{POINT}</gpx>'.encode,
    "no encoding": f'<?xml version="1.0" encoding="x-no"?>{GPX}{POINT}</gpx>'.encode,
    "depth of JSON": lambda: b'{"measurements": ' + b"[" * 100_000,
    "depth in a list": lambda: _json(b'{"a":' + b"[" * 100_000 + b"]" * 100_000 + b"}"),
    "a JSON text": lambda: _json(b'{"a":"' + b"x" * (20 << 20) + b'"}'),
    "a JSON object": lambda: _json(b'{"a":[' + b"[]," * 5_000_000 + b"[]]}"),
    "a JSON line": lambda: b'{"analyzers": [], "x": "' + b"x" * (20 << 20),
    "brackets": lambda: b'[{"analyzers":1},' + b"[" * 5_000_000,
    "a JSON number": lambda: b'[{"analyzers":1},' + b"1" * 5_000_000,
    "gzip": lambda: _pack(b"0" * (300 << 20)),
    "bzip2": lambda: _zip(("a.csv", b"0" * (300 << 20)), packing=zipfile.ZIP_BZIP2),
    "overlapping": _overlapping,
    "table of contents": lambda: _zip(*((f"{i}.csv", "") for i in range(30_000))),
    "two of one name": lambda: _zip(("a.csv", LOG), ("b.csv", LOG)).replace(b"b.csv", b"a.csv"),
    "no name": lambda: _zip(("a.csv", LOG)).replace(b"a.csv", b"\0.csv"),
    "a zip in a zip": lambda: _zip(("a.zip", _zip(("a.csv", LOG)))),
    "encrypted": _encrypt,
    "cut": lambda: _zip(("a.csv", LOG))[:-30],
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_that_is_refused(tmp_path, name):
    (tmp_path / "x").write_bytes(REFUSED[name]())
    code, more_mb, error = _import(tmp_path)
    assert code == 2, error
    assert error.splitlines()[-1].startswith(f"postproc: {tmp_path}/x")
    assert more_mb < MORE_MB, f"{more_mb} MB"
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def _import(folder):
    """Exit code, memory in MB beyond that of the program, and what it says but of single rows."""
    folder_of_copies = folder.parent / f"{folder.name}-copies"
    folder_of_copies.mkdir()
    done = run_alone(
        f"{__name__}:import_quietly",
        *("import", folder / "x", "-o", folder / "run.h5"),
        imports=("postproc.interop.importing",),
        environment={"TMPDIR": str(folder_of_copies)},
    )
    assert "Traceback" not in done.err, done.err[-2000:]
    assert not list(folder_of_copies.iterdir())
    return done.code, done.more_mb, done.err


def _write_kismet(path, *texts):
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE KISMET (db_version INT)")
        database.execute("CREATE TABLE data (ts_sec, ts_usec, lat, lon, alt, type, json)")
        rows = [(1_790_028_000, i, 52, 13, 30, "Cellular", text) for i, text in enumerate(texts)]
        database.executemany("INSERT INTO data VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
    database.close()


CELL = '{"rat": "LTE", "mcc": 262, "mnc": 1, "tac": 1, "cell_id": 2, "rsrp": -100}'
DEEP = "[" * 900 + "]" * 900


@pytest.mark.parametrize("text", ["[" * 100_000, CELL.replace('"LTE"', DEEP), "9" * 5000])
def test_a_deep_value_of_kismet_is_a_bad_row(tmp_path, text):
    _write_kismet(tmp_path / "x", CELL, text, CELL)
    code, more_mb, _ = _import(tmp_path)
    assert (code, more_mb < MORE_MB) == (0, True)


def test_a_blob_of_kismet_is_refused(tmp_path):
    _write_kismet(tmp_path / "x", '{"rat":[' + "[]," * 1_600_000 + "[]]}")
    code, more_mb, error = _import(tmp_path)
    assert (code, more_mb < MORE_MB) == (2, True)
    assert "too big" in error


def test_a_deep_value_of_json_is_a_bad_row(tmp_path):
    good = json.dumps(MEASUREMENT).encode()
    (tmp_path / "x").write_bytes(_json(good, good.replace(b'"GSM"', DEEP.encode()), good))
    assert _import(tmp_path)[0] == 0


def test_a_quotation_mark_takes_no_other_row_in(tmp_path):
    rows = b"".join(b"\n%d,52,13,-70" % i for i in range(1, 50_000))
    (tmp_path / "x").write_bytes(HEADER.encode() + b'0,52,13,"' + rows)
    code, more_mb, error = _import(tmp_path)
    assert (code, more_mb < MORE_MB) == (0, True)
    assert error.splitlines() == [f"{tmp_path}/x: line 2: rssi_dbm is no number: '\"'"]
    assert len(read_run(tmp_path / "run.h5").tables["readings"]) == 49_999


def test_what_stands_between_the_points_is_not_kept(tmp_path):
    """Elements and text without a point, 60 MB of them, and points without anything."""
    other = b"<a/>" * 8_000_000 + b"x" * (20 << 20) + b"<trkpt/>" * 500_000
    (tmp_path / "x").write_bytes(f"{GPX}{POINT}".encode() + other + b"</gpx>")
    code, more_mb, _ = _import(tmp_path)
    assert (code, more_mb < MORE_MB) == (0, True)


def test_short_rows_are_counted(tmp_path, capsys):
    (tmp_path / "x").write_bytes(LOG.encode() + b"2\n" * 300_000)
    code, more_mb, error = _import(tmp_path)
    assert (code, more_mb < MORE_MB) == (0, True)
    assert "... and 299980 more bad rows" in error
    assert main(["import", f"{tmp_path}/x", "-o", f"{tmp_path}/run.h5", "--json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert (output["rows"], output["n_bad_rows"], len(output["bad_rows"])) == (2, 300_000, 10_000)


def test_a_long_log_takes_little_memory(tmp_path):
    rows = (f"{i},{52 + i * 1e-5:.5f},13,-{70 + i % 9}\n" for i in range(60_000))
    (tmp_path / "x").write_text(HEADER + "".join(rows))
    code, more_mb, error = _import(tmp_path)
    assert (code, more_mb < MORE_MB) == (0, True), f"{more_mb} MB {error}"
