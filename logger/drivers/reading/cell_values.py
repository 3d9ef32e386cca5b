"""The values of a cell by the name of their form: which attribute of a reading, and how it is read.

A row reader maps its columns to these names. A text that is not such a value is None.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from logger.core.types import Rat
from logger.drivers.reading.fields import (
    area,
    cell_identity,
    decimal,
    hexadecimal,
    level,
    rscp_dbm,
    rsrp_dbm,
    rsrq_db,
    rssi_dbm,
)

Readers = Mapping[str, tuple[str, Callable[[str], Any]]]
"""Attribute of `CellReading` and reader by name; an empty attribute only proves the order."""


def between(low: int, high: int) -> Callable[[str], int | None]:
    """Reader of a decimal integer in [low, high]."""
    return partial(decimal, low=low, high=high)


VALUES: Readers = {
    "arfcn": ("arfcn", between(0, 1023)),  # 3GPP TS 45.005 2
    "uarfcn": ("arfcn", between(0, 16383)),  # 25.101 5.4.3
    "earfcn": ("arfcn", between(0, 262143)),  # 36.101 5.7.3
    "nrarfcn": ("arfcn", between(0, 3279165)),  # 38.104 5.4.2.1
    "band": ("band", between(1, 255)),
    "bsic": ("bsic", between(0, 63)),
    "psc": ("psc", between(0, 511)),
    "pci": ("pci", between(0, 503)),
    "pci_nr": ("pci", between(0, 1007)),
    "pci_hex": ("pci", partial(hexadecimal, low=0, high=1007)),
    "lac": ("lac", area),
    "tac": ("tac", area),
    "tac24": ("tac", partial(area, bits=24)),
    "cid16": ("cid", partial(cell_identity, bits=16)),
    "cid28": ("cid", partial(cell_identity, bits=28)),
    "cid36": ("cid", partial(cell_identity, bits=36)),
    "rssi": ("rssi_dbm", rssi_dbm),
    "rxq": ("rxq", between(0, 7)),  # 45.008 8.2.4
    "ta": ("ta", between(0, 63)),  # 45.010 5.4
    "c1": ("c1", between(-255, 255)),
    "c2": ("c2", between(-255, 255)),
    "rscp": ("rscp_dbm", rscp_dbm),
    "ecn0": ("ecio_db", partial(level, low=-32.0, high=0.0)),
    "ecio": ("ecio_db", partial(level, low=-40.0, high=0.0)),
    "rsrp": ("rsrp_dbm", rsrp_dbm),
    "rsrq": ("rsrq_db", rsrq_db),
    "sinr": ("sinr_db", partial(level, low=-23.0, high=40.0)),  # 38.133 10.1.16
    "snr": ("sinr_db", partial(level, low=-30.0, high=50.0)),  # as modems print it
}


def read_values(named: Mapping[str, str], readers: Readers = VALUES) -> dict[str, Any]:
    """Values by attribute of a reading; names without a reader are left out."""
    values = {
        readers[name][0]: readers[name][1](text) for name, text in named.items() if name in readers
    }
    values.pop("", None)
    return values


def area_values(rat: Rat | None, code: int | None) -> dict[str, Any]:
    """The area of a cell as `lac` of GSM and WCDMA, or as `tac` of later technologies."""
    return {"lac" if rat in {"GSM", "WCDMA"} else "tac": code}
