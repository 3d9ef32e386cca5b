"""Which countries are near a position, and which networks exist there."""

import gzip
import json
from array import array
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

TEST_MCC = "001"
TEST_MCCS = frozenset({TEST_MCC, "999"})
"""Test and private networks (ITU-T E.212)."""
INTERNATIONAL = "901"
"""Ships, aircraft and satellites."""
GSMR_ARFCNS = range(955, 975)
"""The railways' band (3GPP TS 45.005, 2)."""


@dataclass(frozen=True, slots=True, eq=False)
class Countries:
    """Countries by squares, and networks by mobile country code.

    `rows` are belts from the south: columns at which a set of countries begins, and its number.
    """

    step_deg: float
    near_km: float
    names: Mapping[str, str]
    sets: Sequence[str]
    rows: Sequence[tuple[Sequence[int], Sequence[int]]]
    of_mcc: Mapping[str, str]
    networks: Mapping[str, Mapping[str, str]]
    railways: frozenset[str]

    def near(self, lat_deg: float, lon_deg: float) -> tuple[str, ...]:
        """Codes of the countries nearer than `near_km` to the square of a position."""
        i = min(max(int((lat_deg + 90.0) / self.step_deg), 0), len(self.rows) - 1)
        column = int((lon_deg + 180.0) % 360.0 / self.step_deg)
        starts, numbers = self.rows[i]
        return tuple(self.sets[numbers[bisect_right(starts, column) - 1]].split())

    def countries_of(self, mcc: str) -> tuple[str, ...]:
        """Codes of the countries of a mobile country code; empty if it is nobody's."""
        return tuple(self.of_mcc.get(mcc, "").split())

    def name(self, code: str) -> str:
        """English name of a country."""
        return self.names.get(code, code)

    def is_listed(self, mcc: str, mnc: str) -> bool:
        """Whether a network is known.

        02 and 002 are the same: modems add or drop a zero. A network with three digits may
        broadcast only two (3GPP TS 24.008, 10.5.1.3).
        """
        known = self.networks.get(mcc, {})
        if not mnc.isdecimal():
            return False
        if len(mnc) == 2 and any(len(code) == 3 and code.startswith(mnc) for code in known):
            return True
        return any(int(mnc) == int(code) for code in known)

    def is_railway(self, mcc: str, mnc: str | None) -> bool:
        """Whether a network is that of a railway."""
        return f"{mcc}-{mnc}" in self.railways


@lru_cache(maxsize=1)
def countries() -> Countries:
    """The packed tables; see `data/README.md` for their sources."""
    packed = json.loads(
        gzip.decompress((files(__package__) / "data" / "countries.json.gz").read_bytes())
    )
    return Countries(
        packed["step_deg"],
        packed["near_km"],
        packed["countries"],
        tuple(packed["sets"]),
        tuple((array("H", row[0::2]), array("H", row[1::2])) for row in packed["rows"]),
        packed["mcc"],
        packed["networks"],
        frozenset(packed["railways"]),
    )
