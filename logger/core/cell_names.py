"""Names of cells, and which cells exist: those that two scans have named.

A changed digit names a cell that does not exist. The first time nothing shows it; where it comes
again, the driver knows the true cell and marks the identity as unsure. So a cell named in a single
scan is never a target and never located, and an unsure identity does not make a cell known.

A cell without an identity is named by technology, channel and code, as in `LTE-5780-210`. Networks
reuse codes some kilometres away, so two transmitters may have one such name.
"""

import re
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from logger.core.latest import Latest
from logger.core.types import HIGHEST_ARFCN, CellReading, Scan

REUSED_M = 10_000.0
"""Places of one name farther apart, with none between, are of two cells."""
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

_IDENTITY = re.compile(r"\d{3}-\d{2,3}-\d{1,8}-\d{1,11}", re.ASCII)
_NAME = re.compile(r"(.+?)-(0|[1-9][0-9]{0,6})-(0|[1-9][0-9]{0,3})", re.ASCII)
_BEGINS_SO = re.compile(r"(GSM|WCDMA|UMTS|LTE|LTE-M|NB-IoT|NR)-.*", re.ASCII | re.IGNORECASE)
_EXAMPLES = "LTE-5780-210 (EARFCN, PCI), GSM-62-37 (ARFCN, BSIC), WCDMA-10737-25 or NR-632448-17"
FEWEST_SCANS = 2
_THREE = frozenset({"302", *map(str, range(310, 317))})  # Canada, USA
# tests, India, Malaysia, El Salvador, Honduras, Panama, Argentina, Colombia, Falkland Islands,
# private networks
_EITHER = frozenset({"001", "405", "502", "706", "708", "714", "722", "732", "750", "999"})

_MOST_ONCE = 1000
"""With a false name in each second, a real cell has a quarter of an hour to be named again."""
_MOST_KNOWN = 10_000


def channel_name(reading: CellReading) -> str | None:
    """Name of a cell by channel and code, None where these are unknown."""
    rat = SAME_CARRIER.get(reading.rat or "", reading.rat or "")
    return _name(rat, reading.arfcn, getattr(reading, CODES.get(rat, ""), None))


def each_once(readings: Iterable[CellReading]) -> tuple[CellReading, ...]:
    """Readings of a scan, without neighbours that repeat a cell."""
    unique = dict.fromkeys(readings)
    with_level = [one for one in unique if one.level_dbm is not None]
    seen = {channel_name(one) for one in with_level if one.role == "serving" or one.cell}
    kept: list[CellReading] = []
    for one in unique:
        name = channel_name(one)
        is_nameless = one.role == "neighbour" and one.cell is None and name is not None
        if not is_nameless or name not in seen:
            kept.append(one)
        if is_nameless and one.level_dbm is not None:
            seen.add(name)
    return tuple(kept)


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


class Identities:
    """Names of late; those named once and those known are bounded apart.

    So false names displace no known one.
    """

    def __init__(self) -> None:
        self._once: Latest[None] = Latest(_MOST_ONCE)
        self._known: Latest[None] = Latest(_MOST_KNOWN)

    def __contains__(self, name: str | None) -> bool:
        return name in self._known

    def add(self, scan: Scan) -> None:
        """Add the names of a scan, each once."""
        sure = (r.cell for r in scan.readings if not r.identity_unsure)
        for name in dict.fromkeys(name for name in sure if name is not None):
            is_known = name in self._once or name in self._known
            self._once.pop(name, None)
            (self._known if is_known else self._once).put(name, None)


def is_identity(cell: str) -> bool:
    """Whether a text is the name of a cell with an identity, with the MNC in full."""
    return _IDENTITY.fullmatch(cell) is not None


class Identity(NamedTuple):
    """Network, area and cell; `area` is the LAC of GSM and WCDMA, the TAC of later technologies."""

    mcc: str | None = None
    mnc: str | None = None
    area: int | None = None
    cid: int | None = None


def identity_of(name: str) -> tuple[int, int, int, int] | None:
    """MCC, MNC, area and cell of a name, None where it is no identity."""
    parts = name.split("-")
    if len(parts) != 4 or not all(
        part.isascii() and part.isdigit() and len(part) < 12 for part in parts
    ):
        return None
    mcc, net, area, cell = map(int, parts)
    return mcc, net, area, cell


def with_hint(name: str, others: Iterable[str]) -> str:
    """A name, and that of `others` with the same numbers."""
    identity = identity_of(name)
    same = [one for one in others if identity is not None and identity_of(one) == identity]
    return f"{name} (did you mean {same[0]}?)" if same else name


def mnc_digits(mcc: str) -> int | None:
    """Digits of the network codes of a country (ITU-T E.212 and its list of networks).

    None where two and three are in use, as on many islands of zone 3.
    """
    if mcc in _THREE:
        return 3
    return None if mcc in _EITHER or mcc.startswith("3") else 2
