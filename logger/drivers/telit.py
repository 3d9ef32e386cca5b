"""Telit: cells from AT#MONI and AT#SERVINFO, all carriers from AT#CSURV and AT#CSURVC.

    AT#MONI                                                     after AT#MONI=7
    #MONI: Cell BSIC LAC CellId ARFCN Power C1 C2 TA RxQual PLMN
    #MONI: S 74 E720 9976 1022 -60dbm 45 0 1 0 E-Plus
    #MONI: N1 FF FFFF 0000 980 -76dbm -1 -1                     measured, not decoded
    OK

    AT#CSURV
    Network survey started ...
    arfcn: 61 bsic: 37 rxLev: -57 ber: 0.00 mcc: 262 mnc: 1 lac: 12345 cellId: 6789 cellStatus: ...
    1005,26,-76,0,262,02,23456,34567,CELL_SUITABLE,0            the same by #CSURVC
    Network survey ended

    ... cellStatus: CELL_SUITABLE numArfcn: 2 arfcn: 30 48 numChannels: 5 array: 14 19 22 48 82
    ... pbcch: 0 mstxpwr: 5 rxaccmin: 8 croffset: 30 penaltyt: 0 t3212: 10 CRH: 4

Needs: AT#MONI=7 for all cells, AT#CSURVF=0 for decimal numbers, AT#CSURVEXT for neighbour lists.
Known by: the maker Telit, or a series of its modules.
Doubts: in #MONI LAC and cell id are hexadecimal, the BSIC two octal digits; ARFCN 1024 is an
empty slot. A survey does not state the base of its numbers: AT#CSURVF decides whether area and cell
are decimal (0, as shipped) or padded hexadecimal with an octal BSIC. Widths, letters and ranges
show it; where nothing does, it is taken for decimal and the identity is unsure. Behind the status
of a GSM cell the channels of the cell itself (Cell Channel Description) come first, those of its
neighbours (BA list) second. Such a tail is read completely or not at all: each list has the printed
number of channels, and what follows stands in its order.
Sources: measured #MONI rows in public code; rows with values of our own in the formats of the
manuals, GM862 80000ST10025a p273-278 and p376-386, HE863 80377ST10083a p141, LE910 V2 80446ST10707A
p287-289; LTE from a measured LM960 (firmware_notes/telit.md).
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar

from logger.core.cell_names import Identity
from logger.core.types import HIGHEST_ARFCN, MOST_NEIGHBOURS, Broadcast, CellReading, Rat, Role
from logger.drivers import network_mode
from logger.drivers.family import Claim, Family, cells_with
from logger.drivers.protocols.at import Command, Dialogue
from logger.drivers.reading import modem_gnss
from logger.drivers.reading.row_language import (
    VALUES,
    Kinds,
    NoCell,
    Registration,
    Row,
    Value,
    area,
    at,
    cell_identity,
    decimal,
    hexadecimal,
    labelled_row,
    listed_row,
    network,
    pieces,
    read_values,
    values,
    with_identity,
)
from logger.drivers.reading.standard_replies import is_serving


def _octal_bsic(text: str) -> int | None:
    return int(text, 8) if re.fullmatch(r"[0-7]{2}", text) else None


_MOST_OF_DECIMAL_PCI = 3  # digits; one in hexadecimal is padded
_HIGHEST_PCI = 503
"""Some models print the PCI where others print the cell identity, which is higher than this."""

_MONI = re.compile(r"#MONI:\s*((?:(?!#MONI:).)*)", re.IGNORECASE)
_SERVINFO = re.compile(r"#SERVINFO:\s*((?:(?!#SERVINFO:).)*)", re.IGNORECASE)
_MONI_TABLE = re.compile(
    r"(?P<cell>S|N\d\d?):?\s+(?P<bsic_octal>\w\w?)\s+(?P<lac>[0-9A-F]{4})\s+(?P<cid16>[0-9A-F]{4})"
    r"\s+(?P<arfcn>\d{1,4})\s+(?P<rssi>-\d{1,3})\s?dbm\b(?:\s+(?P<c1>-?\d+)\s+(?P<c2>-?\d+))?"
    r"(?:\s+(?P<ta>\d+)\s+(?P<rxq>\d)\b\s*(?P<name>.*))?",
    re.IGNORECASE | re.ASCII,
)
_LABELS = (
    "Cc|Nc|BSIC|RxQual|LAC|TAC|Id|ARFCN|UARFCN|EARFCN|PWR|TA|PSC|SCR|RSCP|EcIo|DRX|RSRP|RSRQ|PCI"
)
_MONI_LABEL = re.compile(
    rf"(?<!\w)({_LABELS})\s?:[\s,]*([^\s,:\]]*+)(?!\s?:)", re.IGNORECASE | re.ASCII
)
_CHANNELS: Mapping[str, tuple[Rat, int]] = {
    "arfcn": ("GSM", 1023),
    "uarfcn": ("WCDMA", 16383),
    "earfcn": ("LTE", 262143),
}
_LABEL_OF_ONE: Mapping[str, Rat] = {
    "bsic": "GSM",
    "psc": "WCDMA",
    "rscp": "WCDMA",
    "rsrp": "LTE",
    "tac": "LTE",
}
_NO_CHANNEL = 65535
_UTRA = tuple(  # downlinks of the bands in use (3GPP TS 25.101 5.4.4), in which a PCI may be a PSC
    range(first, last + 1)
    for first, last in (
        *((412, 687), (712, 763), (1007, 1087), (1537, 1738), (1887, 2087), (2937, 3088)),
        *((4357, 4458), (9237, 9387), (9662, 9938), (10562, 10838)),
    )
)
_ADJACENT = re.compile(r"adj\b", re.IGNORECASE)
_MONI_IDENTITY = frozenset({"cc", "nc", "lac", "tac", "id"})
_LEVELS = ("psc", "rscp", "ecio", "rsrp", "rsrq", "pci")  # labels that are names of values

_SERVINFO_FORMS: Mapping[Rat, tuple[str, ...]] = {
    "GSM": ("channel", "rssi", "name", "code", "bsic_octal", "lac", "ta_of_last_call", "gprs"),
    "WCDMA": ("channel", "rssi", "name", "code", "psc", "lac", "drx", "sd", "rscp"),
    "LTE": ("channel", "rssi", "name", "code", "id", "tac", "drx", "sd", "rsrp"),
}


# GSM 900, 850, 1800 and 1900, 900 extended (3GPP TS 45.005 2)
_BANDS = ((0, 124), (128, 251), (512, 885), (975, 1023))
_SLICE = 63  # channels; SeaGlass scanned all in 12 parts and allowed 120 s for each
_SLICES = tuple(
    (low, min(low + _SLICE - 1, last))
    for first, last in _BANDS
    for low in range(first, last + 1, _SLICE)
)
# ranges of channels that one survey command covers

_STATUS = (
    "CELL_SUITABLE",
    "CELL_LOW_PRIORITY",
    "CELL_FORBIDDEN",
    "CELL_BARRED",
    "CELL_LOW_LEVEL",
    "CELL_OTHER",
)
_WORDS = (
    "Network survey started ended Carrier BCCh arfcn uarfcn earfcn bsic rxLev ber mcc mnc lac tac"
    " cellId scr code cellIdentity cellStatus rscp ecio rsrp rsrq " + " ".join(_STATUS)
)
_STATE = r"[0-5]|" + "|".join(_STATUS)
_RATIO = r"-?\d{1,3}(?:\.\d+)?"
_KINDS: Kinds = {
    "arfcn": Value("", str, r"\d{1,6}"),
    "uarfcn": Value("", str, r"\d{1,6}"),
    "earfcn": Value("", str, r"\d{1,6}"),
    "bsic": Value("", str, r"\w{1,3}"),
    "mcc": Value("", str, "[0-9A-F]{1,3}"),
    "mnc": Value("", str, "[0-9A-F]{1,3}"),
    "lac": Value("", str, "[0-9A-F]{1,5}"),
    "tac": Value("", str, "[0-9A-F]{1,5}"),
    "cid16": Value("", str, "[0-9A-F]{1,5}"),
    "cid28": Value("", str, "[0-9A-F]{1,9}"),
    "whole_cid28": Value("", str, "[0-9A-F]{4,9}"),
    "ber": Value("", str, r"\d*(?:\.\d+)?"),
    "status": Value("", str, _STATE),
    "rssi": VALUES["rssi"]._replace(pattern=r"-\d{1,3}"),
    "psc": VALUES["psc"],
    "pci": VALUES["pci"],
    **{name: VALUES[name]._replace(pattern=_RATIO) for name in ("rscp", "ecio", "rsrp", "rsrq")},
}
_LTE_CARRIER = "earfcn rxLev=rssi mcc mnc cellId=cid28 tac cellIdentity=pci cellStatus=status"
_FORMS: Mapping[Rat, str] = {
    "GSM": "arfcn bsic rxLev=rssi ber mcc mnc lac cellId=cid16 cellStatus=status",
    "WCDMA": "uarfcn rxLev=rssi mcc mnc scr_code=psc cellId=cid28 lac cellStatus=status rscp ecio",
    "LTE": f"{_LTE_CARRIER} rsrp rsrq",
}
_ROWS = [
    (rat, pattern)
    for rat, labels in _FORMS.items()
    for pattern in (listed_row(labels, _KINDS), labelled_row(labels, _KINDS, r"[\s,]+"))
]
# A row of LTE may end before the levels of the cell; instead of its cell one of WCDMA has a
# scrambling code.
_WITHOUT_LEVELS = listed_row(_LTE_CARRIER.replace("cid28", "whole_cid28"), _KINDS)
_ROWS.append(("LTE", _WITHOUT_LEVELS))
_LEVEL_ONLY = re.compile(
    r"(?<!\w)(?:arfcn\s?:\s*(?P<arfcn>\d{1,4})|uarfcn\s?:\s*(?P<uarfcn>\d{1,5})"
    r"|earfcn\s?:\s*(?P<earfcn>\d{1,6}))"
    r"\s+(?:bsic\s?:\s*\S+\s+)?rxLev\s?:\s*(?P<rssi>-\d{2,3})(?!\d)",
    re.IGNORECASE,
)
_CARRIER = re.compile(
    r"(?<![\w.,-])(?:(?P<arfcn>\d{1,4})|(?P<earfcn>\d{5,6})) ?, ?(?P<rssi>-\d{2,3})\s*\Z"
)
_BEGIN_OR_END = re.compile(r"network survey (started|ended)", re.IGNORECASE)
_CHANNEL: Mapping[Rat, str] = {"GSM": "arfcn", "WCDMA": "uarfcn", "LTE": "earfcn"}

_DECIMAL, _HEXADECIMAL = 10, 16
_BASE_SETTING = re.compile(r"#CSURVF(?:=|:\s*)([0-2])", re.IGNORECASE)
_LEAST_CODES = 2
"""Codes that show a hexadecimal print; a single one may be damaged."""

_OWN, _NEIGHBOURS = ("numarfcn", "arfcn"), ("numchannels", "array")
_PACKET = (  # of a cell with GPRS; without it `pbcch` stands alone
    *("pbcch", "nom", "rac", "spgc", "pat", "nco", "t3168", "t3192", "drxmax", "ctrlack"),
    *("bscvmax", "alpha", "pcmeasch"),
)
_RESELECTION = ("mstxpwr", "rxaccmin", "croffset", "penaltyt", "t3212", "crh")
_ENDS = tuple(
    (*packet, *reselection)
    for packet in ((), _PACKET[:1], _PACKET)
    for reselection in ((), _RESELECTION)
)
"""What follows the neighbours in #CSURVC: each has another number of values."""

