"""Siemens, Cinterion, Gemalto and Thales: cells from ^SMOND, ^SMONC, ^SMONI and tables.

    AT^SMONI
    ^SMONI: 2G,71,-61,262,02,0143,83BA,33,33,3,6,G,NOCONN    serving cell of later modems
    OK

    ^SMONC: 232,03,3010,4EAF,32,82,38,30,30,232,03,...    seven groups of nine values
    ^SMOND:250,01,00EA,0AE1,23,756,47,,,0,,,0,250,01,...,1,31,99
                                                          13 values, six times 7, TA, RSSI and BER
    chann rs  dBm  PLMN  LAC cell NCC BCC PWR RXLev  C1 I chann TS timAdv PWR  dBm Q ChMod
     847  19  -75 26201 2A3B 4C5D   5   2  33  -104  30 I    No connection

Needs: nothing; a poll takes the best of four commands that the modem has.
Known by: makers or series.
Doubts: area and cell have their full width in hexadecimal, so that a lost digit or comma shows: a
group of another form names no cell. `dBm` is the level; `RXLev` and `PWR` are parameters of the
cell, `rs` an index of another scale on each model. The network is one column or two. The bases of
BSIC in ^SMOND, and of area and cell in ^SNMON, are not documented. Huawei's GSM modules print
^SMONC and ^SMOND too (MG323 specification 8.5, 8.6).
Sources: ModemManager's tests (^SMONI) and public code (^SMOND); manuals TC35i V1.05 p207-210, MC35
V05.00 p186, TC63 V00.490 p194, EHS6 V03.001 8.12 (firmware_notes/cinterion.md).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import ClassVar

from logger.core.types import CellReading, Rat
from logger.drivers import network_mode
from logger.drivers.family import Claim, Family, cells_with
from logger.drivers.generic import Generic
from logger.drivers.protocols.at import Command, Dialogue
from logger.drivers.reading.row_language import (
    SEVEN,
    VALUES,
    Form,
    Kinds,
    NoCell,
    Row,
    Value,
    at,
    bsic_of,
    cell,
    cell_identity,
    decimal,
    form,
    network,
    number,
    pieces,
    rssi_dbm,
    values_like,
)
from logger.drivers.reading.row_language import values as split

_FLAGS = re.ASCII | re.IGNORECASE
_HEX4 = r"[0-9A-F]{4}"
_WORDS = (
    "Serving Cell Dedicated channel chann rs dBm PLMN MCC MNC LAC cell NCC BCC PWR RXLev C1 C2 I TS"
    " timAdv Q ChMod No connection Limited Service Reselection Searching 2G 3G 4G 5G"
    " EARFCN UARFCN PSC EC n0 RSCP Squal Srxlev Phys Ch SF Slot ComMod HSUPA HSDPA S_FR S_HR S_EFR"
)
"""Words of the tables."""


def _without_sign(text: str) -> float | None:
    return rssi_dbm("-" + text.lstrip("-"))


def _upper_text(text: str) -> str | None:
    return text.upper() or None


_KINDS: Kinds = {
    **values_like(levels=r"[-+]?\d{1,3}(?:\.\d{1,2})?"),
    "lac": VALUES["lac"]._replace(pattern=_HEX4),
    "tac": VALUES["tac"]._replace(pattern=_HEX4),
    "cid16": VALUES["cid16"]._replace(pattern=_HEX4),
    "cid28": Value("cid", partial(cell_identity, bits=28, form=SEVEN), r"[0-9A-F]{7}"),
    "decoded_bsic": number("bsic", 1, 63),  # 00 of ^SMONC is "not decoded"
    "bsic_raw": Value(
        "more.bsic_raw", _upper_text, r"\d{1,2}"
    ),  # of ^SMOND, its base is not documented
    "index": number("rxlev_raw", 0, 63),
    "rxlev": Value("rssi_dbm", _without_sign, r"[-+]?\d{1,3}"),
    "duplex": Value("more.duplex", _upper_text, "[FT]DD"),
    "ncc": number("more.ncc", 0, 7),
    "bcc": number("more.bcc", 0, 7),
    "lac_raw": Value("more.lac_raw", str),
    "cell_raw": Value("more.cell_raw", str),
    "rs": number("", 0, 99),
    "gprs": Value("", str, r"\w{1,4}"),
}
_WHO = "mcc mnc lac cid16"


def _form(rat: Rat, names: str, unknown: str = "-*") -> Form:
    return form(rat, names, _KINDS, unknown=unknown)


_SMONI = re.compile(r"\^SMONI\s*:\s*([^\^]*)", re.IGNORECASE)
_4G = "earfcn band _bw_dl _bw_ul duplex mcc mnc tac cid28 pci _power rsrp rsrq _ ..."
_SMONI_FORMS: Mapping[str, Form] = {  # one more value must follow
    "2G": _form("GSM", f"arfcn rssi {_WHO} c1 c2 ncc bcc gprs _ ..."),
    "3G": _form("WCDMA", "uarfcn psc ecn0 rscp mcc mnc lac cid28 _squal _srxlev _ ..."),
    "4G": _form("LTE", _4G),
    "CAT.M": _form("LTE-M", _4G),
    "CAT.NB": _form("NB-IoT", _4G),
}
_IDLE = frozenset({"NOCONN", "LIMSRV"})

_GROUPS = re.compile(r"\^SMON([CD])\s*:\s*([-0-9A-F, ]*)", re.IGNORECASE)
_SMONC = _form("GSM", f"{_WHO} decoded_bsic arfcn index c1 c2")
_SMOND = _form("GSM", f"{_WHO} bsic_raw arfcn rxlev")
_SMOND_SERVING = _form(
    "GSM", f"{_WHO} bsic_raw arfcn rxlev _full _sub _rxqual _rxqual_full _rxqual_sub _timeslot"
)
_NEIGHBOURS = 6
_TAIL = 3  # TA, RSSI, BER

_PLACE = (
    r"(?<![\w.,:+-])(?P<arfcn>\d{1,4})\s+(?P<rs>\d{1,2})\s+(?P<rssi>-\d{2,3})\s+"
    r"(?P<mcc>\d{3})\s*(?P<mnc>\d{2,3})\s+"
)
_NUMBER = r"(?:-?\d{1,3}|-+)"
_MONI = re.compile(
    _PLACE
    + r"(?P<lac>[0-9A-F]{4}|-+)\s+(?P<cid16>[0-9A-F]{4}|-+)\s+(?P<ncc>[0-7]|-+)\s+(?P<bcc>[0-7]|-+)"
    + rf"\s+{_NUMBER}\s+{_NUMBER}\s+(?P<c1>{_NUMBER})\s+[I|](?P<rest>.*)",
    _FLAGS,
)
_MONP = re.compile(
    _PLACE + rf"(?P<bcc>[0-7]|-+)\s+(?P<c1>{_NUMBER})\s+(?P<c2>{_NUMBER})\W*\Z", _FLAGS
)
_DEDICATED = re.compile(
    r"\s*(?:\d{1,4}|h)\s+\d\s+(?P<ta>\d{1,2})\s+\d{1,2}\s+-?\d{1,3}\s+(?P<q>[0-7])\s+\w{2,6}\W*\Z",
    _FLAGS,
)
_MONI_HEADER = re.compile(
    r"\bchann\s+rs\s+dBm\b.*\bNCC\b|\bServing Cell\b.*\bDedicated channel\b", _FLAGS
)
_SEARCHING = re.compile(r"(?:\A|\bI\s|[\s\]])\s*(Searching)\W*\Z", _FLAGS)

_MINUS = re.compile("\u00e2\x80[\x92-\x95]|[\u2012-\u2015\u2212\x96]")
"""Dashes for a minus in text from a manual, also UTF-8 read byte by byte."""

_HEADING = re.compile(r"(?:\A|\s)([2-5]G):\s*\Z", _FLAGS)
_SMONP_FORMS: Mapping[str, Form] = {
    "2G": _form("GSM", "arfcn* rs rssi* mcc mnc ncc bcc c1 c2 lac cid16 _c31 _c32", "-+"),
    "3G": _form("WCDMA", "uarfcn* psc* ecn0 rscp* [_ _ _]", "-+"),
}
_SNMON = re.compile(r'\^SNMON\s*:\s*"?INS"?\s*,\s*([^\^]*)', _FLAGS)
_SNMON_FORMS: Mapping[str, Form] = {  # the third value is the technology
    "0": form("GSM", "_ _ _ cell_raw lac_raw _ arfcn _ rssi _", _KINDS),
    "2": form("WCDMA", "_ _ _ cell_raw lac_raw _ uarfcn _ rscp psc", _KINDS),
}


class Cinterion(Family):
    """The serving cell and six neighbours, by the command that the modem has."""

    name = "cinterion"
    gives = MappingProxyType(
        {
            "GSM": cells_with("neighbours", "timing advance", "C1 and C2"),
            "WCDMA": cells_with("neighbours"),
            "LTE": cells_with("neighbours"),
        }
    )
    claim = Claim(
        maker=r"\bSIEMENS\b|(?<!TELIT )\bCINTERION\b|\bGEMALTO\b|\bTHALES\b",
        series=r"\b(?:AHS|ALAS|BGS|EHS|ELS|ENS|EXS|PDS|PHS|PLS|TX)\d{1,2}\b",  # Telit sells these
    )
    setup_commands = Generic.setup_commands
    ways = (
        (Command("AT^SMONI"), Command("AT^SMONP=255")),
        (Command("AT^SMOND"),),
        (Command("AT^SMONC"),),
        (Command("AT^MONI"), Command("AT^MONP")),
    )
    """From the best to the poorest, each with the neighbours' command last; no modem has all."""
    poll_commands = (
        *(command for way in ways for command in way),
        *Generic.poll_commands,
    )
    survey_commands = (
        Command('AT^SNMON="INS",2', timeout_s=180.0),
        *Generic.survey_commands,
    )
    mode_commands = network_mode.SXRAT
    unnamed_rows: ClassVar[Mapping[str, str]] = dict.fromkeys(("^MONI", "^MONP", "^SMONP"), _WORDS)

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells by the first way that gives any; neighbours by a later one where that refuses."""
        found: tuple[CellReading | NoCell, ...] = ()
        for *first, last in self.ways:
            serving = yield from self.ask(first)
            neighbours = yield from self.ask([last])
            rows = (
                row
                for row in (*(serving or ()), *(neighbours or ()))
                if isinstance(row, CellReading | NoCell)
            )
            found += tuple(
                row
                for row in rows
                if not found or (isinstance(row, CellReading) and row.role == "neighbour")
            )
            if found and (neighbours is not None or isinstance(found[0], NoCell)):
                break
        if any(isinstance(row, NoCell) or row.role == "serving" for row in found):
            return found
        # a serving cell in a form that is not known (an identity of another width) has +CREG
        common = yield from Generic().poll()
        return (*(common or ()), *found) if found else common

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in all forms of ^SMONC, ^SMOND, ^SMONI, ^SMONP, ^SNMON, ^MONI and ^MONP."""
        split_lines = tuple(pieces(lines))
        rows: list[Row | None] = []
        for line in split_lines:
            rows += grouped_cells(line)
            rows += map(_smoni, _SMONI.findall(line))
            rows += map(_snmon, _SNMON.findall(line))
        rows += _table_rows(split_lines)
        return tuple(row for row in rows if row is not None)


