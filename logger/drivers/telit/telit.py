"""Telit: cells from AT#MONI, AT#SERVINFO and the network surveys of `survey`
(firmware_notes/telit.md).

    AT#MONI                                                     after AT#MONI=7
    #MONI: Cell BSIC LAC CellId ARFCN Power C1 C2 TA RxQual PLMN
    #MONI: S 52 3F6A 1B7C 688 -79dbm 22 30 1 0 Example Net       LAC and cell id hexadecimal, BSIC two octal digits
    #MONI: N1 FF FFFF 0000 693 -88dbm -1 -1                     heard, not decoded; ARFCN 1024 is an empty slot

Formats: GM862 AT reference (80000ST10025a) p273-278, HE863 (80377ST10083a) p141, LE910 V2
(80446ST10707A) p287-289.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from logger.core.types import CellReading, Rat, Role
from logger.drivers import network_mode
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.fields import (
    area,
    at,
    cell_identity,
    decimal,
    hexadecimal,
    level,
    network,
    pieces,
    rscp_dbm,
    rsrp_dbm,
    rsrq_db,
    rssi_dbm,
    values,
)
from logger.drivers.reading.rows import NoCell, Registration, Row
from logger.drivers.telit.survey import SLICES, octal_bsic, survey_rows

HIGHEST_PCI = 503
"""Some models print the physical cell identity where others print the cell identity; above this it
is the latter.
"""

_MONI = re.compile(r"#MONI:\s*((?:(?!#MONI:).)*)", re.IGNORECASE)
_SERVINFO = re.compile(r"#SERVINFO:\s*((?:(?!#SERVINFO:).)*)", re.IGNORECASE)
_TABLE = re.compile(
    r"(?P<cell>S|N\d\d?):?\s+(?P<bsic>\w\w?)\s+(?P<lac>[0-9A-F]{4})\s+(?P<cid>[0-9A-F]{4})\s+(?P<arfcn>\d{1,4})\s+"
    r"(?P<pwr>-\d{1,3})\s?dbm\b(?:\s+(?P<c1>-?\d+)\s+(?P<c2>-?\d+))?(?:\s+(?P<ta>\d+)\s+(?P<rxqual>\d)\b\s*(?P<name>.*))?",
    re.IGNORECASE | re.ASCII,
)
_LABELS = "Cc|Nc|BSIC|RxQual|LAC|TAC|Id|ARFCN|UARFCN|EARFCN|PWR|TA|PSC|SCR|RSCP|EcIo|DRX|RSRP|RSRQ"
_LABEL = re.compile(rf"(?<!\w)({_LABELS})\s?:[\s,]*([^\s,:]*+)(?!\s?:)", re.IGNORECASE | re.ASCII)
_CHANNELS: dict[str, tuple[Rat, int]] = {
    "arfcn": ("GSM", 1023),
    "uarfcn": ("WCDMA", 16383),
    "earfcn": ("LTE", 262143),
}
_LABEL_OF_ONE: dict[str, Rat] = {
    "bsic": "GSM",
    "psc": "WCDMA",
    "rscp": "WCDMA",
    "rsrp": "LTE",
    "tac": "LTE",
}
_NO_CHANNEL = 65535
_ADJACENT = re.compile(r"adj\b", re.IGNORECASE)
_IDENTITY = frozenset({"cc", "nc", "lac", "tac", "id"})

_SERVINFO_FORMS: dict[Rat, tuple[str, ...]] = {
    "GSM": ("arfcn", "dbm", "name", "code", "bsic", "lac", "ta", "gprs"),
    "WCDMA": ("arfcn", "dbm", "name", "code", "psc", "lac", "drx", "sd", "rscp"),
    "LTE": ("arfcn", "dbm", "name", "code", "id", "tac", "drx", "sd", "rsrp"),
}


class Telit(Family):
    """The serving cell and its neighbours by `AT#MONI`, all carriers by `AT#CSURV`, some channels
    at a time.
    """

    name = "telit"
    claim = Claim(
        maker=r"\btelit\b(?! cinterion)",
        series=r"\b(?:G[CELMT]86\d|UC864|U[EL]86\d|HE86\d|[CDGHLMU]E9[124]0|L[MN]9[4-6]\d|F[NT]9\d0)",
    )
    setup_commands = (
        Command("AT#SELINT=2"),
        Command("AT+CREG=2"),
        Command("AT+CEREG=2"),
        Command("AT#CSURVF=0"),  # numbers of a survey are decimal
        Command(
            "AT#MONI=7"
        ),  # all cells; models and networks that do not know it answer AT#MONI for the serving cell
    )
    poll_commands = (
        Command("AT#MONI", timeout_s=5.0),
        Command("AT#SERVINFO", timeout_s=5.0),
        Command("AT+CREG?"),
        Command("AT+CEREG?"),
    )
    survey_commands = tuple(
        Command(f"AT#CSURV={low},{high}", timeout_s=120.0, silence_s=15.0) for low, high in SLICES
    )
    mode_commands = network_mode.WS46

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Ask, and join what the replies say of the serving cell."""
        rows = yield from self.ask(self.poll_commands)
        return None if rows is None else joined(rows)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in #MONI and #SERVINFO rows and in network surveys."""
        plain = [piece.replace('\\"', '"') for piece in pieces(lines)]
        return (*(row for line in plain for row in _rows(line)), *survey_rows(plain))


