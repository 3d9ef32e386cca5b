"""Logs of drive tests in one form: one row for each cell of a scan.

Columns: `t_s` (seconds), `lat`, `lon` (WGS 84 degrees), `rat`, `mcc`, `mnc`, `lac_tac`, `cid`,
`arfcn`, `pci_bsic`, `level_dbm` (GSM RxLev, UMTS RSCP, LTE RSRP), `serving` (1 or 0), `ta`. Empty
is unknown; rows with the same `t_s` are one scan. A cell without its network code is named with a
question mark in its place, since many logs of telephones leave it out.
"""

from postproc.interop.columns import CODES, Columns
from postproc.interop.contents import of_columns
from postproc.interop.fields import LEVEL_RANGE_DBM, maybe, number, text
from postproc.interop.log_times import Moment

_COLUMNS = Columns(
    when=lambda _, fields: Moment(round(number(fields, "t_s") * 1e9), is_utc=False),
    level_dbm=lambda fields, _: maybe(fields, "level_dbm", LEVEL_RANGE_DBM),
    role=lambda fields: "serving" if text(fields, "serving") == "1" else "neighbour",
    area=("lac_tac",),
    codes=dict.fromkeys(CODES, ("pci_bsic",)),
    ta=("ta",),
    half_networks=True,
)
IMPORTS = (
    of_columns(
        "drive test CSV",
        _COLUMNS,
        ("t_s", "lat", "lon", "rat", "lac_tac", "pci_bsic", "level_dbm"),
        times="t_s",
        has_scans=True,
    ),
)
