"""Any table with levels, and positions or times, its columns found by name or named by the user.

This reads what QualiPoc, Nemo, TEMS and NetMonster export: users choose the columns there. Of the
words of a name, units and words such as "serving" are dropped; a technology ("LTE serving cell RSRP
(dBm)") is that of the level.
"""

import re
import unicodedata
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import Any

from logger.core.errors import ConfigError, RunFileError
from logger.core.types import Rat, Role
from postproc import csv_table
from postproc.interop import json_lines
from postproc.interop.contents import Contents, Format, look_at
from postproc.interop.sighting import (
    CODES,
    LEVEL_RANGE_DBM,
    POSITION_ALONE,
    RATS,
    ROW_NS,
    BadRow,
    Columns,
    Fields,
    Moment,
    NoCell,
    Row,
    Sighting,
    Transmitters,
    cell_identity,
    fix_of,
    integer,
    is_month_first,
    maybe,
    moment_of,
    number,
    parse_rows,
    text,
    whole_identity,
    with_whole_codes,
)

NAME = "CSV by column names"
# our names, which --columns takes, and what other programs call the same; `t_s` counts seconds from
# any start, and a table without `cid` may name its transmitters otherwise
_NAMES: dict[str, tuple[str, ...]] = {
    "time": (
        *("time", "timestamp", "datetime", "utctime", "gpstime", "timeutc", "devicetime"),
        *("zeit", "uhrzeit", "zeitstempel", "datumzeit", "datumuhrzeit", "heure", "horodatage"),
        *("dateheure", "hora", "fechahora", "datahora", "ora", "dataora", "tijd", "tijdstip"),
        *("datumtijd", "czas", "zaman", "время", "датавремя", "时间", "時間", "日時"),
    ),
    "lat": (
        *("lat", "latitude", "gpslat", "gpslatitude", "breite", "breitengrad", "latitud"),
        *("latitudine", "breedtegraad", "szerokosc", "bredde", "breddgrad", "breddegrad"),
        *("enlem", "широта", "纬度", "緯度"),
    ),
    "lon": (
        *("lon", "lng", "long", "longitude", "gpslon", "gpslongitude", "lange", "laenge"),
        *("langengrad", "laengengrad", "longitud", "longitudine", "lengtegraad", "długosc"),
        *("langd", "langdgrad", "lengdegrad", "længdegrad", "boylam", "долгота"),
        *("经度", "經度", "経度"),
    ),
    "place": (
        *(
            "latlon",
            "latlng",
            "latlong",
            "latitudelongitude",
            "location",
            "position",
            "gpslocation",
        ),
        *("gpsposition", "wkt", "geom", "geometry"),
    ),
    "ns": ("ns", "latref", "latituderef", "lathemisphere", "latdir"),
    "ew": ("ew", "lonref", "longituderef", "lonhemisphere", "londir"),
    "level": (
        *("level", "signal", "signalstrength", "dbm", "rssi", "power", "rxpower", "pegel"),
        *("signalpegel", "empfangspegel", "signalstarke", "signalstaerke", "niveau", "puissance"),
        *("niveausignal", "nivel", "nivelsenal", "potencia", "livello", "potenza", "signaal"),
        *("poziom", "sygnał", "уровень", "уровеньсигнала", "信号", "信号强度", "信号強度", "电平"),
    ),
    "rsrp": ("rsrp", "ssrsrp", "rsrprx"),
    "rscp": ("rscp",),
    "rxlev": ("rxlev", "rxlevel", "rxl"),
    "rat": (
        *("rat", "radio", "technology", "tech", "networktype", "nettype", "type", "system", "mode"),
        *("technik", "technologie", "netztyp", "netzart", "typereseau", "tecnologia", "tipored"),
        *("tiporete", "tiporede", "технология", "制式", "网络类型", "网络制式"),
    ),
    "mcc": ("mcc",),
    "mnc": ("mnc", "net"),
    "plmn": ("plmn", "mccmnc"),
    "area": ("lac", "tac", "lactac", "area", "areacode", "trackingareacode", "locationareacode"),
    "cid": (
        *("cid", "ci", "cellid", "eci", "nci", "cellidentity", "ecellid", "zellid", "zellenid"),
        *("idcellule", "idcelda", "idcella", "小区id"),
    ),
    "node": ("enb", "enbid", "enodeb", "enodebid", "rnc", "rncid", "gnb", "gnbid"),
    "sector": ("sector", "sectorid", "localid", "localcid"),
    "arfcn": ("arfcn", "bcch", "bccharfcn", "earfcn", "uarfcn", "narfcn", "nrarfcn", "channel"),
    "bsic": ("bsic",),
    "psc": ("psc", "scramblingcode", "scr", "primaryscramblingcode"),
    "pci": ("pci", "physicalid", "physicalcellid", "physicalidentity", "physicalcellidentity"),
    "ta": ("ta", "timingadvance"),
    "acc": (
        *("accuracy", "acc", "gpsaccuracy", "horizontalaccuracy", "genauigkeit", "precision"),
        *("precisione", "precisao", "nauwkeurigheid", "точность", "精度"),
    ),
    "alt": (
        *("alt", "altitude", "height", "gpsaltitude", "hohe", "hoehe", "altitud", "altitudine"),
        *("hoogte", "wysokosc", "высота", "海拔"),
    ),
    "cell": (),
    "t_s": ("ts", "t", "seconds", "secs", "elapsedseconds", "elapsedtime", "sekunden"),
    "serving": ("serving", "servingcell", "isserving", "registered", "isregistered"),
    "date": (
        *("date", "gpsdate", "utcdate", "day", "datum", "fecha", "data", "дата", "日期", "tarih"),
    ),
}


