"""Fibocom: cells from +GTCCINFO.

    AT+GTCCINFO?
    +GTCCINFO:
    LTE service cell:                                    (the FM350 prints no headings)
    1,4,262,02,BFD3,2D4201,189C,30,120,50,16,42,42,26    service, RAT, network, area, cell,
    LTE neighbor cell:                                   channel, PCI, band, bandwidth, indices
    2,4,,,,,189C,190,,24,24,2
    OK

Needs: nothing, no SIM either.
Known by: the maker, or the series L8x0-GL.
Doubts: area and cell are hexadecimal. Channel and PCI are so in the modems with headings and
decimal in the FM350; the rows of one reply decide it together: by letters, by the range of a PCI
and by the band of a channel. Of GSM rows only the front is known.
Sources: a measured reply (github 4IceG/luci-app-3ginfo-lite pull request 32); FM160 manual
9.1.15 (firmware_notes/fibocom.md).
"""

import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar

from logger.core.types import Rat, Role
from logger.drivers import network_mode
from logger.drivers.family import Claim, Family, cells_with
from logger.drivers.generic import Generic
from logger.drivers.protocols.at import Command, Dialogue
from logger.drivers.reading.row_language import (
    ECN0_OF_INDEX,
    RSCP_OF_INDEX,
    RSRP_OF_INDEX,
    RSRQ_OF_INDEX,
    SS_RSRP_OF_INDEX,
    SS_RSRQ_OF_INDEX,
    VALUES,
    Form,
    Kinds,
    NoCell,
    NumberForm,
    Row,
    Scale,
    Value,
    at,
    cell,
    cell_identity,
    decimal,
    form,
    hexadecimal,
    pieces,
)
from logger.drivers.reading.row_language import values as split
from logger.drivers.reading.standard_replies import is_serving, with_serving_cell

_REPLY = re.compile(
    r"\+GTCCINFO\s*[:?](.*?)(?=[+*^$!][A-Z]{3}|\bPCC\b|\bOK\b|\bERROR\b|\Z)",
    re.DOTALL | re.IGNORECASE,
)
_HEADING = re.compile(
    r"(LTE-NR|LTE|NR|UMTS|WCDMA|GSM)\b.*\b(?:service|neighbou?r) cell", re.IGNORECASE
)
_ROW = re.compile(r"(?:\A|(?<!,)\s|[\]>])([12] ?, ?\d{1,2} ?,[\w,. -]*)\W*\Z", re.ASCII)

_RATS: Mapping[str, Rat] = {"2": "WCDMA", "4": "LTE", "9": "NR"}
_RATS_OF_HEADINGS: Mapping[str, Rat] = {
    "LTE": "LTE",
    "NR": "NR",
    "UMTS": "WCDMA",
    "WCDMA": "WCDMA",
    "GSM": "GSM",
}
_NUMBER = r"-?\d{1,5}"
_raw = partial(decimal, low=-999)


def _index(attribute: str, scale: Scale, raw: str) -> Value:
    return Value(attribute, scale.value_of, _NUMBER, raw=(raw, _raw))


_cell28 = partial(cell_identity, bits=28, form=NumberForm(16, frozenset({7, 9})))
_KINDS: Kinds = {
    "mcc": VALUES["mcc"]._replace(pattern=r"\d{1,3}"),
    "mnc": VALUES["mnc"]._replace(pattern=r"\d{1,3}"),
    **{name: VALUES[name]._replace(pattern="[0-9A-F]{1,7}") for name in ("lac", "tac", "tac24")},
    "cid16": VALUES["cid16"]._replace(pattern="[0-9A-F]{1,10}"),
    "cid28": Value("cid", _cell28, "[0-9A-F]{1,10}"),  # the FM350 pads to the width of NR
    "cid36": VALUES["cid36"]._replace(pattern="[0-9A-F]{1,10}"),
    "channel": Value("", str, "[0-9A-F]{1,7}"),
    "code": Value("", str, "[0-9A-F]{1,4}"),
    "rscp": _index("rscp_dbm", RSCP_OF_INDEX, "rscp_raw"),
    "ecno": Value("ecio_db", ECN0_OF_INDEX.value_of, _NUMBER),
    "rsrp": _index("rsrp_dbm", RSRP_OF_INDEX, "rsrp_raw"),
    "rsrq": _index("rsrq_db", RSRQ_OF_INDEX, "rsrq_raw"),
    "ss_rsrp": _index("rsrp_dbm", SS_RSRP_OF_INDEX, "rsrp_raw"),
    "ss_rsrq": _index("rsrq_db", SS_RSRQ_OF_INDEX, "rsrq_raw"),
    "band": Value("", str, _NUMBER),
    "sinr": Value("more.sinr_raw", _raw, _NUMBER),
}
_PLACE = "channel code"


def _form(rat: Rat, names: str) -> Form:
    return form(rat, f"_service _rat mcc mnc {names}", _KINDS, unknown="-*")