def _smoni(text: str) -> Row | None:
    act, *texts = split(text)
    shape = _SMONI_FORMS.get(act.upper().replace("-", ".").rstrip("12"))  # Cat.M1, Cat.NB2
    if act.upper() == "SEARCH" or (shape and at(texts, 0).upper() == "SEARCH"):
        return NoCell(shape.rat if shape else None, state="SEARCH")
    named = shape.texts_by_name(texts) if shape else None
    if shape is None or named is None:
        return None
    tail = texts[len(shape.names) - 1 :]
    state = re.sub(r"\W+", "", texts[-1]).upper()
    more: dict[str, int | str | None] = {"state": state} if state.isalpha() else {}
    # `power` is the TX power during a connection
    margin = named.get("_srxlev", named.get("_power", "") if state in _IDLE else "")
    if decimal(margin, -255, 255) is not None:
        more["srxlev"] = decimal(margin, -255, 255)
    # the dedicated channel, where `ARFCN,TS,timAdv,dBm,Q,ChMod` end the row
    has_timing = shape.rat == "GSM" and len(tail) in {6, 8}
    timing = decimal(tail[-4], 0, 63) if has_timing else None
    return cell("serving", shape.rat, named, _KINDS, more, bsic=_bsic(named), ta=timing)


def _bsic(named: Mapping[str, str]) -> int | None:
    return bsic_of(*(decimal(named.get(name, ""), 0, 7) for name in ("ncc", "bcc")))


