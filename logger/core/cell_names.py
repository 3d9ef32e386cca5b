"""Names of cells without an identity: technology, channel and code, as in `LTE-5780-210`.

A modem reads the identity of few of its neighbours; of the others it knows the channel and the code
on it: BSIC of GSM, PSC of WCDMA, PCI of LTE and later. Networks use a code again some kilometres
away, so such a name may be that of two transmitters. `joined_names` gives them to readings.
"""

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from logger.core.types import HIGHEST_ARFCN, CellReading

REUSED_M = 10_000.0
"""Places of one channel and code that are farther apart, with none between, are of two cells."""


class Kind(NamedTuple):
    """A technology: the column of its code, and the highest channel and code (3GPP)."""

    code: str
    highest_channel: int
    highest_code: int


KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "GSM": Kind("bsic", HIGHEST_ARFCN, 63),  # TS 45.005 2, TS 23.003 4.3.2
        "WCDMA": Kind("psc", 16383, 511),  # TS 25.331 10.3.6.60 and 10.3.6.51
        "LTE": Kind("pci", 262143, 503),  # TS 36.331 6.3.4
        "NB-IoT": Kind("pci", 262143, 503),
        "NR": Kind("pci", 3279165, 1007),  # TS 38.331 6.3.2
    }
)
SAME_CARRIER = {"LTE-M": "LTE"}
"""A modem of LTE-M hears cells of LTE."""
_NAME = re.compile(r"(.+?)-(0|[1-9][0-9]{0,6})-(0|[1-9][0-9]{0,3})", re.ASCII)
_WORDS = re.compile(r"(GSM|WCDMA|UMTS|LTE|LTE-M|NB-IoT|NR)-.*", re.ASCII | re.IGNORECASE)
_EXAMPLES = "LTE-5780-210 (EARFCN, PCI), GSM-62-37 (ARFCN, BSIC), WCDMA-10737-25 or NR-632448-17"


def channel_name(reading: CellReading) -> str | None:
    """Name of a reading's cell by its channel and code, None where these are not known."""
    rat = SAME_CARRIER.get(reading.rat or "", reading.rat or "")
    kind = KINDS.get(rat)
    return None if kind is None else _name(rat, reading.arfcn, getattr(reading, kind.code))


def _name(rat: str, channel: int | None, code: int | None) -> str | None:
    kind = KINDS.get(rat)
    if kind is None or channel is None or code is None:
        return None
    if not (0 <= channel <= kind.highest_channel and 0 <= code <= kind.highest_code):
        return None
    return f"{rat}-{channel}-{code}"


def is_by_channel(cell: str) -> bool:
    """Whether a name is one of this module."""
    match = _NAME.fullmatch(cell)
    return match is not None and _name(match[1], int(match[2]), int(match[3])) == cell


def why_no_name(cell: str) -> str:
    """Why a name that begins with a technology is none; empty for all others."""
    if is_by_channel(cell) or not _WORDS.fullmatch(cell):
        return ""
    match = _NAME.fullmatch(cell)
    kind = None if match is None else KINDS.get(match[1])
    if kind is None:
        return f"{cell} names no channel and code of a cell: write {_EXAMPLES}"
    return (
        f"{cell} is no cell: the channel is at most {kind.highest_channel}, the "
        f"{kind.code.upper()} at most {kind.highest_code}"
    )
