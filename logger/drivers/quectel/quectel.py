"""Quectel EC2x, EG, EM, EP, BG9x and the 5G modules: cells from AT+QENG, QSCAN and QOPS.

    +QENG: "servingcell","NOCONN","GSM",262,01,1A2B,3C4D,21,57,-,-66,255,255,0,39,41,1,-,...,"-"
    +QENG: "neighbourcell","GSM",262,01,1A2C,3C4F,27,61,-79,24,25,0,0
    +QENG: "servingcell","NOCONN"                   EN-DC: the cells follow in separate lines
    +QENG: "LTE","FDD",515,03,3359966,1,150,1,5,5,4AA3,-89,-13,-58,16,15,20,-
    +QENG: "NR5G-NSA",515,03,832,-76,21,-11,528030,41,8,1

The order of the values depends on the technology that the modem camps on. A neighbour's line does
not name that technology; its values show it. Area and cell are hexadecimal, all else is decimal
(firmware_notes/quectel.md).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

from logger.core.types import Rat
from logger.drivers import network_mode
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.protocols.dialogue import Command
from logger.drivers.quectel.forms import Form, cells, form, levels, split
from logger.drivers.reading import modem_gnss
from logger.drivers.reading.fields import decimal
from logger.drivers.reading.rows import NoCell, Row, Signal

_RATS: Mapping[str, Rat] = {  # as printed, without blanks and marks
    "GSM": "GSM",
    "WCDMA": "WCDMA",
    "LTE": "LTE",
    "CATM": "LTE-M",
    "CATM1": "LTE-M",
    "EMTC": "LTE-M",
    "CATNB": "NB-IoT",
    "CATNB1": "NB-IoT",
    "CATNB2": "NB-IoT",
    "NBIOT": "NB-IoT",
    "NTNNBIOT": "NB-IoT",
    "NR": "NR",
    "NR5G": "NR",
    "NR5GSA": "NR",
    "NR5GNSA": "NR",
}

_GSM = form(
    "mcc mnc lac cid16 bsic! arfcn! dcs_pcs! rxlev! _ _ _ c1 c2 _ _ _ ta _ _ _ _ _ _ _",
)
_WCDMA = form("mcc mnc lac cid28 uarfcn! psc! _ rscp! ecio _ _ _ _ _")
_LTE = form("duplex! mcc mnc cid28 pci! earfcn! band _ _ tac rsrp! rsrq rssi sinr")
_NR_SA = form("duplex! mcc mnc cid36 pci! tac24 nrarfcn! band bandwidth! rsrp! rsrq sinr")
_NR_NSA = form("mcc mnc pci! rsrp! sinr rsrq nrarfcn band", complete=6)
_SERVING_FORMS: Mapping[str, Form] = {
    "GSM": _GSM,
    "WCDMA": _WCDMA,
    "LTE": _LTE,
    "LTE-M": _LTE,
    "NB-IoT": _LTE,
    "NR5GSA": _NR_SA,
    "NR5GNSA": _NR_NSA,
}
_SRXLEV_AFTER = frozenset({1, 3})  # values of an LTE row behind sinr where the last one is srxlev

_NEIGHBOURS: Mapping[Rat, tuple[Form, ...]] = {
    "GSM": (
        form("mcc! mnc! lac cid16 bsic! arfcn* rxlev! c1 c2 _ _", complete=7),  # camped on GSM
        form("arfcn* _ _ _ _ _ bsic! rssi10! _"),  # on LTE
        form("bsic* rssi* _ _"),  # on WCDMA
    ),
    "WCDMA": (
        form("uarfcn! _ _ _ psc* rscp10! ecio10 srxlev"),  # on LTE
        form("uarfcn! _ psc* rscp10* ecio10 _ _ srxlev"),  # on WCDMA
        form("uarfcn! psc* rscp* ecio"),  # on GSM
    ),
    "NR": (form("nrarfcn! pci* rsrp! rsrq sinr", complete=4),),
}
_RSRQ_FIRST = form("earfcn! pci* rsrq rsrp! rssi sinr srxlev", complete=5)  # camped on LTE
_RSRP_FIRST = form(
    "earfcn! pci* rsrp! rsrq"
)  # on GSM, WCDMA or NR, and where the modem has a Unisoc chip
_NEIGHBOURS_LTE = {
    True: (_RSRQ_FIRST, _RSRP_FIRST),
    False: (_RSRP_FIRST, _RSRQ_FIRST),
}  # by "intra" or "inter"

_QSCAN: Mapping[Rat, Form] = {  # the last four only with AT+QSCAN=..,1
    "LTE": form("mcc mnc earfcn! pci! rsrp! rsrq srxlev _ cid28 tac _ band", complete=8),
    "NR": form("mcc mnc nrarfcn! pci! rsrp! rsrq srxlev _ cid36 tac24 _ band", complete=8),
}
_QSCAN_SHORT = 8  # values that a row has at least, and all it has without cell and area

_QOPS: Mapping[str, tuple[Rat, Form]] = {  # the network stands in the line above
    "2G": ("GSM", form("mcc mnc arfcn* lac cid16 bsic! rxlev_raw c1 barred! _")),
    "3G": ("WCDMA", form("mcc mnc uarfcn* psc! lac cid28 rscp! _ barred!")),
    "4G": ("LTE", form("mcc mnc earfcn* pci! tac cid28 rsrp! rsrq _")),
}

_QCSQ: Mapping[Rat | None, tuple[str, ...]] = {
    "GSM": ("rssi",),
    "WCDMA": ("rssi", "rscp", "ecio"),
    "LTE": ("rssi", "rsrp", "sinr", "rsrq"),
    "LTE-M": ("rssi", "rsrp", "sinr", "rsrq"),
    "NB-IoT": ("rssi", "rsrp", "sinr", "rsrq"),
    "NR": ("rsrp", "sinr", "rsrq"),
}

_ROW = re.compile(r"\+(QENG|QSCAN|QCSQ|QOPS)\s*:\s*(.*)", re.IGNORECASE)
_NEXT = re.compile(
    r"\\[rn]|(?=\+Q[A-Z0-9]+\s*:)", re.IGNORECASE
)  # a log may write CR and LF as text
_QOPS_CELL = re.compile(r'(?<![\w",])\d{1,3}\s*,\s*"([234]G)"\s*,(.*)')
_PLMN = re.compile(r'"?(\d{3})(\d{2,3})"?\s*\Z')
_SERVING = re.compile(r"servings?cell", re.IGNORECASE)
_NEIGHBOUR = re.compile(r"neighbou?rcell\s*(intra|inter)?", re.IGNORECASE)


class Quectel(Family):
    """Cells by `AT+QENG`; all cells by `AT+QOPS` (2G, 3G, 4G) or `AT+QSCAN` (5G modules)."""

    name = "quectel"
    claim = Claim(
        series=r"Quectel.*?(?<![A-Z0-9-])(?:EC|EG|EM|EP|BG|RM|RG|RX|AG|AF|AN|UC|UG|SC|SG)\d"
    )
    poll_commands = (
        Command('AT+QENG="servingcell"'),
        Command('AT+QENG="neighbourcell"'),
    )
    survey_commands = (
        Command('AT+QOPSCFG="scancontrol",0;+QOPS', timeout_s=300.0),
        Command('AT+QOPSCFG="scancontrol",1;+QOPS', timeout_s=300.0),
        Command('AT+QOPSCFG="scancontrol",2;+QOPS', timeout_s=300.0),
        Command("AT+QSCAN=3,1", timeout_s=300.0, silence_s=125.0),
    )
    gnss_start_commands = modem_gnss.QGPSLOC_ON
    gnss_poll_commands = modem_gnss.QGPSLOC
    mode_commands = network_mode.NWSCANMODE
    unnamed_rows: ClassVar[Mapping[str, str]] = {"+QOPS": ""}
    other_rows = "+QCSQ"

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Cells in QENG, QSCAN and QOPS rows, levels in QCSQ rows, fixes of the receiver."""
        return (*_rows(lines), *modem_gnss.read_qgpsloc(lines))