_BROADCAST_WORDS = " ".join((*_OWN, *_NEIGHBOURS, *_PACKET, *_RESELECTION))

_BROADCAST_LABEL = re.compile(
    r" ?([A-Z]\w*) ?:([^:]*?)(?= [A-Z]\w* ?:|\Z)", re.ASCII | re.IGNORECASE
)
_CHANNEL_NUMBER = r"(?:0|[1-9]\d{0,3})"
_CHANNEL_LIST = re.compile(rf"{_CHANNEL_NUMBER}(?: {_CHANNEL_NUMBER})*", re.ASCII)
_VALUE = re.compile(r"-?\d{1,5}", re.ASCII)
_DB_OF_STEP = 2
"""Of the cell reselection offset, printed as its code 0 to 63 (3GPP TS 45.008 9.1)."""

_Pairs = Sequence[tuple[str, str]]


@dataclass(frozen=True, slots=True)
class _Carrier:
    """Texts of one carrier, by label; without an identity only channel and level."""

    rat: Rat
    texts: dict[str, str]
    broadcast: Broadcast | None = None

    @property
    def area(self) -> str:
        return self.texts.get("lac", self.texts.get("tac", ""))

    @property
    def cell(self) -> str:
        names = ("cid16", "cid28", "whole_cid28")
        return next((self.texts[name] for name in names if name in self.texts), "")

    @property
    def bases(self) -> set[int]:
        """The only bases that the widths and digits of area, cell and BSIC allow."""
        cell_width = 4 if self.rat == "GSM" else 8
        bases = {
            _base_of(self.area, 4),
            _base_of(self.cell, cell_width),
            _base_of_bsic(self.texts.get("bsic", "")),
        }
        return {base for base in bases if base is not None}


