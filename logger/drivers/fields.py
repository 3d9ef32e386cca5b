"""Values as modems print them: numbers of either base, levels, and the parts of an identity.

Nothing here guesses: a text that is not such a value, or a mark for unknown, is None.
"""

import re
from collections.abc import Iterable, Iterator

from logger.core.types import Rat

RAT_OF_ACT: dict[int, Rat] = {  # 3GPP TS 27.007 7.3; for LTE-M and NB-IoT (8, 9) the vendors' numbers differ
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

_FIELD = re.compile(r'(?:\s*"([^"]*)"?[^,]*|([^,]*)),')
_MCC = re.compile(r"(?!000)[0-9]{3}")
_MNC = re.compile(r"[0-9]{2,3}")


def values(text: str) -> list[str]:
    """Fields between commas, without blanks around them and without quotation marks; commas in quotes do not count."""
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
    """Received level of any technology, -130 to -10 dBm."""
    return level(text, -130.0, -10.0, scale)


def rsrp_dbm(text: str, scale: float = 1.0) -> float | None:
    """Reference signal received power (3GPP TS 36.133 9.1.4, 38.133 10.1.6: -156 to -31 dBm)."""
    return level(text, -156.0, -31.0, scale)


def rsrq_db(text: str, scale: float = 1.0) -> float | None:
    """Reference signal received quality (3GPP TS 36.133 9.1.7, 38.133 10.1.11: -43 to 20 dB); 0 stands for unknown."""
    found = level(text, -43.0, 20.0, scale)
    return None if found == 0.0 else found


def area(text: str, base: int = 16, bits: int = 16) -> int | None:
    """Location or tracking area code; all zeros, all ones and the last but one say "none" (3GPP TS 24.008 10.5.1.3)."""
    code = (hexadecimal if base == 16 else decimal)(text, 0, 2**bits - 1)
    return None if code in {0, 0xFFFE, 0xFFFF, 2**bits - 2, 2**bits - 1} else code


def cell_identity(text: str, bits: int, base: int = 16) -> int | None:
    """Cell identity of 16 (GSM), 28 (WCDMA, LTE) or 36 bits (NR); zero and all ones say "unknown"."""
    identity = (hexadecimal if base == 16 else decimal)(text, 0, 2**bits - 1)
    return None if identity in {0, 0xFFFF, 2**bits - 1} else identity


def network(mcc: str, mnc: str) -> tuple[str, str] | tuple[None, None]:
    """Country and network code as printed, both or neither."""
    mcc, mnc = mcc.strip(), mnc.strip()
    return (mcc, mnc) if _MCC.fullmatch(mcc) and _MNC.fullmatch(mnc) else (None, None)


def pieces(lines: Iterable[str]) -> Iterator[str]:
    """Lines that a log has written as one, with their ends as text (backslash, r, n), apart again; no empty ones."""
    for line in lines:
        yield from filter(str.strip, re.split(r"(?:\\[rn]|[\r\n])+", line))


def labelled(form: Iterable[tuple[str, str]], between: str) -> re.Pattern[str]:
    """Pattern of `label: value` in a fixed order, for (label, pattern of its value); a group is named as its label."""
    return _joined((rf"{re.escape(label)}\s?:\s*(?P<{_group(label)}>{value})" for label, value in form), between)


def listed(form: Iterable[tuple[str, str]]) -> re.Pattern[str]:
    """Pattern of values between commas in a fixed order, for (name, pattern of its value)."""
    return _joined((rf"(?P<{_group(name)}>{value})" for name, value in form), r"\s*,\s*")


def _joined(parts: Iterable[str], between: str) -> re.Pattern[str]:
    return re.compile(r"(?<![\w.,-])" + between.join(parts) + r"(?![\w.])", re.IGNORECASE | re.ASCII)


def _group(label: str) -> str:
    return re.sub(r"\W", "_", label.lower())