def _letters(name: str) -> str:
    # in lower case, without accents
    plain = unicodedata.normalize("NFKD", name.lower())
    return "".join(letter for letter in plain if not unicodedata.combining(letter))


_KNOWN = {_letters(name): ours for ours, names in _NAMES.items() for name in names}
_DROPPED = frozenset(
    {"serving", "serv", "pcell", "cell", "best", "active", "set", "sub", "full", "mean"}
    | {"avg", "average", "value", "top1", "dl", "hex", "kpi", "rf"}
)
# TEMS calls it All-Latitude Decimal Degree
_OF_DEGREES = frozenset({"all", "decimal", "degree", "degrees", "deg", "wgs84"})
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
# technologies that alone have what a name means
_STATES: dict[str, frozenset[Rat]] = {
    **dict.fromkeys(("rxlev", "rxlevel", "rxl", "bsic", "bcch"), frozenset({"GSM"})),
    **dict.fromkeys(("rscp", "uarfcn", "psc", "rnc", "rncid"), frozenset({"WCDMA"})),
    **dict.fromkeys(
        ("earfcn", "eci", "ecellid", "enb", "enbid", "enodeb", "enodebid"), frozenset({"LTE"})
    ),
    **dict.fromkeys(("narfcn", "nrarfcn", "nci", "ssrsrp", "gnb", "gnbid"), frozenset({"NR"})),
    **dict.fromkeys(("rsrp", "rsrprx", "tac", "pci"), frozenset({"LTE", "NR"})),
    "lac": frozenset({"GSM", "WCDMA"}),
}
_FEATURES = r'"features"\s*:\s*\['
_MOST_OBJECTS = 1000  # show which names those of a file have
_LEVELS = ("rsrp", "rscp", "rxlev", "level")
# programs with one such column write there what any technology has: the TAC as LAC
_LOOSE = frozenset({"area", "psc", "pci"})
_LEAST_WHOLE = 1 << 16  # smaller identities may be parts of others
_VAGUE = frozenset({"type", "system", "mode", "radio"})
"""Names that may mean something else than a technology."""
_UNIT = re.compile(r"\(.*?\)|\[.*?\]|[ _]dbm$")
_NO_DBM = re.compile(r"[(\[] *(?:asu|%|percent|raw|bars?|[munμ]?w|db ?[uμ]v.*?) *[)\]]")
_METRES = re.compile(r"[(\[] *m *[)\]]")
_FEET = re.compile(r"[(\[] *(?:ft|feet) *[)\]]")
_FOOT_M = 0.3048
_MILLI = re.compile(r"(?:[\W_]|^)(?:ms|msec|millis|milliseconds)(?=[\W_]|$)")
_MILLISECONDS = re.compile(r"\d{1,11}(?:\.\d*)?")
_WORD = re.compile(r"[^\W_]+")
_TECHNOLOGY_WORD = re.compile(r"[A-Z0-9.]+")
_HEX = re.compile(r"(?=.*[0-9])(?=.*[a-f])[0-9a-f]{3,9}", re.IGNORECASE)
# a BSIC in its two parts (3GPP TS 23.003 4.3.2), as TEMS writes it
_NCC_BCC = re.compile(r"([0-7]) ?[-/] ?([0-7])")
_PLMN = re.compile(r"(\d{3})[-/ _:]?(\d{2,3})(?:\.0)?")
_POINT = re.compile(
    r"(?:SRID=4326; *)?POINT *Z? *\( *([^ ,()]+) +([^ ,()]+)[^()]*\)", re.IGNORECASE
)
_ANGLE = re.compile(
    r"([NSEW]?) *(-?)(\d+(?:[.,]\d+)?) *([°º:]?)"
    r"(?: *(\d+(?:[.,]\d+)?) *(?:['’′:]|(?= |[NSEW]|$))(?: *(\d+(?:[.,]\d+)?) *(?:[\"”″]|'')?)?)?"
    r" *([NSEW]?)",
    re.IGNORECASE,
)
_CLOCK = re.compile(r"([01]?\d|2[0-3])([0-5]\d)([0-5]\d(?:\.\d*)?)")
_FEWEST_TIMES = 10  # different ones: of counted seconds some would be no times of day
_DAY_NS = 86_400 * 10**9
# of a column of times: so few since 1970 were in 1973, so they count from the start
_SECONDS = re.compile(r"\d{1,8}(?:\.\d*)?")
_DECIMAL_COMMA = re.compile(r"-?\d+,\d+")
_WITH_UNIT = re.compile(r"([-\u2212]?\d+(?:[.,]\d+)?)\s*(?:dBm?|m)?", re.IGNORECASE)
# of numbers that do not exist in the technology of a row
_FILLERS = frozenset({"", "0", "-1", "255", "65535", "2147483647"})
_NONE = frozenset({"-", "--", "n/a", "na", "nan", "null", "none"})
_ROLES: dict[str, Role] = {
    **dict.fromkeys(("true", "1", "yes", "y", "serving", "registered"), "serving"),
    **dict.fromkeys(("false", "0", "no", "n", "neighbour", "neighbor"), "neighbour"),
}
"""Another value may be the name of the serving cell."""
_TIMES = frozenset({"t_s", "time"})
_PLACE = frozenset({"lat", "lon", "place"})
_FIX = frozenset({*_TIMES, *_PLACE, "date", "ns", "ew", "acc", "alt"})
_MEASURED = frozenset({"level", "acc", "alt"})
_WHOLE = frozenset({"area", "cid", "arfcn", "bsic", "psc", "pci"})
_OF_CODE = frozenset({"bsic", "psc", "pci"})
_CODES = _OF_CODE | {"arfcn", "code"}
_OF_CELL_ITSELF = _CODES | {"area", "cid", "node", "sector", "ta", "cell"}

