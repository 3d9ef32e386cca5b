"""Fibocom: cells from +GTCCINFO (firmware_notes/fibocom.md).

    +GTCCINFO:
    LTE service cell:                                    (the FM350 prints no headings)
    1,4,262,02,BFD3,2D4201,189C,30,120,50,16,42,42,26    service, RAT, network, area, cell,
    LTE neighbor cell:                                   channel, PCI, band, bandwidth, indices
    2,4,,,,,189C,190,,24,24,2

Area and cell are hexadecimal. Channel and PCI are so in the modems with headings and decimal in the
FM350. The rows of one reply decide it together: by letters, by the range of a PCI and by the band
of a channel.
"""

import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from logger.core.types import CellReading, Rat
from logger.drivers import network_mode
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.generic import Generic
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.cell_values import area_values
from logger.drivers.reading.fields import (
    area,
    at,
    cell_identity,
    decimal,
    hexadecimal,
    network,
    pieces,
)
from logger.drivers.reading.fields import values as split
from logger.drivers.reading.index_scales import (
    ECN0_OF_INDEX,
    RSCP_OF_INDEX,
    RSRP_OF_INDEX,
    RSRQ_OF_INDEX,
    SS_RSRP_OF_INDEX,
    SS_RSRQ_OF_INDEX,
)
from logger.drivers.reading.number_text import NumberForm
from logger.drivers.reading.rows import NoCell, Row
from logger.drivers.reading.serving_cell import is_serving, with_serving_cell

_REPLY = re.compile(
    r"\+GTCCINFO\s*[:?](.*?)(?=[+*^$!][A-Z]{3}|\bPCC\b|\bOK\b|\bERROR\b|\Z)",
    re.DOTALL | re.IGNORECASE,
)
_HEADING = re.compile(
    r"(LTE-NR|LTE|NR|UMTS|WCDMA|GSM)\b.*\b(?:service|neighbou?r) cell", re.IGNORECASE
)
_ROW = re.compile(r"(?:\A|[\s\]>])([12],\d{1,2},[\w,.-]*)\W*\Z", re.ASCII)

_RATS: Mapping[str, Rat] = {"2": "WCDMA", "4": "LTE", "9": "NR"}
_RATS_OF_HEADINGS: Mapping[str, Rat] = {
    "LTE": "LTE",
    "NR": "NR",
    "UMTS": "WCDMA",
    "WCDMA": "WCDMA",
    "GSM": "GSM",
}
_FRONT = ("service", "rat", "mcc", "mnc", "area", "cell", "channel", "code")
_SERVICE = (*_FRONT, "band", "bandwidth", "sinr", "rxlev", "rsrp", "rsrq")
_LAYOUTS: Mapping[tuple[str, Rat], tuple[str, ...]] = {
    ("1", "LTE"): _SERVICE,
    ("1", "NR"): _SERVICE,
    ("2", "LTE"): (*_FRONT, "bandwidth", "rxlev", "rsrp", "rsrq"),
    ("2", "NR"): (*_FRONT, "sinr", "rxlev", "rsrp", "rsrq"),
    ("1", "WCDMA"): (*_FRONT, "band", "ecno", "rscp", "rac", "rxlev"),
    ("2", "WCDMA"): (*_FRONT, "type", "rank", "ranking", "ecno", "loss", "rxlev", "rscp"),
    ("1", "GSM"): _FRONT,
    ("2", "GSM"): _FRONT,
}
_FORMS = {
    "mcc": r"\d{1,3}",
    "mnc": r"\d{1,3}",
    "area": r"[0-9A-F]{1,7}",
    "cell": r"[0-9A-F]{1,10}",
    "channel": r"[0-9A-F]{1,7}",
    "code": r"[0-9A-F]{1,4}",
}
_BITS: Mapping[Rat, tuple[int, int]] = {
    "GSM": (16, 16),
    "WCDMA": (16, 28),
    "LTE": (16, 28),
    "NR": (24, 36),
}
_CELL = NumberForm(16, frozenset({7, 9}))  # the FM350 pads to the width of NR
_SCALES = {  # attribute and scale by the name of the value
    "rscp": ("rscp_dbm", RSCP_OF_INDEX),
    "ecno": ("ecio_db", ECN0_OF_INDEX),
    "rsrp": ("rsrp_dbm", RSRP_OF_INDEX),
    "rsrq": ("rsrq_db", RSRQ_OF_INDEX),
}
_SCALES_NR = {"rsrp": ("rsrp_dbm", SS_RSRP_OF_INDEX), "rsrq": ("rsrq_db", SS_RSRQ_OF_INDEX)}
_NOBODY = frozenset({0xFFFFFFF, 0xFFFFFFFF})  # fills the cell of a neighbour on NR too
_MOST_CODE: Mapping[Rat, int] = {"GSM": 99, "WCDMA": 511, "LTE": 503, "NR": 1007}

_ANY_BAND = 999  # above all bands
_LTE_BAND_EDGES = (  # first downlink EARFCN and band (3GPP TS 36.101 table 5.7.3-1)
    "0:1 600:2 1200:3 1950:4 2400:5 2650:6 2750:7 3450:8 3800:9 4150:10 4750:11 5010:12 "
    "5180:13 5280:14 5730:17 5850:18 6000:19 6150:20 6450:21 6600:22 7500:23 7700:24 8040:25 "
    "8690:26 9040:27 9210:28 9660:29 9770:30 9870:31 9920:32 36000:33 36200:34 36350:35 "
    "36950:36 37550:37 37750:38 38250:39 38650:40 39650:41 41590:42 43590:43 45590:44 "
    "46590:45 46790:46 54540:47 55240:48 65536:65 66436:66 67336:67 67536:68 67836:69 "
    "68336:70 68586:71"
)
_LTE_BANDS = [tuple(map(int, edge.split(":"))) for edge in _LTE_BAND_EDGES.split()]