def joined(rows: tuple[Row, ...]) -> tuple[Row, ...]:
    """Rows of one poll with one serving cell: #MONI names the cell, #SERVINFO the network, +CxREG
    what is missing.
    """
    serving = [row for row in rows if isinstance(row, CellReading) and row.role == "serving"]
    if not serving:
        return rows
    best = max(serving, key=lambda row: (row.cid is not None, _place(row) is not None))
    alike = [row for row in serving if row.rat == best.rat and _place(row) == _place(best)]
    codes = [str(row.more["plmn"]) for row in alike if row.more.get("plmn")]
    mcc, mnc = (
        network(codes[0][:3], codes[0][3:]) if codes and best.mcc is None else (best.mcc, best.mnc)
    )
    registered = [
        row.cid for row in rows if isinstance(row, Registration) and _place(row) == _place(best)
    ]
    cid = best.cid if best.cid is not None or _place(best) is None else next(iter(registered), None)
    return (replace(best, mcc=mcc, mnc=mnc, cid=cid), *(row for row in rows if row not in serving))


def _place(row: CellReading | Registration) -> int | None:
    return row.tac if row.lac is None else row.lac


def _rows(line: str) -> Iterator[Row]:
    for text in _MONI.findall(line):
        table = _TABLE.match(text)
        row = _table_row(table.groupdict()) if table else _labelled_row(text)
        if row is not None:
            yield row
    for text in _SERVINFO.findall(line):
        serving = _servinfo(values(_trimmed(text)))
        if serving is not None:
            yield serving


def _trimmed(text: str) -> str:
    """Without what a log puts behind a row: a semicolon, the OK of the reply."""
    return text.strip("; \t").removesuffix(" OK").rstrip("; \t")


def _table_row(found: dict[str, str | None]) -> CellReading | None:
    """Row of the table; the timing advance is that of the last call or transfer (manual p278)."""
    texts = {name: text or "" for name, text in found.items()}
    channel = decimal(texts["arfcn"], 0, 1023)
    if channel is None:
        return None  # an empty slot
    lac, cid = area(texts["lac"]), cell_identity(texts["cid"], 16)
    if lac is None or cid is None:
        lac = cid = None
    decoded = lac is not None
    name = _trimmed(texts["name"])
    return CellReading(
        role="serving" if texts["cell"].upper() == "S" else "neighbour",
        rat="GSM",
        lac=lac,
        cid=cid,
        arfcn=channel,
        bsic=octal_bsic(texts["bsic"]),
        rssi_dbm=rssi_dbm(texts["pwr"]),
        rxq=decimal(texts["rxqual"], 0, 7),
        ta=decimal(texts["ta"], 0, 63),
        c1=decimal(texts["c1"], -255, 255) if decoded else None,
        c2=decimal(texts["c2"], -255, 255) if decoded else None,
        more={"operator": name} if name else {},
    )


