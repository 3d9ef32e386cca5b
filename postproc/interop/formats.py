"""The formats that are imported, each recognised by what is in the file."""

import sqlite3
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from logger.core.errors import RunFileError
from logger.sqlite_file import open_database
from postproc.interop import (
    csv_table,
    drive_log,
    kismet,
    network_survey,
    opencellid,
    walk_csv,
    wigle,
)
from postproc.interop.fields import RATS
from postproc.interop.sighting import Row

_SQLITE = b"SQLite format 3\0"
_HDF5 = b"\x89HDF\r\n\x1a\n"
_KINDS = {
    b"%PDF": "a PDF document",
    b"\x89PNG": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"PAR1": "a Parquet table",
    b"\x7fELF": "a program",
}
_OURS = {"t_s", "time_utc", "lat", "lon", "rssi_dbm", "rscp_dbm", "rsrp_dbm"}
_MOST_SHOWN = 60


@dataclass(frozen=True, slots=True)
class Format:
    """A format that can be imported, and what it calls its times.

    With `has_scans`, rows that follow each other at one time are one scan.
    """

    name: str
    read: Callable[[Path], Iterator[Row]]
    times: str
    has_scans: bool = False


WALK_CSV = Format("CSV", walk_csv.read, "t_s or time_utc")
DRIVE_LOG = Format("drive test CSV", drive_log.read, "t_s", has_scans=True)
WIGLE = Format("WiGLE CSV", wigle.read, "FirstSeen")
OPENCELLID_CSV = Format("OpenCelliD measurements, CSV", opencellid.read_csv, "measured_at")
OPENCELLID_JSON = Format("OpenCelliD measurements, JSON", opencellid.read_json, "measured_at")
KISMET = Format("Kismet log", kismet.read, "ts_sec")
SURVEY_CSV = Format("Network Survey CSV", network_survey.read_csv, "deviceTime")
SURVEY_GEOPACKAGE = Format("Network Survey GeoPackage", network_survey.read_geopackage, "Time")

KNOWN = (
    "our CSV (columns t_s or time_utc, lat, lon, rssi_dbm), drive test CSV (t_s, lat, lon, rat, "
    "lac_tac, pci_bsic, level_dbm), WiGLE CSV, OpenCelliD or Tower "
    "Collector (CSV, JSON), "
    "Kismet log, Network Survey (CSV, GeoPackage), each also as .gz or .zip"
)


def recognise(source: Path) -> Format:
    """Format of a file by its content; raises `RunFileError` for one that is none of them."""
    try:
        with source.open("rb") as file:
            head = file.read(4096)
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror}") from error
    if head.startswith(_SQLITE):
        return _of_tables(source)
    if head.startswith(_HDF5):
        raise RunFileError(f"{source} is HDF5: a run needs no import")
    text = head.lstrip(b"\xef\xbb\xbf \r\n\t")
    if text.startswith(b"{"):
        return OPENCELLID_JSON
    if not text or b"\0" in head or text.startswith((b"<", b"[", *_KINDS)):
        raise _unknown_format(source, _kind_of(text))
    return _of_columns(source)


def _of_tables(source: Path) -> Format:
    try:
        with open_database(source) as database:
            tables = {
                str(name)
                for (name,) in database.execute(
                    "SELECT name FROM sqlite_master WHERE type = 'table'"
                )
            }
    except sqlite3.Error as error:
        raise RunFileError(f"{source} is a damaged SQLite file: {error}") from error
    if {name.lower() for name in tables} >= {"kismet", "data"}:
        return KISMET
    if tables & set(network_survey.TABLES):
        return SURVEY_GEOPACKAGE
    raise RunFileError(
        f"{source} is SQLite, but neither a Kismet log (tables KISMET and data) nor a GeoPackage "
        "of Network Survey "
        f"(one of {', '.join(network_survey.TABLES)}); it has "
        f"{', '.join(sorted(tables)[:8]) or 'no table'}"
    )


def _of_columns(source: Path) -> Format:
    """Format of a text file by its header; two of our columns suffice for our own format."""
    with csv_table.text_lines(source) as lines:
        header = next((line for line in lines if not line.startswith("#")), "")
        if header.startswith(wigle.PREFIX):
            return WIGLE
        columns = csv_table.names_of(header)
    names = set(columns)
    if {"mac", "firstseen"} <= names:
        return WIGLE
    # country files of OpenCelliD have no header: they begin with the technology of a cell
    if {"radio", "net", "area", "cell"} <= names or header.partition(",")[0].upper() in {
        *RATS,
        "CDMA",
    }:
        raise RunFileError(
            f"{source} is a list of cells, not a walk; `postproc celldb import` reads it"
        )
    if {"mcc", "measured_at"} <= names:
        return OPENCELLID_CSV
    if {"devicetime", "latitude", "longitude"} <= names:
        return SURVEY_CSV
    if names >= drive_log.COLUMNS:
        return DRIVE_LOG
    if len(names & _OURS) >= 2:
        return WALK_CSV
    if len(columns) > 1:
        raise _unknown_format(source, f"a table with the columns {_short(', '.join(columns))}")
    raise _unknown_format(source, f"text that begins with {_short(header.strip())!r}")


def _unknown_format(source: Path, kind: str) -> RunFileError:
    return RunFileError(
        f"{source}: no format that can be imported; it looks like {kind}. Known are: {KNOWN}"
    )


def _kind_of(head: bytes) -> str:
    """In words, what a file that is no table and no database looks like by its first bytes."""
    if not head:
        return "an empty file"
    for magic, kind in _KINDS.items():
        if head.startswith(magic):
            return kind
    if head.startswith((b"<", b"[")):
        kind = "XML or HTML" if head.startswith(b"<") else "a JSON list"
        return f"{kind} that begins with {_short(head.split(b'>')[0].decode('utf-8', 'replace'))!r}"
    return f"a binary file that begins with {head[:8].hex(' ')}"


def _short(text: str) -> str:
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."
