"""Rows of Quectel modems: the values of each form by name, and one reader for them all.

A form is the names of its values in their order; `_` is a value that is not read. A name with `!`
must be there and fit, one with `*` must be known too: they prove the order, since a comma lost or
added moves another value there, which does not fit. Then the row has another form.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from logger.core.types import CellReading, Rat, Role
from logger.drivers.reading.cell_values import VALUES, Readers, between, read_values
from logger.drivers.reading.fields import decimal, hexadecimal, level, network, rssi_dbm

DBM_OF_RXLEV_0 = -111.0  # EC2x manual 6.17; in practice the modem prints dBm

_UNKNOWN = frozenset({"", "-", "x", "255", "65535", "-32768", "-1920"})
_BESIDE = ("duplex", "sinr_raw", "srxlev")  # values of `more`
_BITS = {"lac": 16, "tac": 16, "tac24": 24, "cid16": 16, "cid28": 28, "cid36": 36}


@dataclass(frozen=True, slots=True)
class Form:
    """Values of a row by name; a row of fewer than `complete` values is cut."""

    names: tuple[str, ...]
    fitting: frozenset[str]
    known: frozenset[str]
    identity: frozenset[str]
    complete: int

    def is_cut(self, texts: Sequence[str]) -> bool:
        """True where the last value may have lost its end."""
        return len(texts) < self.complete or (len(texts) == self.complete and not texts[-1])

    def values_of(self, texts: Sequence[str]) -> dict[str, str] | None:
        """Values of a row by their names, None for a row of another form."""
        if self.is_cut(texts):
            texts = texts[:-1]
        named = dict(zip(self.names, texts, strict=False))
        if not (self.fitting | self.known) <= named.keys():
            return None
        fits = all(named[name] in _UNKNOWN or _is_known(name, named[name]) for name in self.fitting)
        return named if fits and all(_is_known(name, named[name]) for name in self.known) else None


def form(names: str, complete: int | None = None) -> Form:
    """The form whose values have these names; `complete` is their least number, by default all."""
    marked = names.split()
    return Form(
        names=tuple(name.rstrip("!*") for name in marked),
        fitting=frozenset(name[:-1] for name in marked if name.endswith("!")),
        known=frozenset(name[:-1] for name in marked if name.endswith("*")),
        identity=frozenset(marked) & _BITS.keys(),
        complete=len(marked) if complete is None else complete,
    )


def split(body: str) -> list[str]:
    """Values of a row; no value contains a comma, so a lost quotation mark does no harm."""
    return [text.strip(" \t\"'") for text in body.split(",")]


def cells(
    forms: Sequence[Form],
    texts: Sequence[str],
    role: Role,
    rat: Rat,
    more: Mapping[str, Any] | None = None,
) -> tuple[CellReading, ...]:
    """The cell of a row in the first form that it has; none without a form or without a value."""
    named_forms = ((shape, shape.values_of(texts)) for shape in forms)
    shape, named = next(((shape, named) for shape, named in named_forms if named), (None, None))
    if shape is None or named is None:
        return ()
    uncut = not shape.is_cut(texts) or shape.identity <= named.keys()
    ids = identity(named) if uncut else {}
    values = levels(named)
    if all(value is None for value in (*values.values(), *ids.values())):
        return ()
    beside = {name: values.pop(name) for name in _BESIDE if name in values}
    return (CellReading(role, rat, **ids, **values, more={**(more or {}), **beside}),)


def levels(named: Mapping[str, str]) -> dict[str, Any]:
    """Values but those of the identity, by attribute of a reading; None where unknown."""
    return read_values({name: named[name] for name in named if name not in _BITS}, _READERS)


def identity(named: Mapping[str, str]) -> dict[str, Any]:
    """Network, area and cell, or nothing: an area or a cell may be unknown but not damaged."""
    network_code: dict[str, Any] = {}
    if "mcc" in named:
        mcc, mnc = network(named["mcc"], named.get("mnc", ""))
        if mcc is None:
            return {}
        network_code = {"mcc": mcc, "mnc": mnc}
    parts = {name: named[name] for name in named if name in _BITS}
    for name, text in parts.items():
        if text not in {"", "-"} and hexadecimal(text, 0, 2 ** _BITS[name] - 1) is None:
            return {}
    return network_code | read_values(parts)


def _is_known(name: str, text: str) -> bool:
    return _READERS[name][1](text) is not None


def _duplex(text: str) -> str | None:
    return text.upper() if text.upper() in {"FDD", "TDD"} else None


def _mnc(text: str) -> str | None:
    return text if re.fullmatch(r"[0-9]{2,3}", text) else None


def _rxlev(text: str) -> float | None:
    index = decimal(text, 0, 63)
    return rssi_dbm(text) if index is None else DBM_OF_RXLEV_0 + index


_TENTH = 0.1
_rscp = partial(level, low=-140.0, high=-20.0)  # wider than 3GPP's: it proves the order only
_ecio = partial(level, low=-40.0, high=0.0)
_READERS: Readers = {
    **VALUES,
    "mcc": ("", between(0, 999)),
    "mnc": ("", _mnc),
    "order": ("", between(1, 9)),
    "dcs_pcs": ("", between(0, 1)),  # 0 is printed for any band
    "bandwidth": ("", between(0, 400)),
    "barred": ("", between(0, 1)),
    "pci": ("pci", between(0, 1007)),
    "band": ("band", between(1, 1024)),
    "duplex": ("duplex", _duplex),
    "rxlev": ("rssi_dbm", _rxlev),
    "rxlev_raw": ("rxlev_raw", between(0, 63)),
    "rssi10": ("rssi_dbm", partial(rssi_dbm, scale=_TENTH)),
    "rscp": ("rscp_dbm", _rscp),
    "rscp10": ("rscp_dbm", partial(_rscp, scale=_TENTH)),
    "ecio10": ("ecio_db", partial(_ecio, scale=_TENTH)),
    "sinr": ("sinr_raw", between(-100, 300)),
    "srxlev": ("srxlev", between(-200, 10000)),
}
