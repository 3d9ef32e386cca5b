"""Values as modems print them: numbers of either base, levels, parts of an identity.

Nothing here guesses: a text that is not such a value, or a mark for unknown, is None.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from logger.core.types import CellReading, Rat
from logger.drivers.reading.number_text import NumberForm, NumberText

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

_GSM_DBM = (-113.0, -47.0)
"""Lowest index (SIM800 manual V1.09 p163) to RXLEV 63 (3GPP TS 45.008 8.1.4)."""
_RSRP_DBM = (-140.0, -43.0)
"""3GPP TS 36.133 9.1.4, and one step more at the strong end, where modems round."""
_COVERAGE_DBM = (-156.0, -43.0)
"""The same with enhanced coverage: NB-IoT (36.133 9.1.22.9) and LTE-M (9.1.4, extended)."""
_CARRIER_DBM = (-120.0, -20.0)
"""Total power on a channel; 3GPP gives LTE no range, modems print up to -35 dBm."""
LEVELS_DBM: Mapping[str, Mapping[Rat | None, tuple[float, float]]] = {
    "rssi_dbm": {"GSM": _GSM_DBM, None: _CARRIER_DBM},
    "rscp_dbm": {None: (-120.0, -25.0)},  # 3GPP TS 25.133 9.1.1.3
    "rsrp_dbm": {
        "NB-IoT": _COVERAGE_DBM,
        "LTE-M": _COVERAGE_DBM,
        "NR": (-156.0, -31.0),  # 3GPP TS 38.133 10.1.6
        None: _RSRP_DBM,
    },
}
"""Range of a level by technology, None for all others; a level outside is damaged."""
_OWN = {
    "WCDMA": "rscp_dbm",
    "LTE": "rsrp_dbm",
    "LTE-M": "rsrp_dbm",
    "NB-IoT": "rsrp_dbm",
    "NR": "rsrp_dbm",
}
"""The level of the cell alone; where it is damaged, that of the carrier does not replace it.

Where it is damaged that of the carrier does not stand in: it is another one.
"""

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
    return level(text, *_widest("rssi_dbm"), scale)


def rscp_dbm(text: str, scale: float = 1.0) -> float | None:
    """Received signal code power of WCDMA."""
    return level(text, *_widest("rscp_dbm"), scale)


def rsrp_dbm(text: str, scale: float = 1.0) -> float | None:
    """Reference signal received power of any technology."""
    return level(text, *_widest("rsrp_dbm"), scale)


def _widest(name: str) -> tuple[float, float]:
    lowest, highest = zip(*LEVELS_DBM[name].values(), strict=True)
    return min(lowest), max(highest)


_CARRIER_ABOVE_DB = (-3.0, 60.0)
"""Carrier above cell: up to 20 dB (resource blocks) and 34 dB (RSRQ), averaged separately."""


def reportable(reading: CellReading) -> CellReading:
    """The reading without levels that its technology cannot report."""
    outside = {name for name in LEVELS_DBM if not _is_reportable(reading, name)}
    own = _OWN.get(reading.rat or "", "")
    if own in outside or (own and not _holds(reading.rssi_dbm, getattr(reading, own))):
        outside.add("rssi_dbm")
    if not outside:
        return reading
    nothing: dict[str, Any] = dict.fromkeys(outside)
    return replace(reading, **nothing)


def _holds(carrier_dbm: float | None, cell_dbm: float | None) -> bool:
    low, high = _CARRIER_ABOVE_DB
    return carrier_dbm is None or cell_dbm is None or low <= carrier_dbm - cell_dbm <= high


def _is_reportable(reading: CellReading, name: str) -> bool:
    value: float | None = getattr(reading, name)
    ranges = LEVELS_DBM[name]
    low, high = ranges.get(reading.rat, ranges[None])
    return value is None or low <= value <= high


def rsrq_db(text: str, scale: float = 1.0) -> float | None:
    """Reference signal received quality (3GPP TS 36.133 9.1.7, 38.133 10.1.11); 0 is unknown."""
    found = level(text, -43.0, 20.0, scale)
    return None if found == 0.0 else found


def area(text: str, base: int = 16, bits: int = 16) -> int | None:
    """Location or tracking area code; None for the marks of 3GPP TS 24.008 10.5.1.3."""
    code = (hexadecimal if base == 16 else decimal)(text, 0, 2**bits - 1)
    if code is None or code in {0, 0xFFFE, 0xFFFF, 2**bits - 2, 2**bits - 1}:
        return None
    return NumberText(code, text, _AREAS[base, bits])


def cell_identity(
    text: str, bits: int, base: int = 16, form: NumberForm | None = None
) -> int | None:
    """Cell identity of 16 (GSM), 28 (WCDMA, LTE) or 36 bits (NR); None for 0 and all ones."""
    identity = (hexadecimal if base == 16 else decimal)(text, 0, 2**bits - 1)
    if identity is None or identity in {0, 0xFFFF, 2**bits - 1}:
        return None
    return NumberText(identity, text, form or _CELLS[base, bits])


def bsic_of(ncc: int | None, bcc: int | None) -> int | None:
    """Base station identity code of the network's and the station's colour code."""
    return None if ncc is None or bcc is None else 8 * ncc + bcc


HEX = r"[0-9A-Fa-f]{4}|[1-9A-Fa-f][0-9A-Fa-f]{0,2}|0?"
"""A number of 16 bits: firmware pads to four digits or prints no leading zero; "013" is neither."""


def matches(patterns: Mapping[str, str], named: Mapping[str, str]) -> bool:
    """True where each value that has a pattern matches it; a missing value is empty."""
    return all(re.fullmatch(pattern, named.get(name, "")) for name, pattern in patterns.items())


def network(mcc: str, mnc: str) -> tuple[str, str] | tuple[None, None]:
    """Country and network code as printed, both or neither."""
    mcc, mnc = mcc.strip(), mnc.strip()
    return (mcc, mnc) if _MCC.fullmatch(mcc) and _MNC.fullmatch(mnc) else (None, None)


def pieces(lines: Iterable[str]) -> Iterator[str]:
    """Lines that a log has joined, with CR and LF as text, apart again; no empty ones."""
    for line in lines:
        yield from filter(str.strip, re.split(r"(?:\\[rn]|[\r\n])+", line))
