"""Telit's #MONI, as a table or as labels, and #SERVINFO (firmware_notes/telit.md).

    AT#MONI                                                     after AT#MONI=7
    #MONI: Cell BSIC LAC CellId ARFCN Power C1 C2 TA RxQual PLMN
    #MONI: S 52 3F6A 1B7C 688 -79dbm 22 30 1 0 Example Net
    #MONI: N1 FF FFFF 0000 693 -88dbm -1 -1                     measured, not decoded

LAC and cell id are hexadecimal, the BSIC two octal digits; ARFCN 1024 is an empty slot. Formats:
GM862 AT reference (80000ST10025a) p273-278, HE863 (80377ST10083a) p141, LE910 V2 (80446ST10707A)
p287-289.
"""

import re
from collections.abc import Iterator, Mapping

from logger.core.types import CellReading, Rat, Role
from logger.drivers.reading.cell_values import area_values, read_values
from logger.drivers.reading.fields import (
    area,
    at,
    cell_identity,
    decimal,
    hexadecimal,
    network,
    values,
)
from logger.drivers.reading.rows import NoCell, Row
from logger.drivers.telit.survey import octal_bsic

HIGHEST_PCI = 503
"""Some models print the PCI where others print the cell identity, which is higher than this."""

_MONI = re.compile(r"#MONI:\s*((?:(?!#MONI:).)*)", re.IGNORECASE)
_SERVINFO = re.compile(r"#SERVINFO:\s*((?:(?!#SERVINFO:).)*)", re.IGNORECASE)
_TABLE = re.compile(
    r"(?P<cell>S|N\d\d?):?\s+(?P<bsic_octal>\w\w?)\s+(?P<lac>[0-9A-F]{4})\s+(?P<cid16>[0-9A-F]{4})"
    r"\s+(?P<arfcn>\d{1,4})\s+(?P<rssi>-\d{1,3})\s?dbm\b(?:\s+(?P<c1>-?\d+)\s+(?P<c2>-?\d+))?"
    r"(?:\s+(?P<ta>\d+)\s+(?P<rxq>\d)\b\s*(?P<name>.*))?",
    re.IGNORECASE | re.ASCII,
)
_LABELS = "Cc|Nc|BSIC|RxQual|LAC|TAC|Id|ARFCN|UARFCN|EARFCN|PWR|TA|PSC|SCR|RSCP|EcIo|DRX|RSRP|RSRQ"
_LABEL = re.compile(rf"(?<!\w)({_LABELS})\s?:[\s,]*([^\s,:]*+)(?!\s?:)", re.IGNORECASE | re.ASCII)
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
_ADJACENT = re.compile(r"adj\b", re.IGNORECASE)
_IDENTITY = frozenset({"cc", "nc", "lac", "tac", "id"})
_LEVELS = ("psc", "rscp", "ecio", "rsrp", "rsrq")  # labels that are names of `cell_values`

_SERVINFO_FORMS: Mapping[Rat, tuple[str, ...]] = {
    "GSM": ("channel", "rssi", "name", "code", "bsic_octal", "lac", "ta_of_last_call", "gprs"),
    "WCDMA": ("channel", "rssi", "name", "code", "psc", "lac", "drx", "sd", "rscp"),
    "LTE": ("channel", "rssi", "name", "code", "id", "tac", "drx", "sd", "rsrp"),
}


def monitor_rows(line: str) -> Iterator[Row]:
    """Readings of #MONI and #SERVINFO in a line."""
    for text in _MONI.findall(line):
        table = _TABLE.match(text)
        row = _table_row(table.groupdict("")) if table else _labelled_row(text)
        if row is not None:
            yield row
    for text in _SERVINFO.findall(line):
        serving = _servinfo(values(_without_log_text(text)))
        if serving is not None:
            yield serving


def _without_log_text(text: str) -> str:
    """The text without what a log appends to a row: a semicolon, the OK of the reply."""
    return text.strip("; \t").removesuffix(" OK").rstrip("; \t")


def _operator(name: str) -> dict[str, int | str | None]:
    return {"operator": name} if name else {}


def _table_row(texts: Mapping[str, str]) -> CellReading | None:
    """Row of the table; the timing advance is that of the last call or transfer (manual p278)."""
    found = read_values(texts)
    if found["arfcn"] is None:
        return None  # an empty slot
    if found["lac"] is None or found["cid"] is None:  # not decoded
        found |= dict.fromkeys(("lac", "cid", "c1", "c2"))
    return CellReading(
        role="serving" if texts["cell"].upper() == "S" else "neighbour",
        rat="GSM",
        bsic=octal_bsic(texts["bsic_octal"]),
        more=_operator(_without_log_text(texts["name"])),
        **found,
    )


