"""A row of any third-party format: one cell received at one position, by names of its values."""

import marshal
import math
import re
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from dataclasses import fields as fields_of
from datetime import UTC, datetime
from operator import attrgetter
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, TypeVar, get_args

import numpy as np

from logger.core.arrays import BoolArray, IntArray
from logger.core.cell_names import channel_name, identity_of, mnc_digits
from logger.core.errors import GeoError, RunFileError
from logger.core.places import Places, Track, check_position, fix_sigma_m
from logger.core.rows import channels_of
from logger.core.types import (
    Broadcast,
    CellReading,
    Fix,
    Rat,
    Role,
    area_marks,
    identity_bits,
    identity_marks,
    utc_text,
)
from postproc import csv_table

Source = TypeVar("Source")
REMARK = "remark"
"""Code of the note of a warning."""


# in place of a reading: many loggers write a position each second and levels less often
POSITION_ALONE = CellReading("scan", None)


@dataclass(frozen=True, slots=True)
class Sighting:
    """One cell received at one position, or a position of the walker alone.

    `line` is the number of the line, row or record, `t_ns` gives the order in time; `fix.utc_ns` is
    None where the file has no UTC, and `fix.valid` is False where it has no position. `receiver`
    tells the receivers of one modem apart.
    """

    line: int
    t_ns: int
    fix: Fix
    reading: CellReading
    receiver: int = 0

    @property
    def is_position(self) -> bool:
        return self.reading == POSITION_ALONE

    @property
    def lat_deg(self) -> float:
        return _number_of(self.fix.lat_deg)

    @property
    def lon_deg(self) -> float:
        return _number_of(self.fix.lon_deg)

    @property
    def rssi_dbm(self) -> float:
        """Level, whatever the technology calls it."""
        return _number_of(self.reading.level_dbm)


@dataclass(frozen=True, slots=True)
class BadRow:
    """A row that could not be used, and why."""

    line: int
    why: str


@dataclass(frozen=True, slots=True)
class NoCell:
    """Rows about something else: Wi-Fi, Bluetooth, a technology without a 3GPP cell identity."""

    line: int
    why: str = "no cell"
    n: int = 1


@dataclass(frozen=True, slots=True)
class Remark:
    """What another program noticed at a time, for example a warning; `code` is that of its note."""

    line: int
    utc_ns: int
    text: str
    code: str = REMARK


Row = Sighting | BadRow | NoCell | Remark
Parsed = Row | Sequence[Row] | None


def parse_rows(
    rows: Iterable[tuple[int, Source] | BadRow], parse: Callable[[int, Source], Parsed]
) -> Iterator[Row]:
    """Parsed rows with line numbers; `parse` returns None for no cell, raises for bad rows."""
    for row in rows:
        if isinstance(row, BadRow):
            yield row
            continue
        line, fields = row
        if isinstance(fields, dict) and (many := fields.get(csv_table.TOO_MANY)):
            why = "a text with the separator needs quotation marks, a column a name in the header"
            yield BadRow(line, f"{many} for {len(fields) - 1} columns: {why}")
            continue
        try:
            parsed = parse(line, fields)
        except (ValueError, GeoError) as error:
            yield BadRow(line, str(error))
        except RecursionError:
            yield BadRow(line, "its values are nested too deeply")
        else:
            yield from parsed if isinstance(parsed, Sequence) else [parsed or NoCell(line)]


def _number_of(value: float | None) -> float:
    if value is None:
        raise TypeError("a sighting has a position and a level")
    return value


_READING = [f.name for f in fields_of(CellReading) if f.name not in {"broadcast", "more"}]
_VALUES_OF = {
    kind: attrgetter(*names)
    for kind, names in (
        (Fix, [f.name for f in fields_of(Fix)]),
        (Broadcast, [f.name for f in fields_of(Broadcast)]),
        (CellReading, _READING),
    )
}