class Telit(Family):
    """Serving cell and neighbours by `AT#MONI`; all carriers by `AT#CSURV` in slices."""

    name = "telit"
    gives = MappingProxyType(
        {
            "GSM": cells_with("neighbours", "timing advance", "C1 and C2", "neighbour lists"),
            "LTE": cells_with("neighbours"),
        }
    )
    claim = Claim(
        maker=r"\btelit\b",
        series=r"\b(?:G[CELMT]86\d|UC864|U[EL]86\d|HE86\d|[CDGHLMU]E9[124]0"
        r"|L[MN]9[4-6]\d|F[NT]9\d0)",
    )
    setup_commands = (
        Command("AT#SELINT=2"),
        Command("AT+CREG=2"),
        Command("AT+CEREG=2"),
        Command("AT#CSURVF=0"),  # numbers of a survey are decimal
        Command("AT#CSURVEXT=1"),  # surveys print the neighbour lists of all cells
        Command("AT#CSURVEXT=3"),  # of newer models: reselection values too; others keep 1
        Command("AT#MONI=7"),  # all cells; without it AT#MONI prints the serving cell
    )
    poll_commands = (
        Command("AT#MONI", timeout_s=5.0),
        Command("AT#SERVINFO", timeout_s=5.0),
        Command("AT+CREG?"),
        Command("AT+CEREG?"),
    )
    survey_commands = tuple(
        Command(f"AT#CSURV={low},{high}", timeout_s=120.0, silence_s=15.0) for low, high in _SLICES
    )
    gnss_start_commands = modem_gnss.GPSACP_ON
    gnss_poll_commands = modem_gnss.GPSACP
    mode_commands = network_mode.WS46
    unnamed_rows: ClassVar[Mapping[str, str]] = {
        "#CSURV": f"{_WORDS} {_BROADCAST_WORDS}",
        "#MONI": "Cell BSIC LAC CellId ARFCN Power C1 C2 TA RxQual PLMN Id PWR",
        "+WS46": "",
    }
    rows_with_networks = "#MONI #SERVINFO"
    rows_in_columns = "#MONI"

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Ask, and put together what the replies contain of the serving cell."""
        rows = yield from self.ask(self.poll_commands)
        return None if rows is None else complete_serving_cell(rows)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in #MONI, #SERVINFO and surveys; fixes of the receiver."""
        plain = [piece.replace('\\"', '"') for piece in pieces(lines)]
        cells = (row for line in plain for row in _monitor_rows(line))
        return (*cells, *_survey_rows(plain), *modem_gnss.read_qgpsloc(plain))