def _rows(lines: Sequence[str]) -> Iterator[Row]:
    state = None  # of the modem, in a line before the cells where it has two at once
    network = ("", "")  # of the QOPS rows that follow
    for line in lines:
        for piece in _NEXT.split(line.replace('\\"', '"')):
            row = _ROW.search(piece)
            if row is None:
                for generation, values in _QOPS_CELL.findall(piece):
                    yield from _offered_cells(network, generation, split(values))
                continue
            kind, texts = row[1].upper(), split(row[2])
            if kind == "QENG":
                if _SERVING.fullmatch(texts[0]):
                    state = texts[1] if len(texts) == 2 else None
                yield from _engineering(texts, state)
            elif kind == "QOPS":
                plmn = _PLMN.search(texts[-1])
                network = (plmn[1], plmn[2]) if plmn else ("", "")
            else:
                yield from (_scan if kind == "QSCAN" else _quality)(texts)


def _engineering(texts: list[str], state: str | None) -> Iterator[Row]:
    neighbour = _NEIGHBOUR.fullmatch(texts[0])
    if neighbour and len(texts) > 1:
        yield from _neighbour(neighbour[1], texts[1], texts[2:])
    elif not _SERVING.fullmatch(texts[0]):
        yield from _serving(texts[0], texts[1:], state)
    elif len(texts) > 2:
        yield from _serving(texts[2], texts[3:], texts[1])
    elif state == "SEARCH":
        yield NoCell(state=state)