class SightingFile:
    """Sightings, at first in the order in which they came; in memory are 57 bytes of each.

    The file has no name and goes with the object. Raises OSError where it cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self._file = TemporaryFile(dir=folder)  # noqa: SIM115 (closed with this object)
        self._at = array("q", [0])
        self._t_ns, self._hashes = array("q"), array("q")
        self._place, self._is_position = array("d"), array("b")
        self._order: IntArray | None = None

    def close(self) -> None:
        """Remove the file."""
        with suppress(OSError):  # what a full disk did not take is not wanted
            self._file.close()

    def append(self, one: Sighting) -> None:
        """Add a sighting behind the others, before anything is asked."""
        fix, reading = one.fix, one.reading
        broadcast = _VALUES_OF[Broadcast](reading.broadcast) if reading.broadcast else None
        known = _VALUES_OF[Fix](fix), _VALUES_OF[CellReading](reading), broadcast
        data = marshal.dumps((one.line, one.t_ns, *known, one.receiver))
        self._file.write(data)
        self._at.append(self._at[-1] + len(data))
        self._t_ns.append(one.t_ns)
        self._hashes.append(hash((one.t_ns, fix, reading)))
        self._is_position.append(one.is_position)
        if fix.valid:
            sigma_m = fix_sigma_m(fix.acc_m, fix.hdop, fix.quality)
            self._place.extend((one.lat_deg, one.lon_deg, sigma_m))

    def __len__(self) -> int:
        return len(self._t_ns if self._order is None else self._order)

    def __iter__(self) -> Iterator[Sighting]:
        self._file.flush()
        for i in self._order_of_rows().tolist():
            yield self._read(i)

    @property
    def n_positions(self) -> int:
        """How many are a position alone."""
        is_position = np.frombuffer(self._is_position, np.int8)
        return int(np.count_nonzero(is_position[self._order_of_rows()]))

    def leave_out_repeated(self) -> None:
        """Keep one of equal sightings, the last."""
        order = self._order_of_rows()
        hashes = np.frombuffer(self._hashes, np.int64)[order]
        by_hash = np.argsort(hashes, kind="stable")
        same = np.flatnonzero(np.diff(hashes[by_hash]) == 0)
        keep: BoolArray = np.ones(len(order), np.bool_)
        self._file.flush()
        for i in same.tolist():
            one, next_ = (int(order[by_hash[k]]) for k in (i, i + 1))
            if self._key(one) == self._key(next_):  # hashes may be equal by chance
                keep[by_hash[i]] = False
        self._order = order[keep]

    def leave_out_before(self, t_ns: int) -> int:
        """Leave out those before a time if there are any after it; how many were left out."""
        order = self._order_of_rows()
        is_after = np.frombuffer(self._t_ns, np.int64)[order] >= t_ns
        if not np.any(is_after):
            return 0
        self._order = order[is_after]
        return int(np.count_nonzero(~is_after))

    def span_ns(self) -> tuple[int, int]:
        """First and last time of those that are left, at least one."""
        t_ns = np.frombuffer(self._t_ns, np.int64)[self._order_of_rows()]
        return int(t_ns.min()), int(t_ns.max())

    def sort_by_time(self) -> bool:
        """Sort them, those of one time as they came; whether they were out of order."""
        order = self._order_of_rows()
        t_ns = np.frombuffer(self._t_ns, np.int64)[order]
        if np.all(np.diff(t_ns) >= 0):
            return False
        self._order = order[np.argsort(t_ns, kind="stable")]
        return True

    def track(self) -> Track:
        """Positions, which all have, each once at a time; raises `GeoError` outside of UTM."""
        order = self._order_of_rows()
        t_ns = np.frombuffer(self._t_ns, np.int64)[order]
        place = np.frombuffer(self._place).reshape(-1, 3)[order]
        _, first = np.unique(np.column_stack([t_ns, place]), axis=0, return_index=True)
        first.sort()
        lat_deg, lon_deg, sigma_m = place[first].T
        at = Places.of_degrees(lat_deg, lon_deg)
        seq = np.arange(len(first))
        return Track(at.x_m, at.y_m, at.z_m, sigma_m, t_ns[first], at.utm, seq=seq)

    def _order_of_rows(self) -> IntArray:
        if self._order is None:
            self._order = np.arange(len(self._t_ns))
        return self._order

    def _key(self, i: int) -> tuple[object, ...]:
        one = self._read(i)
        return one.t_ns, one.fix, one.reading

    def _read(self, i: int) -> Sighting:
        self._file.seek(self._at[i])
        data = self._file.read(self._at[i + 1] - self._at[i])
        values = marshal.loads(data)  # noqa: S302 (written above)
        line, t_ns, fix, reading, broadcast, receiver = values
        more = dict(zip(_READING, reading, strict=True))
        if broadcast is not None:
            more["broadcast"] = Broadcast(*broadcast)
        return Sighting(line, t_ns, Fix(*fix), CellReading(**more), receiver)


# --- values by name ---

Fields = Mapping[str, Any]

LEVEL_RANGE_DBM = (-200.0, 50.0)
"""Any receiver: from far below the noise to beside a strong transmitter."""
_UNKNOWN = (2**31 - 1, 2**63 - 1)
"""CellInfo.UNAVAILABLE and UNAVAILABLE_LONG of Android, which apps write unchanged."""
_LARGEST = 2**31 - 2
_LARGEST_CID = 2**36 - 1
"""NR cell identity: 36 bit (3GPP TS 38.413 9.3.1.7)."""

_NAMES: dict[Rat, tuple[str, ...]] = {
    "GSM": ("2G", "GPRS", "EDGE"),
    "WCDMA": ("3G", "UMTS", "HSPA", "HSPA+", "HSPAP", "HSDPA", "HSUPA"),
    "LTE": ("4G", "LTE+", "LTE_CA", "LTE-A", "EUTRAN", "E-UTRAN", "EUTRA", "E-UTRA"),
    "NR": ("5G", "NR5G", "NR5G-SA", "NR5G-NSA", "NRNSA", "NR_SA", "NR_NSA"),
    "LTE-M": ("LTEM", "EMTC", "CAT-M", "CAT-M1"),
    "NB-IoT": ("NBIOT", "CAT-NB1", "CAT-NB2", "NB1", "NB2"),
}
RATS: dict[str, Rat] = {rat.upper(): rat for rat in get_args(Rat)} | {
    n: rat for rat, ns in _NAMES.items() for n in ns
}


_ASU_MOST = {"GSM": 31, "LTE": 97, "NR": 97}
_LAST_DAY = 100_000  # since 1970, the year 2243: nanoseconds still fit into 64 bit


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
        is_hex = value_text[:2] in {"0x", "0X"}
        value = int(value_text, 16) if is_hex else int(value_text.removesuffix(".0"))
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


# bits of the identity below the node (3GPP TS 23.003 4.3, TS 36.413 9.2.1.38)
_NODE_BITS: dict[Rat, int] = {"WCDMA": 16, "LTE": 8}
_LEAST_NCI = 1 << 14  # of NR 4 to 14 bits (TS 38.413 9.3.1.6): which, only the network knows


def whole_identity(rat: Rat | None, node: int | None, rest: int | None) -> int | None:
    """Complete identity from node and rest; a number that needs no node is complete already."""
    if rat == "NR" and node and rest is not None and rest < _LEAST_NCI:
        return None
    bits = None if rat is None else _NODE_BITS.get(rat)
    if rest is None or not node or bits is None or rest >> bits:
        return rest
    return node << bits | rest


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
    mcc, mnc = half_plmn(fields)
    return (None, None) if mcc is None or mnc is None else (mcc, mnc)


def half_plmn(fields: Fields) -> tuple[str | None, str | None]:
    """As `plmn`, each by itself."""
    mcc = _network_code(fields, "mcc", 3)
    return mcc, _network_code(fields, "mnc", (mnc_digits(mcc) if mcc else None) or 2)


def _network_code(fields: Fields, name: str, fewest_digits: int) -> str | None:
    """Code of a country or a network; one with too few digits has lost its zeros in a table."""
    code = integer(fields, name, largest=999)
    if code is None or (name == "mcc" and code == 0):
        return None  # no country has zeros, and apps write them for none
    n_digits = len(text(fields, name).removesuffix(".0"))  # 020 is not 20
    return f"{code:0{max(n_digits, fewest_digits)}d}"


def with_whole_codes(name: str) -> str:
    """A cell's name with the zeros of its network code."""
    mcc, *rest = name.split("-")
    if len(mcc) != 3 or identity_of(name) is None:
        return name
    mnc = half_plmn({"mcc": mcc, "mnc": rest[0]})[1]
    return name if mnc is None else "-".join([mcc, mnc, *rest[1:]])