def complete_serving_cell(rows: tuple[Row, ...]) -> tuple[Row, ...]:
    """Rows of one poll with one serving cell, first.

    #MONI names the cell, #SERVINFO the network, +CxREG what is missing.
    """
    serving = [_of_lte(row, rows) for row in rows if is_serving(row)]
    if not serving:
        return rows
    best = max(serving, key=lambda row: (row.cid is not None, _area(row) is not None))
    alike = [row for row in serving if row.rat == best.rat and _area(row) == _area(best)]
    plmns = [str(row.more["plmn"]) for row in alike if row.more.get("plmn")]
    if plmns and best.mcc is None:
        mcc, mnc = network(plmns[0][:3], plmns[0][3:])
        best = replace(best, mcc=mcc, mnc=mnc)
    if best.cid is None and _area(best) is not None:
        cids = (row.cid for row in _registrations(rows) if _area(row) == _area(best))
        best = replace(best, cid=next(cids, None))
    others = [row for row in rows if not is_serving(row)]
    for row in others:
        if isinstance(row, CellReading) and _is_again(row, best):
            best = replace(best, pci=row.pci, rsrq_db=row.rsrq_db)
            others.remove(row)
            break
    return (best, *others)


def _is_again(row: CellReading, serving: CellReading) -> bool:
    # an LM960 lists the serving cell without its name
    names = ("rat", "arfcn", "rsrp_dbm", "rssi_dbm")
    values = [getattr(row, name) for name in names]
    is_same = None not in values and values == [getattr(serving, name) for name in names]
    return is_same and row.cid is None and row.pci is not None and serving.pci is None


