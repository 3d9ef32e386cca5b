"""What the rules of suspicion see of a run: its columns as a survey keeps them, and back.

Positions are those of the receiver, since the rules say something else of smoothed ones, and
readings without an identity are among them. Times count from the start of the run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from logger.core.live_settings import LiveSettings
from logger.core.rows import DTYPES, Rows
from logger.core.runfile import Damage, Run, RunMeta
from logger.core.schema import TABLES, encode
from logger.core.types import Broadcast

_COLUMNS: Mapping[str, tuple[str, ...]] = {
    "fixes": ("seq", "t_ns", "valid", "lat_deg", "lon_deg"),
    "scans": ("seq", "t_ns"),
    "readings": (
        "seq", "cell", "role", "rat", "mcc", "mnc", "lac", "tac", "cid", "arfcn", "bsic", "psc",
        "pci", "rxlev_raw", "rssi_dbm", "rscp_dbm", "rsrp_dbm", "ta", "c1", "c2",
        "identity_unsure",
    ),
    "broadcasts": ("seq", "reading", *(field.name for field in fields(Broadcast))),
}  # fmt: skip


class RuleColumn(NamedTuple):
    """A column of a table of a run: numpy dtype, length, and the bytes of its values.

    Of a column with one value throughout, that value is kept. `max_fix_age_s`, the age at which
    fixes of the run end, is the same in all its columns.
    """

    max_fix_age_s: float
    table: str
    column: str
    kind: str
    n: int
    values: bytes


def rule_inputs(run: Run) -> list[RuleColumn]:
    """What the rules see of a run, and nothing else of it."""
    return [
        _pack(run, table, name)
        for table, names in _COLUMNS.items()
        if len(run.tables[table])
        for name in names
    ]


def run_of(columns: Sequence[RuleColumn]) -> Run:
    """The run that these are the columns of; all else of it is unknown."""
    tables: dict[str, Rows] = {table: np.zeros(0, dtype) for table, dtype in DTYPES.items()}
    tables |= {
        table: _rows(table, {one.column: one for one in of_table})
        for table, of_table in groupby(columns, key=attrgetter("table"))
    }
    live = LiveSettings(max_fix_age_s=columns[0].max_fix_age_s)
    meta = RunMeta(run_id="", boot_id="", started_ns=0, origin="", program="", live=live)
    return Run(Path(), "survey", meta, None, Damage(), tables, np.zeros(0, np.uint8))


def _rows(table: str, packed: Mapping[str, RuleColumn]) -> Rows:
    rows = np.zeros(packed["seq"].n, DTYPES[table])
    for column in TABLES[table]:
        if column.name in packed:
            one = packed[column.name]
            rows[column.name] = np.frombuffer(one.values, one.kind)
        elif column.unknown is not None or column.dtype == "<f8":
            rows[column.name] = encode(column, None)
    return rows


def _pack(run: Run, table: str, name: str) -> RuleColumn:
    values: NDArray[Any] = run.tables[table][name]
    if name == "t_ns":
        values = values - run.meta.started_ns
    n = len(values)
    if np.all(values == values[0]) or (values.dtype.kind == "f" and np.all(np.isnan(values))):
        values = values[:1]
    stored = np.ascontiguousarray(values).tobytes()
    return RuleColumn(run.meta.live.max_fix_age_s, table, name, values.dtype.str, n, stored)
