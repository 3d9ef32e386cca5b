"""Values of a row by name, as text (CSV) or numbers (JSON, SQLite); None where unknown."""

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, get_args

from logger.core.geo import check_position
from logger.core.types import CellReading, Fix, Rat, Role

Fields = Mapping[str, Any]

LEVEL_RANGE_DBM = (-200.0, 50.0)
_UNKNOWN = (2**31 - 1, 2**63 - 1)
"""CellInfo.UNAVAILABLE and UNAVAILABLE_LONG of Android, which apps write unchanged."""
_LARGEST = 2**31 - 2
_LARGEST_CID = 2**36 - 1
"""NR cell identity: 36 bit (3GPP TS 38.413 9.3.1.7)."""

_NAMES: dict[Rat, tuple[str, ...]] = {
    "GSM": ("2G", "GPRS", "EDGE"),
    "WCDMA": ("3G", "UMTS", "HSPA", "HSPA+", "HSPAP", "HSDPA", "HSUPA"),
    "LTE": ("4G", "LTE+", "LTE_CA", "LTE-A"),
    "NR": ("5G", "NR5G", "NR5G-SA", "NR5G-NSA", "NRNSA", "NR_SA", "NR_NSA"),
}
RATS: dict[str, Rat] = {rat.upper(): rat for rat in get_args(Rat)} | {
    n: rat for rat, ns in _NAMES.items() for n in ns
}


_ASU_MOST = {"GSM": 31, "LTE": 97, "NR": 97}
_LAST_DAY = 100_000
"""Days since 1970, the year 2243: nanoseconds still fit into 64 bit."""


def text(fields: Fields, *names: str) -> str:
    """First value among `names` that is not empty, "" without one."""
    for name in names:
        value = fields.get(name)
        if value is not None and (value_text := str(value).strip()):
            return value_text
    return ""


def number(fields: Fields, name: str, limits: tuple[float, float] = (-1e12, 1e12)) -> float:
    """Finite number within limits; raises ValueError."""
    value_text = text(fields, name)
    if not value_text:
        raise ValueError(f"{name} is empty")
    try:
        value = float(value_text)
    except ValueError:
        raise ValueError(f"{name} is no number: {value_text[:40]!r}") from None
    if not (math.isfinite(value) and limits[0] <= value <= limits[1]):
        raise ValueError(f"{name} is out of range: {value_text[:40]}")
    return value


def maybe(fields: Fields, name: str, limits: tuple[float, float] = (-1e12, 1e12)) -> float | None:
    """As `number`, None for an empty or absent value."""
    return number(fields, name, limits) if text(fields, name) else None


def integer(fields: Fields, *names: str, largest: int = _LARGEST) -> int | None:
    """Integer from 0; None where it is empty or a mark: negative, or the largest there is."""
    value_text = text(fields, *names)
    if not value_text:
        return None
    try:
        value = int(value_text.removesuffix(".0"))
    except ValueError:
        raise ValueError(f"{names[0]} is no integer: {value_text[:40]!r}") from None
    if value < 0 or value in _UNKNOWN:
        return None
    if value > largest:
        raise ValueError(f"{names[0]} is out of range: {value_text[:40]}")
    return value


def cell_identity(fields: Fields, *names: str) -> int | None:
    """Cell identity of any technology."""
    return integer(fields, *names, largest=_LARGEST_CID)


def level_of(fields: Fields, column: str, rat: Rat) -> float:
    """Level in dBm of a column that has dBm if it is negative, else Android's ASU of `rat`.

    Raises ValueError where the level is not known. Sources: 3GPP TS 27.007 8.5 (GSM),
    CellSignalStrengthLte and -Nr of Android; of WCDMA two scales exist, so none is read.
    """
    signal = number(fields, column, (LEVEL_RANGE_DBM[0], 2.0**31))
    if signal < 0:
        return signal
    if signal > _ASU_MOST.get(rat, -1):
        raise ValueError(f"{column} {signal:.0f} is no level of {rat}")
    return 2.0 * signal - 113.0 if rat == "GSM" else signal - 140.0


def plmn(fields: Fields) -> tuple[str | None, str | None]:
    """Country and network code with their digits; both or none."""
    mcc, mnc = network_code(fields, "mcc", 3), network_code(fields, "mnc", 2)
    return (None, None) if mcc is None or mnc is None else (mcc, mnc)


def network_code(fields: Fields, name: str, fewest_digits: int) -> str | None:
    """Code of a country or a network; one with too few digits has lost its zeros in a table."""
    code = integer(fields, name, largest=999)
    if code is None:
        return None
    n_digits = len(text(fields, name).removesuffix(".0"))  # 020 is not 20
    return f"{code:0{max(n_digits, fewest_digits)}d}"


def is_plmn(mcc: str | None, mnc: str | None) -> bool:
    """Whether the codes of country and network are numbers, as other programs take them to be."""
    return all(code is not None and code.isascii() and code.isdecimal() for code in (mcc, mnc))


def reading_of(
    rat: Rat | None, role: Role, level_dbm: float | None, area: int | None, **values: Any
) -> CellReading:
    """A reading with its level and its area code where the technology, if known, has them."""
    level = {None: "rssi_dbm", "GSM": "rssi_dbm", "WCDMA": "rscp_dbm"}.get(rat, "rsrp_dbm")
    code = "lac" if rat in {None, "GSM", "WCDMA"} else "tac"
    return CellReading(role, rat, **{level: level_dbm, code: area} | values)


def fix_of(fields: Fields, lat: str, lon: str, utc_ns: int | None, **values: float | None) -> Fix:
    """A fix; raises `GeoError` for no position, ValueError for 0, 0, written without a fix."""
    lat_deg, lon_deg = number(fields, lat), number(fields, lon)
    check_position(lat_deg, lon_deg)
    if lat_deg == lon_deg == 0.0:
        raise ValueError("the position is 0, 0: there was no fix")
    return Fix(True, utc_ns=utc_ns, lat_deg=lat_deg, lon_deg=lon_deg, **values)  # type: ignore[arg-type]


def utc_ns_of(time: str, name: str) -> int:
    """Nanoseconds since 1970 of an ISO 8601 time, UTC where it names no zone; raises ValueError."""
    try:
        when = datetime.fromisoformat(time)
    except ValueError:
        raise ValueError(f"{name} is no ISO 8601 time: {time[:40]!r}") from None
    if when.tzinfo is None:
        when = when.replace(tzinfo=UTC)
    return ns_since_1970(when, name)


def ns_since_1970(when: datetime, name: str) -> int:
    """Nanoseconds since 1970 of a time with a zone; raises ValueError outside of 1970 to 2243."""
    since = when - datetime(1970, 1, 1, tzinfo=UTC)
    if not 0 <= since.days < _LAST_DAY:
        raise ValueError(f"{name} is no time of a walk: {when.isoformat()!r}")
    return ((since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds) * 1000
