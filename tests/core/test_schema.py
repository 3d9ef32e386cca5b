from dataclasses import fields

import numpy as np
import pytest

from logger.core.rows import DTYPES, dtypes_of, to_current_columns, values_of
from logger.core.schema import TABLES, rows_of
from logger.core.types import (
    Broadcast,
    CellReading,
    Fix,
    LiveEstimate,
    Note,
    RawBytes,
    Record,
    Scan,
)

HEAD = {"seq", "t_ns", "source"}


@pytest.mark.parametrize(
    ("table", "kind", "written_instead"),
    [
        ("fixes", Fix, {}),
        ("scans", Scan, {"readings": "n_readings"}),
        ("readings", CellReading, {"label": "cell"}),
        ("broadcasts", Broadcast, {}),
        ("notes", Note, {}),
        ("live", LiveEstimate, {}),
    ],
)
def test_every_field_of_a_value_has_its_column(table, kind, written_instead):
    columns = {column.name for column in TABLES[table]} - HEAD
    extra = {
        "readings": {"t_start_ns", "fix_start_seq", "fix_seq"},
        "broadcasts": {"reading"},
    }.get(table, set())
    elsewhere = {"more", "broadcast"}
    names = {f.name for f in fields(kind)} - elsewhere
    assert columns == {written_instead.get(name, name) for name in names} | extra


def test_every_column_has_a_unit_or_meaning():
    assert all(column.unit for columns in TABLES.values() for column in columns)


def test_a_whole_number_that_may_be_unknown_has_a_mark():
    always_known = {
        "seq",
        "t_ns",
        "valid",
        "t_start_ns",
        "scan_seq",
        "reading",
        "n",
        "utm_zone",
        "sent",
        "offset",
        "length",
    }
    for columns in TABLES.values():
        for column in columns:
            if column.dtype[1] in "iu" and column.name not in always_known:
                assert column.unknown is not None, column


def test_raw_bytes_have_no_row_of_their_own():
    with pytest.raises(TypeError):
        rows_of(0, Record(0, "gnss", RawBytes(b"x")))


def test_rows_of_an_older_run_have_all_of_todays_columns():
    today = np.zeros(2, DTYPES["readings"])
    names = [
        name for name in today.dtype.names if name not in {"rsrp_dbm", "tac", "band", "t_start_ns"}
    ]
    old = today[names].copy()
    old["arfcn"] = 77
    rows = to_current_columns("readings", old)
    assert rows.dtype == DTYPES["readings"]
    assert next(values_of("readings", rows))["arfcn"] == 77
    assert all(
        next(values_of("readings", rows))[name] is None
        for name in ("rsrp_dbm", "tac", "band", "t_start_ns")
    )
    assert to_current_columns("readings", today) is today


@pytest.mark.parametrize("unsure", [False, True])
def test_a_run_keeps_which_identity_is_unsure_and_an_older_one_has_none(unsure):
    reading = CellReading("serving", "GSM", "262", "01", 4711, 2655, identity_unsure=unsure)
    found = rows_of(0, Record(5, "modem", Scan(1, (reading,))))
    table = np.array([row for name, row in found if name == "readings"], DTYPES["readings"])
    assert next(values_of("readings", table))["identity_unsure"] == (1 if unsure else None)
    older = table[list(dtypes_of(2)["readings"].names)]
    assert (
        next(values_of("readings", to_current_columns("readings", older)))["identity_unsure"]
        is None
    )
