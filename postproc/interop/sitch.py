"""SITCH sensor: `cells.log` and `gsm_modem_channel.log`, JSON objects one a line.

Sources: log_cells.rst, log_gsm_modem_channel.rst and gsm_decomposer.py of sitch-io/sensor. They
have no position: join them with the sensor's `gps.log` or a GPX track (`--track`). `rxl` is RXLEV,
an index from 0 to 63. Area and identity are hexadecimal until the sensor has added `cgi_str`. The
public address of the sensor, which both files have, is not read.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from logger.core.types import CellReading, Fix
from postproc.interop import json_lines
from postproc.interop.contents import Contents
from postproc.interop.fields import Fields, integer, number, text
from postproc.interop.log_times import moment_of
from postproc.interop.sighting import BadRow, NoCell, Row, Sighting

_NO_TIMING_ADVANCE = 255
_NOBODY = {"cid": 0xFFFF, "lac": 0}
"""What the modem prints for a cell that it has not decoded."""


def is_it(seen: Contents) -> bool:
    return seen.kind == "json" and (seen.has("scan_program") or seen.has("arfcn", "rxl", "cellid"))


def read(source: Path) -> Iterator[Row]:
    """Cells of all scans, without positions; raises `RunFileError` for a file that is no JSON."""
    yield from json_lines.parse_objects(source, _cells)


def _cells(line: int, document: dict[str, Any]) -> list[Row]:
    scanned = document.get("scan_results", [document] if "rxl" in document else None)
    if not isinstance(scanned, list):
        return [NoCell(line, f"{text(document, 'scan_program') or 'another'} event")]
    moment = moment_of(text(document, "scan_finish"), "scan_finish")
    # the sensor's clock is UTC (utility.py of the sensor)
    fix = Fix(False, utc_ns=moment.t_ns)
    return [_cell(line, moment.t_ns, fix, one) for one in scanned]


def _cell(line: int, t_ns: int, fix: Fix, channel: object) -> Row:
    if not isinstance(channel, dict):
        return BadRow(line, "a channel is no object")
    try:
        return Sighting(line, t_ns, fix, _reading(channel))
    except ValueError as error:
        return BadRow(line, str(error))


def _reading(channel: Fields) -> CellReading:
    area, cid = _identity(channel)
    is_decoded = (
        text(channel, "mcc").isdecimal() and area != _NOBODY["lac"] and cid != _NOBODY["cid"]
    )
    timing_advance = integer(channel, "ta")
    return CellReading(
        "serving" if integer(channel, "cell") == 0 else "neighbour",
        "GSM",
        mcc=text(channel, "mcc") if is_decoded else None,
        mnc=text(channel, "mnc") or None if is_decoded else None,
        lac=area if is_decoded else None,
        cid=cid if is_decoded else None,
        arfcn=integer(channel, "arfcn"),
        bsic=integer(channel, "bsic", largest=63),
        rxlev_raw=round(number(channel, "rxl", (0.0, 63.0))),
        ta=None if timing_advance == _NO_TIMING_ADVANCE else timing_advance,
    )


def _identity(channel: Fields) -> tuple[int | None, int | None]:
    """Area and cell; the seven fields of some neighbours have no cell, which the sensor calls 0."""
    parts = text(channel, "cgi_str").split(":")
    if len(parts) == 4:
        named = {"lac": parts[2], "cellid": parts[3]}
        return integer(named, "lac"), integer(named, "cellid") or None
    area, cid = (text(channel, name) for name in ("lac", "cellid"))
    try:
        return int(area, 16) if area else None, int(cid, 16) or None if cid else None
    except ValueError:
        raise ValueError(f"lac or cellid is not hexadecimal: {area[:20]!r}, {cid[:20]!r}") from None
