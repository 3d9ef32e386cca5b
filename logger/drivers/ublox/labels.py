"""u-blox rows of `label:value`: the scan AT+COPS=5 and the cell environment AT+CGED.

    MCC:310, MNC:260, LAC:ab22, CI:b633, BSIC:24, Arfcn:00594, RXLEV:017      scan; base of BSIC and RXLEV unknown
    MCC:222, MNC:88, TAC:562c, CI:57367043, DLF: 1325, ULF:19325, PCI:163, RSRP LEV:25, RSRQ LEV:1
    Mcc:262, Mnc:  2, Lac:1c96, Ci:bcf4e8d, DLF:10612 , ULF:9662              +CGED on 3G
    Service Cell: / Neighbour Cell 1:                                         +CGED on 2G, the cell follows

Layouts: captures, ubxlib cell/src/u_cell_net.c, NuttX
apps/system/ubmodem/ubmodem_cell_environment.c.
"""

import re
from collections.abc import Iterator, Sequence

from logger.core.types import Rat, Role
from logger.drivers.reading.fields import labelled
from logger.drivers.reading.rows import Row
from logger.drivers.ublox.cell import reading

_COMMA = r"\s*,\s*"
_CODE, _HEX, _NUMBER, _INDEX = r"\d{1,5}|f{3,4}", r"[0-9A-F]{1,8}", r"\d{1,5}", r"-?\d{1,3}"
_2G_NETWORK = (("MCC", _CODE), ("MNC", _CODE), ("LAC", _HEX))
_WHOLE_HEX = _HEX + r"(?=\s*,)"
_WHO = (
    labelled((*_2G_NETWORK, ("CI", _WHOLE_HEX)), _COMMA),
    labelled((*_2G_NETWORK, ("RAC", _HEX), ("CI", _WHOLE_HEX)), _COMMA),
)
_SCANS: dict[Rat, re.Pattern[str]] = {
    "GSM": labelled(
        (
            *_2G_NETWORK,
            ("CI", _HEX),
            ("BSIC", r"\w{1,3}"),
            ("Arfcn", _NUMBER),
            ("RXLEV", r"\w{1,3}"),
        ),
        _COMMA,
    ),
    "WCDMA": labelled(
        (
            *_2G_NETWORK,
            ("RAC", _HEX),
            ("CI", _HEX),
            ("DLF", _NUMBER),
            ("ULF", _NUMBER),
            ("SC", _NUMBER),
            ("RSCP LEV", _INDEX),
            ("ECN0 LEV", _INDEX),
        ),
        _COMMA,
    ),
    "LTE": labelled(
        (
            ("MCC", _CODE),
            ("MNC", _CODE),
            ("TAC", _HEX),
            ("CI", _HEX),
            ("DLF", _NUMBER),
            ("ULF", _NUMBER),
            ("PCI", _NUMBER),
            ("RSRP LEV", _INDEX),
            ("RSRQ LEV", _INDEX),
        ),
        _COMMA,
    ),
}
_RADIO_3G = (("SC", _NUMBER), ("RSCP LEV", _INDEX), ("ECN0 LEV", _INDEX))
_DUMPED: tuple[
    tuple[Role, Rat, re.Pattern[str]], ...
] = (  # AT+CGED=0; rows NU and NG are not measured
    (
        "serving",
        "WCDMA",
        labelled((("Cell-ID", _HEX), ("DLF", _NUMBER), ("ULF", _NUMBER), *_RADIO_3G), _COMMA),
    ),
    ("neighbour", "WCDMA", labelled((("Cell", "[UMD]"), *_RADIO_3G, ("DLF", _NUMBER)), _COMMA)),
    (
        "neighbour",
        "GSM",
        labelled((("Cell", "G"), ("B", r"\w*"), ("Arfcn", _NUMBER), ("RXLEV", _INDEX)), r"[\s,]+"),
    ),
)
_NAMES = {  # as `cell.reading` calls them
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
_ENVIRONMENT = re.compile(r"\+CGED\b", re.IGNORECASE)
_TECHNOLOGY = re.compile(r'(?:RAT:\s*"|(?<!\w))(GSM|UMTS|BSIC|DLF)(?:"|\s?:)', re.IGNORECASE)
_RATS: dict[str, Rat] = {"GSM": "GSM", "UMTS": "WCDMA", "BSIC": "GSM", "DLF": "WCDMA"}
_OVER = re.compile(r"(?<!\w)(?:OK|ERROR)\b|\bAT\+(?!CGED)", re.IGNORECASE)
_HEADING = re.compile(
    r"(?P<serving>Serv(?:ice|ing)[- ]Cell)|(?P<neighbour>Neighbou?r[- ]Cell)|(?P<other>PLMNs?\s?:|(?<!\w)Cell\s?:)",
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
        for row in (_environment(reply) if is_environment else _scanned(reply, hexadecimal))
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


def _scanned(lines: Sequence[str], lte_is_hexadecimal: bool) -> Iterator[Row]:
    for line in lines:
        for rat, pattern in _SCANS.items():
            for row in pattern.finditer(line):
                texts = _named(row)
                if (
                    rat == "GSM"
                ):  # Particle's library takes the level for hexadecimal, no manual says so
                    texts["rxlev_text"] = texts.pop("rxlev")
                elif rat == "LTE" and not lte_is_hexadecimal:
                    texts["ci"] = ""
                cell = reading("scan", rat, texts)
                if cell is not None:
                    yield cell


def _lte_is_hexadecimal(lines: Sequence[str]) -> bool:
    """True where a letter shows it: a SARA-R5 prints 57367043, which has more than 28 bits unless
    it is decimal.
    """
    cells = [row["ci"] for line in lines for row in _SCANS["LTE"].finditer(line)]
    return any(re.search(r"[A-Fa-f]", cell.lower().replace("fffffff", "")) for cell in cells)


def _environment(lines: Sequence[str]) -> Iterator[Row]:
    """Cells of one +CGED reply: what is between two cells belongs to the first."""
    role: Role | None = "serving"
    told: Rat | None = None
    texts: dict[str, str] = {}
    for line in lines:
        heading = _HEADING.search(line)
        who = next((row for pattern in _WHO if (row := pattern.search(line))), None)
        if heading or who:
            yield from _cell(role, told, texts)
            texts = {}
        technology = _TECHNOLOGY.search(line)
        told = _RATS[technology[1].upper()] if technology else told
        if heading:
            role = (
                "serving" if heading["serving"] else "neighbour" if heading["neighbour"] else None
            )
        if who and role is not None:
            texts = _named(who)
        if texts:
            radio = line[who.end() :] if who else line
            texts |= {name: value for name, value in _radio(radio).items() if name not in texts}
        yield from _dumped(line)
    yield from _cell(role, told, texts)


def _cell(role: Role | None, told: Rat | None, texts: dict[str, str]) -> Iterator[Row]:
    """The cell under way; what it says of the radio channel tells the technology, else the head of
    the reply.
    """
    rat: Rat | None = "GSM" if "bsic_text" in texts else "WCDMA" if "psc" in texts else told
    cell = reading(role, rat, texts) if texts and role is not None and rat is not None else None
    if cell is not None:
        yield cell


def _dumped(line: str) -> Iterator[Row]:
    for role, rat, pattern in _DUMPED:
        for row in pattern.finditer(line):
            cell = reading(role, rat, _named(row))
            if cell is not None:
                yield cell


def _radio(text: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for label, value in _RADIO.findall(text):
        found.setdefault(_name(label), value)
    return found


def _named(row: re.Match[str]) -> dict[str, str]:
    return {_name(label): value or "" for label, value in row.groupdict().items()}


def _name(label: str) -> str:
    plain = label.lower().replace(" ", "_")
    return _NAMES.get(plain, plain)