def is_plmn(mcc: str | None, mnc: str | None) -> bool:
    """Whether the codes of country and network are numbers, as other programs take them to be."""
    return all(code is not None and code.isascii() and code.isdecimal() for code in (mcc, mnc))


def reading_of(
    rat: Rat | None, role: Role, level_dbm: float | None, area: int | None, **values: Any
) -> CellReading:
    """A reading with its level and its area code where the technology, if known, has them."""
    level = {None: "rssi_dbm", "GSM": "rssi_dbm", "WCDMA": "rscp_dbm"}.get(rat, "rsrp_dbm")
    code = "lac" if rat in {None, "GSM", "WCDMA"} else "tac"
    return with_name(CellReading(role, rat, **{level: level_dbm, code: area} | values))


def with_name(reading: CellReading) -> CellReading:
    """The reading without codes that mean no area or no cell, and with a name if it has none.

    The name has question marks for missing parts of the identity: many telephones leave out the
    network code, and without a name the level would be lost.
    """
    is_nr = reading.rat == "NR"
    if {reading.lac, reading.tac} & area_marks(24 if is_nr else 16):
        reading = replace(reading, lac=None, tac=None)
    if reading.cid in identity_marks(identity_bits(reading.rat)):
        reading = replace(reading, cid=None)
    if reading.cid is None or reading.cell is not None:
        return reading
    area = reading.tac if reading.lac is None else reading.lac
    parts = (reading.mcc, reading.mnc, area, reading.cid)
    return replace(reading, label="-".join("?" if part is None else str(part) for part in parts))


