"""Any table with levels, and positions or times, its columns found by name or named by the user.

This reads what QualiPoc, Nemo, TEMS and NetMonster export: users choose the columns there. Of the
words of a name, units and words such as "serving" are dropped; a technology ("LTE serving cell RSRP
(dBm)") is that of the level.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from logger.core.errors import ConfigError, RunFileError
from logger.core.types import Rat, Role
from postproc import csv_table
from postproc.interop.contents import Contents, Format
from postproc.interop.sighting import (
    LEVEL_RANGE_DBM,
    POSITION_ALONE,
    RATS,
    ROW_NS,
    Columns,
    Fields,
    Moment,
    NoCell,
    Row,
    Sighting,
    Transmitters,
    fix_of,
    integer,
    is_month_first,
    maybe,
    moment_of,
    number,
    parse_rows,
    text,
    with_whole_codes,
)

NAME = "CSV by column names"
_NAMES: dict[str, tuple[str, ...]] = {
    "time": ("time", "timestamp", "datetime", "utctime", "gpstime", "timeutc", "devicetime"),
    "lat": ("lat", "latitude", "gpslat", "gpslatitude"),
    "lon": ("lon", "lng", "long", "longitude", "gpslon", "gpslongitude"),
    "level": ("level", "signal", "signalstrength", "dbm", "rssi", "power", "rxpower"),
    "rsrp": ("rsrp", "ssrsrp", "rsrprx"),
    "rscp": ("rscp",),
    "rxlev": ("rxlev", "rxlevel", "rxl"),
    "rat": ("rat", "technology", "tech", "networktype", "nettype", "type", "system", "mode"),
    "mcc": ("mcc",),
    "mnc": ("mnc", "net"),
    "area": ("lac", "tac", "lactac", "area", "areacode", "trackingareacode", "locationareacode"),
    "cid": ("cid", "ci", "cellid", "eci", "nci", "cellidentity"),
    "arfcn": ("arfcn", "bcch", "bccharfcn", "earfcn", "uarfcn", "narfcn", "nrarfcn", "channel"),
    "bsic": ("bsic",),
    "psc": ("psc", "scramblingcode", "scr", "primaryscramblingcode"),
    "pci": ("pci", "physicalid", "physicalcellid", "physicalidentity", "physicalcellidentity"),
    "ta": ("ta", "timingadvance"),
    "acc": ("accuracy", "acc", "gpsaccuracy", "horizontalaccuracy"),
    "alt": ("alt", "altitude", "height", "gpsaltitude"),
    "cell": (),
    "t_s": ("ts", "t", "seconds", "secs", "elapsedseconds", "elapsedtime"),
    "serving": ("serving", "servingcell", "isserving", "registered", "isregistered"),
    "date": ("date", "gpsdate", "utcdate", "day"),
}
"""Our names, which --columns takes, and what other programs call the same.