Column = tuple[str, str, frozenset[Rat]]
"""Our name, the name in the file, and the technologies that this name states."""


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
    is_ours = seen.has("rssi_dbm") and not seen.names.isdisjoint({"t_s", "time_utc"})
    if seen.kind not in {"text", "json"} or (seen.kind == "text" and is_ours):
        return False  # `walk_csv` names what is missing
    found = {ours for ours, _, _ in _columns(sorted(seen.names), {})}
    has_place = _has_place(found) or (_needs_track(found) and "cid" in found)
    return has_place and bool(found & set(_LEVELS))


def _has_place(found: set[str]) -> bool:
    return {"lat", "lon"} <= found or "place" in found


def _needs_track(found: set[str]) -> bool:
    return "time" in found and not found & _PLACE


def has_time(source: Path, chosen: Mapping[str, str]) -> bool:
    """Whether a file has a column of times; without one only the order of its rows counts."""
    return any(ours in _TIMES for ours, _, _ in _columns_of_file(source, chosen))


def read(source: Path, chosen: Mapping[str, str], *, times: bool = True) -> Iterator[Row]:
    """Rows of a table; `chosen` maps our names to columns that the user names.

    Raises `RunFileError` for a column that is not in the file, or without a position or a level.
    """
    all_columns = _columns_of_file(source, chosen)
    columns = tuple(column for column in all_columns if times or column[0] not in _TIMES)
    columns += _cell_numbers(source, columns)
    known = {ours for ours, _, _ in columns}
    clock = _column_of_clock(source, columns)
    month_first = _is_month_first(source, columns, clock)
    form = replace(_OURS, place=None) if _needs_track(known) else _OURS
    transmitters = None
    if not known & {"cid", "cell"} and not {"node", "sector"} <= known:
        used = {name for ours, name, _ in columns if ours not in {"node", "sector"}}
        others = [name for name in _names_of_file(source) if name not in used]
        transmitters = Transmitters(others, has_codes=bool(known & _CODES))
    sighting = partial(_sighting, source, form, columns, transmitters, month_first)
    found = parse_rows(_rows(source, clock), sighting)
    midnight = _midnight(source, columns, clock, month_first) if "time" in known else None
    yield from _in_two_days(found, *midnight) if midnight else found
    if transmitters is not None:
        transmitters.check(source)


