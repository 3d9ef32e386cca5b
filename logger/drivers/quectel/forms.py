"""Rows of Quectel modems: the values of each form by name, and one way to read them all.

A form is the names of its values in their order; `_` is a value that is not read. A name with `!`
must be there and fit, one with `*` must be known too: they prove the order, since a comma lost or
added moves a value that does not fit into their place. Then the row is no row of that form.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from logger.core.types import CellReading, Rat, Role
from logger.drivers.reading.fields import (
    area,
    cell_identity,
    decimal,
    hexadecimal,
    level,
    network,
    rsrp_dbm,
    rsrq_db,
    rssi_dbm,
)

DBM_OF_RXLEV_0 = -111.0  # EC2x manual 6.17; in practice the modem prints dBm

_UNKNOWN = frozenset({"", "-", "x", "255", "65535", "-32768", "-1920"})
_BESIDE = ("duplex", "sinr_raw", "srxlev")  # kept in `more`

_AREAS = {"lac": ("lac", 16), "tac": ("tac", 16), "tac24": ("tac", 24)}
_CELLS = {"cid16": 16, "cid28": 28, "cid36": 36}


@dataclass(frozen=True, slots=True)
class Form:
    """Values of a row by name; a row with fewer than `whole` values is cut, and its last one is not
    trusted.
    """

    names: tuple[str, ...]
    fitting: frozenset[str]
    known: frozenset[str]
    places: frozenset[str]
    whole: int

    def is_cut(self, texts: Sequence[str]) -> bool:
        """True where the last value may have lost its end."""
        return len(texts) < self.whole or (len(texts) == self.whole and not texts[-1])

    def named(self, texts: Sequence[str]) -> dict[str, str] | None:
        """Values of a row by their names, None for a row of another form."""
        if self.is_cut(texts):
            texts = texts[:-1]
        named = dict(zip(self.names, texts, strict=False))
        if not (self.fitting | self.known) <= named.keys():
            return None
        fits = all(named[name] in _UNKNOWN or _is_known(name, named[name]) for name in self.fitting)
        return named if fits and all(_is_known(name, named[name]) for name in self.known) else None


def form(names: str, whole: int | None = None) -> Form:
    """The form whose values have these names; `whole` is the number of values of an uncut row, by
    default all.
    """
    marked = names.split()
    return Form(
        names=tuple(name.rstrip("!*") for name in marked),
        fitting=frozenset(name[:-1] for name in marked if name.endswith("!")),
        known=frozenset(name[:-1] for name in marked if name.endswith("*")),
        places=frozenset(marked) & (_AREAS.keys() | _CELLS.keys()),
        whole=len(marked) if whole is None else whole,
    )


def split(body: str) -> list[str]:
    """Values of a row; no text in these rows holds a comma, so a lost quotation mark does no
    harm.
    """
    return [text.strip(" \t\"'") for text in body.split(",")]


def cell(
    forms: Sequence[Form],
    texts: Sequence[str],
    role: Role,
    rat: Rat,
    more: Mapping[str, Any] | None = None,
) -> CellReading | None:
    """The cell of a row in the first of the forms it has; None for a row of none and for one that
    tells nothing.
    """
    shape, named = next(
        ((shape, named) for shape in forms if (named := shape.named(texts))), (None, None)
    )
    if shape is None or named is None:
        return None
    who = identity(named) if not shape.is_cut(texts) or shape.places <= named.keys() else {}
    values = measured(named)
    if all(value is None for value in (*values.values(), *who.values())):
        return None
    beside = {name: values.pop(name) for name in _BESIDE if name in values}
    return CellReading(role, rat, **who, **values, more={**(more or {}), **beside})


def measured(named: Mapping[str, str]) -> dict[str, Any]:
    """Values but those of the identity, by attribute of a reading; None where the modem says
    unknown.
    """
    read = {
        _VALUES[name][0]: _VALUES[name][1](text) for name, text in named.items() if name in _VALUES
    }
    read.pop("", None)
    return read


def identity(named: Mapping[str, str]) -> dict[str, Any]:
    """Network, area and cell: whole or nothing, where an area or a cell may be unknown but not
    damaged.
    """
    found: dict[str, Any] = {}
    if "mcc" in named:
        found["mcc"], found["mnc"] = network(named["mcc"], named.get("mnc", ""))
        if found["mcc"] is None:
            return {}
    for name, text in named.items():
        bits = _AREAS[name][1] if name in _AREAS else _CELLS.get(name)
        if bits is None:
            continue
        if text not in {"", "-"} and hexadecimal(text, 0, 2**bits - 1) is None:
            return {}
        if name in _AREAS:
            found[_AREAS[name][0]] = area(text, bits=bits)
        else:
            found["cid"] = cell_identity(text, bits)
    return found


def _is_known(name: str, text: str) -> bool:
    return _VALUES[name][1](text) is not None


def _duplex(text: str) -> str | None:
    return text.upper() if text.upper() in {"FDD", "TDD"} else None


def _mnc(text: str) -> str | None:
    return text if re.fullmatch(r"[0-9]{2,3}", text) else None


def _rxlev(text: str) -> float | None:
    index = decimal(text, 0, 63)
    return rssi_dbm(text) if index is None else DBM_OF_RXLEV_0 + index


def _between(low: int, high: int) -> Callable[[str], int | None]:
    return partial(decimal, low=low, high=high)


_TENTH = 0.1

_VALUES: Mapping[
    str, tuple[str, Callable[[str], Any]]
] = {  # attribute, empty for what only proves the order; reader
    "mcc": ("", _between(0, 999)),
    "mnc": ("", _mnc),
    "order": ("", _between(1, 9)),
    "dcs_pcs": ("", _between(0, 1)),  # 0 is printed for any band
    "bandwidth": ("", _between(0, 400)),
    "barred": ("", _between(0, 1)),
    "arfcn": ("arfcn", _between(0, 1023)),
    "uarfcn": ("arfcn", _between(0, 16383)),
    "earfcn": ("arfcn", _between(0, 262143)),
    "nrarfcn": ("arfcn", _between(0, 3279165)),
    "bsic": ("bsic", _between(0, 63)),
    "psc": ("psc", _between(0, 511)),
    "pci": ("pci", _between(0, 1007)),
    "band": ("band", _between(1, 1024)),
    "duplex": ("duplex", _duplex),
    "rxlev": ("rssi_dbm", _rxlev),
    "rxlev_raw": ("rxlev_raw", _between(0, 63)),
    "rssi": ("rssi_dbm", rssi_dbm),
    "rssi10": ("rssi_dbm", partial(rssi_dbm, scale=_TENTH)),
    "rscp": ("rscp_dbm", partial(level, low=-140.0, high=-20.0)),
    "rscp10": ("rscp_dbm", partial(level, low=-140.0, high=-20.0, scale=_TENTH)),
    "ecio": ("ecio_db", partial(level, low=-40.0, high=0.0)),
    "ecio10": ("ecio_db", partial(level, low=-40.0, high=0.0, scale=_TENTH)),
    "rsrp": ("rsrp_dbm", rsrp_dbm),
    "rsrq": ("rsrq_db", rsrq_db),
    "sinr": ("sinr_raw", _between(-100, 300)),
    "srxlev": ("srxlev", _between(-200, 10000)),
    "c1": ("c1", _between(-255, 255)),
    "c2": ("c2", _between(-255, 255)),
    "ta": ("ta", _between(0, 63)),
}
