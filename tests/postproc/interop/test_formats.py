"""The table of formats, in the source and in the documentation; real samples if there are any."""

import json
import os
import re
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from logger.core.errors import RunFileError
from postproc.interop.importing import formats, recognise
from postproc.interop.sighting import BadRow, Sighting
from tests.kit.sample_results import write_run

ROOT = Path(__file__).parents[3]
SAMPLES = Path(os.environ.get("CELLWALK_FORMATS", ROOT.parent / "shared/corpus/formats"))


def _table():
    return (ROOT / "docs/guide/formats.md").read_text().partition("\n## ")[0]


def test_the_page_lists_every_format_and_no_other():
    names = re.findall(r"^\| ([^|]+?) +\|", _table(), re.MULTILINE)
    assert set(names) - {"format"} == {form.name for form in formats()}
    assert len(formats()) == len({form.name for form in formats()})


def test_the_page_says_where_no_real_file_was_tried():
    rows = [line for line in _table().splitlines() if line.startswith("| ")][1:]
    tried = [row for row in rows if "real rows" in row]
    assert tried
    assert all("no real file tried" in row for row in rows if row not in tried)


@pytest.mark.parametrize(
    "name",
    [
        "wigle_1.4_sample.csv",
        "wigle_1.6_sample.csv",
        "opencellid_measurements_app_export_sample.csv",
        "opencellid_measurements_app_export_sample2.csv",
        "opencellid_upload_sample.json",
        "opencellid_upload_towercollector_sample.csv",
    ],
)
def test_all_but_one_in_a_hundred_cells_of_a_real_sample_are_read(name):
    source = SAMPLES / name
    if not source.exists():
        pytest.skip("CELLWALK_FORMATS names no folder with it; it is somebody's track")
    rows = list(recognise(source).read(source))
    bad = [
        row for row in rows if isinstance(row, BadRow) and "stands for an unknown" not in row.why
    ]
    n_read = sum(isinstance(row, Sighting) for row in rows)
    assert n_read > 0
    assert len(bad) <= 0.01 * (n_read + len(bad)), bad[:3]


ONE_FILE = {
    "readers": """
from postproc.interop.fields import Columns, level_in
from postproc.interop.contents import of_columns

IMPORTS = (
    of_columns(
        "Acme log", Columns(level_dbm=level_in("acme_dbm")), ("acme_dbm", "rat", "lat"), times=""
    ),
)
""",
    "writers": """
def write(walk, estimates, target):
    target.write_text(f"{len(walk.sightings)} levels")
""",
}
WITH_FILE = """
import sys
from importlib import import_module
import_module(f"postproc.interop.{sys.argv[1]}").__path__.append(sys.argv[2])
from postproc.cli import main
sys.exit(main(sys.argv[3:]))
"""


def _with_one_file(folder, room, *argv):
    (folder / room).mkdir()
    (folder / room / "acme.py").write_text(ONE_FILE[room])
    command = [sys.executable, "-c", WITH_FILE, room, str(folder / room), *map(str, argv)]
    return subprocess.run(command, capture_output=True, text=True, check=True)


def test_a_format_that_is_imported_is_one_file(tmp_path):
    rows = "".join(f"-{70 + i},LTE,52.{i},13.0,262,1,4711,17\n" for i in range(3))
    (tmp_path / "log.csv").write_text("acme_dbm,rat,lat,lon,mcc,mnc,lac,cid\n" + rows)
    argv = ("import", tmp_path / "log.csv", "-o", tmp_path / "run.h5", "--json")
    done = _with_one_file(tmp_path, "readers", *argv)
    assert json.loads(done.stdout)["format"] == "Acme log"
    assert json.loads(done.stdout)["rows"] == 3


def test_a_format_that_is_exported_is_one_file(tmp_path):
    write_run(tmp_path / "run.journal", seconds=20, cells=1)
    argv = ("export", tmp_path / "run.journal", "-o", tmp_path / "x.acme")
    assert "(acme)" in _with_one_file(tmp_path, "writers", *argv).stdout
    assert (tmp_path / "x.acme").read_text() == "10 levels"
    command = [sys.executable, "-c", WITH_FILE, "writers", str(tmp_path / "writers")]
    done = subprocess.run(
        [*command, "export", "--help"], capture_output=True, text=True, check=True
    )
    assert "acme" in done.stdout


def test_a_file_of_no_known_format_is_answered_with_how_to_read_it(tmp_path):
    with sqlite3.connect(tmp_path / "log.db") as database:
        database.execute("CREATE TABLE session_info (id, mcc, mnc, lac, cid)")
    database.close()
    (tmp_path / "log.json").write_text('{"cell": 1, "rxlev": 20}')
    for name, how in (("log.db", "sqlite3 -csv -header"), ("log.json", "as a table (CSV")):
        with pytest.raises(RunFileError, match="--columns lat=") as refused:
            recognise(tmp_path / name)
        assert how in str(refused.value)
