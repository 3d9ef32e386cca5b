"""Names of cells without an identity: technology, channel and code, as in `LTE-5780-210`.

Networks use a code again some kilometres away, so two transmitters may have one such name.
"""

import re
from collections.abc import Mapping
from types import MappingProxyType

from logger.core.types import HIGHEST_ARFCN, CellReading

REUSED_M = 10_000.0
"""Places of one name that are farther apart, with none between, are of two cells."""
CODES: Mapping[str, str] = MappingProxyType(
    {"GSM": "bsic", "WCDMA": "psc", "LTE": "pci", "NB-IoT": "pci", "NR": "pci"}
)
"""Column of the code that tells cells of one channel apart, by technology."""
HIGHEST: Mapping[str, tuple[int, int]] = MappingProxyType(
    {
        "GSM": (HIGHEST_ARFCN, 63),  # 3GPP TS 23.003 4.3.2
        "WCDMA": (16383, 511),  # TS 25.331 10.3.6
        "LTE": (262143, 503),  # TS 36.331 6.3
        "NB-IoT": (262143, 503),
        "NR": (3279165, 1007),  # TS 38.331 6.3.2
    }
)
"""Channel and code."""
SAME_CARRIER: Mapping[str, str] = MappingProxyType({"LTE-M": "LTE"})
"""A modem of LTE-M hears cells of LTE."""

_NAME = re.compile(r"(.+?)-(0|[1-9][0-9]{0,6})-(0|[1-9][0-9]{0,3})", re.ASCII)
_BEGINS_SO = re.compile(r"(GSM|WCDMA|UMTS|LTE|LTE-M|NB-IoT|NR)-.*", re.ASCII | re.IGNORECASE)
_EXAMPLES = "LTE-5780-210 (EARFCN, PCI), GSM-62-37 (ARFCN, BSIC), WCDMA-10737-25 or NR-632448-17"


def channel_name(reading: CellReading) -> str | None:
    """Name of a reading's cell by channel and code, None where these are unknown."""
    rat = SAME_CARRIER.get(reading.rat or "", reading.rat or "")
    return _name(rat, reading.arfcn, getattr(reading, CODES.get(rat, ""), None))


def is_by_channel(cell: str) -> bool:
    """Whether a cell has such a name."""
    match = _NAME.fullmatch(cell)
    return match is not None and _name(match[1], int(match[2]), int(match[3])) == cell


def why_no_name(cell: str) -> str:
    """Why a text that begins as such a name is none; empty for all others."""
    if is_by_channel(cell) or not _BEGINS_SO.fullmatch(cell):
        return ""
    match = _NAME.fullmatch(cell)
    if match is None or match[1] not in HIGHEST:
        return f"{cell} names no channel and code of a cell: write {_EXAMPLES}"
    channel, code = HIGHEST[match[1]]
    return (
        f"{cell} is no cell: the channel is at most {channel}, the {CODES[match[1]].upper()} at "
        f"most {code}"
    )


def _name(rat: str, channel: int | None, code: int | None) -> str | None:
    if rat not in HIGHEST or channel is None or code is None:
        return None
    highest_channel, highest_code = HIGHEST[rat]
    if not (0 <= channel <= highest_channel and 0 <= code <= highest_code):
        return None
    return f"{rat}-{channel}-{code}"