def fix_of(fields: Fields, lat: str, lon: str, utc_ns: int | None, **values: float | None) -> Fix:
    """A fix; raises `GeoError` for no position, ValueError for 0, 0, written without a fix."""
    lat_deg, lon_deg = number(fields, lat), number(fields, lon)
    check_position(lat_deg, lon_deg)
    if lat_deg == lon_deg == 0.0:
        raise ValueError("the position is 0, 0: there was no fix")
    return Fix(
        True,
        utc_ns=utc_ns,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        **values,  # type: ignore[arg-type]
    )


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


DEFAULT_CELL = "target"  # the only cell of a table that names none
_TRANSMITTERS = (
    *("cell", "bssid", "mac", "macaddress", "transmitter", "transmitterid", "txid", "beacon"),
    *("beaconid", "beaconuuid", "gateway", "gatewayid", "gatewayeui", "gateweui", "gtwid", "gweui"),
    *("gw", "gwid", "eui", "basestation", "basestationid", "bts", "btsid", "cellname", "sitename"),
    *("cgi", "ecgi", "ncgi", "globalcellid", "cellglobalid", "zelle", "cellule", "celda", "cella"),
)
"""Columns that name the transmitter, by their letters and digits alone."""
_DEVICES = (
    *("device", "deviceid", "devicename", "dev", "devid", "deveui", "devaddr", "node", "nodeid"),
    *("nodename", "sensor", "sensorid", "station", "stationid", "source", "src", "sourceid"),
    *("sender", "senderid", "address", "addr", "id", "uid", "uuid", "name", "ssid", "tag", "tagid"),
    *("tx", "emitter", "ap", "apname", "site", "siteid", "sector", "sectorid", "serial"),
    *("enb", "enbid", "enodeb", "enodebid", "gnb", "gnbid", "nodeb", "nodebid"),
)
"""Columns that may name the transmitter, or the receiver, or number the rows."""
_MOST_VALUES = 10_000  # a column with more numbers the rows