def _of_lte(row: CellReading, rows: Sequence[Row]) -> CellReading:
    # one of #SERVINFO with a PCI looks like one of WCDMA
    registered = _registrations(rows)
    is_of_lte = any(one.domain == "CEREG" for one in registered) and not any(
        one.rat in {"GSM", "WCDMA"} for one in registered
    )
    if row.rat != "WCDMA" or row.cid is not None or not is_of_lte:
        return row
    return replace(
        row,
        rat="LTE",
        lac=None,
        tac=row.lac,
        psc=None,
        pci=row.psc,
        rscp_dbm=None,
        rsrp_dbm=row.rscp_dbm,
    )


def _registrations(rows: Sequence[Row]) -> list[Registration]:
    return [row for row in rows if isinstance(row, Registration) and row.has_serving_cell]


def _area(row: CellReading | Registration) -> int | None:
    return row.tac if row.lac is None else row.lac


def _monitor_rows(line: str) -> Iterator[Row]:
    for text in _MONI.findall(line):
        table = _MONI_TABLE.match(text)
        row = _table_row(table.groupdict("")) if table else _labelled_row(text)
        if row is not None:
            yield row
    for text in _SERVINFO.findall(line):
        serving = _servinfo(values(_without_log_text(text)))
        if serving is not None:
            yield serving


def _without_log_text(text: str) -> str:
    """Without the semicolon or OK that a log appends to a row."""
    return text.strip("; \t").removesuffix(" OK").rstrip("; \t")


def _operator(name: str) -> dict[str, int | str | None]:
    return {"operator": name} if name else {}


def _table_row(texts: Mapping[str, str]) -> CellReading | None:
    """The timing advance is that of the last call or transfer (manual p278)."""
    found = read_values(texts)
    if found["arfcn"] is None:
        return None  # an empty slot
    if found["lac"] is None or found["cid"] is None:  # not decoded
        found |= dict.fromkeys(("lac", "cid", "c1", "c2"))
    return CellReading(
        role="serving" if texts["cell"].upper() == "S" else "neighbour",
        rat="GSM",
        bsic=_octal_bsic(texts["bsic_octal"]),
        more=_operator(_without_log_text(texts["name"])),
        **found,
    )


def _labelled_row(text: str) -> CellReading | None:
    """`label:value` pairs; the label of the channel gives the technology."""
    found: dict[str, str] = {}
    first = _MONI_LABEL.search(text)
    for label, value in _MONI_LABEL.findall(text):
        found.setdefault(label.lower(), value)
    rat = _rat(found)
    if first is None or rat is None:
        return None
    last = next(reversed(found))
    if last in _MONI_IDENTITY and not _is_full(last, found[last], rat):
        found[last] = ""
    name = text[: first.start()].strip()
    channel = _channel(found, rat)
    if channel is None and found.keys() & _CHANNELS.keys():
        return None  # an empty slot
    if last in _CHANNELS:
        channel = None  # perhaps cut: a level follows it
    on_lte = rat == "LTE"
    code = found.get("id", "")
    area_code = area(found.get("tac" if on_lte else "lac", ""))
    mcc, mnc = network(found.get("cc", ""), found.get("nc", ""))
    named = {label: found[label] for label in _LEVELS if label in found}
    named["rssi"] = found.get("pwr", "").lower().removesuffix("dbm")
    named["rxq"] = found.get("rxqual", "")
    named["ta"] = found.get("ta", "") if rat == "GSM" else ""
    read = read_values(named)
    if on_lte and not found.keys() & {"tac", "pci"}:
        read["pci"] = hexadecimal(code, 0, _HIGHEST_PCI)
    reading = CellReading(
        role=_role(name, found),
        rat=rat,
        arfcn=channel,
        bsic=_octal_bsic(found.get("bsic", "")),
        more=_operator("" if _ADJACENT.match(name) else name),
        **read,
    )
    has_value = channel is not None or area_code is not None or reading.level_dbm is not None
    cid = None if area_code is None else _identity(code, rat)
    return with_identity(reading, Identity(mcc, mnc, area_code, cid)) if has_value else None


