"""u-blox +UCGED: the serving cell in two lines without a prefix, after one that has it.

    +UCGED: 2
    6,4,001,01                                    technology, service, mcc, mnc
    2525,5,50,50,e8fe,1a2d001,1,...               channel, band, bandwidths, area, cell, pci, ...

The SARA-R422 prints no service, and levels in dB; the LARA-R6 has rows of its own for 2G and 3G.
The layouts are those of u-blox's own library ubxlib, cell/src/u_cell_info.c. AT+UCGED=5 (SARA-R4)
answers with +RSRP and +RSRQ rows.
"""

import re
from collections.abc import Iterator, Sequence

from logger.core.types import Rat
from logger.drivers.reading.fields import listed
from logger.drivers.reading.rows import Row
from logger.drivers.ublox.cell import reading

_START = re.compile(r"\+UCGED:\s*2\b", re.IGNORECASE)
_STOP = re.compile(r"\bOK\b|\bERROR\b|\bAT\+", re.IGNORECASE)
_NETWORK = re.compile(
    r"(?<![\w.,-])(?P<rat>[2346])\s*,(?:\s*(?P<service>\d{1,3})\s*,)?\s*(?P<mcc>\d{3}|fff)\s*,\s*(?P<mnc>\d{1,3}|fff?)\s*\Z",
    re.IGNORECASE | re.ASCII,
)
_RATS: dict[str, Rat] = {"2": "GSM", "3": "WCDMA", "4": "LTE", "6": "LTE"}
_CHANNEL, _SMALL, _INDEX, _RATIO = r"\d{1,6}", r"\d{1,5}", r"-?\d{1,3}", r"-?\d{1,3}(?:\.\d+)?"
_AREA, _CELL, _HEX = r"[0-9A-F]{1,4}", r"[0-9A-F]{1,8}", r"[0-9A-F]{1,8}"
_GSM = listed(
    (
        ("arfcn", _CHANNEL),
        ("is_1900", r"\d{1,3}"),
        ("ci", _AREA),
        ("bsic_text", r"\w{1,3}"),
        ("lac", _AREA),
        ("rac", _HEX),
        ("rxlev", _INDEX),
        ("ta", _INDEX),
        ("c1", _INDEX),
        ("c2", _INDEX),
    )
)
_WCDMA = listed(
    (
        ("arfcn", _CHANNEL),
        ("band", _SMALL),
        ("ci", _CELL),
        ("lac", _AREA),
        ("rac", _HEX),
        ("psc", _SMALL),
        ("rrc", _SMALL),
        ("rssi_index", _INDEX),
        ("ecn0", _INDEX),
    )
)
_LTE_CARRIER = (
    ("arfcn", _CHANNEL),
    ("band", _SMALL),
    ("ul", _SMALL),
    ("dl", _SMALL),
    ("tac", _AREA),
)
_LTE = listed(
    (
        *_LTE_CARRIER,
        ("ci", _CELL),
        ("pci", _SMALL),
        ("tmsi", _HEX),
        ("mme_group", _HEX),
        ("mme", _HEX),
        ("rsrp", _INDEX),
        ("rsrq", _INDEX),
        ("sinr", _RATIO),
    )
)
_LTE_R422 = listed(
    (
        *_LTE_CARRIER,
        ("pci", _SMALL),
        ("rsrp_dbm", _RATIO),
        ("rsrq_db", _RATIO),
        ("sinr_index", _SMALL),
    )
)
_LEVELS = re.compile(r"\+(?P<name>RSRP|RSRQ):\s*(?P<cells>[^+]*)", re.IGNORECASE)
_LEVEL = re.compile(
    r'(?<!\d)(?P<pci>\d{1,3}),(?P<arfcn>\d{1,6}),"?(?P<value>-\d{1,3}\.\d{1,2})(?!\d)'
)


def ucged_rows(lines: Sequence[str]) -> tuple[Row, ...]:
    """Rows of all +UCGED replies in the lines."""
    return (*_serving_cells(lines), *_measured_cells(lines))


def _serving_cells(lines: Sequence[str]) -> Iterator[Row]:
    expected = False
    network: re.Match[str] | None = None
    for line in lines:
        started = _START.search(line) is not None
        if started or _STOP.search(line):
            expected, network = started, None
        elif expected and network is None:
            network = _NETWORK.search(line)
        elif network is not None and (values := _layout(network).search(line)):
            cell = reading(
                "serving", _RATS[network["rat"]], {**network.groupdict(""), **values.groupdict("")}
            )
            expected, network = (
                False,
                None,
            )  # the neighbours that may follow have no documented layout
            if cell is not None:
                yield cell


def _layout(network: re.Match[str]) -> re.Pattern[str]:
    rat = _RATS[network["rat"]]
    if rat == "LTE":
        return _LTE_R422 if network["service"] is None else _LTE
    return _GSM if rat == "GSM" else _WCDMA


def _measured_cells(lines: Sequence[str]) -> Iterator[Row]:
    """Cells of +RSRP rows, each with the +RSRQ of the same name; the first is the serving cell."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for line in lines:
        for levels in _LEVELS.finditer(line):
            name = {"rsrp": "rsrp_dbm", "rsrq": "rsrq_db"}[levels["name"].lower()]
            for cell in _LEVEL.finditer(levels["cells"]):
                texts = found.setdefault(
                    (cell["pci"], cell["arfcn"]), {"pci": cell["pci"], "arfcn": cell["arfcn"]}
                )
                texts[name] = cell["value"]
    for number, texts in enumerate(found.values()):
        row = reading("neighbour" if number else "serving", "LTE", texts)
        if row is not None:
            yield row
