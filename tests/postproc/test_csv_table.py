"""No cell of a CSV file that we write is a formula, and our own files come back as they were."""

import csv
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from logger.core.errors import RunFileError
from logger.core.types import CellReading, Fix
from postproc.csv_table import TOO_MANY, escape, rows, unescape
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


def _read(tmp_path, text, encoding="utf-8"):
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    return list(rows(tmp_path / "a.csv"))


@pytest.mark.parametrize(
    "title", ["My walk\n\n", "Export;;;;\r\n;;;;\r\n", "# a\nUser: x\n\n# b\n"]
)
def test_titles_above_the_header_are_no_header(tmp_path, title):
    ((line, row),) = _read(tmp_path, f"{title}lat;lon;level\n1;2;3\n")
    assert (line, row) == (title.count("\n") + 2, {"lat": "1", "lon": "2", "level": "3"})


@pytest.mark.parametrize(
    "rows_of_r", ['"1","a",2,3\n"2","b",4,5\n', '"0","a, b",2,3\n"1","b",4,5\n']
)
def test_row_numbers_without_a_name_move_no_value(tmp_path, rows_of_r):
    """As write.table of R writes them."""
    head = "name,lat,level\n"
    assert [row["name"] for _, row in _read(tmp_path, head + rows_of_r)] in (
        ["a", "b"],
        ["a, b", "b"],
    )


def test_a_row_with_more_values_than_columns_is_not_read(tmp_path):
    """Which of them a comma has moved nobody knows; an empty last value moves none."""
    text = "cell,lat,lon\nA, b,48,11\nA,48,137,11,575\nA,48,11,,\n0,48,1,11\n"
    one, two, three, _ = (row for _, row in _read(tmp_path, text))
    assert one == {"cell": "", "lat": "", "lon": "", TOO_MANY: "4 values"}
    assert (two["lat"], two[TOO_MANY]) == ("", "5 values")
    assert three == {"cell": "A", "lat": "48", "lon": "11"}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_texts_of_windows_are_read(tmp_path, encoding):
    ((_, row),) = _read(tmp_path, "Länge;Breite;Straße\n11,5;48,1;°\n", encoding)
    assert row == {"länge": "11.5", "breite": "48.1", "straße": "°"}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_pairs_of_letters_of_western_europe_are_not_chinese(tmp_path, encoding):
    ((_, row),) = _read(tmp_path, "Größe;Straße;Länge;süß;über;größer\n1;2;3;4;5;6\n", encoding)
    assert list(row) == ["größe", "straße", "länge", "süß", "über", "größer"]


def test_files_that_were_joined_need_one_order_of_columns(tmp_path):
    head, other = "lat,lon,level,level\n", "lat,level,lon\n"
    texts = [row["lon"] for _, row in _read(tmp_path, f"{head}1,2,3,4\n{head}5,6,7,8\n")]
    assert texts == ["2", "lon", "6"]
    with pytest.raises(RunFileError, match="a.csv: line 3 is another header"):
        _read(tmp_path, f"{head}1,2,3,4\n{other}5,6,7\n")


def test_a_first_value_without_quotation_marks_is_no_row_number(tmp_path):
    """Of 0,48,1,11 a comma has moved the values."""
    ((_, row),) = _read(tmp_path, "t,lat,lon\n0,48,1,11\n")
    assert row["lat"] == ""


def test_lines_of_the_last_value_are_no_rows(tmp_path):
    """A comment of two lines, beside names of networks that begin with a quotation mark."""
    head, comment = "lat,lon,note\n", '1,2,"a\nb"\n'
    assert [row["note"] for _, row in _read(tmp_path, head + 2 * comment)] == ["a\nb", "a\nb"]
    read = _read(tmp_path, f'{head}1,2,"a\n3,4,b"\n{comment}')
    assert [(line, row["note"]) for line, row in read] == [(2, '"a'), (3, 'b"'), (4, "a\nb")]