def _rat(found: Mapping[str, str]) -> Rat | None:
    """None for a line without a channel: it is cut."""
    rats: set[Rat] = {rat for label, (rat, _) in _CHANNELS.items() if label in found}
    rats = rats or {rat for label, rat in _LABEL_OF_ONE.items() if label in found}
    return rats.pop() if len(rats) == 1 else None


def _channel(found: Mapping[str, str], rat: Rat) -> int | None:
    label, highest = next((label, most) for label, (of, most) in _CHANNELS.items() if of == rat)
    number = decimal(found.get(label, ""), 0, highest)
    return None if number == _NO_CHANNEL else number


def _is_full(label: str, text: str, rat: Rat) -> bool:
    """False where a last value may be cut: four hexadecimal digits are complete."""
    return len(text) == 4 and (label in {"lac", "tac"} or (label == "id" and rat == "GSM"))


def _role(name: str, found: Mapping[str, str]) -> Role:
    if _ADJACENT.match(name):
        return "neighbour"
    return "serving" if name or found.keys() & {"cc", "lac", "tac", "rxqual"} else "neighbour"


def _identity(text: str, rat: Rat) -> int | None:
    identity = cell_identity(text, 16 if rat == "GSM" else 28)
    may_be_pci = decimal(text, 0, _HIGHEST_PCI) is not None or (
        identity is not None and identity <= _HIGHEST_PCI
    )
    return None if rat == "LTE" and may_be_pci else identity


def _servinfo(fields: list[str]) -> CellReading | NoCell | None:
    """The fifth and the ninth value of a row show its technology."""
    rat = _servinfo_rat(fields)
    if rat is None:
        return None
    texts = dict(zip(_SERVINFO_FORMS[rat], fields, strict=False))
    channel = _channel(dict.fromkeys(_CHANNELS, texts["channel"]), rat)
    code = re.sub(r"\s|[Ff]\Z", "", texts["code"])
    found = read_values(texts)
    if channel is None or (found["rssi_dbm"] is None and not code and not _area_code(found)):
        return NoCell(rat)
    if rat == "LTE" and len(texts["id"]) <= _MOST_OF_DECIMAL_PCI:
        found["pci"] = decimal(texts["id"], 0, _HIGHEST_PCI)
    plmn = {"plmn": code} if re.fullmatch(r"\d{5,6}", code) else {}
    return CellReading(
        role="serving",
        rat=rat,
        cid=_identity(texts["id"], rat) if rat == "LTE" else None,
        arfcn=channel,
        more=_operator(texts["name"]) | plmn,
        **found,
    )


def _area_code(found: Mapping[str, int | None]) -> int | None:
    return found.get("lac", found.get("tac"))


def _servinfo_rat(fields: list[str]) -> Rat | None:
    if not re.fullmatch(r"\d{0,6}", at(fields, 0)) or not 8 <= len(fields) <= 13:
        return None
    if re.fullmatch(r"-\d{1,3}", at(fields, 8)):  # a level, where GSM has a channel
        text = at(fields, 4)
        # a scrambling code is decimal, so letters show a PCI
        is_pci = decimal(text) is None and hexadecimal(text, 0, _HIGHEST_PCI) is not None
        channel = decimal(at(fields, 0))
        may_be_utra = channel in {None, _NO_CHANNEL} or any(channel in band for band in _UTRA)
        is_lte = is_pci or not may_be_utra or re.fullmatch(r"[0-9A-Fa-f]{6,8}", text)
        return "LTE" if is_lte else "WCDMA"
    narrow = decimal(at(fields, 0), 0, 1023) is not None or at(fields, 0) in {"", str(_NO_CHANNEL)}
    return "GSM" if narrow and re.fullmatch(r"\d{0,3}|[Ff]{2}", at(fields, 4)) else None


def _survey_rows(lines: Sequence[str]) -> tuple[CellReading, ...]:
    """All surveys in the lines have one format."""
    carriers = list(_carriers(lines))
    base = _base_of_survey(lines, carriers)
    is_decimal = _codes_are_decimal(carriers)
    readings = (_reading(carrier, base, is_decimal=is_decimal) for carrier in carriers)
    return tuple(reading for reading in readings if reading is not None)