class Transmitters:
    """Names of the transmitters in a table without cell identities."""

    def __init__(self, columns: Iterable[str], *, has_codes: bool) -> None:
        plain = {_plain(column): column for column in columns}
        self._has_codes = has_codes
        self._name = next((plain[name] for name in _TRANSMITTERS if name in plain), None)
        self._values: dict[str, Counter[str]] = {}
        if self._name is None and not has_codes:
            self._values = {plain[name]: Counter() for name in _DEVICES if name in plain}

    def name(self, fields: Fields, reading: CellReading) -> str | None:
        """Name of the transmitter of a row by its column, else by code and channel."""
        if self._name is not None:
            return text(fields, self._name) or None
        if self._has_codes:
            codes = {
                "channel": reading.arfcn,
                "BSIC": reading.bsic,
                "PSC": reading.psc,
                "PCI": reading.pci,
            }
            in_words = " ".join(f"{k} {v}" for k, v in codes.items() if v is not None)
            return channel_name(reading) or in_words or None
        for column, values in self._values.items():
            if len(values) <= _MOST_VALUES and (value := text(fields, column)):
                values[value] += 1
        return DEFAULT_CELL

    def check(self, source: object) -> None:
        """Raise `RunFileError` where a column seems to name several transmitters.

        A single value, and another in each row, name none.
        """
        for column, values in self._values.items():
            if 1 < len(values) <= min(_MOST_VALUES, values.total() // 2):
                examples = ", ".join(repr(value[:20]) for value in list(values)[:3])
                raise RunFileError(
                    f"{source}: column {column!r} has {len(values)} values ({examples}). If they "
                    f"are transmitters, add --columns cell={column}; if they are receivers, "
                    "remove the column, or import each one's rows as a walk"
                )


def _plain(column: str) -> str:
    return "".join(filter(str.isalnum, column.lower()))


_CLOCK = (
    r"(?P<hour>\d{1,2})[:.](?P<minute>\d{2})"
    r"(?:[:.](?P<second>\d{2})(?:[.,](?P<fraction>\d{1,9}))?)?"
    r"(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?"
)
# only all times of a file show which of the first two numbers is the month
_SLASHED = {
    True: re.compile(r"(?P<month>\d{1,2})[-/](?P<day>\d{1,2})[-/](?P<year>\d{4}),?[ T_]" + _CLOCK),
    False: re.compile(r"(?P<day>\d{1,2})[-/](?P<month>\d{1,2})[-/](?P<year>\d{4}),?[ T_]" + _CLOCK),
}
_FORMS = (
    re.compile(r"(?P<year>\d{4})[-./](?P<month>\d{1,2})[-./](?P<day>\d{1,2})[ T_]" + _CLOCK),
    re.compile(r"(?P<day>\d{1,2})\.(?P<month>\d{1,2})\.(?P<year>\d{4}|\d{2}),?[ T_]" + _CLOCK),
    re.compile(r"(?P<day>\d{1,2})[ -](?P<month>[A-Za-z]{3,9})[ -](?P<year>\d{4}),? " + _CLOCK),
    re.compile(r"(?P<month>[A-Za-z]{3,9}) (?P<day>\d{1,2}),? (?P<year>\d{4}),? " + _CLOCK),
    re.compile(
        r"(?P<year>\d{4})(?P<month>\d{2})(?P<day>\d{2})"
        r"(?P<hour>\d{2})(?P<minute>\d{2})(?P<second>\d{2})"
    ),
    re.compile(r"(?=\d{1,2}:\d{2}:\d{2})" + _CLOCK),
)
_EPOCH = {"year": "1970", "month": "1", "day": "1"}
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_SINCE_1970 = re.compile(r"(\d{10})(?:[.,](\d{1,9}))?|(\d{13})(?:[.,]\d+)?|(\d{16})|(\d{19})")


@dataclass(frozen=True, slots=True)
class Moment:
    """Nanoseconds since 1970 in UTC, or by a clock whose zone the file does not name."""

    t_ns: int
    is_utc: bool

    @property
    def utc_ns(self) -> int | None:
        return self.t_ns if self.is_utc else None


def is_month_first(times: Iterable[str]) -> bool | None:
    """Whether dates such as 5/14/2024 begin with the month; None without such dates.

    Raises ValueError where none tells.
    """
    example = ""
    for time in filter(None, times):
        found = _SLASHED[True].fullmatch(time)
        if found is None:
            break  # no file has two forms: the first value tells
        first, second = int(found["month"]), int(found["day"])
        if max(first, second) > 12:
            return second > 12
        example = example or time
    if example:
        raise ValueError(f"of dates such as {example!r} nobody knows which number is the month")
    return None


def moment_of(time: str, name: str, *, month_first: bool | None = None) -> Moment:
    """The moment that a text means; raises ValueError, naming the column, for none.

    Ten digits are seconds since 1970, 13 milliseconds, 16 microseconds, 19 nanoseconds. A time of
    day without a date counts from 1970.
    """
    time = " ".join(time.split())
    if not time:
        raise ValueError(f"{name} is empty")
    if time.upper().endswith((" UTC", " GMT")):
        return replace(moment_of(time[:-4], name, month_first=month_first), is_utc=True)
    if found := _SINCE_1970.fullmatch(time):
        whole, fraction, ms, us, ns = found.groups()
        t_ns = int(whole or 0) * 10**9 + _fraction_ns(fraction)
        t_ns += int(ms or 0) * 10**6 + int(us or 0) * 10**3 + int(ns or 0)
        if t_ns >= _LAST_DAY * 86_400 * 10**9:
            raise ValueError(f"{name} is no time of a walk: {time!r}")
        return Moment(t_ns, is_utc=True)
    for form in _FORMS if month_first is None else (*_FORMS, _SLASHED[month_first]):
        if found := form.fullmatch(time):
            return _by_clock(time, name, found.groupdict())
    return Moment(utc_ns_of(time, name), is_utc=True)


def _hour_of_day(hour: int, half: str | None) -> int:
    """With the letter of AM or PM; raises ValueError."""
    if half is None:
        return hour
    if not 1 <= hour <= 12:
        raise ValueError("an hour with AM or PM is 1 to 12")
    return hour % 12 + 12 * (half in "pP")


def _by_clock(time: str, name: str, parts: dict[str, str | None]) -> Moment:
    date = [parts.get(part) or default for part, default in _EPOCH.items()]
    clock = [parts.get(part) or 0 for part in ("hour", "minute", "second")]
    month = date[1][:3].lower()
    if month in _MONTHS:
        date[1] = str(_MONTHS.index(month) + 1)
    try:
        year, month_number, day, hour, minute, second = map(int, (*date, *clock))
        year += 2000 * (year < 100)
        hour = _hour_of_day(hour, parts.get("half"))
        when = datetime(year, month_number, day, hour, minute, second, tzinfo=UTC)
    except ValueError as error:
        raise ValueError(f"{name} is no time: {time[:40]!r} ({error})") from None
    t_ns = ns_since_1970(when, name) + _fraction_ns(parts.get("fraction"))
    return Moment(t_ns, is_utc=False)


def _fraction_ns(digits: str | None) -> int:
    return int((digits or "0").ljust(9, "0"))


def moment(utc_ns: int | None) -> str | None:
    """ISO 8601 in UTC, to the millisecond."""
    return None if utc_ns is None else f"{utc_text(utc_ns)[:-1]}.{utc_ns // 10**6 % 1000:03d}Z"


def seconds(t_ns: int) -> float:
    """Seconds, to the millisecond."""
    return round(t_ns / 1e9, 3)


Names = tuple[str, ...]
"""Names of a column, of which the first that has a value counts."""
ROW_NS = 10**9
"""From row to row where only their order is known."""
CODES: Mapping[Rat, str] = {"GSM": "bsic", "WCDMA": "psc", "LTE": "pci", "NR": "pci"}
"""What a technology calls the code of a cell."""


def in_order(line: int, _: Fields) -> Moment:
    """The number of a row, where a file has no times."""
    return Moment(line * ROW_NS, is_utc=False)


def broadcast_of(fields: Fields) -> Broadcast | None:
    """What the cell broadcasts; None where the row has nothing of it."""
    channels = channels_of(text(fields, "neighbour_arfcns") or None)
    if channels is None and text(fields, "neighbour_arfcns"):
        raise ValueError("neighbour_arfcns is no list of GSM channels")
    cro_db, penalty_time, t3212_raw = (
        integer(fields, name) for name in ("cro_db", "penalty_time", "t3212_raw")
    )
    unsure = bool(integer(fields, "broadcast_unsure"))
    found = Broadcast(channels, cro_db, penalty_time, t3212_raw, unsure)
    return None if found == Broadcast(broadcast_unsure=unsure) else found


def level_in(name: str) -> Callable[[Fields, Rat | None], float]:
    """The level of a column in dBm; a row without it is a bad one."""
    return lambda fields, _: number(fields, name, LEVEL_RANGE_DBM)


def by_flag(*names: str, means: Role, otherwise: Role) -> Callable[[Fields], Role]:
    """The role by a column of true and false; without a value it is `scan`."""

    def role(fields: Fields) -> Role:
        flag = text(fields, *names).lower()
        if not flag:
            return "scan"
        return means if flag in {"true", "1"} else otherwise

    return role


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Columns of a format in lower case.

    `codes` are by technology the columns of the BSIC, PSC or PCI, `more` gives further values of a
    reading by our names. With `half_networks` a country without a network counts as well. Rows
    without a known technology are no cells if `needs_rat`. A track gives the positions where
    `place` is None.
    """

    level_dbm: Callable[[Fields, Rat | None], float | None]
    when: Callable[[int, Fields], Moment] = in_order
    role: Callable[[Fields], Role] = lambda _: "scan"
    rat: Names = ("rat",)
    place: tuple[str, str] | None = ("lat", "lon")
    alt_m: Names = ()
    acc_m: Names = ()
    speed_mps: Names = ()
    course_deg: Names = ()
    area: Mapping[Rat, Names] | Names = ("lac",)
    cid: Names = ("cid",)
    arfcn: Names = ("arfcn",)
    codes: Mapping[Rat, Names] = field(default_factory=dict)
    ta: Mapping[Rat, Names] | Names = ()
    more: Callable[[Fields, Rat | None], Mapping[str, Any]] = lambda *_: {}
    half_networks: bool = False
    needs_rat: bool = True

    def sighting(self, line: int, fields: Fields) -> Sighting | NoCell:
        """The row; raises ValueError or `GeoError` for a bad one."""
        name = text(fields, *self.rat)
        rat = RATS.get(name.upper())
        if rat is None and self.needs_rat:
            return NoCell(line, f"no technology of 2G to 5G is called {name[:40]!r}")
        moment = self.when(line, fields)
        acc = _name_in(fields, self.acc_m)
        known = {
            "alt_m": maybe(fields, _name_in(fields, self.alt_m)),
            "acc_m": maybe(fields, acc, (0.0, 1e6)) or None,
            "speed_mps": maybe(fields, _name_in(fields, self.speed_mps)),
            "course_deg": maybe(fields, _name_in(fields, self.course_deg)),
        }
        if self.place is None:
            fix = Fix(False, utc_ns=moment.utc_ns)
        else:
            lat, lon = self.place
            fix = fix_of(fields, lat, lon, moment.utc_ns, **known)
        mcc, mnc = half_plmn(fields) if self.half_networks else plmn(fields)
        values: dict[str, Any] = {
            "mcc": mcc,
            "mnc": mnc,
            "cid": cell_identity(fields, *self.cid),
            "arfcn": integer(fields, *self.arfcn),
            "ta": _first_known(fields, _names(self.ta, rat)),
        }
        if rat is not None and rat in self.codes:
            values[CODES[rat]] = _first_known(fields, self.codes[rat])
        reading = reading_of(
            rat,
            self.role(fields),
            self.level_dbm(fields, rat),
            _first_known(fields, _names(self.area, rat)),
            **values,
            **self.more(fields, rat),
        )
        return Sighting(line, moment.t_ns, fix, reading)


def _names(names: Mapping[Rat, Names] | Names, rat: Rat | None) -> Names:
    if isinstance(names, Mapping):
        return () if rat is None else names.get(rat, ())
    return names


def _name_in(fields: Fields, names: Names) -> str:
    return next((name for name in names if name in fields), "")


def _first_known(fields: Fields, names: Names) -> int | None:
    """First known integer: an app writes a mark where another one leaves the column empty."""
    return next((value for name in names if (value := integer(fields, name)) is not None), None)