def _cell_numbers(source: Path, columns: tuple[Column, ...]) -> tuple[Column, ...]:
    # a column `cell` with numbers, which with area and country are identities
    known, used = {ours for ours, _, _ in columns}, {name for _, name, _ in columns}
    if "cid" in known or "cell" in used or not {"mcc", "area"} <= known:
        return ()
    first = islice(_rows(source), _MOST_OBJECTS)
    values = [_plain(row[1].get("cell", "")) for row in first if not isinstance(row, BadRow)]
    are_numbers = any(values) and all(re.fullmatch(r"(\d+(\.0)?)?", one) for one in values)
    return (("cid", "cell", frozenset()),) if are_numbers else ()


def _column_of_clock(source: Path, columns: tuple[Column, ...]) -> str:
    # the column of times if all are times of day without colons, as GPS receivers print them;
    # numbers that count seconds come to 60 of a minute
    name = next((name for ours, name, _ in columns if ours == "time"), "")
    different, has_zero = set[str](), False
    for row in _rows(source) if name else ():
        if isinstance(row, BadRow) or not (value := _plain(row[1].get(name, ""))):
            continue
        if not _CLOCK.fullmatch(value):
            return ""
        has_zero = has_zero or value.startswith("0")
        if len(different) < _FEWEST_TIMES:
            different.add(value)
    return name if has_zero or len(different) == _FEWEST_TIMES else ""


def _is_month_first(source: Path, columns: tuple[Column, ...], clock: str) -> bool | None:
    named = {ours: name for ours, name, _ in columns if ours in {"date", "time"}}
    if "time" not in named:
        return None
    rows = (row[1] for row in _rows(source, clock) if not isinstance(row, BadRow))
    try:
        return is_month_first(
            " ".join(row.get(named[ours], "").strip() for ours in sorted(named)) for row in rows
        )
    except ValueError as why:
        if "date" in named:
            return None  # the time of day counts alone
        raise RunFileError(
            f"{source}: column {named['time']!r}: {why}: write them as 2024-05-14 09:00:00, or add "
            "--times none"
        ) from None


def _midnight(
    source: Path, columns: tuple[Column, ...], clock: str, month_first: bool | None
) -> tuple[int, bool] | None:
    # line where times of day without a date change to another day, and whether to the next; None
    # where that never happens, or more often than in rows that are ordered by time
    named = {ours: name for ours, name, _ in reversed(columns) if ours in {"date", "time"}}
    last_ns, found = None, None
    for row in _rows(source, clock):
        if isinstance(row, BadRow):
            continue
        line, raw = row
        fields = {ours: _plain(raw[name]) for ours, name in named.items()}
        try:
            moment = _moment(columns, line, fields, month_first=month_first)
        except ValueError:
            continue
        if moment.t_ns >= _DAY_NS or ":" not in fields["time"]:
            return None
        if last_ns is not None and 2 * abs(moment.t_ns - last_ns) > _DAY_NS:
            if found is not None:
                return None
            found = line, moment.t_ns < last_ns
        last_ns = moment.t_ns
    return found


def _in_two_days(rows: Iterator[Row], line: int, is_next: bool) -> Iterator[Row]:
    for row in rows:
        if isinstance(row, Sighting) and (row.line >= line) == is_next:
            yield replace(row, t_ns=row.t_ns + _DAY_NS)
        else:
            yield row


