"""The row language of all drivers: which values a row has, and the cell that they describe.

    form("GSM", "mcc mnc lac cid16 bsic! arfcn! _ rxlev! c1 [c2 ta]")

A form names the values of a row in their order; `_` is one that is not read, and `_name` a number
that is not read. From `[` on a row may end, and behind `...` others may follow. A name with `!`
must fit (be readable, or a mark for unknown), one with `*` must be known: they prove the order,
since a comma lost or added moves another value there. In a strict form every value must look like
one of its kind. Rows with labels or columns are searched for in a line (`listed_row`,
`labelled_row`).

What a name means stands in `values_like`; a family adds its own. An identity is read completely or
not at all.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from typing import Any, NamedTuple, Self

from logger.core.cell_names import Identity
from logger.core.types import CellReading, Fix, Rat, Role, area_marks, identity_marks, widest_dbm

# The value of a5f is 2655 whether the modem sent that or a digit of a53f was lost. The width shows
# it, beside the other numbers of the reply and of the modem; so the text travels with the value
# until recognition has compared them all.


@dataclass(frozen=True, slots=True)
class NumberForm:
    """Base of a number, and the widths in which no digit can be missing."""

    base: int
    full_widths: frozenset[int]

    def is_full(self, text: str) -> bool:
        """True for a number with all its digits."""
        return len(text) in self.full_widths


class NumberText(int):
    """An integer with its text, equal to any integer of the same value.

    `confirmed` where the reply contains the number twice.
    """

    text: str
    form: NumberForm
    confirmed: bool

    def __new__(cls, value: int, text: str, form: NumberForm, confirmed: bool = False) -> Self:
        """The text has no blanks, sign and 0x."""
        number = super().__new__(cls, value)
        number.text = text.strip().lower().removeprefix("0x")
        number.form = form
        number.confirmed = confirmed
        return number

    def __reduce__(self) -> tuple[type["NumberText"], tuple[int, str, NumberForm, bool]]:
        return NumberText, (int(self), self.text, self.form, self.confirmed)


def confirm(number: int | None) -> int | None:
    """The number, marked as printed twice."""
    if not isinstance(number, NumberText):
        return number
    return NumberText(number, number.text, number.form, confirmed=True)


MPS_PER_KNOT = 1852 / 3600


_NO_SERVICE = frozenset({0, 2, 4})


@dataclass(frozen=True, slots=True)
class Registration:
    """Answer or report of +CREG and its like (3GPP TS 27.007 7.2, 10.1.20); answers have `n`.

    Where the modem prints why the network refused it: `reject_cause` of 3GPP (type 0, in
    TS 24.008 or 24.301) or of the maker (type 1).
    """

    domain: str
    stat: int
    rat: Rat | None = None
    n: int | None = None
    lac: int | None = None
    tac: int | None = None
    cid: int | None = None
    act: int | None = None
    reject_cause_type: int | None = None
    reject_cause: int | None = None
    identity_unsure: bool = False

    @property
    def has_serving_cell(self) -> bool:
        # 27.007 prints a cell only while the modem is registered: of one that is not (0), searches
        # (2) or does not know (4), it may be the last one; one that is denied (3) has heard that
        # from the cell
        return self.cid is not None and self.stat not in _NO_SERVICE


@dataclass(frozen=True, slots=True)
class Signal:
    """Level without a cell; `raw` are printed values whose meaning depends on the technology."""

    rat: Rat | None = None
    csq_raw: int | None = None
    ber: int | None = None
    rssi_dbm: float | None = None
    rscp_dbm: float | None = None
    ecio_db: float | None = None
    rsrp_dbm: float | None = None
    rsrq_db: float | None = None
    sinr_db: float | None = None
    more: Mapping[str, Any] = field(default_factory=dict, hash=False)


@dataclass(frozen=True, slots=True)
class Operator:
    """A network: offered by a scan (`stat`, `long`, `short`) or chosen (`name`, `plmn`)."""

    rat: Rat | None = None
    stat: int | None = None
    long: str | None = None
    short: str | None = None
    name: str | None = None
    plmn: str | None = None
    act: int | None = None


@dataclass(frozen=True, slots=True)
class Refusal:
    """A final error: its number, or its words."""

    code: int | None = None
    text: str | None = None


@dataclass(frozen=True, slots=True)
class NoCell:
    """The modem reports that it has no cell: `status` or `state` as printed."""

    rat: Rat | None = None
    status: str | None = None
    state: str | None = None


Row = CellReading | Registration | Signal | Operator | Refusal | NoCell | Fix

_ROLES = {
    Registration: "registration",
    Signal: "signal",
    Operator: "operator",
    Refusal: "error",
    NoCell: "none",
}


def as_json(row: Row) -> dict[str, Any]:
    """One flat JSON object for a row, null where a value is unknown.

    What a cell broadcasts is there only where the modem prints some of it.
    """
    if isinstance(row, Fix):
        return _fix_json(row)
    named = asdict(row)
    more = {**(named.pop("broadcast", None) or {}), **named.pop("more", {})}
    if not named.get("identity_unsure"):
        named.pop("identity_unsure", None)  # the key is there only where it is true
    return {"role": _ROLES.get(type(row), named.pop("role", None)), "rat": None, **named, **more}


def _fix_json(fix: Fix) -> dict[str, Any]:
    knots = None if fix.speed_mps is None else fix.speed_mps / MPS_PER_KNOT
    return {
        "role": "gnss",
        "fix": fix.valid,
        "utc": None if fix.utc_ns is None else _iso(fix.utc_ns),
        "lat": fix.lat_deg,
        "lon": fix.lon_deg,
        "alt_m": fix.alt_m,
        "hdop": fix.hdop,
        "sats_used": fix.sats_used,
        "speed_kn": None if knots is None else round(knots, 3),
        "speed_kmh": None if fix.speed_mps is None else round(fix.speed_mps * 3.6, 3),
        "course_deg": fix.course_deg,
    }


def _iso(utc_ns: int) -> str:
    seconds, rest_ns = divmod(utc_ns, 10**9)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest_ns // 10**6:03d}Z"


# Nothing here guesses: a text that is not such a value, or a mark for unknown, is None.

RAT_OF_ACT: dict[
    int, Rat
] = {  # 3GPP TS 27.007 7.3; for LTE-M and NB-IoT (8, 9) the vendors' numbers differ
    0: "GSM",
    1: "GSM",
    2: "WCDMA",
    3: "GSM",
    4: "WCDMA",
    5: "WCDMA",
    6: "WCDMA",
    7: "LTE",
    10: "LTE",
    11: "NR",
    12: "NR",
    13: "LTE",
}

SEVEN = NumberForm(16, frozenset({7}))
EIGHT = NumberForm(16, frozenset({8}))
"""Cell identities of 28 bits in columns of a fixed width."""
_AREAS = {
    (16, 16): NumberForm(16, frozenset({4})),
    (16, 24): NumberForm(16, frozenset({4, 6})),  # +CREG and its like print 16 bits in four digits
    (10, 16): NumberForm(10, frozenset({5})),
    (10, 24): NumberForm(10, frozenset({8})),
}
_CELLS = {
    (16, 16): NumberForm(16, frozenset({4})),
    (16, 28): NumberForm(16, frozenset({7, 8})),
    (16, 36): NumberForm(16, frozenset({9, 16})),
    (10, 16): NumberForm(10, frozenset({5})),
    (10, 28): NumberForm(10, frozenset({9})),
    (10, 36): NumberForm(10, frozenset({11})),
}
"""By base and bits: the widths in which no digit can be missing."""

_FIELD = re.compile(r'(?:\s*"([^"]*)"?[^,]*|([^,]*)),')
_MCC = re.compile(r"(?!000)[0-9]{3}")
_MNC = re.compile(r"[0-9]{2,3}")


def values(text: str) -> list[str]:
    """Fields between commas, without blanks and quotation marks; quoted commas do not count."""
    return [(quoted or plain).strip() for quoted, plain in _FIELD.findall(text + ",")]


def at(fields: list[str], index: int) -> str:
    """Field of that number, empty where the modem prints fewer."""
    return fields[index] if -len(fields) <= index < len(fields) else ""


def decimal(text: str, low: int = 0, high: int = 2**31 - 1) -> int | None:
    """Decimal integer within [low, high]."""
    text = text.strip()
    if not re.fullmatch(r"[-+]?[0-9]{1,12}", text):
        return None
    number = int(text)
    return number if low <= number <= high else None


def hexadecimal(text: str, low: int = 0, high: int = 2**36 - 1) -> int | None:
    """Hexadecimal integer, with or without 0x, within [low, high]."""
    text = text.strip()
    if not re.fullmatch(r"(?:0[xX])?[0-9A-Fa-f]{1,16}", text):
        return None
    number = int(text, 16)
    return number if low <= number <= high else None


def level(text: str, low: float, high: float, scale: float = 1.0) -> float | None:
    """Number times `scale` within [low, high]: a level or a ratio in dB."""
    text = text.strip()
    if not re.fullmatch(r"[-+]?[0-9]{1,5}(?:\.[0-9]{0,6})?", text):
        return None
    value = float(text) * scale
    return value if low <= value <= high else None


def rssi_dbm(text: str, scale: float = 1.0) -> float | None:
    """Received level of any technology; `reportable` has the narrower range of each."""
    return level(text, *widest_dbm("rssi_dbm"), scale)


def rscp_dbm(text: str, scale: float = 1.0) -> float | None:
    """Received signal code power of WCDMA."""
    return level(text, *widest_dbm("rscp_dbm"), scale)


def rsrp_dbm(text: str, scale: float = 1.0) -> float | None:
    """Reference signal received power of any technology."""
    return level(text, *widest_dbm("rsrp_dbm"), scale)


def rsrq_db(text: str, scale: float = 1.0) -> float | None:
    """Reference signal received quality (3GPP TS 36.133 9.1.7, 38.133 10.1.11); 0 is unknown."""
    found = level(text, -43.0, 20.0, scale)
    return None if found == 0.0 else found


def area(text: str, base: int = 16, bits: int = 16) -> int | None:
    """Location or tracking area code; None for the marks of 3GPP TS 24.008 10.5.1.3."""
    code = (hexadecimal if base == 16 else decimal)(text, 0, 2**bits - 1)
    if code is None or code in area_marks(bits):
        return None
    return NumberText(code, text, _AREAS[base, bits])


def cell_identity(
    text: str, bits: int, base: int = 16, form: NumberForm | None = None
) -> int | None:
    """Cell identity of 16 (GSM), 28 (WCDMA, LTE) or 36 bits (NR); None for 0 and all ones."""
    identity = (hexadecimal if base == 16 else decimal)(text, 0, 2**bits - 1)
    if identity is None or identity in identity_marks(bits):
        return None
    return NumberText(identity, text, form or _CELLS[base, bits])


def bsic_of(ncc: int | None, bcc: int | None) -> int | None:
    """Base station identity code of the network's and the station's colour code."""
    return None if ncc is None or bcc is None else 8 * ncc + bcc


HEX = r"[0-9A-Fa-f]{4}|[1-9A-Fa-f][0-9A-Fa-f]{0,2}|0?"
"""A number of 16 bits: padded to four digits or without a leading zero; "013" is neither."""


def matches(patterns: Mapping[str, str], named: Mapping[str, str]) -> bool:
    """True where each value that has a pattern matches it; a missing value is empty."""
    return all(re.fullmatch(pattern, named.get(name, "")) for name, pattern in patterns.items())


def network(mcc: str, mnc: str) -> tuple[str, str] | tuple[None, None]:
    """Country and network code as printed, both or neither."""
    mcc, mnc = mcc.strip(), mnc.strip()
    return (mcc, mnc) if _MCC.fullmatch(mcc) and _MNC.fullmatch(mnc) else (None, None)


def network_of(plmn: str) -> tuple[str, str] | tuple[None, None]:
    """Of one number."""
    return network(plmn[:3], plmn[3:].rstrip("Ff"))  # F fills a code of two digits


def pieces(lines: Iterable[str]) -> Iterator[str]:
    """Lines that a log has joined, with CR and LF as text, apart again; no empty ones."""
    for line in lines:
        yield from filter(str.strip, re.split(r"(?:\\[rn]|[\r\n])+", line))


@dataclass(frozen=True, slots=True)
class Scale:
    """Indices from `lowest` to `highest`; index 0 stands for `at_zero`, in dBm or dB."""

    highest: int
    at_zero: float
    step: float = 1.0
    lowest: int = 0

    def value_of(self, text: str) -> float | None:
        """The level of a printed index; None for one outside the scale, which is unknown."""
        return self.value_at(decimal(text, self.lowest, self.highest))

    def value_at(self, index: int | None) -> float | None:
        """The level of an index."""
        if index is None or not self.lowest <= index <= self.highest:
            return None
        return self.at_zero + self.step * index


# 3GPP TS 27.007 8.69 (+CESQ), which refers to 45.008 8.1.4, 25.133 9.1 and 36.133 9.1
RXLEV_OF_INDEX = Scale(63, -110.0)
RSCP_OF_INDEX = Scale(96, -121.0)
ECN0_OF_INDEX = Scale(49, -24.5, 0.5)
RSRP_OF_INDEX = Scale(97, -141.0)
RSRQ_OF_INDEX = Scale(34, -20.0, 0.5)
# 38.133 10.1.6 and 10.1.11
SS_RSRP_OF_INDEX = Scale(126, -157.0)
SS_RSRQ_OF_INDEX = Scale(126, -43.5, 0.5)
CSQ_OF_INDEX = Scale(31, -113.0, 2.0)
"""27.007 8.5 (+CSQ)."""
CARRIER_OF_INDEX = Scale(76, -100.0)
"""Level of a WCDMA carrier, all its cells together (25.133 9.1.3)."""


_FLAGS = re.ASCII | re.IGNORECASE
_SIGNED = r"[-+]?\d{1,4}(?:\.\d{1,2})?"
_SHORT = r"[-+]?\d{1,3}(?:\.\d{1,2})?"
_WIDEST = 4
_BESIDE = "more."
_UNKNOWN = frozenset({"", "-", "x", "255", "65535", "-32768", "-1920"})
_NO_VALUE = re.compile(r"-*")


class Value(NamedTuple):
    """A value that rows contain: an attribute of a reading, its reader, the texts of its kind.

    An attribute that begins with `more.` is a key of `CellReading.more`; an empty one is not kept.
    An index keeps its number there too: `raw` are its key and reader.
    """

    attribute: str
    read: Callable[[str], Any]
    pattern: str = _SIGNED
    raw: tuple[str, Callable[[str], Any]] | None = None


Kinds = Mapping[str, Value]


def between(low: int, high: int) -> Callable[[str], int | None]:
    """Reader of a decimal integer in [low, high]."""
    return partial(decimal, low=low, high=high)


def _channel(high: int) -> Value:
    # 65535 is in no band; modems print it for none
    def read(text: str) -> int | None:
        found = decimal(text, 0, high)
        return None if found == 0xFFFF else found

    return Value("arfcn", read, rf"\d{{1,{len(str(high))}}}")


def number(attribute: str, low: int, high: int) -> Value:
    """A decimal integer in [low, high]."""
    width = max(len(str(abs(bound))) for bound in (low, high))
    return Value(attribute, between(low, high), rf"{'-?' if low < 0 else ''}\d{{1,{width}}}")


def padded_number(attribute: str, high: int, width: int, pattern: str | None = None) -> Value:
    """A decimal integer from 0 that some firmware pads to a width, which shows a lost digit."""
    full = NumberForm(10, frozenset({width}))

    def read(text: str) -> int | None:
        found = decimal(text, 0, high) if len(text) <= _WIDEST else None
        return None if found is None else NumberText(found, text, full)

    return Value(attribute, read, pattern or rf"\d{{1,{width}}}")


def _network_code(text: str) -> str | None:
    return network("001", text)[1]


def values_like(levels: str = _SIGNED, padding: str = "(?:0x)?0*") -> Kinds:
    """All values by the names that forms use; `_10` are decimal identities.

    The patterns of levels, and of what may stand before a hexadecimal number, are a firmware's.
    """

    def code(attribute: str, bits: int, base: int = 16) -> Value:
        read = cell_identity if attribute == "cid" else area
        digits = rf"{padding}[0-9A-F]{{1,{bits // 4}}}" if base == 16 else r"\d{1,11}"
        return Value(attribute, partial(read, bits=bits, base=base), digits)

    def ratio(low: float, high: float) -> Callable[[str], float | None]:
        return partial(level, low=low, high=high)

    return {
        "mcc": Value("mcc", between(0, 999), r"\d{3}"),
        "mnc": Value("mnc", _network_code, r"\d{2,3}"),
        "lac": code("lac", 16),
        "tac": code("tac", 16),
        "tac24": code("tac", 24),
        "cid16": code("cid", 16),
        "cid28": code("cid", 28),
        "cid36": code("cid", 36),
        "lac_10": code("lac", 16, 10),
        "tac_10": code("tac", 16, 10),
        "cid16_10": code("cid", 16, 10),
        "cid28_10": code("cid", 28, 10),
        "arfcn": number("arfcn", 0, 1023),  # 3GPP TS 45.005 2
        "uarfcn": number("arfcn", 0, 16383),  # 25.101 5.4.3
        "earfcn": _channel(262143),  # 36.101 5.7.3
        "nrarfcn": _channel(3279165),  # 38.104 5.4.2.1
        "band": number("band", 1, 255),
        "bsic": number("bsic", 0, 63),
        "psc": number("psc", 0, 511),
        "pci": number("pci", 0, 503),
        "pci_nr": number("pci", 0, 1007),
        "pci_hex": Value("pci", partial(hexadecimal, low=0, high=503), r"[0-9A-F]{1,3}"),
        "pci_nr_hex": Value("pci", partial(hexadecimal, low=0, high=1007), r"[0-9A-F]{1,3}"),
        "rssi": Value("rssi_dbm", rssi_dbm, levels),
        "rxq": number("rxq", 0, 7),  # 45.008 8.2.4
        "ta": number("ta", 0, 63),  # 45.010 5.4
        "c1": number("c1", -255, 255),
        "c2": number("c2", -255, 255),
        "rscp": Value("rscp_dbm", rscp_dbm, levels),
        "ecn0": Value("ecio_db", ratio(-32.0, 0.0), levels),
        "ecio": Value("ecio_db", ratio(-40.0, 0.0), levels),
        "rsrp": Value("rsrp_dbm", rsrp_dbm, levels),
        "rsrq": Value("rsrq_db", rsrq_db, levels),
        "sinr": Value("sinr_db", ratio(-23.0, 40.0), levels),  # 38.133 10.1.16
        "snr": Value("sinr_db", ratio(-30.0, 50.0), levels),  # as modems print it
    }


def _tenths(read: Callable[[str, float], float | None]) -> Callable[[str], float | None]:
    return lambda text: None if (found := read(text, 0.1)) is None else round(found, 1)


VALUES = values_like()
TENTHS: Kinds = {
    "rsrq": Value("rsrq_db", _tenths(rsrq_db)),
    "rsrp": Value("rsrp_dbm", _tenths(rsrp_dbm)),
    "rssi": Value("rssi_dbm", _tenths(rssi_dbm)),
}
"""Levels in tenths of a dB."""
_NETWORK = frozenset({"mcc", "mnc"})
_AREA_AND_CELL = frozenset({"lac", "tac", "cid"})


@dataclass(frozen=True, slots=True)
class Form:
    """Values of a row by name. `least` is how many a row has that is not cut."""

    rat: Rat | None
    names: tuple[str, ...]
    kinds: Kinds
    fitting: frozenset[str]
    known: frozenset[str]
    least: int
    is_open: bool
    unknown: re.Pattern[str] | None

    def texts_by_name(self, texts: Sequence[str]) -> dict[str, str] | None:
        """Values of a row by their names, None for a row of another form."""
        if self._is_cut(texts):
            texts = texts[:-1]  # the last one may have lost its end
        named = dict(zip(self.names, texts, strict=False))
        if not (self.fitting | self.known) <= named.keys():
            return None
        if self.unknown and not self._is_well_formed(texts, named):
            return None
        fits = all(named[name] in _UNKNOWN or self._is_known(name, named) for name in self.fitting)
        return named if fits and all(self._is_known(name, named) for name in self.known) else None

    def cell(
        self,
        role: Role,
        texts: Sequence[str],
        more: Mapping[str, Any] | None = None,
        **values: Any,
    ) -> CellReading | None:
        """The cell of a row, with more `values`; None for another form or without any."""
        named = self.texts_by_name(texts)
        if named is None:
            return None
        is_identified = not self._is_cut(texts) or _identity_of(self.names, self.kinds) <= {*named}
        if not is_identified:
            named = {name: text for name, text in named.items() if not _names(name, self.kinds)}
        return cell(role, self.rat, named, self.kinds, more, **values)

    def _is_cut(self, texts: Sequence[str]) -> bool:
        is_short = len(texts) == self.least and not texts[-1] and not self.unknown
        return is_short or len(texts) < self.least

    def _is_well_formed(self, texts: Sequence[str], named: Mapping[str, str]) -> bool:
        is_long = len(texts) > len(self.names) and not self.is_open
        return len(texts) >= self.least and not is_long and self.looks_right(named)

    def looks_right(self, named: Mapping[str, str]) -> bool:
        """True where each value looks like one of its kind, or is unknown."""
        unknown = self.unknown or _NO_VALUE
        return all(
            unknown.fullmatch(text) or re.fullmatch(_pattern(name, self.kinds), text, _FLAGS)
            for name, text in named.items()
        )

    def _is_known(self, name: str, named: Mapping[str, str]) -> bool:
        return self.kinds[name].read(named[name]) is not None


def form(rat: Rat | None, names: str, kinds: Kinds = VALUES, unknown: str | None = None) -> Form:
    """The form of rows of one technology whose values have these names.

    With `unknown`, the pattern of a value that is not known, the form is strict.
    """
    required, _, spare = names.replace("]", "").partition("[")
    is_open = "..." in names
    marked = [word for word in f"{required} {spare}".split() if word != "..."]
    return Form(
        rat=rat,
        names=tuple(name.rstrip("!*") for name in marked),
        kinds=kinds,
        fitting=frozenset(name[:-1] for name in marked if name.endswith("!")),
        known=frozenset(name[:-1] for name in marked if name.endswith("*")),
        least=len(required.replace("...", "").split()),
        is_open=is_open,
        unknown=None if unknown is None else re.compile(unknown),
    )


def first_cell(
    forms: Sequence[Form],
    role: Role,
    texts: Sequence[str],
    more: Mapping[str, Any] | None = None,
) -> CellReading | None:
    """The cell of a row in the first form that it has."""
    fitting = (shape for shape in forms if shape.texts_by_name(texts))
    shape = next(fitting, None)
    return shape.cell(role, texts, more) if shape else None


def split(body: str) -> list[str]:
    """Values of a row; none contains a comma, so a lost quotation mark does no harm."""
    return [text.strip(" \t\"'") for text in body.split(",")]


def _pattern(name: str, kinds: Kinds) -> str:
    return r".*" if name == "_" else _SHORT if name.startswith("_") else kinds[name].pattern


def read_values(named: Mapping[str, str], kinds: Kinds = VALUES) -> dict[str, Any]:
    """Values by attribute of a reading; names of no kind are left out."""
    values: dict[str, Any] = {}
    more: dict[str, Any] = {}
    for name, text in named.items():
        attribute = kinds[name].attribute if name in kinds else ""
        if attribute.startswith(_BESIDE):
            more[attribute.removeprefix(_BESIDE)] = kinds[name].read(text)
        elif attribute:
            values[attribute] = kinds[name].read(text)
        if name in kinds and (raw := kinds[name].raw):
            more[raw[0]] = raw[1](text)
    return values | ({"more": more} if more else {})


def identity(named: Mapping[str, str], kinds: Kinds = VALUES) -> dict[str, Any]:
    """Network, area and cell, or nothing: an area or a cell may be unknown but not damaged."""
    codes = {}
    if "mcc" in named:
        mcc, mnc = network(named["mcc"], named.get("mnc", ""))
        if mcc is None:
            return {}
        codes = {"mcc": mcc, "mnc": mnc}
    parts = {
        name: text for name, text in named.items() if name not in _NETWORK and _names(name, kinds)
    }
    return codes | read_values(parts, kinds) if _are_whole(parts, kinds) else {}


def _are_whole(parts: Mapping[str, str], kinds: Kinds) -> bool:
    return all(
        _NO_VALUE.fullmatch(text) or re.fullmatch(kinds[name].pattern, text, _FLAGS)
        for name, text in parts.items()
    )


def cell(
    role: Role,
    rat: Rat | None,
    named: Mapping[str, str],
    kinds: Kinds = VALUES,
    more: Mapping[str, Any] | None = None,
    **values: Any,
) -> CellReading | None:
    """The cell that texts by name describe, with more `values`; None where none is known."""
    others = {name: text for name, text in named.items() if not _names(name, kinds)}
    found = identity(named, kinds) | read_values(others, kinds)
    beside = found.pop("more", {})
    # a network alone is no cell
    known = {name: value for name, value in (found | values).items() if name not in _NETWORK}
    if all(value is None for value in (*known.values(), *beside.values())):
        return None
    return CellReading(role, rat, **found | values, more={**(more or {}), **beside})


def _names(name: str, kinds: Kinds) -> bool:
    return name in kinds and kinds[name].attribute in _NETWORK | _AREA_AND_CELL


def _identity_of(names: Sequence[str], kinds: Kinds) -> set[str]:
    return {name for name in names if name not in _NETWORK and _names(name, kinds)}


def with_identity(reading: CellReading, named: Identity) -> CellReading:
    """The reading with an identity; the area is `lac` of GSM and WCDMA, `tac` of all others."""
    reading = replace(reading, mcc=named.mcc, mnc=named.mnc, cid=named.cid)
    if reading.rat in {"GSM", "WCDMA"}:
        return replace(reading, lac=named.area)
    return replace(reading, tac=named.area)


def listed_row(names: str, kinds: Kinds) -> re.Pattern[str]:
    """Pattern of values in the order of words `name` or `label=name`; a group has the name.

    Here `_` is a hexadecimal number that is not read, and `_name` a decimal one.
    """
    words = (word.rpartition("=")[2] for word in names.split())
    return _row((_group(name, kinds) for name in words), r"\s*,\s*")


def labelled_row(labels: str, kinds: Kinds, between: str = r"\s*,\s*") -> re.Pattern[str]:
    """Pattern of `label: value` in the order of words `label=name`; `_` in a label is a blank."""
    words = (word.rpartition("=") for word in labels.split())
    parts = (
        rf"{re.escape((label or name).replace('_', ' '))}\s?:\s*{_group(name, kinds)}"
        for label, _, name in words
    )
    return _row(parts, between)


def _group(name: str, kinds: Kinds) -> str:
    if name.startswith("_"):
        return "[0-9A-F]{1,8}" if name == "_" else r"\d{1,6}"
    return rf"(?P<{name}>{kinds[name].pattern})"


def _row(parts: Any, between: str) -> re.Pattern[str]:
    return re.compile(r"(?<![\w.,-])" + between.join(parts) + r"(?![\w.])", _FLAGS)
