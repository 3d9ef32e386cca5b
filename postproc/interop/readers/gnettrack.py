"""Logs of G-NetTrack: a text file with tabs, or KML with the same values at each point.

Sources: the manual at gyokovsolutions.com/g-nettrack-user-guide and the column names in public
programs that read such logs (braz0101/GNetTrackAnalytics, uccmisl/5Gdataset). Columns, which differ
between versions, go by their names. `Node` is the eNodeB or the RNC: the app splits the identity of
a cell, and `CellID` is then the rest. Versions that write CSV also have the complete identity
(`RAWCELLID`), hexadecimal forms of the node, the rest and the area, and one column of levels for
all technologies (`RSRP`). Speed is in km/h, times are the telephone's own. The numbers of the SIM
and the telephone, which some versions write, are not read.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

from logger.core.types import Fix, Rat
from postproc import csv_table
from postproc.interop import xml_file
from postproc.interop.contents import Contents, Format
from postproc.interop.sighting import CODES as _CODES
from postproc.interop.sighting import (
    LEVEL_RANGE_DBM,
    RATS,
    BadRow,
    Fields,
    NoCell,
    Row,
    Sighting,
    cell_identity,
    fix_of,
    integer,
    maybe,
    moment_of,
    parse_rows,
    plmn,
    reading_of,
    text,
    whole_identity,
)

_LEVELS: dict[Rat, tuple[str, ...]] = {
    "GSM": ("level", "rxlev", "rxl", "rsrp"),
    "WCDMA": ("level", "rscp", "rsrp"),
    "LTE": ("level", "rsrp"),
    "NR": ("level", "rsrp", "csirsrp"),
}
_MOST_NEIGHBOURS = 18
_NONE = frozenset({"-", "--", "n/a", "na", "nan", "null", "none", "unknown"})
_KML_NAMES = {
    "time": "timestamp",
    "technology": "networktech",
    "mode": "networkmode",
    "enb": "node",
    "rnc": "node",
    "gnb": "node",
    "tac": "lac",
    "pc": "psc",
    "pci": "psc",
}
_LEADING_NUMBER = re.compile(r"\s*(-?\d+(?:\.\d+)?)\s*(?:dBm|dB|km/h|m|kbps)?\s*")


def is_text(seen: Contents) -> bool:
    """Whether a table has the columns of a G-NetTrack log."""
    has_level = any(name in seen.names for names in _LEVELS.values() for name in names)
    has_technology = seen.has("networktech") or seen.has("networkmode")
    return seen.has("timestamp", "longitude", "latitude") and has_level and has_technology


def is_kml(seen: Contents) -> bool:
    """Whether the points of a KML file have the values of G-NetTrack."""
    names = ('name="TECHNOLOGY"', 'name="CGI"')
    return seen.kind == "xml" and seen.has("kml") and all(name in seen.head for name in names)


def read_text(source: Path) -> Iterator[Row]:
    """Serving cell and neighbours of each row; raises `RunFileError` without the columns needed."""
    needed = ("timestamp", "longitude", "latitude", {"networktech", "networkmode"})
    yield from parse_rows(csv_table.rows(source, required=needed), _cells)


def read_kml(source: Path) -> Iterator[Row]:
    """The same of each point with values; raises `RunFileError` for damaged XML."""
    points = enumerate(xml_file.elements(source, "Placemark"), 1)
    yield from parse_rows(((number, _values(point)) for number, point in points), _cells)


def _values(point: ET.Element) -> dict[str, str]:
    """Values of a point under the names of the text file; numbers without their units."""
    values = {}
    for data in point.iter("Data"):
        name, value = data.get("name", "").lower(), (data.findtext("value") or "").strip()
        number = _LEADING_NUMBER.fullmatch(value)
        values[_KML_NAMES.get(name, name)] = number[1] if number else value
    lon, lat, *_ = [*(point.findtext(".//coordinates") or "").strip().split(","), "", ""]
    return values | {"longitude": lon, "latitude": lat}


def _cells(line: int, raw: Fields) -> list[Row]:
    fields = {k: "" if str(v).strip().lower() in _NONE else v for k, v in raw.items()}
    if not text(fields, "timestamp"):
        return [NoCell(line, "a point without a time")]
    names = (text(fields, "networktech").upper(), text(fields, "networkmode").upper())
    rat = next((RATS[name] for name in names if name in RATS), None)
    if rat is None:
        return [NoCell(line, "no service")]
    moment = moment_of(text(fields, "timestamp"), "Timestamp")
    speed_kmh = maybe(fields, "speed")
    fix = fix_of(
        fields,
        "latitude",
        "longitude",
        moment.utc_ns,
        alt_m=maybe(fields, "altitude"),
        acc_m=maybe(fields, "accuracy", (0.0, 1e6)) or None,
        speed_mps=None if speed_kmh is None else speed_kmh / 3.6,
    )
    serving = _serving(line, moment.t_ns, fix, rat, fields)
    return [serving, *_neighbours(line, moment.t_ns, fix, rat, fields)]


def _serving(line: int, t_ns: int, fix: Fix, rat: Rat, fields: Fields) -> Row:
    column = next((name for name in _LEVELS[rat] if text(fields, name)), None)
    if column is None:
        return BadRow(line, f"{_LEVELS[rat][0]} is empty")
    reading = reading_of(
        rat,
        "serving",
        maybe(fields, column, LEVEL_RANGE_DBM),
        _decimal_or_hex(fields, "lac", "tac", hexadecimal="lachex"),
        **_network(fields),
        cid=_identity(rat, fields),
        arfcn=integer(fields, "arfcn"),
        rsrq_db=maybe(fields, "qual" if "qual" in fields else "rsrq") if rat == "LTE" else None,
        sinr_db=maybe(fields, "snr") if rat in {"LTE", "NR"} else None,
        ta=integer(fields, "ta") if rat == "GSM" else None,
        **{_CODES[rat]: integer(fields, "psc", "bsic")},
    )
    return Sighting(line, t_ns, fix, reading)


def _network(fields: Fields) -> dict[str, str | None]:
    """Country and network from the operator's number, for example 26201, or from the CGI."""
    number = text(fields, "operator", "mccmnc", "mcc")
    if number.isdecimal() and len(number) in {5, 6}:
        return {"mcc": number[:3], "mnc": number[3:]}
    parts = re.split(r"[-_:/ ]", text(fields, "cgi"))
    if len(parts) >= 4 and parts[0].isdecimal() and parts[1].isdecimal():
        return {"mcc": parts[0], "mnc": parts[1]}
    mcc, mnc = plmn(fields)
    return {"mcc": mcc, "mnc": mnc}