def _carriers(lines: Sequence[str]) -> Iterator[_Carrier]:
    surveying = False
    for line in lines:
        for word in _BEGIN_OR_END.findall(line):
            surveying = word.lower() == "started"
        found: dict[int, tuple[Rat, re.Match[str]]] = {}
        for rat, pattern in _ROWS:
            for row in pattern.finditer(line):
                found.setdefault(row.start(), (rat, row))
        for row in _LEVEL_ONLY.finditer(line):
            found.setdefault(row.start(), (_rat_of_channel(row), row))
        if surveying and not found:
            found = {row.start(): (_rat_of_channel(row), row) for row in _CARRIER.finditer(line)}
        starts = sorted(found)
        for i, start in enumerate(starts):
            rat, row = found[start]
            after = starts[i + 1] if i + 1 < len(starts) else len(line)
            yield _Carrier(
                rat, row.groupdict(""), _carrier_broadcast(rat, row, line[row.end() : after])
            )


def _rat_of_channel(row: re.Match[str]) -> Rat:
    texts = row.groupdict("")
    return next((rat for rat, name in _CHANNEL.items() if texts.get(name)), "GSM")


def _carrier_broadcast(rat: Rat, row: re.Match[str], tail: str) -> Broadcast | None:
    if rat != "GSM" or not row.groupdict().get("status"):
        return None
    return _labelled_broadcast(tail) if ":" in row[0] else _listed_broadcast(tail)


def _reading(carrier: _Carrier, base: int | None, *, is_decimal: bool) -> CellReading | None:
    texts, rat = carrier.texts, carrier.rat
    channel = VALUES[_CHANNEL[rat]].read(texts.get(_CHANNEL[rat], ""))
    levels = read_values(texts, _KINDS)
    if channel is None or levels["rssi_dbm"] is None:
        return None
    is_unknown = base is None and not carrier.bases
    agreed = base if base is not None and carrier.bases <= {base} else None
    sure_base = _DECIMAL if is_unknown else agreed
    named = _survey_identity(carrier, sure_base, is_decimal=is_decimal)
    status = texts.get("status", "").upper()
    status = _STATUS[int(status)] if status.isdecimal() else status
    reading = CellReading(
        role="scan",
        rat=rat,
        arfcn=channel,
        bsic=None if is_unknown else _bsic(texts.get("bsic", ""), sure_base),
        broadcast=carrier.broadcast,
        identity_unsure=is_unknown and named.mcc is not None,
        more={"status": status} if status else {},
        **levels,
    )
    return with_identity(reading, named)


def _survey_identity(carrier: _Carrier, base: int | None, *, is_decimal: bool) -> Identity:
    mcc, mnc = _network_of(carrier.texts, is_decimal=is_decimal)
    if mcc is None or base is None:
        return Identity()
    bits = 16 if carrier.rat == "GSM" else 28
    return Identity(mcc, mnc, area(carrier.area, base), cell_identity(carrier.cell, bits, base))


def _bsic(text: str, base: int | None) -> int | None:
    if base is None:
        return None
    return decimal(text, 0, 63) if base == _DECIMAL else _octal_bsic(text)


def _base_of(text: str, width: int) -> int | None:
    """Hexadecimal numbers are padded to `width` digits, decimal ones are not."""
    if not text or text == "0":
        return None
    if re.search(r"[A-Fa-f]", text) or text.startswith("0"):
        return _HEXADECIMAL
    if len(text) == width - 1 and width == 8:
        return None  # seven digits hold all 28 bits, so a firmware may print no more
    # the cell identity has 28 bits, so its eighth hexadecimal digit is 0
    return None if len(text) == width == 4 else _DECIMAL


def _base_of_bsic(text: str) -> int | None:
    number = decimal(text, 0, 99)
    if number is None:
        return None
    if len(text) == 1 or re.search(r"[89]", text):
        return _DECIMAL
    return _HEXADECIMAL if number > 63 or text.startswith("0") else None


def _base_of_survey(lines: Sequence[str], carriers: Sequence[_Carrier]) -> int | None:
    """Base of the surveys: as set in the transcript, or the only one that most lines allow."""
    for line in reversed(lines):
        setting = _BASE_SETTING.search(line)
        if setting:
            return _DECIMAL if setting[1] == "0" else _HEXADECIMAL
    bases = [base for carrier in carriers if len(carrier.bases) == 1 for base in carrier.bases]
    votes = Counter(bases).most_common()
    tied = len(votes) > 1 and votes[0][1] == votes[1][1]
    return votes[0][0] if votes and not tied else None