def _names_of_file(source: Path) -> list[str]:
    if (objects := _objects(source)) is None:
        return csv_table.names_of(csv_table.header_of(source)[1])
    first = islice(objects, _MOST_OBJECTS)
    return list(dict.fromkeys(n for row in first if not isinstance(row, BadRow) for n in row[1]))


def _objects(source: Path) -> Iterator[tuple[int, dict[str, str]] | BadRow] | None:
    seen = look_at(source)
    if seen.kind != "json":
        return None
    list_after = _FEATURES if seen.has("features") else r"\[" * seen.head.startswith("[")
    rows = json_lines.objects(source, list_after)
    flat = json_lines.named_values
    return (row if isinstance(row, BadRow) else (row[0], dict(flat(row[1]))) for row in rows)


def _rows(source: Path, clock: str = "") -> Iterator[tuple[int, dict[str, str]] | BadRow]:
    # with colons in a column of times of day
    for row in _rows_of_file(source):
        if clock and not isinstance(row, BadRow) and (found := _CLOCK.fullmatch(row[1][clock])):
            row[1][clock] = ":".join(found.groups())
        yield row


def _rows_of_file(source: Path) -> Iterator[tuple[int, dict[str, str]] | BadRow]:
    objects = _objects(source)
    if objects is None:
        yield from csv_table.rows(source)
        return
    nothing = dict.fromkeys(_names_of_file(source), "")
    for row in objects:
        yield row if isinstance(row, BadRow) else (row[0], nothing | row[1])


def _columns_of_file(source: Path, chosen: Mapping[str, str]) -> list[Column]:
    names = _names_of_file(source)
    for ours, name in chosen.items():
        if name.lower() not in names:
            raise RunFileError(f"{source} has no column {name!r} for {ours}; it has {names}")
    columns = _columns(names, chosen)
    found = {ours for ours, _, _ in columns}
    missing = [name for name in ("lat", "lon") if name not in found]
    if _has_place(found) or _needs_track(found):
        missing = []
    if missing or not found & set(_LEVELS):
        what = ", ".join([*missing, *(["level"] if not found & set(_LEVELS) else [])])
        raise RunFileError(
            f"{source}: no column is known to be {what}: name it with --columns; it has {names}"
        )
    return columns


def _columns(names: list[str], chosen: Mapping[str, str]) -> list[Column]:
    """What is known of each column; the first of several with one meaning and technology counts."""
    columns: dict[tuple[str, object], Column] = {}
    for ours, name in chosen.items():
        rats = _meaning(name)[2] if ours in _LEVELS else frozenset()
        columns[ours, rats] = (ours, name.lower(), rats)
    # "level" may be a number of bars, "net" a technology and "Länge" a length
    last = dict.fromkeys(("net", "länge", "laenge", "lange", "breite", "bredde", "längd"), 2)
    meant = sorted(
        map(_meaning, names),
        key=lambda column: last.get(column[1], column[0] == "level" and "dbm" not in column[1]),
    )
    for ours, name, rats in meant:
        if ours and ours not in chosen and not (ours in _LEVELS and set(chosen) & set(_LEVELS)):
            key = name if ours in {"rat", "mnc"} else rats
            columns.setdefault((ours, key), (ours, name, rats))
    found = list(columns.values())
    if {"lat", "lon"} <= {ours for ours, _, _ in found}:
        found = [column for column in found if column[0] != "place"]
    return found


def _meaning(name: str) -> Column:
    # ours is empty for what is not known
    plain = _letters(name)
    all_words = _WORD.findall(_UNIT.sub("", _MILLI.sub("", plain)))
    words = [word for word in all_words if word not in _OF_DEGREES]
    if "".join(words) in _NAMES["serving"]:
        return "serving", name, frozenset()
    kept = [word for word in words if word not in _DROPPED and word not in _TECHNOLOGIES]
    left = "".join(kept)
    left = f"cell{left}" if left in _OF_CELL and "cell" in words else left
    ours = _KNOWN.get(left) or _together(kept)
    rats = frozenset(_TECHNOLOGIES[word] for word in words if word in _TECHNOLOGIES)
    if not rats and (left in _STATES or all(word in _STATES for word in kept)):
        rats = frozenset().union(*(_STATES[word] for word in ([left] if left in _STATES else kept)))
    is_other = (
        (ours in _LEVELS and bool(_NO_DBM.search(plain)))
        or (ours == "ta" and bool(_METRES.search(plain)))
        or (ours not in _TIMES and bool(_MILLI.search(plain)))
        # the position of a station, not of the receiver
        or (ours in _FIX and kept != words)
        # the power of the carrier, which has no fixed relation to that of the cell
        or (left == "rssi" and bool(rats) and rats != {"GSM"})
    )
    return "" if is_other else ours, name, rats


