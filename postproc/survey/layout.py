"""Names and columns of the files of a survey.

    survey.json                       what the folder is, and the salt of the pseudonyms
    readings/area=A/000001.parquet    readings of batch 1 of all cells of an area, cell by cell
    cells/000001.parquet              what each run of the batch heard of each cell
    rules/000001.parquet              what the rules of suspicion see of its runs
    runs/000001.parquet               its runs; written last: without it the batch does not exist

An area is `mcc-mnc-lac`, so that DuckDB, pandas and Spark see a partitioned dataset.
"""

from pathlib import Path

import pyarrow as pa

READINGS = pa.schema(
    [
        pa.field("cell", pa.string(), metadata={"unit": "name of the cell"}),
        pa.field("run", pa.string(), metadata={"unit": "digest of the run"}),
        pa.field("t_ns", pa.int64(), metadata={"unit": "ns since the run began, 0 without times"}),
        pa.field("zone", pa.int8(), metadata={"unit": "UTM zone, negative south of the equator"}),
        pa.field("x_m", pa.float64(), metadata={"unit": "m east"}),
        pa.field("y_m", pa.float64(), metadata={"unit": "m north"}),
        pa.field("position_sigma_m", pa.float64(), metadata={"unit": "m, per axis"}),
        pa.field("level_dbm", pa.float64(), metadata={"unit": "dBm"}),
        pa.field("scan_seq", pa.int64(), metadata={"unit": "number of the scan in the run"}),
        pa.field("ta", pa.int16(), metadata={"unit": "timing advance in steps, -1 if unknown"}),
        pa.field(
            "named_share", pa.float64(), metadata={"unit": "of the scans near, NaN if unknown"}
        ),
    ]
)
CELLS = pa.schema(
    [
        ("run", pa.string()),
        ("cell", pa.string()),
        ("rat", pa.string()),
        ("n_readings", pa.int64()),
        ("n_scans", pa.int64()),
        ("channels", pa.list_(pa.int32())),
    ]
)
"""`channels` has pairs one after the other: channel number and code, -1 where unknown."""
RUNS = pa.schema(
    [
        ("digest", pa.string()),
        ("content", pa.string()),
        ("run_id", pa.string()),
        ("name", pa.string()),
        ("logger", pa.string()),
        ("modem", pa.string()),
        ("began_utc_ns", pa.int64()),
        ("n_readings", pa.int64()),
        ("is_complete", pa.bool_()),
        ("replaces", pa.string()),
        ("marks", pa.binary()),
        ("is_copy", pa.bool_()),
    ]
)
NOT_IN_OLDER = frozenset(("is_complete", "replaces", "marks", "is_copy"))
"""Columns of runs that surveys of older versions lack."""
RULES = pa.schema(
    [
        pa.field("run", pa.string(), metadata={"unit": "digest of the run"}),
        pa.field("max_fix_age_s", pa.float64(), metadata={"unit": "s, of its settings"}),
        pa.field("table", pa.string(), metadata={"unit": "table of the run"}),
        pa.field("column", pa.string(), metadata={"unit": "column of this table"}),
        pa.field("kind", pa.string(), metadata={"unit": "numpy dtype"}),
        pa.field("n", pa.int64(), metadata={"unit": "number of rows"}),
        pa.field("values", pa.binary(), metadata={"unit": "values, or the one of all rows"}),
    ]
)
FILES_KEY = b"files"
"""Metadata of a file of `runs`: the sizes of the other files of the batch, as JSON."""
NO_AREA = "none"
"""Area of cells that have a name and no identity."""


def area_of(cell: str) -> str:
    """The area of a cell by its name, as part of a path."""
    text, _, _ = cell.rpartition("-")
    is_identity = text.count("-") == 2 and text.replace("-", "").isdigit()
    return text if is_identity else NO_AREA


def description(survey: Path) -> Path:
    """The file that says what the folder is."""
    return survey / "survey.json"


def runs_file(survey: Path, batch: str) -> Path:
    """The file that makes a batch part of the survey."""
    return survey / "runs" / f"{batch}.parquet"


def cells_file(survey: Path, batch: str) -> Path:
    """What the runs of a batch heard."""
    return survey / "cells" / f"{batch}.parquet"


def rules_file(survey: Path, batch: str) -> Path:
    """What the rules see of the runs of a batch; not there where they were no run files."""
    return survey / "rules" / f"{batch}.parquet"


def readings_file(survey: Path, area: str, batch: str) -> Path:
    """Readings of a batch in an area."""
    return survey / "readings" / f"area={area}" / f"{batch}.parquet"