`t_s` counts seconds from any start. A table without `cid` may name its transmitters otherwise.
"""

_DROPPED = frozenset(
    {"serving", "serv", "pcell", "cell", "best", "active", "set", "sub", "full", "ss", "mean"}
    | {"avg", "average", "value", "top1", "dl", "hex"}
)
_OF_CELL = frozenset({"id", "identity", "name"})
"""Words that mean something else without "cell"."""
_TECHNOLOGIES: dict[str, Rat] = {
    "gsm": "GSM",
    "2g": "GSM",
    "wcdma": "WCDMA",
    "umts": "WCDMA",
    "3g": "WCDMA",
    "lte": "LTE",
    "4g": "LTE",
    "nr": "NR",
    "5g": "NR",
}
_LEVELS: dict[str, Rat | None] = {"rsrp": "LTE", "rscp": "WCDMA", "rxlev": "GSM", "level": None}
_LEVEL_WORDS = frozenset({"rssi", "rxlev", "rscp", "rsrp"})  # "RSSI/RSRP": by the technology
_UNIT = re.compile(r"\(.*?\)|\[.*?\]|[ _]dbm$")
_WORD = re.compile(r"[a-z0-9]+")
_SECONDS = re.compile(r"\d{1,8}(?:\.\d*)?")
"""Of a column of times: so few since 1970 were in 1973, so they count from the start."""
_DECIMAL_COMMA = re.compile(r"-?\d+,\d+")
_WITH_UNIT = re.compile(r"([-\u2212]?\d+(?:[.,]\d+)?)\s*(?:dBm?|m)?", re.IGNORECASE)
_NONE = frozenset({"-", "--", "n/a", "na", "nan", "null", "none"})
_ROLES: dict[str, Role] = {
    **dict.fromkeys(("true", "1", "yes", "y", "serving", "registered"), "serving"),
    **dict.fromkeys(("false", "0", "no", "n", "neighbour", "neighbor"), "neighbour"),
}
"""Another value may be the name of the serving cell."""
_TIMES = frozenset({"t_s", "time"})
_FIX = frozenset({*_TIMES, "date", "lat", "lon", "acc", "alt"})
_MEASURED = frozenset({"level", "acc", "alt"})
_WHOLE = frozenset({"area", "cid", "arfcn", "bsic", "psc", "pci"})
_CODES = frozenset({"arfcn", "bsic", "psc", "pci"})

Column = tuple[str, str, Rat | None]
"""Our name, the name in the file, and the technology that this name states."""


def columns_of(text: str) -> dict[str, str]:
    """The option `--columns level=RSRP,lat=Y,...`: our names to those of the file.

    Raises `ConfigError`.
    """
    pairs = [part.partition("=") for part in text.split(",")]
    chosen = {name.strip().lower(): column.strip() for name, _, column in pairs}
    unknown = sorted(set(chosen) - set(_NAMES))
    if unknown or not all(chosen.values()):
        wrong = unknown[0] if unknown else next(name for name, value in chosen.items() if not value)
        raise ConfigError(
            f"--columns: {wrong!r} is not NAME=COLUMN with one of the names {', '.join(_NAMES)}"
        )
    return chosen


def is_it(seen: Contents) -> bool:
    """Whether a table has a level, and a position or a cell at a time, under names known."""
    if seen.kind != "text" or "rssi_dbm" in seen.names:
        return False  # `walk_csv` names what is missing
    found = {ours for ours, _, _ in _columns(sorted(seen.names), {})}
    has_place = {"lat", "lon"} <= found or (_needs_track(found) and "cid" in found)
    return has_place and bool(found & set(_LEVELS))


def _needs_track(found: set[str]) -> bool:
    return "time" in found and not found & {"lat", "lon"}


def has_time(source: Path, chosen: Mapping[str, str]) -> bool:
    """Whether a file has a column of times; without one only the order of its rows counts."""
    return any(ours in _TIMES for ours, _, _ in _columns_of_file(source, chosen))


def read(source: Path, chosen: Mapping[str, str], *, times: bool = True) -> Iterator[Row]:
    """Rows of a table; `chosen` maps our names to columns that the user names.

    Raises `RunFileError` for a column that is not in the file, or without a position or a level.
    """
    columns = _columns_of_file(source, chosen)
    columns = [column for column in columns if times or column[0] not in _TIMES]
    known = {ours for ours, _, _ in columns}
    month_first = _is_month_first(source, columns)
    form = replace(_OURS, place=None) if _needs_track(known) else _OURS
    if known & {"cid", "cell"}:
        sighting = partial(_sighting, form, columns, None, month_first)
        yield from parse_rows(csv_table.rows(source), sighting)
        return
    used = {name for _, name, _ in columns}
    others = [name for name in _names_of_file(source) if name not in used]
    transmitters = Transmitters(others, has_codes=bool(known & _CODES))
    sighting = partial(_sighting, form, columns, transmitters, month_first)
    yield from parse_rows(csv_table.rows(source), sighting)
    transmitters.check(source)


def _is_month_first(source: Path, columns: list[Column]) -> bool | None:
    named = {ours: name for ours, name, _ in columns if ours in {"date", "time"}}
    if "time" not in named:
        return None
    rows = (row for _, row in csv_table.rows(source))
    try:
        return is_month_first(
            " ".join(row[named[ours]].strip() for ours in sorted(named)) for row in rows
        )
    except ValueError as why:
        if "date" in named:
            return None  # the time of day counts alone
        raise RunFileError(
            f"{source}: column {named['time']!r}: {why}: write them as 2024-05-14 09:00:00, or add "
            "--times none"
        ) from None


def _names_of_file(source: Path) -> list[str]:
    return csv_table.names_of(csv_table.header_of(source)[1])


def _columns_of_file(source: Path, chosen: Mapping[str, str]) -> list[Column]:
    names = _names_of_file(source)
    for ours, name in chosen.items():
        if name.lower() not in names:
            raise RunFileError(f"{source} has no column {name!r} for {ours}; it has {names}")
    columns = _columns(names, chosen)
    found = {ours for ours, _, _ in columns}
    missing = [name for name in ("lat", "lon") if name not in found and not _needs_track(found)]
    if missing or not found & set(_LEVELS):
        what = ", ".join([*missing, *(["level"] if not found & set(_LEVELS) else [])])
        raise RunFileError(
            f"{source}: no column is known to be {what}: name it with --columns; it has {names}"
        )
    return columns


def _columns(names: list[str], chosen: Mapping[str, str]) -> list[Column]:
    """What is known of each column; the first of several with one meaning and technology counts."""
    columns: dict[tuple[str, Rat | None], Column] = {}
    for ours, name in chosen.items():
        columns[ours, None] = (ours, name.lower(), _meaning(name)[1])
    for name in names:
        key, rat = _meaning(name)
        ours = next((ours for ours, known in _NAMES.items() if key in known), "")
        if ours and ours not in chosen and not (ours in _LEVELS and set(chosen) & set(_LEVELS)):
            columns.setdefault((ours, rat), (ours, name, rat))
    return list(columns.values())


def _meaning(name: str) -> tuple[str, Rat | None]:
    words = _WORD.findall(_UNIT.sub("", name.lower()))
    if "".join(words) in _NAMES["serving"]:
        return "serving", None
    rat = next((_TECHNOLOGIES[word] for word in words if word in _TECHNOLOGIES), None)
    kept = [word for word in words if word not in _DROPPED and word not in _TECHNOLOGIES]
    left = "level" if len(kept) > 1 and _LEVEL_WORDS.issuperset(kept) else "".join(kept)
    return f"cell{left}" if left in _OF_CELL and "cell" in words else left, rat


def _sighting(
    form: Columns,
    columns: list[Column],
    transmitters: Transmitters | None,
    month_first: bool | None,
    line: int,
    raw: Fields,
) -> Row:
    level = _level(columns, raw)
    if level is None:
        return _position(form, columns, month_first, line, raw)
    column, rat = level
    fields: dict[str, Any] = {
        ours: _value(ours, name, raw)
        for ours, name, own in columns
        if (own is None or rat is None or own == rat) and _plain(raw[name])
    }
    if text(fields, "rat").upper() not in RATS:
        fields["rat"] = rat or ""
    fields |= {
        "level": _value("level", column, raw),
        "when": _moment(columns, line, fields, month_first=month_first),
    }
    sighting = form.sighting(line, fields)
    if transmitters is None or not isinstance(sighting, Sighting):
        return sighting
    label = transmitters.name(raw, sighting.reading)
    return replace(sighting, reading=replace(sighting.reading, label=label))


def _position(
    form: Columns, columns: list[Column], month_first: bool | None, line: int, raw: Fields
) -> Row:
    # without a level its position counts where it has one and a time
    fields = {ours: _value(ours, name, raw) for ours, name, _ in columns if ours in _FIX}
    if form.place is None or not fields.keys() & _TIMES or not (fields["lat"] and fields["lon"]):
        return NoCell(line, "no level")
    moment = _moment(columns, line, fields, month_first=month_first)
    known = {"alt_m": maybe(fields, "alt"), "acc_m": maybe(fields, "acc", (0.0, 1e6)) or None}
    fix = fix_of(fields, "lat", "lon", moment.utc_ns, **known)
    return Sighting(line, moment.t_ns, fix, POSITION_ALONE)


def _level(columns: list[Column], raw: Fields) -> tuple[str, Rat | None] | None:
    for ours, default in _LEVELS.items():
        for own, name, rat in columns:
            if own == ours and _plain(raw[name]):
                return name, rat or default
    return None


def _moment(
    columns: list[Column], line: int, fields: Fields, *, month_first: bool | None
) -> Moment:
    known = {ours for ours, _, _ in columns} & _TIMES
    if "time" in known:
        time = text(fields, "time")
        if _SECONDS.fullmatch(time):
            return Moment(round(float(time) * 1e9), is_utc=False)
        try:  # a date of its own column belongs to a time of day
            return moment_of(f"{text(fields, 'date')} {time}", "time", month_first=month_first)
        except ValueError:
            return moment_of(time, "time", month_first=month_first)
    if known:
        return Moment(round(number(fields, "t_s", (-1e9, 1e9)) * 1e9), is_utc=False)
    return Moment(line * ROW_NS, is_utc=False)


def _role(fields: Fields) -> Role:
    return _ROLES.get(text(fields, "serving").lower(), "scan") if "serving" in fields else "scan"


def _value(ours: str, name: str, raw: Fields) -> str:
    # of a measured value without its unit, of a hexadecimal one with 0x
    value = _plain(raw[name])
    if ours in _MEASURED and (found := _WITH_UNIT.fullmatch(value)):
        return found[1].replace(",", ".").replace("\u2212", "-")
    is_hex = "hex" in name and value and ours in _WHOLE
    return f"0x{value.removeprefix('0x')}" if is_hex else value


def _plain(value: str) -> str:
    """A value without marks for "none", its decimal comma as a point."""
    value = value.strip()
    if value.lower() in _NONE:
        return ""
    return value.replace(",", ".") if _DECIMAL_COMMA.fullmatch(value) else value


_OURS = Columns(
    needs_rat=False,
    when=lambda _, fields: fields["when"],
    level_dbm=lambda fields, _: maybe(fields, "level", LEVEL_RANGE_DBM),
    role=_role,
    alt_m=("alt",),
    acc_m=("acc",),
    area=("area",),
    ta=("ta",),
    more=lambda fields, _: {
        **{name: integer(fields, name) for name in ("bsic", "psc", "pci")},
        "label": with_whole_codes(text(fields, "cell")) or None,
    },
)


def format_of(source: Path, chosen: Mapping[str, str], *, times: bool = True) -> Format:
    """The format that reads a file with the `chosen` columns.

    Without `times` those of the file do not count.
    """
    named = "time" if times and has_time(source, chosen) else ""
    rows = partial(read, chosen=chosen, times=times)
    return Format(NAME, rows, named, is_it, has_scans=bool(named))


IMPORTS = (Format(NAME, partial(read, chosen={}), "time", is_it, has_scans=True, is_general=True),)
