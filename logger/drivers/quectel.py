"""Quectel EC2x, EG, EM, EP, BG9x and the 5G modules: cells from AT+QENG, QSCAN and QOPS.

    AT+QENG="servingcell"
    +QENG: "servingcell","NOCONN"                   EN-DC: the cells follow in separate lines
    +QENG: "LTE","FDD",515,03,3359966,1,150,1,5,5,4AA3,-89,-13,-58,16,15,20,-
    +QENG: "NR5G-NSA",515,03,832,-76,21,-11,528030,41,8,1
    OK

    +QENG: "servingcell","NOCONN","GSM",262,01,1A2B,3C4D,21,57,-,-66,255,255,0,39,41,1,-,...,"-"
    +QENG: "neighbourcell","GSM",262,01,1A2C,3C4F,27,61,-79,24,25,0,0

Needs: nothing; the commands read what the modem measures anyway.
Known by: the maker with a series of two letters and a digit.
Doubts: the order of the values depends on the technology that the modem camps on. A neighbour's
line does not name that technology; its values show it. Area and cell are hexadecimal, all else is
decimal.
Sources: a measured EN-DC reply (github 4IceG/luci-app-3ginfo-lite issue 56); EC2x AT commands
manual 6.15 to 6.17 (firmware_notes/quectel.md).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import ClassVar

from logger.core.types import Rat
from logger.drivers import network_mode
from logger.drivers.family import Claim, Family, cells_with
from logger.drivers.protocols.at import Command
from logger.drivers.reading import modem_gnss
from logger.drivers.reading.row_language import (
    VALUES,
    Form,
    Kinds,
    NoCell,
    Row,
    Signal,
    Value,
    decimal,
    first_cell,
    form,
    level,
    number,
    read_values,
    rssi_dbm,
    split,
)

DBM_OF_RXLEV_0 = -111.0  # EC2x manual 6.17; in practice the modem prints dBm


def _rxlev(text: str) -> float | None:
    index = decimal(text, 0, 63)
    return rssi_dbm(text) if index is None else DBM_OF_RXLEV_0 + index


def _duplex(text: str) -> str | None:
    return text.upper() if text.upper() in {"FDD", "TDD"} else None


_TENTH = 0.1
_rscp = partial(level, low=-140.0, high=-20.0)  # wider than 3GPP's: it proves the order only
KINDS: Kinds = {
    **VALUES,
    "order": number("", 1, 9),
    "dcs_pcs": number("", 0, 1),  # 0 is printed for any band
    "bandwidth": number("", 0, 400),
    "barred": number("", 0, 1),
    "pci": VALUES["pci_nr"],
    "band": number("band", 1, 1024),
    "duplex": Value("more.duplex", _duplex),
    "rxlev": Value("rssi_dbm", _rxlev),
    "rxlev_raw": number("rxlev_raw", 0, 63),
    "rssi10": Value("rssi_dbm", partial(rssi_dbm, scale=_TENTH)),
    "rscp": Value("rscp_dbm", _rscp),
    "rscp10": Value("rscp_dbm", partial(_rscp, scale=_TENTH)),
    "ecio10": Value("ecio_db", partial(level, low=-40.0, high=0.0, scale=_TENTH)),
    "sinr": number("more.sinr_raw", -100, 300),
    "srxlev": number("more.srxlev", -200, 10000),
}
"""Values of all Quectel modems."""

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

_LTE = "duplex! mcc mnc cid28 pci! earfcn! band _ _ tac rsrp! rsrq rssi sinr"
_SERVING_FORMS: Mapping[str, str] = {
    "GSM": "mcc mnc lac cid16 bsic! arfcn! dcs_pcs! rxlev! _ _ _ c1 c2 _ _ _ ta _ _ _ _ _ _ _",
    "WCDMA": "mcc mnc lac cid28 uarfcn! psc! _ rscp! ecio _ _ _ _ _",
    "LTE": _LTE,
    "LTE-M": _LTE,
    "NB-IoT": _LTE,
    "NR5GSA": "duplex! mcc mnc cid36 pci! tac24 nrarfcn! band bandwidth! rsrp! rsrq sinr",
    "NR5GNSA": "mcc mnc pci! rsrp! sinr rsrq [nrarfcn band]",
}
_SRXLEV_AFTER = frozenset({1, 3})  # values of an LTE row behind sinr where the last one is srxlev


def _forms(rat: Rat, *rows: str) -> tuple[Form, ...]:
    return tuple(form(rat, names, KINDS) for names in rows)


_NEIGHBOURS: Mapping[Rat, tuple[Form, ...]] = {
    "GSM": _forms(
        "GSM",
        "arfcn* _ _ _ _ _ bsic! rssi10* _",  # camped on LTE; in tenths no other value is so low
        "mcc! mnc! lac cid16 bsic! arfcn* rxlev! [c1 c2 _ _]",  # on GSM
        "arfcn* _ _ _ _ _ bsic! rssi10! _",  # on LTE
        "bsic* rssi* _ _",  # on WCDMA
    ),
    "WCDMA": _forms(
        "WCDMA",
        "uarfcn! _ _ _ psc* rscp10! ecio10 srxlev",  # on LTE
        "uarfcn! _ psc* rscp10* ecio10 _ _ srxlev",  # on WCDMA
        "uarfcn! psc* rscp* ecio",  # on GSM
    ),
    "NR": _forms("NR", "nrarfcn! pci* rsrp! rsrq [sinr]"),
}
_ANNOUNCED = "-1920"  # level of a cell of GSM that was not received
_RSRQ_FIRST = "earfcn! pci* rsrq rsrp! rssi [sinr srxlev]"  # camped on LTE
_RSRP_FIRST = "earfcn! pci* rsrp! rsrq"  # on others, and where the modem has a Unisoc chip
# an RSRP is no RSRQ, however unknown the other is
_INTRA_OR_INTER: Sequence[str] = (_RSRQ_FIRST.replace("rsrq", "rsrq!"), _RSRP_FIRST, _RSRQ_FIRST)

_QSCAN: Mapping[Rat, Form] = {  # the last four only with AT+QSCAN=..,1
    "LTE": form("LTE", "mcc mnc earfcn! pci! rsrp! rsrq srxlev _ [cid28 tac _ band]", KINDS),
    "NR": form("NR", "mcc mnc nrarfcn! pci! rsrp! rsrq srxlev _ [cid36 tac24 _ band]", KINDS),
}

_QOPS: Mapping[str, Form] = {  # the network stands in the line above
    "2G": form("GSM", "mcc mnc arfcn* lac cid16 bsic! rxlev_raw c1 barred! _", KINDS),
    "3G": form("WCDMA", "mcc mnc uarfcn* psc! lac cid28 rscp! _ barred!", KINDS),
    "4G": form("LTE", "mcc mnc earfcn* pci! tac cid28 rsrp! rsrq _", KINDS),
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
    gives = MappingProxyType(
        {
            "GSM": cells_with("C1 and C2"),
            "WCDMA": cells_with("neighbours"),
            "LTE": cells_with("neighbours"),
            "LTE-M": cells_with(),
            "NB-IoT": cells_with("neighbours"),
            "NR": cells_with("neighbours"),
        }
    )
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
    rows_with_networks = "+QOPS"

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Cells in QENG, QSCAN and QOPS rows, levels in QCSQ rows, fixes of the receiver."""
        return (*_rows(lines), *modem_gnss.read_qgpsloc(lines))