def grouped_cells(line: str) -> Iterator[Row]:
    """Cells of a ^SMONC or ^SMOND line; `NoCell` where all groups are empty."""
    for kind, text in _GROUPS.findall(line):
        groups = tuple(_smonc_groups(text) if kind in "Cc" else _smond_groups(text))
        cells = [
            cell("neighbour" if number else "serving", "GSM", named, _KINDS, ta=timing)
            for number, named, timing in groups
            if named and _has_channel(named)
        ]
        yield from (found for found in cells if found is not None)
        if groups and not cells and all(named for _, named, _ in groups):
            yield NoCell("GSM")


def _has_channel(named: Mapping[str, str]) -> bool:
    channel = decimal(named["arfcn"], 0, 1023)
    return bool(channel) or (channel == 0 and network(named["mcc"], named["mnc"])[0] is not None)


_Group = tuple[int, dict[str, str] | None, int | None]
"""Number of a group, its values by name and its timing advance."""


def _smonc_groups(text: str) -> Iterator[_Group]:
    values, width = split(text), len(_SMONC.names)
    if len(values) % width:
        values.pop()  # the line is cut, perhaps within this value
    for start in range(0, len(values) - width + 1, width):
        yield start, _SMONC.texts_by_name(values[start : start + width]), None


def _smond_groups(text: str) -> Iterator[_Group]:
    values = split(text)
    first, width = len(_SMOND_SERVING.names), len(_SMOND.names)
    end = first + _NEIGHBOURS * width
    tail = values[end:]
    if first != len(values) < end:
        values.pop()  # cut
    if len(values) >= first:
        timing = decimal(tail[0], 0, 63) if len(tail) == _TAIL else None
        yield 0, _SMOND_SERVING.texts_by_name(values[:first]), timing
    for start in range(first, min(len(values), end) - width + 1, width):
        yield start, _SMOND.texts_by_name(values[start : start + width]), None