def _serving(word: str, texts: list[str], state: str | None) -> Iterator[Row]:
    rat = _rat(word)
    shape = _SERVING_FORMS.get(_plain(word)) or _SERVING_FORMS.get(rat or "")
    if rat is None or shape is None:
        return
    more: dict[str, int | str | None] = {"state": state or None}
    if rat == "NR":
        more["mode"] = _plain(word)[4:]
    elif shape is _LTE:
        tail = len(texts) - len(_LTE.names)
        more["srxlev"] = decimal(texts[-1], -200, 10000) if tail in _SRXLEV_AFTER else None
    yield from cells((shape,), texts, "serving", rat, more)


def _neighbour(kind: str | None, word: str, texts: list[str]) -> Iterator[Row]:
    rat = _rat(word)
    if rat is None:
        return
    more = {"kind": kind.lower()} if kind else {}
    forms = _NEIGHBOURS.get(rat) or _NEIGHBOURS_LTE[bool(kind)]
    for reading in cells(forms, texts, "neighbour", rat, more):
        announced = rat == "GSM" and reading.mcc is None and reading.rssi_dbm is None
        yield replace(reading, bsic=None) if announced else reading  # a filler before reception


def _scan(texts: list[str]) -> Iterator[Row]:
    rat = _rat(texts[0])
    if rat is None or rat not in _QSCAN:
        return
    values = texts[1:]
    complete = len(values) >= len(_QSCAN[rat].names)
    yield from cells((_QSCAN[rat],), values if complete else values[:_QSCAN_SHORT], "scan", rat)


def _offered_cells(network: tuple[str, str], generation: str, texts: list[str]) -> Iterator[Row]:
    rat, shape = _QOPS[generation]
    yield from cells((shape,), [*network, *texts], "scan", rat)


def _quality(texts: list[str]) -> Iterator[Row]:
    rat = _rat(texts[0])
    names = _QCSQ.get(rat)
    if names and len(texts) > len(names):
        values = levels(dict(zip(names, texts[1:], strict=False)))
        more = {name: values.pop(name) for name in ("sinr_raw",) if name in values}
        yield Signal(rat, **values, more=more)
    elif _plain(texts[0]) == "NOSERVICE":
        yield NoCell(status=texts[0])


def _plain(word: str) -> str:
    return re.sub(r"[^A-Z0-9]", "", word.upper())


def _rat(word: str) -> Rat | None:
    return _RATS.get(_plain(word))