def _rows(lines: Sequence[str]) -> Iterator[Row]:
    state = None  # of the modem, in a line before the cells where it has two at once
    network = ("", "")  # of the QOPS rows that follow
    for line in lines:
        for piece in _NEXT.split(line.replace('\\"', '"')):
            row = _ROW.search(piece)
            rows: list[Row | None] = []
            kind, texts = (row[1].upper(), split(row[2])) if row else ("", [])
            if kind == "QENG":
                if _SERVING.fullmatch(texts[0]):
                    state = texts[1] if len(texts) == 2 else None
                rows = [_engineering(texts, state)]
            elif kind == "QOPS":
                plmn = _PLMN.search(texts[-1])
                network = (plmn[1], plmn[2]) if plmn else ("", "")
            elif row:
                rows = [(_scan if kind == "QSCAN" else _quality)(texts)]
            else:
                rows += (
                    _QOPS[generation].cell("scan", [*network, *split(values)])
                    for generation, values in _QOPS_CELL.findall(piece)
                )
            yield from (found for found in rows if found is not None)


def _engineering(texts: list[str], state: str | None) -> Row | None:
    neighbour = _NEIGHBOUR.fullmatch(texts[0])
    if neighbour and len(texts) > 1:
        return _neighbour(neighbour[1], texts[1], texts[2:])
    if not _SERVING.fullmatch(texts[0]):
        return _serving(texts[0], texts[1:], state)
    if len(texts) > 2:
        return _serving(texts[2], texts[3:], texts[1])
    return NoCell(state=state) if state == "SEARCH" else None


def _serving(word: str, texts: list[str], state: str | None) -> Row | None:
    rat = _rat(word)
    names = _SERVING_FORMS.get(_plain(word)) or _SERVING_FORMS.get(rat or "")
    if rat is None or names is None:
        return None
    shape = form(rat, names, KINDS)
    more: dict[str, int | str | None] = {"state": state or None}
    if rat == "NR":
        more["mode"] = _plain(word)[4:]
    elif names is _LTE:
        tail = len(texts) - len(shape.names)
        more["srxlev"] = decimal(texts[-1], -200, 10000) if tail in _SRXLEV_AFTER else None
    return shape.cell("serving", texts, more)


def _neighbour(kind: str | None, word: str, texts: list[str]) -> Row | None:
    rat = _rat(word)
    if rat is None:
        return None
    lte = _INTRA_OR_INTER if kind else (_RSRP_FIRST, _RSRQ_FIRST)
    forms = _NEIGHBOURS.get(rat) or _forms(rat, *lte)
    if rat == "GSM" and _ANNOUNCED in texts:
        forms = forms[2:]  # seen from LTE: its channel and priority are no network
    reading = first_cell(forms, "neighbour", texts, {"kind": kind.lower()} if kind else {})
    if reading and rat == "GSM" and reading.mcc is None and reading.rssi_dbm is None:
        return replace(reading, bsic=None)  # a filler before reception
    return reading


def _scan(texts: list[str]) -> Row | None:
    shape = _QSCAN.get(_rat(texts[0]) or "GSM")
    if shape is None:
        return None
    values = texts[1:]
    is_complete = len(values) >= len(shape.names)
    return shape.cell("scan", values if is_complete else values[: shape.least])


def _quality(texts: list[str]) -> Row | None:
    rat = _rat(texts[0])
    names = _QCSQ.get(rat)
    if names and len(texts) > len(names):
        return Signal(rat, **read_values(dict(zip(names, texts[1:], strict=False)), KINDS))
    return NoCell(status=texts[0]) if _plain(texts[0]) == "NOSERVICE" else None


def _plain(word: str) -> str:
    return re.sub(r"[^A-Z0-9]", "", word.upper())


def _rat(word: str) -> Rat | None:
    return _RATS.get(_plain(word))