def _labelled_row(text: str) -> CellReading | None:
    """Row of `label:value` pairs; the label of the channel gives the technology."""
    found: dict[str, str] = {}
    first = _LABEL.search(text)
    for label, value in _LABEL.findall(text):
        found.setdefault(label.lower(), value)
    rat = _rat(found)
    if first is None or rat is None:
        return None
    last = next(reversed(found))
    if last in _IDENTITY and not _is_full(last, found[last], rat):
        found[last] = ""
    name = text[: first.start()].strip()
    channel = _channel(found, rat)
    if channel is None and found.keys() & _CHANNELS.keys():
        return None  # an empty slot
    on_lte = rat == "LTE"
    cell = found.get("id", "")
    area_code = area(found.get("tac" if on_lte else "lac", ""))
    mcc, mnc = network(found.get("cc", ""), found.get("nc", ""))
    named = {label: found[label] for label in _LEVELS if label in found}
    named["rssi"] = found.get("pwr", "").lower().removesuffix("dbm")
    named["rxq"] = found.get("rxqual", "")
    named["ta"] = found.get("ta", "") if rat == "GSM" else ""
    reading = CellReading(
        role=_role(name, found),
        rat=rat,
        mcc=mcc,
        mnc=mnc,
        **area_values(rat, area_code),
        cid=None if area_code is None else _identity(cell, rat),
        pci=hexadecimal(cell, 0, HIGHEST_PCI) if on_lte and "tac" not in found else None,
        arfcn=channel,
        bsic=octal_bsic(found.get("bsic", "")),
        more=_operator("" if _ADJACENT.match(name) else name),
        **read_values(named),
    )
    has_value = channel is not None or area_code is not None or reading.level_dbm is not None
    return reading if has_value else None


def _rat(found: Mapping[str, str]) -> Rat | None:
    """Technology of a row; a line without a channel is one that is cut."""
    rats: set[Rat] = {rat for label, (rat, _) in _CHANNELS.items() if label in found}
    rats = rats or {rat for label, rat in _LABEL_OF_ONE.items() if label in found}
    return rats.pop() if len(rats) == 1 else None


def _channel(found: Mapping[str, str], rat: Rat) -> int | None:
    label, highest = next((label, most) for label, (of, most) in _CHANNELS.items() if of == rat)
    number = decimal(found.get(label, ""), 0, highest)
    return None if number == _NO_CHANNEL else number


def _is_full(label: str, text: str, rat: Rat) -> bool:
    """False where the last value of a line may be cut: four hexadecimal digits are complete."""
    return len(text) == 4 and (label in {"lac", "tac"} or (label == "id" and rat == "GSM"))


def _role(name: str, found: Mapping[str, str]) -> Role:
    """Serving for a row with a network name, its code, or an area without the words "Adj Cell"."""
    if _ADJACENT.match(name):
        return "neighbour"
    return "serving" if name or found.keys() & {"cc", "lac", "tac", "rxqual"} else "neighbour"


def _identity(text: str, rat: Rat) -> int | None:
    identity = cell_identity(text, 16 if rat == "GSM" else 28)
    return None if rat == "LTE" and identity is not None and identity <= HIGHEST_PCI else identity


def _servinfo(fields: list[str]) -> CellReading | NoCell | None:
    """The serving cell; the fifth and the ninth value of a row show its technology."""
    rat = _servinfo_rat(fields)
    if rat is None:
        return None
    texts = dict(zip(_SERVINFO_FORMS[rat], fields, strict=False))
    channel = _channel(dict.fromkeys(_CHANNELS, texts["channel"]), rat)
    code = re.sub(r"\s|[Ff]\Z", "", texts["code"])
    found = read_values(texts)
    if channel is None or (found["rssi_dbm"] is None and not code and not _area_code(found)):
        return NoCell(rat)
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
        return "LTE" if re.fullmatch(r"[0-9A-Fa-f]{6,8}", at(fields, 4)) else "WCDMA"
    narrow = decimal(at(fields, 0), 0, 1023) is not None or at(fields, 0) in {"", str(_NO_CHANNEL)}
    return "GSM" if narrow and re.fullmatch(r"\d{0,3}|[Ff]{2}", at(fields, 4)) else None
