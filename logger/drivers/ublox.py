"""u-blox LISA, SARA, LARA, TOBY: cells from +CGED, +UCELLINFO, +UCGED and AT+COPS=5.

    AT+UCELLINFO?
    +UCELLINFO:       1,     2,  310,  410, 7f05, 57b14e2, 395, 1032, 255, 255
                   mode, type, mcc, mnc, lac, cell id, scrambling code, channel, RSCP, Ec/N0

    MCC:310, MNC:260, LAC:ab22, CI:b633, BSIC:24, Arfcn:00594, RXLEV:017
                                              AT+COPS=5; the base of BSIC and RXLEV is unknown
    MCC:222, MNC:88, TAC:562c, CI:57367043, DLF: 1325, ULF:19325, PCI:163, RSRP LEV:25, RSRQ LEV:1
    Mcc:262, Mnc:  2, Lac:1c96, Ci:bcf4e8d, DLF:10612 , ULF:9662      +CGED on 3G
    Service Cell: / Neighbour Cell 1:                  +CGED on 2G, the cell follows

    +UCGED: 2                                     the serving cell in two lines without a prefix
    6,4,001,01                                    technology, service, mcc, mnc
    2525,5,50,50,e8fe,1a2d001,1,...               channel, band, bandwidths, area, cell, pci, ...

Needs: AT+UCGED=2, on the SARA-R4 AT+UCGED=5; each model has one of three commands for cells.
Known by: the maker, or a series of its modules.
Doubts: area and cell id are hexadecimal, 255 is unknown. A network code loses its zeros; +COPS
restores those of the modem's own network. Levels are the indices of 3GPP TS 36.133 and
45.008; the SARA-R422 prints no service, and levels in dB. The LARA-R6 has rows of its own for 2G
and 3G.
Sources: measured replies in public code (a Particle Electron, a SARA-U260, a SARA-R5); u-blox's own
library ubxlib (cell/src/u_cell_info.c, u_cell_net.c); NuttX
apps/system/ubmodem/ubmodem_cell_environment.c (firmware_notes/ublox.md).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, ClassVar

from logger.core.types import CellReading, Rat, Role
from logger.drivers import network_mode
from logger.drivers.family import Claim, Family, cells_with
from logger.drivers.generic import Generic
from logger.drivers.protocols.at import Command, Dialogue
from logger.drivers.reading.row_language import (
    CARRIER_OF_INDEX,
    RSRP_OF_INDEX,
    RSRQ_OF_INDEX,
    VALUES,
    Kinds,
    NoCell,
    Row,
    Value,
    between,
    cell,
    decimal,
    labelled_row,
    listed_row,
    number,
    padded_number,
    pieces,
)
from logger.drivers.reading.standard_replies import chosen_networks, is_serving, with_name

PCS_FLAG = 0x8000
"""Added to the channel in the 1900 MHz band (AT+CGED)."""
_PCS_CHANNELS, _PCS_BAND = range(512, 811), 1900
"""The same channels are used in the 1800 MHz band (3GPP TS 45.005 2)."""
_CHANNELS: Mapping[Rat, str] = {"GSM": "arfcn", "WCDMA": "uarfcn", "LTE": "earfcn"}
_NO_CHANNEL = 65535
_IDENTITY = frozenset({"lac", "tac", "cid16", "cid28"})

_HEX, _NUMBER, _INDEX, _TEXT = "[0-9A-F]{1,8}", r"\d{1,5}", r"-?\d{1,3}", r"\w{1,3}"
_CODE = r"\d{1,5}|f{2,4}"
_RATIO = r"-?\d{1,3}(?:\.\d+)?"


def _level(attribute: str, name: str, low: int, high: int) -> Value:
    """An index; where `attribute` is empty only its number is kept."""
    scale = {"rsrp_dbm": RSRP_OF_INDEX, "rsrq_db": RSRQ_OF_INDEX}.get(attribute)
    raw = (name, between(low, high))
    return Value(attribute, scale.value_of if scale else str, _INDEX, raw)


_KINDS: Kinds = {
    "mcc": Value("mcc", str, _CODE),
    "mnc": Value("mnc", str, _CODE),
    "lac": VALUES["lac"]._replace(pattern=_HEX),
    "tac": VALUES["tac"]._replace(pattern=_HEX),
    "ci": Value("", str, _HEX),
    "whole_ci": Value("", str, rf"{_HEX}(?=\s*,)"),
    "cid16": VALUES["cid16"]._replace(pattern=_HEX),
    "cid28": VALUES["cid28"]._replace(pattern=_HEX),
    "arfcn": Value("", str, _NUMBER),
    "band": number("band", 1, 254)._replace(pattern=_NUMBER),
    "psc": VALUES["psc"]._replace(pattern=_NUMBER),
    "pci": VALUES["pci"]._replace(pattern=_NUMBER),
    "rscp": _level("", "rscp_raw", 0, 96),
    "ecn0": _level("", "ecn0_raw", 0, 49),
    "rsrp": _level("rsrp_dbm", "rsrp_raw", -17, 97),
    "rsrq": _level("rsrq_db", "rsrq_raw", -30, 46),
    "rsrp_dbm": VALUES["rsrp"]._replace(pattern=_RATIO),
    "rsrq_db": VALUES["rsrq"]._replace(pattern=_RATIO),
    "sinr": VALUES["snr"]._replace(pattern=_RATIO),
    "sinr_index": number("more.sinr_raw", 0, 254)._replace(pattern=_NUMBER),
    "rssi_index": Value("rssi_dbm", CARRIER_OF_INDEX.value_of, _INDEX),
    "rxlev": number("rxlev_raw", 0, 63)._replace(pattern=_INDEX),
    "rxlev_of_three": padded_number("rxlev_raw", 63, 3),
    # the base of these is not documented
    "bsic_text": Value("more.bsic_text", str, _TEXT),
    "rxlev_text": Value("more.rxlev_text", str, _TEXT),
    "ta": VALUES["ta"]._replace(pattern=_INDEX),
    "c1": number("c1", -127, 127),
    "c2": number("c2", -127, 127),
    "umts": Value("", str, "[UMD]"),
    "gsm": Value("", str, "G"),
    "letters": Value("", str, r"\w*"),
}

_LISTED: Kinds = {  # of +UCELLINFO
    **_KINDS,
    "mode": Value("", str, "[01]"),
    "type": Value("", str, "[0-3]"),  # of 2G and 3G; no document at hand gives a row of LTE
    **{name: _KINDS[name]._replace(pattern=_NUMBER) for name in ("rxlev", "rscp", "ecn0")},
}
_HEAD = "mode type mcc mnc lac ci "
_2G = listed_row(_HEAD + "rxlev", _LISTED)
_3G = listed_row(_HEAD + "psc arfcn rscp ecn0", _LISTED)
_UCELLINFO = re.compile(r"\+UCELLINFO:\s*((?:(?!\+UCELLINFO:).)*)", re.IGNORECASE)
_CUT_LEVEL = re.compile(r",(?=\s)[\s\d]{1,3}\Z")
"""An index at the end of a row in columns, which begin with a blank and have three digits."""
_SERVING = frozenset({0, 2})
_FIRST_3G = 2

_WHO = (
    labelled_row("mcc mnc lac CI=whole_ci", _KINDS),
    labelled_row("mcc mnc lac RAC=_ CI=whole_ci", _KINDS),
)
_SCANS: Mapping[Rat, re.Pattern[str]] = {
    "GSM": labelled_row("mcc mnc lac ci BSIC=bsic_text arfcn RXLEV=rxlev_text", _KINDS),
    "WCDMA": labelled_row(
        "mcc mnc lac RAC=_ ci DLF=arfcn ULF=_ulf SC=psc RSCP_LEV=rscp ECN0_LEV=ecn0", _KINDS
    ),
    "LTE": labelled_row(
        "mcc mnc tac ci DLF=arfcn ULF=_ulf pci RSRP_LEV=rsrp RSRQ_LEV=rsrq", _KINDS
    ),
}
_DUMPED: tuple[tuple[Role, Rat, re.Pattern[str]], ...] = (  # AT+CGED=0; NU and NG are not measured
    (
        "serving",
        "WCDMA",
        labelled_row("Cell-ID=ci DLF=arfcn ULF=_ulf SC=psc RSCP_LEV=rscp ECN0_LEV=ecn0", _KINDS),
    ),
    (
        "neighbour",
        "WCDMA",
        labelled_row("Cell=umts SC=psc RSCP_LEV=rscp ECN0_LEV=ecn0 DLF=arfcn", _KINDS),
    ),
    (
        "neighbour",
        "GSM",
        labelled_row("Cell=gsm B=letters arfcn RXLEV=rxlev", _KINDS, r"[\s,]+"),
    ),
)
_WORDS = (
    "MCC MNC LAC TAC RAC CI Cell ID BSIC Arfcn RxLev RxLevServ RxLevFull RxLevSub DLF ULF SC PCI"
    " RSCP RSRP RSRQ ECN0 LEV RAT Service Serving Neighbour Neighbor Equivalent PLMN PLMNs GSM UMTS"
    " URR DC BP M ERR RC OOS BLER TSIR MSIR HCS HMD LM PSM RV RS C D B U G NU NG RxQual TA"
)
"""Words of the labels of a scan and of +CGED."""
_ENVIRONMENT = re.compile(r"\+CGED\b", re.IGNORECASE)
_TECHNOLOGY = re.compile(r'(?:RAT:\s*"|(?<!\w))(GSM|UMTS|BSIC|DLF)(?:"|\s?:)', re.IGNORECASE)
_RATS: dict[str, Rat] = {"GSM": "GSM", "UMTS": "WCDMA", "BSIC": "GSM", "DLF": "WCDMA"}
_OVER = re.compile(r"(?<!\w)(?:OK|ERROR)\b|\bAT\+(?!CGED)", re.IGNORECASE)
_HEADING = re.compile(
    r"(?P<serving>Serv(?:ice|ing)[- ]Cell)|(?P<neighbour>Neighbou?r[- ]Cell)"
    r"|(?P<other>PLMNs?\s?:|(?<!\w)Cell\s?:)",
    re.IGNORECASE,
)
_RADIO = re.compile(
    r"(?<!\w)(Bsic|Arfcn|RxLevServ|RxLev|DLF|SC|RSCP LEV|ECN0 LEV)\s?:\s*(\w+)",
    re.IGNORECASE | re.ASCII,
)
_RADIO_NAMES = {
    "bsic": "bsic_text",
    "arfcn": "arfcn",
    "rxlevserv": "rxlev_of_three",
    "rxlev": "rxlev",
    "dlf": "arfcn",
    "sc": "psc",
    "rscp lev": "rscp",
    "ecn0 lev": "ecn0",
}

_UCGED_START = re.compile(r"\+UCGED:\s*(?:2\b|\Z)", re.IGNORECASE)  # the mode may be cut
_UCGED_STOP = re.compile(r"\bOK\b|\bERROR\b|\bAT\+", re.IGNORECASE)
_NETWORK = re.compile(
    r"(?<![\w.,-])(?P<rat>[2346])\s*,(?:\s*(?P<service>\d{1,3})\s*,)?"
    r"\s*(?P<mcc>\d{3}|fff)\s*,\s*(?P<mnc>\d{1,3}|fff?)\s*\Z",
    re.IGNORECASE | re.ASCII,
)
_UCGED_RATS: dict[str, Rat] = {"2": "GSM", "3": "WCDMA", "4": "LTE", "6": "LTE"}
_UCGED: Kinds = {
    **_KINDS,
    **{name: _KINDS[name]._replace(pattern="[0-9A-F]{1,4}") for name in ("lac", "tac", "cid16")},
    "arfcn": Value("", str, r"\d{1,6}"),
    "is_1900": Value("", str, r"\d{1,3}"),
}
_LTE_CARRIER = "arfcn band _ul _dl tac "
_UCGED_FORMS = {
    "GSM": listed_row("arfcn is_1900 cid16 bsic_text lac _ rxlev ta c1 c2", _UCGED),
    "WCDMA": listed_row("arfcn band ci lac _ psc _rrc rssi_index ecn0", _UCGED),
    "LTE": listed_row(_LTE_CARRIER + "ci pci _ _ _ rsrp rsrq sinr", _UCGED),
    "R422": listed_row(_LTE_CARRIER + "pci rsrp_dbm rsrq_db sinr_index", _UCGED),
}
_LEVELS = re.compile(r"\+(?P<name>RSRP|RSRQ):\s*(?P<cells>[^+]*)", re.IGNORECASE)
_LEVEL = re.compile(
    r'(?<![\d-])(?P<pci>\d{1,3}) ?, ?(?P<arfcn>\d{1,6}) ?, ?"?(?P<value>-\d{1,3}\.\d{1,2})(?!\d)'
)


class Ublox(Family):
    """Cells by the first of three commands that a model has, else by the standard ones."""

    name = "ublox"
    gives = MappingProxyType(
        {
            "GSM": cells_with("neighbours", "C1 and C2", without=("colour code",)),
            "WCDMA": cells_with("neighbours", without=("level",)),
            "LTE": cells_with(),
        }
    )
    claim = Claim(
        maker=r"\bu-?blox\b", series=r"\b(?:SARA|LISA|LARA|LEXI|TOBY|LENA|LEON|LUCY)-[A-Z]?\d"
    )
    setup_commands = (
        *Generic.setup_commands,
        Command("AT+UCGED=5"),  # the only one of the SARA-R4; the next replaces it elsewhere
        Command("AT+UCGED=2"),
    )
    poll_commands = (
        Command("AT+CGED=5", timeout_s=5.0),
        Command("AT+UCELLINFO?", timeout_s=7.0),
        Command("AT+UCGED?", timeout_s=5.0),
    )
    survey_commands = (Command("AT+COPS=5", timeout_s=200.0, silence_s=60.0),)
    mode_commands = network_mode.URAT
    other_rows = "+RSRP +RSRQ"  # the answer of a SARA-R4 to AT+UCGED?
    unnamed_rows: ClassVar[Mapping[str, str]] = {
        "+COPS": _WORDS,
        "+CGED": _WORDS,
        "+UCGED": "",
    }

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Ask in turn until a reply has cells; AT+COPS? restores zeros of a network code."""
        answers: list[tuple[Row, ...]] = []
        network = (yield from self.ask([Command("AT+COPS?")])) or ()
        for command in self.poll_commands:
            rows = yield from self.ask([command])
            if rows and any(isinstance(row, CellReading) for row in rows):
                # a SARA-R4 does not name its cells
                if any(is_serving(row) and row.cid is None for row in rows):
                    rows = with_name(rows, (yield from Generic().poll()) or ())
                return complete_networks((*rows, *network))
            answers += [] if rows is None else [rows]
        common = yield from Generic().poll()
        answers += [] if common is None else [common]
        return tuple(row for rows in answers for row in rows) if answers else None

    def survey(self, command: Command) -> Dialogue[tuple[Row, ...] | None]:
        """As for all; AT+COPS? restores the lost zeros of the modem's own network."""
        rows = yield from self.ask([command])
        if rows is None:
            return None
        network = (yield from self.ask([Command("AT+COPS?")])) or ()
        return complete_networks((*rows, *network))[: len(rows)]

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in the rows of +UCELLINFO, +UCGED, +CGED and AT+COPS=5."""
        plain = [piece.replace('\\"', '"') for piece in pieces(lines)]
        return (
            *(row for line in plain for row in _ucellinfo(line)),
            *_serving_cells(plain),
            *_measured_cells(plain),
            *_labelled_rows(plain),
        )


def _readings(role: Role, rat: Rat, texts: Mapping[str, str]) -> Iterator[CellReading | NoCell]:
    """One cell; of a serving cell with unknown values only `NoCell`, of a neighbour nothing."""
    network = _network(texts)
    is_named = "mcc" in network or "mcc" not in texts
    channel, flagged = _channel(texts.get("arfcn", ""), rat)
    named = {name: text for name, text in texts.items() if name not in {"mcc", "mnc"}}
    named["cid16" if rat == "GSM" else "cid28"] = texts.get(
        "cid16", texts.get("ci", texts.get("whole_ci", ""))
    )
    if not is_named:
        named = {name: text for name, text in named.items() if name not in _IDENTITY}
    if "rxlev_of_three" in named:
        named.pop("rxlev", None)
    place: dict[str, Any] = {"arfcn": channel, "arfcn_raw": flagged}
    if rat == "GSM" and channel in _PCS_CHANNELS:
        is_pcs = flagged is not None or texts.get("is_1900") == "1"
        place["band"] = _PCS_BAND if is_pcs else None
    mcc, mnc = network.get("mcc"), network.get("mnc")
    more = {"mnc_raw": int(texts["mnc"])} if mcc and not mnc else {}
    reading = cell(role, rat, named, _KINDS, more, mcc=mcc, mnc=mnc, **place)
    if reading and (reading.mcc, reading.cid, channel) != (None, None, None):
        yield reading
    elif role == "serving":
        yield NoCell(rat)


def _network(texts: Mapping[str, str]) -> dict[str, str]:
    """A network code of one digit has lost its zeros and stays a number."""
    mcc, mnc = texts.get("mcc", ""), texts.get("mnc", "")
    if not re.fullmatch(r"(?!000)[0-9]{3}", mcc) or not re.fullmatch(r"[0-9]{1,3}", mnc):
        return {}
    return {"mcc": mcc} if len(mnc) == 1 else {"mcc": mcc, "mnc": mnc}


def _channel(text: str, rat: Rat) -> tuple[int | None, int | None]:
    """Also the number as printed where it has the flag of the 1900 MHz band."""
    printed = decimal(text, 0, 2**18)
    if printed is None or printed == _NO_CHANNEL:
        return None, None
    if rat == "GSM" and printed >= PCS_FLAG:
        channel = printed - PCS_FLAG
        return (channel if channel in _PCS_CHANNELS else None), printed
    return VALUES[_CHANNELS[rat]].read(text), None


def complete_networks(rows: tuple[Row, ...]) -> tuple[Row, ...]:
    """Rows with the network code of +COPS where they print the same code without its zeros."""
    plmn = next((network.plmn for network in chosen_networks(rows)), None) or ""
    return tuple(
        replace(row, mnc=plmn[3:]) if isinstance(row, CellReading) and _is_of(row, plmn) else row
        for row in rows
    )


def _is_of(reading: CellReading, plmn: str) -> bool:
    number = reading.more.get("mnc_raw")
    return number is not None and reading.mcc == plmn[:3] and decimal(plmn[3:]) == number


def _ucellinfo(line: str) -> Iterator[Row]:
    for text in _UCELLINFO.findall(line):
        head = _2G.match(text)
        is_3g = head is not None and int(head["type"]) >= _FIRST_3G
        row = _3G.match(text) if is_3g else head
        if row is None:
            continue
        role: Role = "serving" if int(row["type"]) in _SERVING else "neighbour"
        texts = row.groupdict() | ({"rxlev": ""} if _CUT_LEVEL.search(text) else {})
        yield from _readings(role, "WCDMA" if is_3g else "GSM", texts)


def _labelled_rows(lines: Sequence[str]) -> tuple[Row, ...]:
    replies = list(_replies(lines))
    hexadecimal = _lte_is_hexadecimal(lines)
    return tuple(
        row
        for is_environment, reply in replies
        for row in (_environment(reply) if is_environment else _scan_cells(reply, hexadecimal))
    )


def _replies(lines: Sequence[str]) -> Iterator[tuple[bool, list[str]]]:
    """In runs: lines of a +CGED reply (True) and others."""
    inside = False
    run: list[str] = []
    for line in lines:
        begins = _ENVIRONMENT.search(line) is not None or _HEADING.match(line.strip()) is not None
        if begins and not inside:
            yield inside, run
            inside, run = True, []
        run.append(line)
        if inside and _OVER.search(line):
            yield inside, run
            inside, run = False, []
    yield inside, run


def _scan_cells(lines: Sequence[str], lte_is_hexadecimal: bool) -> Iterator[Row]:
    for line in lines:
        for rat, pattern in _SCANS.items():
            for row in pattern.finditer(line):
                texts = row.groupdict("")
                if rat == "LTE" and not lte_is_hexadecimal:
                    texts["ci"] = ""
                yield from _readings("scan", rat, texts)


def _lte_is_hexadecimal(lines: Sequence[str]) -> bool:
    """True where a letter shows it: the 57367043 of a SARA-R5 has 28 bits only as a decimal."""
    cells = [row["ci"] for line in lines for row in _SCANS["LTE"].finditer(line)]
    return any(re.search(r"[A-Fa-f]", cell.lower().replace("fffffff", "")) for cell in cells)


def _environment(lines: Sequence[str]) -> Iterator[Row]:
    """What is between two cells belongs to the first."""
    role: Role | None = "serving"
    is_served = False
    rat_of_head: Rat | None = None
    texts: dict[str, str] = {}
    for line in lines:
        heading = _HEADING.search(line)
        identity = next((row for pattern in _WHO if (row := pattern.search(line))), None)
        if heading or identity:
            yield from _environment_cell(role, rat_of_head, texts)
            texts = {}
        technology = _TECHNOLOGY.search(line)
        rat_of_head = _RATS[technology[1].upper()] if technology else rat_of_head
        if heading:
            is_served = False
            role = (
                "serving" if heading["serving"] else "neighbour" if heading["neighbour"] else None
            )
        if identity and role is not None:
            if role == "serving" and is_served:
                role = "neighbour"  # its heading is lost
            is_served |= role == "serving"
            texts = identity.groupdict("")
        if texts:
            radio = line[identity.end() :] if identity else line
            texts |= {name: value for name, value in _radio(radio).items() if name not in texts}
        yield from _dumped_cells(line)
    yield from _environment_cell(role, rat_of_head, texts)


def _environment_cell(
    role: Role | None, rat_of_head: Rat | None, texts: dict[str, str]
) -> Iterator[Row]:
    """The radio values show the technology, else the head of the reply."""
    rat: Rat | None = "GSM" if "bsic_text" in texts else "WCDMA" if "psc" in texts else rat_of_head
    if texts and role is not None and rat is not None:
        yield from _readings(role, rat, texts)


def _dumped_cells(line: str) -> Iterator[Row]:
    for role, rat, pattern in _DUMPED:
        for row in pattern.finditer(line):
            yield from _readings(role, rat, row.groupdict(""))


def _radio(text: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for label, value in _RADIO.findall(text):
        found.setdefault(_RADIO_NAMES[label.lower()], value)
    return found


def _serving_cells(lines: Sequence[str]) -> Iterator[Row]:
    expected = False
    network: re.Match[str] | None = None
    for line in lines:
        started = _UCGED_START.search(line) is not None
        if started or _UCGED_STOP.search(line):
            expected, network = started, None
        elif expected and network is None:
            network = _NETWORK.search(line)
        elif network is not None and (values := _layout(network).search(line)):
            texts = network.groupdict("") | values.groupdict("")
            yield from _readings("serving", _UCGED_RATS[network["rat"]], texts)
            expected, network = False, None  # no manual gives the layout of neighbours


def _layout(network: re.Match[str]) -> re.Pattern[str]:
    rat = _UCGED_RATS[network["rat"]]
    return _UCGED_FORMS["R422" if rat == "LTE" and network["service"] is None else rat]


def _measured_cells(lines: Sequence[str]) -> Iterator[Row]:
    """Cells of +RSRP rows, each with the +RSRQ of the same name; the first is the serving cell."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for line in lines:
        for levels in _LEVELS.finditer(line):
            name = {"rsrp": "rsrp_dbm", "rsrq": "rsrq_db"}[levels["name"].lower()]
            for level in _LEVEL.finditer(levels["cells"]):
                texts = found.setdefault(
                    (level["pci"], level["arfcn"]), {"pci": level["pci"], "arfcn": level["arfcn"]}
                )
                texts[name] = level["value"]
    for place, texts in enumerate(found.values()):
        yield from _readings("neighbour" if place else "serving", "LTE", texts)
