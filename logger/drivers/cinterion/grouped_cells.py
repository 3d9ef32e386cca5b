"""^SMONC and ^SMOND, the serving cell and six neighbours as groups of values in one line.

    ^SMONC: 232,03,3010,4EAF,32,82,38,30,30,232,03,...    seven groups of nine values
    ^SMOND:250,01,00EA,0AE1,23,756,47,,,0,,,0,250,01,...,1,31,99
                                                          13 values, six times 7, TA, RSSI and BER

Area and cell have their full width in hexadecimal (TC35i manual V1.05 p207-210), so that a lost
digit or comma shows: a group of another form names no cell. Huawei's GSM modules print these lines
too (MG323 specification 8.5, 8.6).
"""

import re
from collections.abc import Iterator, Mapping

from logger.core.types import CellReading, Role
from logger.drivers.reading.cell_values import read_values
from logger.drivers.reading.fields import at, decimal, network, rssi_dbm
from logger.drivers.reading.fields import values as split
from logger.drivers.reading.rows import NoCell, Row

_LINE = re.compile(r"\^SMON([CD])\s*:\s*([-0-9A-F, ]*)", re.IGNORECASE)

_CELL = ("mcc", "mnc", "lac", "cid16", "bsic", "arfcn")
_SMONC = (*_CELL, "index", "c1", "c2")
_NEIGHBOUR = (*_CELL, "rxlev")
_SERVING = (*_NEIGHBOUR, "full", "sub", "rxqual", "rxqual_full", "rxqual_sub", "timeslot")
_NEIGHBOURS = 6
_TAIL = 3  # TA, RSSI, BER

_HEX4 = r"[0-9A-F]{4}"
_SIGNED = r"[-+]?\d{1,3}(?:\.\d{1,2})?"
_FORMS = {  # of a value that is known; anything but these or an unknown mark is damage
    "mcc": r"\d{3}",
    "mnc": r"\d{2,3}",
    "lac": _HEX4,
    "tac": _HEX4,
    "cid16": _HEX4,
    "cid28": r"[0-9A-F]{7}",
    "bsic": r"\d{1,2}",
    "arfcn": r"\d{1,4}",
    "uarfcn": r"\d{1,5}",
    "earfcn": r"\d{1,6}",
    "psc": r"\d{1,3}",
    "pci": r"\d{1,3}",
    "index": r"\d{1,2}",
    "gprs": r"\w{1,4}",
    "duplex": r"[FT]DD",
}
_UNKNOWN = re.compile(r"-*")

_Group = tuple[Role, dict[str, str]]


def is_well_formed(named: Mapping[str, str]) -> bool:
    """True where each value has the form of its name, or is a mark for unknown."""
    return all(
        _UNKNOWN.fullmatch(text)
        or re.fullmatch(_FORMS.get(name, _SIGNED), text, re.ASCII | re.IGNORECASE)
        for name, text in named.items()
    )


def grouped_cells(line: str) -> Iterator[Row]:
    """Cells of a ^SMONC or ^SMOND line; `NoCell` where all groups are empty."""
    for kind, text in _LINE.findall(line):
        groups = tuple(_smonc_groups(text) if kind in "Cc" else _smond_groups(text))
        cells = [cell for cell in map(_reading, groups) if cell is not None]
        yield from cells
        if groups and not cells and all(is_well_formed(named) for _, named in groups):
            yield NoCell("GSM")


def _smonc_groups(text: str) -> Iterator[_Group]:
    values = split(text)
    if len(values) % len(_SMONC):
        values.pop()  # the line is cut, perhaps within this value
    for start in range(0, len(values) - len(_SMONC) + 1, len(_SMONC)):
        yield "neighbour" if start else "serving", dict(zip(_SMONC, values[start:], strict=False))


def _smond_groups(text: str) -> Iterator[_Group]:
    values = split(text)
    end = len(_SERVING) + _NEIGHBOURS * len(_NEIGHBOUR)
    tail = values[end:]
    if len(_SERVING) != len(values) < end:
        values.pop()  # cut
    if len(values) >= len(_SERVING):
        timing = at(tail, 0) if len(tail) == _TAIL else ""
        yield "serving", dict(zip(_SERVING, values, strict=False)) | {"ta": timing}
    last = min(len(values), end) - len(_NEIGHBOUR)
    for start in range(len(_SERVING), last + 1, len(_NEIGHBOUR)):
        yield "neighbour", dict(zip(_NEIGHBOUR, values[start:], strict=False))


def _reading(group: _Group) -> CellReading | None:
    """Reading of a group; None where there is no cell, or where the group is damaged."""
    role, named = group
    if not is_well_formed(named):
        return None
    mcc, mnc = network(named["mcc"], named["mnc"])
    channel = decimal(named["arfcn"], 0, 1023)
    if channel is None or (mcc is None and channel == 0):
        return None
    smonc = "index" in named
    values = read_values(named)
    if not mcc:
        values |= {"lac": None, "cid": None}
    # BSIC 00 of ^SMONC is "not decoded"; the base of that of ^SMOND is not documented
    values["bsic"] = decimal(named["bsic"], 1, 63) if smonc else None
    return CellReading(
        role=role,
        rat="GSM",
        mcc=mcc,
        mnc=mnc,
        rxlev_raw=decimal(named["index"], 0, 63) if smonc else None,
        rssi_dbm=None if smonc else rssi_dbm("-" + named["rxlev"].lstrip("-")),
        more={} if smonc else {"bsic_raw": named["bsic"] or None},
        **values,
    )