def _together(words: list[str]) -> str:
    # "RSSI/RSRP" is a level, "PSC/PCI" a code
    meant = {_KNOWN.get(word, "") for word in words}
    if len(meant) == 1:
        return meant.pop()
    if meant and meant <= set(_LEVELS):
        own = meant - {"level"}
        return own.pop() if len(own) == 1 and "rssi" not in words else "level"
    return "code" if meant and meant <= _OF_CODE else ""


def _is_explicit(name: str) -> bool:
    return not _TECHNOLOGIES.keys().isdisjoint(_WORD.findall(_letters(name)))


def _is_vague(name: str) -> bool:
    return {word for word in _WORD.findall(_letters(name)) if word not in _DROPPED} <= _VAGUE


def _like(rat: Rat) -> Rat:
    return "LTE" if rat in {"LTE-M", "NB-IoT"} else rat


@cache
def _names_for(
    columns: tuple[Column, ...], rat: Rat | None, *, is_beside: bool = False
) -> dict[str, tuple[str, ...]]:
    # the columns of each of our names that may have the value of a technology, best first
    if is_beside:
        columns = tuple(one for one in columns if one[0] not in _OF_CELL_ITSELF or one[2] == {rat})
    names: dict[str, tuple[str, ...]] = {}
    for ours in dict.fromkeys(ours for ours, _, _ in columns):
        some = [(name, rats) for known, name, rats in columns if known == ours]
        fits = [name for name, rats in some if rat is None or _like(rat) in rats]
        fits += [name for name, rats in some if rat is not None and not rats]
        if not fits and ours in _LOOSE:
            fits = [name for name, _ in some if not _is_explicit(name)]
        names[ours] = tuple(fits)
    if rat is None:
        return names
    code = CODES.get(rat, "pci")
    codes = {name: names.pop(name, ()) for name in ("code", *_OF_CODE)}
    own = codes[code] + codes["code"]
    if code != "bsic":
        own = own or codes["psc"] + codes["pci"]
    return names | {code: own}


def _sighting(
    source: Path,
    form: Columns,
    columns: tuple[Column, ...],
    transmitters: Transmitters | None,
    month_first: bool | None,
    line: int,
    raw: Fields,
) -> Row:
    stated, other = _technology_in(columns, raw)
    hinted = frozenset[Rat]().union(
        *(
            rats
            for ours, name, rats in columns
            if len(rats) == 1
            and ours not in {*_LEVELS, *_LOOSE}
            and _plain(raw[name]).removesuffix(".0") not in _FILLERS
        )
    )
    level = _level(columns, raw, stated or hinted)
    if level is None:
        return _position(form, columns, month_first, line, raw)
    _, column, of_level = level
    rats = stated or of_level
    for more in (of_level, hinted):
        rats = rats & more or rats
    if of_level and other.isdecimal() and len(rats) > 1:
        rats = frozenset()  # Android and modems number the technologies differently
    elif of_level and other and not other.isdecimal():
        return NoCell(line, f"no technology of 2G to 5G is called {other[:40]!r}")
    elif stated and len(rats) > 1:
        return NoCell(line, f"its technology may be {' or '.join(sorted(rats))}")
    rat = "LTE" if len(rats) > 1 else next(iter(rats), None)
    fields: dict[str, Any] = {}
    # a telephone in 5G NSA names the cell of LTE, whose level may be missing
    is_beside = (
        rat == "NR"
        and not stated
        and any("LTE" in one[2] for one in columns if one != level and one[0] in _LEVELS)
    )
    for ours, names in _names_for(columns, rat, is_beside=is_beside).items():
        values = (_value(source, ours, name, raw) for name in names)
        if value := next((one for one in values if one and not _is_no_code(ours, one)), ""):
            fields[ours] = value
    fields |= {
        "rat": rat or "",
        "level": _value(source, "level", column, raw),
        "when": _moment(columns, line, fields, month_first=month_first),
        **_place(fields),
        **_network(fields),
        **_identity(fields, rat or next(iter(hinted), None)),
    }
    sighting = form.sighting(line, fields)
    if transmitters is None or not isinstance(sighting, Sighting):
        return sighting
    label = transmitters.name(raw, sighting.reading)
    return replace(sighting, reading=replace(sighting.reading, label=label))