@dataclass(frozen=True, slots=True)
class _Cell:
    """A row of the reply in one of the layouts."""

    rat: Rat
    named: Mapping[str, str]

    @property
    def band(self) -> int | None:
        """Band as a number; the modem adds 100 on LTE and prints 50 before it on NR."""
        printed = decimal(self.named.get("band", ""), 1)
        if printed is None or self.rat != "NR":
            return printed - 100 if printed and self.rat == "LTE" and printed > 100 else printed
        digits = str(printed)
        return int(digits[2:]) if digits.startswith("50") and printed > 500 else None


class Fibocom(Family):
    """Serving cell and neighbours by AT+GTCCINFO?, which takes 25 ms and needs no SIM."""

    name = "fibocom"
    claim = Claim(maker=r"\bFIBOCOM\b", series=r"\bL8[1356]0-GL\b")
    setup_commands = Generic.setup_commands
    poll_commands = (
        Command("AT+GTCCINFO?", timeout_s=8.0),
        *Generic.poll_commands,
    )
    survey_commands = Generic.survey_commands
    mode_commands = network_mode.GTRAT
    unnamed_rows: ClassVar[Mapping[str, str]] = {
        "+GTCCINFO": "LTE NR UMTS WCDMA GSM EN DC service neighbor neighbour cell PCC"
    }

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells received now; the serving one from +CREG and its like where +GTCCINFO has none."""
        rows = yield from self.ask(self.poll_commands)
        if rows is None or any(map(is_serving, rows)):
            return rows
        return with_serving_cell(rows)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Cells of all replies to +GTCCINFO."""
        found: list[Row] = []
        for reply in _REPLY.findall("\n".join(pieces(lines)) + "\n"):
            found += _reply_rows(reply.splitlines())
        return tuple(found)


def _reply_rows(lines: Sequence[str]) -> Iterator[Row]:
    headings = False
    heading = ""
    cells: list[_Cell] = []
    for line in lines:
        title = _HEADING.search(line)
        heading, headings = (title[1].upper(), True) if title else (heading, headings)
        row = _ROW.search(line)
        if row is None:
            continue
        if row[1].split(",")[1] == "0":
            yield NoCell()
        elif (cell := _cell(split(row[1]), heading)) is not None:
            cells.append(cell)
    number = _base(cells, headings=headings)
    yield from (_reading(cell, number) for cell in cells)


def _cell(fields: list[str], heading: str) -> _Cell | None:
    """Row in its layout; None where it is damaged or its technology unknown."""
    rat = _RATS.get(at(fields, 1)) or _RATS_OF_HEADINGS.get(heading)
    if rat is None:
        return None
    layout = _LAYOUTS[fields[0], rat]
    named = dict(zip(layout, fields, strict=False))
    well_formed = all(
        not text or re.fullmatch(_FORMS.get(name, r"-?\d{1,5}"), text, re.ASCII | re.IGNORECASE)
        for name, text in named.items()
    )
    # of a GSM row only the front is known; a row of another length has a comma more or less
    complete = len(fields) > len(_FRONT) if rat == "GSM" else len(fields) == len(layout)
    return _Cell(rat, named) if complete and well_formed else None


def _base(cells: Sequence[_Cell], *, headings: bool) -> Callable[[str], int | None]:
    """Reader of channels and PCIs: of the base that fits all rows, else that of the headings."""
    fitting = [read for read in (hexadecimal, decimal) if all(_fits(cell, read) for cell in cells)]
    usual = hexadecimal if headings else decimal
    return usual if usual in fitting else next(iter(fitting), lambda _: None)


def _fits(cell: _Cell, read: Callable[[str], int | None]) -> bool:
    channel, code = (
        read(cell.named[name]) if cell.named[name] else 0 for name in ("channel", "code")
    )
    if channel is None or code is None or code > _MOST_CODE[cell.rat]:
        return False
    if cell.rat != "LTE" or cell.band is None or not cell.named["channel"]:
        return True
    return _LTE_BANDS[bisect_right(_LTE_BANDS, (channel, _ANY_BAND)) - 1][1] == cell.band


def _reading(cell: _Cell, number: Callable[[str], int | None]) -> CellReading:
    named, rat = cell.named, cell.rat
    mcc, mnc = network(named["mcc"], named["mnc"])
    area_bits, cell_bits = _BITS[rat]
    later = rat in {"LTE", "NR"}
    area_code = area(named["area"], bits=area_bits)
    form = _CELL if rat in {"WCDMA", "LTE"} else None
    identity = cell_identity(named["cell"], cell_bits, form=form)
    is_nobody = identity in _NOBODY or (mcc is None and named["service"] != "1")
    channel, code = (None if rat == "GSM" else number(named[name]) for name in ("channel", "code"))
    scales = _SCALES | (_SCALES_NR if rat == "NR" else {})
    levels: dict[str, Any] = {
        attribute: scale.value_of(named[name])
        for name, (attribute, scale) in scales.items()
        if name in named
    }
    return CellReading(
        role="serving" if named["service"] == "1" else "neighbour",
        rat=rat,
        mcc=mcc,
        mnc=mnc,
        **area_values(rat, area_code),
        cid=None if is_nobody else identity,
        arfcn=channel,
        band=cell.band,
        psc=code if rat == "WCDMA" else None,
        pci=code if later else None,
        more={
            f"{name}_raw": decimal(named[name], -999)
            for name in ("sinr", "rsrp", "rsrq", "rscp")
            if name in named
        },
        **levels,
    )