_GSM = _form("GSM", "lac cid16 channel code _ ...")  # only the front is known
_FORMS: Mapping[tuple[str, Rat], Form] = {
    ("1", "LTE"): _form("LTE", "tac cid28 channel code band _bandwidth sinr _rxlev rsrp rsrq"),
    ("2", "LTE"): _form("LTE", "tac cid28 channel code _bandwidth _rxlev rsrp rsrq"),
    ("1", "NR"): _form(
        "NR", "tac24 cid36 channel code band _bandwidth sinr _rxlev ss_rsrp ss_rsrq"
    ),
    ("2", "NR"): _form("NR", "tac24 cid36 channel code sinr _rxlev ss_rsrp ss_rsrq"),
    ("1", "WCDMA"): _form("WCDMA", "lac cid28 channel code band ecno rscp _rac _rxlev"),
    ("2", "WCDMA"): _form(
        "WCDMA", "lac cid28 channel code _type _rank _ranking ecno _loss _rxlev rscp"
    ),
    ("1", "GSM"): _GSM,
    ("2", "GSM"): _GSM,
}
_MOST_CODE: Mapping[Rat, int] = {"GSM": 99, "WCDMA": 511, "LTE": 503, "NR": 1007}
# of LTE the end of the last band
_MOST_CHANNEL: Mapping[Rat, int] = {"GSM": 1023, "WCDMA": 16383, "LTE": 70705, "NR": 3279165}
# 7.125 to 24.25 GHz (3GPP TS 38.104 5.1, 5.4.2.1)
_BETWEEN_BANDS_OF_NR = range(875_001, 2_016_667)

_ANY_BAND = 999  # above all bands
_LTE_BAND_EDGES = (  # first downlink EARFCN and band (3GPP TS 36.101 table 5.7.3-1)
    "0:1 600:2 1200:3 1950:4 2400:5 2650:6 2750:7 3450:8 3800:9 4150:10 4750:11 5010:12 "
    "5180:13 5280:14 5730:17 5850:18 6000:19 6150:20 6450:21 6600:22 7500:23 7700:24 8040:25 "
    "8690:26 9040:27 9210:28 9660:29 9770:30 9870:31 9920:32 36000:33 36200:34 36350:35 "
    "36950:36 37550:37 37750:38 38250:39 38650:40 39650:41 41590:42 43590:43 45590:44 "
    "46590:45 46790:46 54540:47 55240:48 65536:65 66436:66 67336:67 67536:68 67836:69 "
    "68336:70 68586:71 68936:72 68986:73 69036:74 69466:75 70316:76 70366:85 70546:87 70596:88 "
    "70646:103 70656:106 70706:0"
)
_LTE_BANDS = [tuple(map(int, edge.split(":"))) for edge in _LTE_BAND_EDGES.split()]


_Cell = tuple[Rat, Mapping[str, str]]
"""A row of the reply in its form: its technology, its values by name."""


class Fibocom(Family):
    """Serving cell and neighbours by AT+GTCCINFO?."""

    name = "fibocom"
    gives = MappingProxyType(
        {
            "LTE": cells_with("neighbours"),
            "WCDMA": cells_with(),
        }
    )
    claim = Claim(maker=r"\bFIBOCOM\b", series=r"\b(?:L8[1356]0|FM350)-GL\b")
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

    padded_cells: ClassVar[Mapping[str, str]] = {
        "+GTCCINFO": "[12], ?9, ?[0-9]{0,3}, ?[0-9]{0,3}, ?[0-9A-F]{1,7}, ?(0)[0-9A-F]{9},"
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
        if split(row[1])[1] == "0":
            yield NoCell()
        elif (found := _cell(split(row[1]), heading)) is not None:
            cells.append(found)
    number = _base(cells, headings=headings)
    for found in cells:
        reading = _reading(*found, number)
        if reading is not None:
            yield reading


def _cell(fields: list[str], heading: str) -> _Cell | None:
    rat = _RATS.get(at(fields, 1)) or _RATS_OF_HEADINGS.get(heading)
    named = _FORMS[fields[0], rat].texts_by_name(fields) if rat else None
    return (rat, named) if rat and named else None


def _band(rat: Rat, named: Mapping[str, str]) -> int | None:
    """The modem adds 100 on LTE and prints 50 before the band on NR."""
    printed = decimal(named.get("band", ""), 1)
    if printed is None or rat != "NR":
        return printed - 100 if printed and rat == "LTE" and printed > 100 else printed
    digits = str(printed)
    return int(digits[2:]) if digits.startswith("50") and printed > 500 else None


def _base(cells: Sequence[_Cell], *, headings: bool) -> Callable[[str], int | None]:
    fitting = [read for read in (hexadecimal, decimal) if all(_fits(*of, read) for of in cells)]
    usual = hexadecimal if headings else decimal
    return usual if usual in fitting else next(iter(fitting), lambda _: None)


def _fits(rat: Rat, named: Mapping[str, str], read: Callable[[str], int | None]) -> bool:
    channel, code = (read(named[name]) if named[name] else 0 for name in ("channel", "code"))
    if channel is None or code is None or code > _MOST_CODE[rat] or channel > _MOST_CHANNEL[rat]:
        return False
    if rat == "NR":
        return channel not in _BETWEEN_BANDS_OF_NR
    band = _band(rat, named)
    if rat != "LTE" or band is None or not named["channel"]:
        return True
    return _LTE_BANDS[bisect_right(_LTE_BANDS, (channel, _ANY_BAND)) - 1][1] == band


def _reading(rat: Rat, named: Mapping[str, str], number: Callable[[str], int | None]) -> Row | None:
    if named["_service"] == "1" and re.fullmatch(r"[0-9]", named["mnc"]):  # it lost its zeros
        named = {name: text for name, text in named.items() if name not in {"mcc", "mnc"}}
    channel, code = (None if rat == "GSM" else number(named[name]) for name in ("channel", "code"))
    place: dict[str, Any] = {"arfcn": channel, "psc" if rat == "WCDMA" else "pci": code}
    role: Role = "serving" if named["_service"] == "1" else "neighbour"
    return cell(role, rat, named, _KINDS, band=_band(rat, named), **place)
