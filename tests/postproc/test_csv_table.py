"""No cell of a CSV file that we write is a formula, and our own files come back as they were."""

import csv
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from logger.core.types import CellReading, Fix
from postproc.csv_table import escape, unescape
from postproc.interop.sighting import Sighting
from postproc.interop.writers import csv as write_csv
from tests.postproc.interop.walks import export_of, read_walk

FORMULAS = [
    "=cmd|' /C calc'!A0",
    "+1+1",
    "-2+3",
    "@SUM(A1)",
    "\t=1",
    "\r=1",
    "\n=1",
    "'=1",
    "''+1",
    "=",
    "-",
]
TEXTS = st.one_of(
    st.text(),
    st.builds(str.__add__, st.sampled_from(["'", "''", "=", "+", "-", "@", "\t"]), st.text()),
)


@given(TEXTS)
def test_what_is_marked_is_no_formula_and_comes_back(text):
    assert unescape(escape(text)) == text
    assert not escape(text).startswith(tuple("=+-@\t\r\n"))


@pytest.mark.parametrize("name", FORMULAS)
def test_a_cell_named_as_a_formula(tmp_path, name):
    reading = CellReading(
        "scan", "GSM", mcc=name[:4], mnc=name[:4], band=name[:12], rssi_dbm=-77.5, c1=-3, label=name
    )
    heard = Sighting(2, -5, Fix(True, lat_deg=-33.0, lon_deg=-70.0, alt_m=-2.5), reading)
    write_csv.write(export_of([heard]), tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            for column, value in row.items():
                if column in {"cell", "mcc", "mnc", "band", "role", "rat"}:
                    assert not value.startswith(tuple("=+-@\t\r\n")), column
            assert (row["rssi_dbm"], row["c1"], row["lat"]) == ("-77.5", "-3", "-33.0")
    (found,), bad = read_walk(tmp_path / "a.csv")
    assert (replace(found, line=2), bad) == (heard, [])
