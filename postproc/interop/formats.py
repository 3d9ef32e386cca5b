"""The table of formats that are imported; each is recognised by what is in the file."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from logger.core.errors import RunFileError
from postproc.interop import (
    cellmapper,
    drive_log,
    gnettrack,
    kismet,
    named_columns,
    network_survey,
    opencellid,
    rayhunter,
    tower_collector,
    walk_csv,
    wigle,
)
from postproc.interop.contents import Contents, look_at, unknown_format
from postproc.interop.fields import RATS
from postproc.interop.sighting import Row

Recognise = Callable[[Contents], bool]


@dataclass(frozen=True, slots=True)
class Format:
    """A format that can be imported, how it is recognised, and what it calls its times.

    Without a name of times only the order of the rows counts. With `has_scans`, rows that follow
    each other at one time are one scan.
    """

    name: str
    read: Callable[[Path], Iterator[Row]]
    times: str
    is_it: Recognise
    has_scans: bool = False


def _of_text(*columns: str) -> Recognise:
    return lambda seen: seen.kind == "text" and seen.has(*columns)


def _of_json(*keys: str) -> Recognise:
    return lambda seen: seen.kind == "json" and seen.has(*keys)


def _is_ours(seen: Contents) -> bool:
    """Two of our columns suffice: the reader names those that are missing."""
    ours = {"t_s", "time_utc", "lat", "lon", "rssi_dbm", "rscp_dbm", "rsrp_dbm"}
    return seen.kind == "text" and len(seen.names & ours) >= 2


def _is_wigle(seen: Contents) -> bool:
    return seen.kind == "text" and (
        seen.head.startswith(wigle.PREFIX) or seen.has("mac", "firstseen")
    )


def _is_geopackage(seen: Contents) -> bool:
    tables = {name.lower() for name in network_survey.TABLES}
    return seen.kind == "tables" and bool(seen.names & tables)


_BY_NAMES: Callable[[Path], Iterator[Row]] = partial(named_columns.read, chosen={})

WALK_CSV = Format("CSV", walk_csv.read, "t_s or time_utc", _is_ours)

FORMATS = (
    Format("WiGLE CSV", wigle.read, "FirstSeen", _is_wigle),
    Format(
        "OpenCelliD measurements, CSV",
        opencellid.read_csv,
        "measured_at",
        _of_text("mcc", "measured_at"),
    ),
    Format(
        "OpenCelliD measurements, JSON",
        opencellid.read_json,
        "measured_at",
        _of_json("measurements"),
    ),
    Format("Tower Collector GPX or KML", tower_collector.read, "time", tower_collector.is_it),
    Format(
        "Network Survey CSV",
        network_survey.read_csv,
        "deviceTime",
        _of_text("devicetime", "latitude", "longitude"),
    ),
    Format("Network Survey GeoPackage", network_survey.read_geopackage, "Time", _is_geopackage),
    Format(
        "Network Survey messages, JSON",
        network_survey.read_messages,
        "deviceTime",
        _of_json("messagetype", "data"),
    ),
    Format(
        "Kismet log",
        kismet.read,
        "ts_sec",
        lambda seen: seen.kind == "tables" and seen.has("kismet", "data"),
    ),
    Format("G-NetTrack text", gnettrack.read_text, "Timestamp", gnettrack.is_text, has_scans=True),
    Format("G-NetTrack KML", gnettrack.read_kml, "TIME", gnettrack.is_kml, has_scans=True),
    Format("CellMapper CSV", cellmapper.read, "", cellmapper.is_it),
    Format("Rayhunter analysis, NDJSON", rayhunter.read, "packet_timestamp", rayhunter.is_it),
    Format("drive test CSV", drive_log.read, "t_s", _of_text(*drive_log.COLUMNS), has_scans=True),
    Format("CSV by column names", _BY_NAMES, "time", named_columns.is_it, has_scans=True),
    WALK_CSV,
)
"""The first that fits a file reads it: those with names that nobody else has come first."""


def recognise(source: Path, columns: Mapping[str, str] | None = None) -> Format:
    """Format of a file by its content, or the one that reads the `columns` named by the user.

    Raises `RunFileError` for a file that is none of them.
    """
    if columns:
        return _by_columns(source, columns)
    seen = look_at(source)
    if _is_cell_list(seen):
        raise RunFileError(
            f"{source} is a list of cells, not a walk; `postproc celldb import` reads those of "
            "OpenCelliD and Mozilla"
        )
    form = next((form for form in FORMATS if form.is_it(seen)), None)
    if form is None:
        raise unknown_format(source, seen.words)
    return _by_columns(source, {}) if form.read is _BY_NAMES else form


def _by_columns(source: Path, columns: Mapping[str, str]) -> Format:
    times = "time" if named_columns.has_time(source, columns) else ""
    read = partial(named_columns.read, chosen=columns)
    return Format("CSV by column names", read, times, named_columns.is_it, has_scans=bool(times))


def _is_cell_list(seen: Contents) -> bool:
    """Whether a text lists cells: country files of OpenCelliD and NTM files have no header.

    They begin with the technology of a cell. A walk of CellMapper does not.
    """
    first = seen.head.replace(";", ",").partition(",")[0].strip().upper()
    return seen.kind == "text" and (
        seen.has("radio", "net", "area", "cell") or first in {*RATS, "CDMA"}
    )
