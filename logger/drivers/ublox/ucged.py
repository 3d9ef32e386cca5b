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
from logger.drivers.reading.row_patterns import form, listed_row
from logger.drivers.reading.rows import Row
from logger.drivers.ublox.cell import readings

_START = re.compile(r"\+UCGED:\s*2\b", re.IGNORECASE)
_STOP = re.compile(r"\bOK\b|\bERROR\b|\bAT\+", re.IGNORECASE)
_NETWORK = re.compile(
    r"(?<![\w.,-])(?P<rat>[2346])\s*,(?:\s*(?P<service>\d{1,3})\s*,)?"
    r"\s*(?P<mcc>\d{3}|fff)\s*,\s*(?P<mnc>\d{1,3}|fff?)\s*\Z",
    re.IGNORECASE | re.ASCII,
)
_RATS: dict[str, Rat] = {"2": "GSM", "3": "WCDMA", "4": "LTE", "6": "LTE"}
_PATTERNS = {
    "channel": r"\d{1,6}",
    "small": r"\d{1,5}",
    "index": r"-?\d{1,3}",
    "flag": r"\d{1,3}",
    "text": r"\w{1,3}",
    "ratio": r"-?\d{1,3}(?:\.\d+)?",
    "area": r"[0-9A-F]{1,4}",
    "cell": r"[0-9A-F]{1,8}",
}
_LTE_CARRIER = "arfcn/channel band/small ul/small dl/small tac/area "


def _row(labels: str) -> re.Pattern[str]:
    return listed_row(form(labels, _PATTERNS))


_GSM = _row(
    "arfcn/channel is_1900/flag ci/area bsic_text/text lac/area rac/cell rxlev/index ta/index"
    " c1/index c2/index"
)
_WCDMA = _row(
    "arfcn/channel band/small ci/cell lac/area rac/cell psc/small rrc/small rssi_index/index"
    " ecn0/index"
)
_LTE = _row(
    _LTE_CARRIER + "ci/cell pci/small tmsi/cell mme_group/cell mme/cell rsrp/index rsrq/index"
    " sinr/ratio"
)
_LTE_R422 = _row(_LTE_CARRIER + "pci/small rsrp_dbm/ratio rsrq_db/ratio sinr_index/small")
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
            texts = network.groupdict("") | values.groupdict("")
            yield from readings("serving", _RATS[network["rat"]], texts)
            expected, network = False, None  # no manual gives the layout of neighbours


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
        yield from readings("neighbour" if number else "serving", "LTE", texts)
