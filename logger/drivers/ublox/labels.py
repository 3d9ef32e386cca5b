"""u-blox rows of `label:value`: the scan AT+COPS=5 and the cell environment AT+CGED.

    MCC:310, MNC:260, LAC:ab22, CI:b633, BSIC:24, Arfcn:00594, RXLEV:017
                                              scan; the base of BSIC and RXLEV is unknown
    MCC:222, MNC:88, TAC:562c, CI:57367043, DLF: 1325, ULF:19325, PCI:163, RSRP LEV:25, RSRQ LEV:1
    Mcc:262, Mnc:  2, Lac:1c96, Ci:bcf4e8d, DLF:10612 , ULF:9662      +CGED on 3G
    Service Cell: / Neighbour Cell 1:                  +CGED on 2G, the cell follows

Layouts: captures, ubxlib cell/src/u_cell_net.c, NuttX
apps/system/ubmodem/ubmodem_cell_environment.c.
"""

import re
from collections.abc import Iterator, Mapping, Sequence

from logger.core.types import Rat, Role
from logger.drivers.reading.row_patterns import form, labelled_row
from logger.drivers.reading.rows import Row
from logger.drivers.ublox.cell import readings

_COMMA = r"\s*,\s*"
_PATTERNS = {
    "code": r"\d{1,5}|f{3,4}",
    "hex": r"[0-9A-F]{1,8}",
    "full_hex": r"[0-9A-F]{1,8}(?=\s*,)",
    "number": r"\d{1,5}",
    "index": r"-?\d{1,3}",
    "text": r"\w{1,3}",
    "letters": r"\w*",
    "umts": "[UMD]",
    "gsm": "G",
}


def _row(labels: str, between: str = _COMMA) -> re.Pattern[str]:
    return labelled_row(form(labels, _PATTERNS), between)


_WHO = (
    _row("MCC/code MNC/code LAC/hex CI/full_hex"),
    _row("MCC/code MNC/code LAC/hex RAC/hex CI/full_hex"),
)
_SCANS: Mapping[Rat, re.Pattern[str]] = {
    "GSM": _row("MCC/code MNC/code LAC/hex CI/hex BSIC/text Arfcn/number RXLEV/text"),
    "WCDMA": _row(
        "MCC/code MNC/code LAC/hex RAC/hex CI/hex DLF/number ULF/number SC/number RSCP_LEV/index"
        " ECN0_LEV/index"
    ),
    "LTE": _row(
        "MCC/code MNC/code TAC/hex CI/hex DLF/number ULF/number PCI/number RSRP_LEV/index"
        " RSRQ_LEV/index"
    ),
}
_DUMPED: tuple[tuple[Role, Rat, re.Pattern[str]], ...] = (  # AT+CGED=0; NU and NG are not measured
    (
        "serving",
        "WCDMA",
        _row("Cell-ID/hex DLF/number ULF/number SC/number RSCP_LEV/index ECN0_LEV/index"),
    ),
    ("neighbour", "WCDMA", _row("Cell/umts SC/number RSCP_LEV/index ECN0_LEV/index DLF/number")),
    ("neighbour", "GSM", _row("Cell/gsm B/letters Arfcn/number RXLEV/index", r"[\s,]+")),
)
_NAMES = {  # as in `cell.readings`
    "dlf": "arfcn",
    "sc": "psc",
    "rscp_lev": "rscp",
    "ecn0_lev": "ecn0",
    "rsrp_lev": "rsrp",
    "rsrq_lev": "rsrq",
    "cell_id": "ci",
    "rxlevserv": "rxlev_of_three",
    "bsic": "bsic_text",
}
WORDS = (
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


def labelled_rows(lines: Sequence[str]) -> tuple[Row, ...]:
    """Rows of all scans and +CGED replies in the lines."""
    replies = list(_replies(lines))
    hexadecimal = _lte_is_hexadecimal(lines)
    return tuple(
        row
        for is_environment, reply in replies
        for row in (_environment(reply) if is_environment else _scan_cells(reply, hexadecimal))
    )


def _replies(lines: Sequence[str]) -> Iterator[tuple[bool, list[str]]]:
    """Lines in runs: those of a +CGED reply (True) and others."""
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
                texts = _texts(row)
                if (
                    rat == "GSM"
                ):  # Particle's library reads the level as hexadecimal, no manual does
                    texts["rxlev_text"] = texts.pop("rxlev")
                elif rat == "LTE" and not lte_is_hexadecimal:
                    texts["ci"] = ""
                yield from readings("scan", rat, texts)


def _lte_is_hexadecimal(lines: Sequence[str]) -> bool:
    """True where a letter shows it: the 57367043 of a SARA-R5 has 28 bits only as a decimal."""
    cells = [row["ci"] for line in lines for row in _SCANS["LTE"].finditer(line)]
    return any(re.search(r"[A-Fa-f]", cell.lower().replace("fffffff", "")) for cell in cells)


def _environment(lines: Sequence[str]) -> Iterator[Row]:
    """Cells of one +CGED reply: what is between two cells belongs to the first."""
    role: Role | None = "serving"
    rat_of_head: Rat | None = None
    texts: dict[str, str] = {}
    for line in lines:
        heading = _HEADING.search(line)
        identity = next((row for pattern in _WHO if (row := pattern.search(line))), None)
        if heading or identity:
            yield from _cell(role, rat_of_head, texts)
            texts = {}
        technology = _TECHNOLOGY.search(line)
        rat_of_head = _RATS[technology[1].upper()] if technology else rat_of_head
        if heading:
            role = (
                "serving" if heading["serving"] else "neighbour" if heading["neighbour"] else None
            )
        if identity and role is not None:
            texts = _texts(identity)
        if texts:
            radio = line[identity.end() :] if identity else line
            texts |= {name: value for name, value in _radio(radio).items() if name not in texts}
        yield from _dumped_cells(line)
    yield from _cell(role, rat_of_head, texts)


def _cell(role: Role | None, rat_of_head: Rat | None, texts: dict[str, str]) -> Iterator[Row]:
    """The cell so far; its radio values show the technology, else the head of the reply."""
    rat: Rat | None = "GSM" if "bsic_text" in texts else "WCDMA" if "psc" in texts else rat_of_head
    if texts and role is not None and rat is not None:
        yield from readings(role, rat, texts)


def _dumped_cells(line: str) -> Iterator[Row]:
    for role, rat, pattern in _DUMPED:
        for row in pattern.finditer(line):
            yield from readings(role, rat, _texts(row))


def _radio(text: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for label, value in _RADIO.findall(text):
        found.setdefault(_name(label), value)
    return found


def _texts(row: re.Match[str]) -> dict[str, str]:
    return {_name(label): value for label, value in row.groupdict("").items()}


def _name(label: str) -> str:
    plain = label.lower().replace(" ", "_")
    return _NAMES.get(plain, plain)