def _codes_are_decimal(carriers: Sequence[_Carrier]) -> bool:
    """False where no country code is one as it stands: those models print it in hexadecimal."""
    countries, networks = (
        [carrier.texts.get(name, "").upper() for carrier in carriers] for name in ("mcc", "mnc")
    )
    codes = [text for text in countries if text.strip("F")]
    codes += [text for text in networks if re.search(r"[A-E]", text)]
    return any(map(_is_country, countries)) or len(codes) < _LEAST_CODES


def _is_country(text: str) -> bool:
    """Country codes of ITU-T E.212: by world zone, 901 shared, 001 for tests."""
    return re.fullmatch(r"[2-7]\d\d|901|999|001", text) is not None


def _network_of(texts: dict[str, str], *, is_decimal: bool) -> tuple[str | None, str | None]:
    """A network code has two digits at least, so lost zeros are restored."""
    mcc, mnc = texts.get("mcc", ""), texts.get("mnc", "")
    if not is_decimal and mcc and mnc:
        is_filler = re.fullmatch(r"F+", mnc, re.IGNORECASE)
        mcc, mnc = f"{int(mcc, 16):03d}", "F" if is_filler else str(int(mnc, 16))
    if not _is_country(mcc) or not re.fullmatch(r"\d{1,3}", mnc):
        return None, None
    return mcc, mnc.zfill(2)


def _labelled_broadcast(tail: str) -> Broadcast | None:
    text = " ".join(tail.split())
    pairs, end = [], 0
    while pair := _BROADCAST_LABEL.match(text, end):
        pairs.append((pair[1].lower(), pair[2].strip()))
        end = pair.end()
    return None if text[end:] else _broadcast(pairs)


def _listed_broadcast(tail: str) -> Broadcast | None:
    before, *values = [" ".join(value.split()) for value in tail.split(",")]
    if before or not values:
        return None
    found = (_broadcast(pairs) for pairs in _namings(values))
    return next((broadcast for broadcast in found if broadcast is not None), None)


def _namings(values: Sequence[str]) -> Iterator[_Pairs]:
    own = _OWN if values[0] != "0" else _OWN[:1]
    forms = [(), _RESELECTION]
    forms += [(*lists, *end) for lists in (_NEIGHBOURS, _NEIGHBOURS[:1]) for end in _ENDS]
    for names in ((*own, *form) for form in forms):
        if len(names) == len(values):
            yield list(zip(names, values, strict=True))


def _broadcast(pairs: _Pairs) -> Broadcast | None:
    """None where a value is damaged, missing or too much."""
    names, named = tuple(name for name, _ in pairs), dict(pairs)
    own, rest = _take_list(names, named, _OWN)
    neighbours, end = _take_list(rest, named, _NEIGHBOURS)
    in_order = iter((*_PACKET, *_RESELECTION))
    if own is None or (neighbours is None and rest != end):
        return None
    if not all(name in in_order and _VALUE.fullmatch(named[name]) for name in end):
        return None
    offset = decimal(named.get("croffset", ""), 0, 63)
    found = Broadcast(
        neighbour_arfcns=neighbours,
        cro_db=None if offset is None else _DB_OF_STEP * offset,
        penalty_time=decimal(named.get("penaltyt", ""), 0, 31),
        t3212_raw=decimal(named.get("t3212", ""), 0, 255),
    )
    return None if found == Broadcast() else found


def _take_list(
    names: tuple[str, ...], named: dict[str, str], labels: tuple[str, str]
) -> tuple[tuple[int, ...] | None, tuple[str, ...]]:
    """The channels behind their number, and the names that follow.

    None for a damaged list; where there is none the names stay the same.
    """
    count, channels = labels
    if names[:1] != (count,):
        return None, names
    n_taken = 2 if names[1:2] == (channels,) else 1
    return _channels(named[count], named.get(channels, "")), names[n_taken:]


def _channels(count: str, text: str) -> tuple[int, ...] | None:
    """Exactly `count` different channels."""
    number = decimal(count, 0, MOST_NEIGHBOURS)
    words = text.split() if _CHANNEL_LIST.fullmatch(text) else []
    found = tuple(map(int, words))
    if number is None or (text and not words) or len(set(found)) != number:
        return None
    return found if len(found) == number and max(found, default=0) <= HIGHEST_ARFCN else None