def _snmon(text: str) -> Row | None:
    """No manual gives the base of area and cell, which are kept as text."""
    texts = split(text)
    shape = _SNMON_FORMS.get(at(texts, 2))
    if shape is None or len(texts) != len(shape.names):
        return None
    mcc, mnc = network(texts[5][:3], texts[5][3:])
    return shape.cell("scan", texts, mcc=mcc, mnc=mnc)


def _table_rows(lines: Sequence[str]) -> Iterator[Row]:
    """Serving cell of ^MONI, neighbours of ^MONP and ^SMONP; `NoCell` while the modem searches."""
    moni = False
    heading = ""
    for line in lines:
        text = _MINUS.sub("-", line.strip())
        moni = moni or _MONI_HEADER.search(text) is not None
        title = _HEADING.search(text)
        heading = title[1].upper() if title else "" if "^" in text or text == "OK" else heading
        row = _moni(text) or _monp(text) or _smonp(text, heading)
        if row is not None:
            yield row
        elif moni and (word := _SEARCHING.search(text)):
            yield NoCell("GSM", state=word[1])


def _moni(line: str) -> Row | None:
    row = _MONI.search(line)
    if row is None:
        return None
    call = _DEDICATED.match(row["rest"])
    timing, quality = (decimal(call["ta"], 0, 63), decimal(call["q"])) if call else (None, None)
    state = " ".join(re.findall(r"[A-Za-z]+", row["rest"]))
    more = {} if call or not state else {"state": state}
    named = row.groupdict("")
    return cell("serving", "GSM", named, _KINDS, more, bsic=_bsic(named), ta=timing, rxq=quality)


def _monp(line: str) -> Row | None:
    row = _MONP.search(line)
    return cell("neighbour", "GSM", row.groupdict(""), _KINDS) if row else None


def _smonp(line: str, heading: str) -> Row | None:
    """The heading above a row decides how it is read."""
    shape = _SMONP_FORMS.get(heading)
    words = re.sub(r"\s*,\s*", ",", line).split()  # a log may write before the row
    named = shape.texts_by_name(split(words[-1])) if shape and words else None
    if shape is None or named is None:
        return None
    plain = {name: text for name, text in named.items() if name not in {"ncc", "bcc"}}
    return cell("neighbour", shape.rat, plain, _KINDS, bsic=_bsic(named))
