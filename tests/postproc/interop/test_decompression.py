"""Compressed files are imported as what is in them."""

import gzip
import json
import sqlite3
import zipfile

import pytest

from logger.core.runfile import read_run
from postproc.cli import main
from postproc.interop import contents
from postproc.interop.importing import import_walk
from tests.postproc.interop.test_importing import WIGLE, _write


def _pack(tmp_path, plain, kind):
    if kind == "gz":
        (tmp_path / f"{plain.name}.gz").write_bytes(gzip.compress(plain.read_bytes()))
        return tmp_path / f"{plain.name}.gz"
    with zipfile.ZipFile(tmp_path / f"{plain.name}.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(plain, plain.name)
        archive.writestr("__MACOSX/._junk", "junk")
    return tmp_path / f"{plain.name}.zip"


def _survey(tmp_path):
    database = sqlite3.connect(tmp_path / "s.gpkg")
    database.execute(
        "CREATE TABLE GSM_MESSAGE (Time INT, MCC INT, MNC INT, LAC INT, CID INT, Latitude REAL, "
        "Longitude REAL, SignalStrength REAL)"
    )
    database.execute(
        "INSERT INTO GSM_MESSAGE VALUES (1500000000000, 262, 1, 4711, 17, 52, 13, -70)"
    )
    database.commit()
    database.close()
    return tmp_path / "s.gpkg"


@pytest.mark.parametrize("kind", ["gz", "zip"])
@pytest.mark.parametrize("form", ["csv", "wigle", "geopackage"])
def test_a_compressed_file_is_what_is_in_it(tmp_path, form, kind):
    plain = {
        "csv": lambda: _write(
            tmp_path, "t_s,lat,lon,rssi_dbm\n0,52,13,-70\n1,52,13,-71\n", "a.csv"
        ),
        "wigle": lambda: _write(tmp_path, WIGLE, "w.csv"),
        "geopackage": lambda: _survey(tmp_path),
    }[form]()
    first = import_walk(plain, tmp_path / "plain.h5")
    packed = import_walk(_pack(tmp_path, plain, kind), tmp_path / "packed.h5")
    assert (packed.format, packed.n_rows, packed.left.bad) == (
        first.format,
        first.n_rows,
        first.left.bad,
    )
    one, other = (
        read_run(tmp_path / name).tables["readings"] for name in ("plain.h5", "packed.h5")
    )
    assert one.tobytes() == other.tobytes()


def test_errors_name_the_compressed_file_and_not_its_copy(tmp_path, capsys):
    packed = _pack(tmp_path, _write(tmp_path, "t_s,lat,lon\n1,2,3\n", "a.csv"), "gz")
    assert main(["import", str(packed), "-o", str(tmp_path / "run.h5")]) == 2
    output = capsys.readouterr().err
    assert f"{packed}: the header line has no column rssi_dbm" in output
    assert "unpacked" not in output


def _logs(tmp_path):
    """A zip of two logs in folders, one of which is called like the other, and a text."""
    with zipfile.ZipFile(tmp_path / "logs.zip", "w") as archive:
        for i, name in enumerate(("mo/walk 1.csv", "tu/walk 1.csv")):
            archive.writestr(name, f"t_s,lat,lon,rssi_dbm\n0,52,13,-7{i}\n1,52,13,-7{i}\n")
        archive.writestr("readme.txt", "Walks of last week.\n")
    return tmp_path / "logs.zip"


def test_each_log_of_a_zip_becomes_a_run(tmp_path, capsys):
    packed = _logs(tmp_path)
    assert main(["import", str(packed), "-o", str(tmp_path / "w.h5"), "--json"]) == 0
    output = capsys.readouterr()
    result = json.loads(output.out)
    assert [run["file"] for run in result["runs"]] == ["mo/walk 1.csv", "tu/walk 1.csv"]
    assert [left["file"] for left in result["left_out"]] == ["readme.txt"]
    assert f"{packed}/readme.txt is left out: " in output.err
    assert sorted(path.name for path in tmp_path.glob("*.h5")) == [
        "w-walk-1-2.h5",
        "w-walk-1.h5",
    ]
    second = read_run(tmp_path / "w-walk-1-2.h5")
    assert second.tables["readings"]["rssi_dbm"].tolist() == [-71.0, -71.0]
    assert second.meta.origin.endswith("walk 1.csv")


def test_one_file_of_a_zip_is_named(tmp_path, capsys):
    packed, run = str(_logs(tmp_path)), tmp_path / "w.h5"
    assert main(["import", packed, "-o", str(run), "--member", "tu/walk 1.csv"]) == 0
    assert read_run(run).tables["readings"]["rssi_dbm"].tolist() == [-71.0, -71.0]
    assert main(["import", packed, "-o", str(run), "--member", "walk.csv"]) == 2
    assert "has no file 'walk.csv': it has mo/walk 1.csv" in capsys.readouterr().err


def test_names_in_a_zip_lead_nowhere_else(tmp_path):
    (tmp_path / "in").mkdir()
    with zipfile.ZipFile(tmp_path / "evil.zip", "w") as archive:
        for name in ("../../up.csv", "/root.csv", "..", "a/"):
            archive.writestr(name, "t_s,lat,lon,rssi_dbm\n0,52,13,-70\n1,52,13,-71\n")
    assert main(["import", str(tmp_path / "evil.zip"), "-o", str(tmp_path / "in/w.h5")]) == 0
    assert sorted(path.name for path in (tmp_path / "in").iterdir()) == [
        "w-log.h5",
        "w-root.h5",
        "w-up.h5",
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["evil.zip", "in"]


def test_a_zip_without_a_log_and_a_file_that_would_fill_the_disk(tmp_path, capsys, monkeypatch):
    with zipfile.ZipFile(tmp_path / "two.zip", "w") as archive:
        archive.writestr("a.csv", "x")
        archive.writestr("b.csv", "x")
    assert main(["import", str(tmp_path / "two.zip"), "-o", str(tmp_path / "run.h5")]) == 2
    assert "none of its 2 files could be imported" in capsys.readouterr().err
    monkeypatch.setattr(contents, "MOST_MEMBERS", 1)
    assert main(["import", str(tmp_path / "two.zip"), "-o", str(tmp_path / "run.h5")]) == 2
    assert "has 2 files" in capsys.readouterr().err
    (tmp_path / "bomb.gz").write_bytes(gzip.compress(b"0" * 2**27, mtime=0))
    assert main(["import", str(tmp_path / "bomb.gz"), "-o", str(tmp_path / "run.h5")]) == 2
    assert "unpacks to more than" in capsys.readouterr().err