def _is_no_code(ours: str, value: str) -> bool:
    return ours == "mnc" and bool(_technologies(value))


def _technology_in(columns: tuple[Column, ...], raw: Fields) -> tuple[frozenset[Rat], str]:
    # with what the row names that is no technology
    other = ""
    for ours, name, _ in columns:
        value = _plain(raw[name]) if ours in {"rat", "mnc"} else ""
        if rats := _technologies(value):
            return rats, ""
        if ours == "rat" and not _is_vague(name):
            other = other or value
    return frozenset(), other


@cache
def _technologies(value: str) -> frozenset[Rat]:
    # of "5G NSA", where LTE is the anchor, both
    if value.upper() in RATS:
        return frozenset({RATS[value.upper()]})
    words = _TECHNOLOGY_WORD.findall(value.upper())
    rats = {RATS[word] for word in words if word in RATS}
    return frozenset(rats | {"LTE"} if "NSA" in words and "NR" in rats else rats)


def _level(columns: tuple[Column, ...], raw: Fields, rats: frozenset[Rat]) -> Column | None:
    levels = [column for ours in _LEVELS for column in columns if column[0] == ours]
    if rats and (len(levels) > 1 or _is_explicit(levels[0][1])):
        # another level of the row is that of the carrier, or of another cell
        own = [column for column in levels if column[2] & {_like(rat) for rat in rats}]
        levels = own or [column for column in levels if not column[2]]
    elif not rats:
        levels = [column for column in levels if column[2]] or levels
    return next((column for column in levels if _plain(raw[column[1]])), None)


def _place(fields: Fields) -> dict[str, str]:
    if not fields.keys() & _PLACE:
        return {}
    lat, lon = text(fields, "lat"), text(fields, "lon")
    if "place" in fields:
        lat, lon = _pair(text(fields, "place"))
    sides = [text(fields, name).upper()[:1] for name in ("ns", "ew")]
    return {
        "lat": _degrees(lat, "lat", "NS", sides[0]),
        "lon": _degrees(lon, "lon", "EW", sides[1]),
    }


def _pair(place: str) -> list[str]:
    # of "48.1, 11.5" or POINT(11.5 48.1)
    if found := _POINT.fullmatch(place):
        return [found[2], found[1]]
    for separator in (";", ", ", ",", " "):
        if len(parts := place.strip("() ").split(separator)) == 2:
            return parts
    raise ValueError(f"no latitude and longitude: {place[:40]!r}")


def _degrees(value: str, name: str, letters: str, side: str) -> str:
    value = value.strip().replace("\u2212", "-")
    value = f"{value} {side}" if side and side in letters else value
    try:
        float(value.replace(",", "."))
    except ValueError:
        pass
    else:
        return value.replace(",", ".")
    found = _ANGLE.fullmatch(value)
    if not value or found is None:
        return value  # is no number, which the next reader says
    before, minus, degrees, mark, minutes, seconds, after = found.groups("")
    letter = (before + after).upper()
    numbers = [float(one.replace(",", ".") or 0) for one in (degrees, minutes, seconds)]
    is_whole = all(
        one.is_integer() for one, next_ in zip(numbers, (minutes, seconds), strict=False) if next_
    )
    if len(letter) > 1 or (letter and minus) or not (letter or mark == "°") or not is_whole:
        return value
    if letter and letter not in letters:
        raise ValueError(f"{name} is {value[:40]!r}: latitude and longitude swapped?")
    if max(numbers[1:]) >= 60.0:
        return value
    size = numbers[0] + numbers[1] / 60.0 + numbers[2] / 3600.0
    return repr(-size if minus or letter in {"S", "W"} else size)