def _labelled_row(text: str) -> CellReading | None:
    """Row of `label:value` pairs: which label the channel has says the technology, the others may
    miss.
    """
    found: dict[str, str] = {}
    first = _LABEL.search(text)
    for label, value in _LABEL.findall(text):
        found.setdefault(label.lower(), value)
    rat = _rat(found)
    if first is None or rat is None:
        return None
    last = next(reversed(found))
    if last in _IDENTITY and not _ends_whole(last, found[last], rat):
        found[last] = ""
    name = text[: first.start()].strip()
    channel = _channel(found, rat)
    if channel is None and any(label in found for label in _CHANNELS):
        return None  # an empty slot
    power, rsrp = found.get("pwr", "").lower().removesuffix("dbm"), rsrp_dbm(found.get("rsrp", ""))
    place = area(found.get("tac" if rat == "LTE" else "lac", ""))
    mcc, mnc = network(found.get("cc", ""), found.get("nc", ""))
    reading = CellReading(
        role=_role(name, found),
        rat=rat,
        mcc=mcc,
        mnc=mnc,
        lac=None if rat == "LTE" else place,
        tac=place if rat == "LTE" else None,
        cid=None if place is None else _identity(found.get("id", ""), rat),
        pci=hexadecimal(found.get("id", ""), 0, HIGHEST_PCI)
        if rat == "LTE" and "tac" not in found
        else None,
        arfcn=channel,
        bsic=octal_bsic(found.get("bsic", "")),
        psc=decimal(found.get("psc", ""), 0, 511),
        rxq=decimal(found.get("rxqual", ""), 0, 7),
        rssi_dbm=rssi_dbm(power),
        rscp_dbm=rscp_dbm(found.get("rscp", "")),
        ecio_db=level(found.get("ecio", ""), -40.0, 0.0),
        ta=decimal(found.get("ta", ""), 0, 63) if rat == "GSM" else None,
        rsrp_dbm=rsrp,
        rsrq_db=rsrq_db(found.get("rsrq", "")),
        more={"operator": name} if name and not _ADJACENT.match(name) else {},
    )
    heard = channel is not None or place is not None or reading.level_dbm is not None
    return reading if heard else None


def _rat(found: dict[str, str]) -> Rat | None:
    """Technology of a row; a line without a channel is one that is cut."""
    told: set[Rat] = {rat for label, (rat, _) in _CHANNELS.items() if label in found}
    if not told:
        told = {rat for label, rat in _LABEL_OF_ONE.items() if label in found}
    return told.pop() if len(told) == 1 else None


def _channel(found: dict[str, str], rat: Rat) -> int | None:
    for label, (of, highest) in _CHANNELS.items():
        if of == rat:
            number = decimal(found.get(label, ""), 0, highest)
            return None if number == _NO_CHANNEL else number
    return None


def _ends_whole(label: str, text: str, rat: Rat) -> bool:
    """False where the last value of a line may be cut: only four hexadecimal digits show that they
    are all.
    """
    return len(text) == 4 and (label in {"lac", "tac"} or (label == "id" and rat == "GSM"))


def _role(name: str, found: dict[str, str]) -> Role:
    """Only the row of the serving cell has a network name or code, or an area without the words
    "Adj Cell".
    """
    if _ADJACENT.match(name):
        return "neighbour"
    return "serving" if name or found.keys() & {"cc", "lac", "tac", "rxqual"} else "neighbour"


def _identity(text: str, rat: Rat) -> int | None:
    identity = cell_identity(text, 16 if rat == "GSM" else 28)
    return None if rat == "LTE" and identity is not None and identity <= HIGHEST_PCI else identity


def _servinfo(fields: list[str]) -> CellReading | NoCell | None:
    """The serving cell; which technology the row is of, its fifth and ninth values tell."""
    rat = _servinfo_rat(fields)
    if rat is None:
        return None
    texts = dict(zip(_SERVINFO_FORMS[rat], fields, strict=False))
    channel = _channel(dict.fromkeys(_CHANNELS, texts["arfcn"]), rat)
    code = re.sub(r"\s|[Ff]\Z", "", texts["code"])
    place = area(texts.get("lac", texts.get("tac", "")))
    power = rssi_dbm(texts["dbm"])
    if channel is None or (power is None and place is None and not code):
        return NoCell(rat)
    named = {"operator": texts["name"]} if texts["name"] else {}
    return CellReading(
        role="serving",
        rat=rat,
        lac=None if rat == "LTE" else place,
        tac=place if rat == "LTE" else None,
        cid=_identity(texts["id"], rat) if rat == "LTE" else None,
        arfcn=channel,
        psc=decimal(texts.get("psc", ""), 0, 511),
        rssi_dbm=power,
        rscp_dbm=rscp_dbm(texts.get("rscp", "")),
        rsrp_dbm=rsrp_dbm(texts.get("rsrp", "")),
        more={**named, "plmn": code} if re.fullmatch(r"\d{5,6}", code) else named,
    )


def _servinfo_rat(fields: list[str]) -> Rat | None:
    if not re.fullmatch(r"\d{0,6}", at(fields, 0)) or not 8 <= len(fields) <= 13:
        return None
    if re.fullmatch(r"-\d{1,3}", at(fields, 8)):  # a level, where GSM has a channel
        return "LTE" if re.fullmatch(r"[0-9A-Fa-f]{6,8}", at(fields, 4)) else "WCDMA"
    narrow = decimal(at(fields, 0), 0, 1023) is not None or at(fields, 0) in {"", str(_NO_CHANNEL)}
    return "GSM" if narrow and re.fullmatch(r"\d{0,3}|[Ff]{2}", at(fields, 4)) else None