def _identity(rat: Rat, fields: Fields) -> int | None:
    whole = cell_identity(fields, "rawcellid")
    if whole:
        return whole
    cid = _decimal_or_hex(fields, "cellid", hexadecimal="cellhex")
    node = _decimal_or_hex(fields, "node", hexadecimal="nodehex")
    return whole_identity(rat, node, cid)


def _decimal_or_hex(fields: Fields, *names: str, hexadecimal: str) -> int | None:
    number = cell_identity(fields, *names)
    digits = text(fields, hexadecimal)
    if number is not None or not digits:
        return number
    if not re.fullmatch(r"(?:0[xX])?[0-9A-Fa-f]{1,9}", digits):
        raise ValueError(f"{hexadecimal} is no hexadecimal number: {digits[:40]!r}")
    return int(digits, 16)


def _neighbours(line: int, t_ns: int, fix: Fix, rat: Rat, fields: Fields) -> Iterator[Row]:
    """Neighbours; of those without a complete identity, channel and code alone are known."""
    for i in range(1, _MOST_NEIGHBOURS + 1):
        level_dbm = maybe(fields, f"nrxlev{i}")
        # 0 and positive numbers stand for no neighbour, or for a level that is not known
        if level_dbm is None or not LEVEL_RANGE_DBM[0] <= level_dbm < 0.0:
            continue
        own = RATS.get(text(fields, f"ntech{i}").upper(), rat)
        named = integer(fields, f"ncell{i}", f"ncellid{i}")
        area = integer(fields, f"nlac{i}")
        is_named = own == "GSM" and bool(area) and named is not None
        identity = {**_network(fields), "cid": named} if is_named else {_CODES[own]: named}
        yield Sighting(
            line,
            t_ns,
            fix,
            reading_of(
                own,
                "neighbour",
                level_dbm,
                area if is_named else None,
                arfcn=integer(fields, f"narfcn{i}"),
                **identity,
            ),
        )


IMPORTS = (
    Format("G-NetTrack text", read_text, "Timestamp", is_text, has_scans=True),
    Format("G-NetTrack KML", read_kml, "TIME", is_kml, has_scans=True),
)