def _network(fields: Fields) -> dict[str, str]:
    codes = {name: text(fields, name) for name in ("mcc", "mnc")}
    found = _PLMN.fullmatch(text(fields, "plmn"))
    return {"mcc": found[1], "mnc": found[2]} if found and not any(codes.values()) else codes


def _identity(fields: Fields, rat: Rat | None) -> dict[str, int | str]:
    rest = cell_identity(fields, "cid")
    if rest is None and "node" in fields:
        rest = integer(fields, "sector")
    if rest is None or rest >= _LEAST_WHOLE:
        return {} if rest is None else {"cid": rest}
    whole = whole_identity(rat and _like(rat), integer(fields, "node"), rest)
    return {"cid": "" if whole is None else whole}


def _position(
    form: Columns, columns: tuple[Column, ...], month_first: bool | None, line: int, raw: Fields
) -> Row:
    # without a level its position counts where it has one and a time
    fields: dict[str, Any] = {}
    for ours, name, _ in columns:
        if ours in _FIX and (value := _plain(raw[name])):
            fields.setdefault(ours, _measure(ours, name, value))
    if form.place is None or not fields.keys() & _TIMES or not fields.keys() & _PLACE:
        return NoCell(line, "no level")
    fields |= _place(fields)
    if not (fields["lat"] and fields["lon"]):
        return NoCell(line, "no level")
    moment = _moment(columns, line, fields, month_first=month_first)
    known = {"alt_m": maybe(fields, "alt"), "acc_m": maybe(fields, "acc", (0.0, 1e6)) or None}
    fix = fix_of(fields, "lat", "lon", moment.utc_ns, **known)
    return Sighting(line, moment.t_ns, fix, POSITION_ALONE)


def _moment(
    columns: tuple[Column, ...], line: int, fields: Fields, *, month_first: bool | None
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
        try:
            return Moment(round(number(fields, "t_s", (-1e9, 1e9)) * 1e9), is_utc=False)
        except ValueError:  # "ts" may be a timestamp
            return moment_of(text(fields, "t_s"), "t_s", month_first=month_first)
    return Moment(line * ROW_NS, is_utc=False)


def _role(fields: Fields) -> Role:
    return _ROLES.get(text(fields, "serving").lower(), "scan") if "serving" in fields else "scan"


def _value(source: Path, ours: str, name: str, raw: Fields) -> str:
    value = _plain(raw[name])
    if ours not in _WHOLE or not value:
        return _measure(ours, name, value)
    if ours == "bsic" and (parts := _NCC_BCC.fullmatch(value)):
        return str(8 * int(parts[1]) + int(parts[2]))
    if "hex" in name:
        return f"0x{value.removeprefix('0x')}"
    if _HEX.fullmatch(value):
        raise RunFileError(
            f"{source}: column {name!r} has hexadecimal numbers ({value}), of which some look "
            "decimal: write hex into its name, as in LAC (hex)"
        )
    return value


def _measure(ours: str, name: str, value: str) -> str:
    # without its unit, in metres and seconds
    if ours in _TIMES and _MILLI.search(_letters(name)) and _MILLISECONDS.fullmatch(value):
        return f"{float(value) / 1e3:.6f}"
    if ours not in _MEASURED or not (found := _WITH_UNIT.fullmatch(value)):
        return value
    plain = found[1].replace(",", ".").replace("\u2212", "-")
    return repr(float(plain) * _FOOT_M) if _FEET.search(name) else plain


def _plain(value: str) -> str:
    """A value without marks for "none", its decimal comma as a point."""
    value = value.strip()
    if value.lower() in _NONE:
        return ""
    return value.replace(",", ".") if _DECIMAL_COMMA.fullmatch(value) else value


def _level_dbm(fields: Fields, rat: Rat | None) -> float | None:
    level = maybe(fields, "level", (LEVEL_RANGE_DBM[0], 2.0**63))
    if level is not None and level >= 0.0 and rat is None:
        raise ValueError(
            f"level is {level:g}, and dBm of a receiver are negative: ASU, percent and numbers "
            "without their sign are not read"
        )
    return level


_OURS = Columns(
    needs_rat=False,
    when=lambda _, fields: fields["when"],
    level_dbm=_level_dbm,
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
