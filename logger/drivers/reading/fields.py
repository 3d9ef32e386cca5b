"""Values as modems print them: numbers of either base, levels, parts of an identity.

Nothing here guesses: a text that is not such a value, or a mark for unknown, is None.
"""

import re
from collections.abc import Iterable, Iterator, Mapping

from logger.core.reportable import area_marks, identity_marks, widest_dbm
from logger.core.types import Rat
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
