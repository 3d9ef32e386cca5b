"""Siemens, Cinterion, Gemalto and Thales: cells from ^SMOND, ^SMONC, ^SMONI and tables
(firmware_notes/cinterion.md).

    ^SMONC: 232,03,3010,4EAF,32,82,38,30,30,232,03,...          serving cell and six neighbours, nine values each
    ^SMOND:250,01,00EA,0AE1,23,756,47,,,0,,,0,250,01,...,1,31,99
                                                                13 values, six times 7, then TA,
                                                                RSSI and BER
    ^SMONI: 2G,71,-61,262,02,0143,83BA,33,33,3,6,G,NOCONN       serving cell of later modems

Area and cell have their full width in hexadecimal (TC35i manual V1.05 p207-210, EHS6 manual V03.001
8.12), so that a lost digit or comma shows: a group of another form names no cell.
"""

import re
from collections.abc import Iterator, Mapping, Sequence

from logger.core.types import CellReading, Rat, Role
from logger.drivers import network_mode
from logger.drivers.cinterion.tables import rows_of_tables, scanned
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.generic.generic import Generic
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.fields import (
    SEVEN,
    area,
    at,
    cell_identity,
    decimal,
    level,
    network,
    pieces,
    rsrp_dbm,
    rsrq_db,
    rssi_dbm,
)
from logger.drivers.reading.fields import values as split
from logger.drivers.reading.rows import NoCell, Row

_GROUPED = re.compile(r"\^SMON([CD])\s*:\s*([-0-9A-F, ]*)", re.IGNORECASE)
_SMONI = re.compile(r"\^SMONI\s*:\s*([^\^]*)", re.IGNORECASE)

_CELL = ("mcc", "mnc", "lac", "cell", "bsic", "chann")
_SMONC = (*_CELL, "rssi", "c1", "c2")
_NEIGHBOUR = (*_CELL, "rxlev")
_SERVING = (
    *_NEIGHBOUR,
    "rxlev_full",
    "rxlev_sub",
    "rxqual",
    "rxqual_full",
    "rxqual_sub",
    "timeslot",
)
_NEIGHBOURS = 6
_TAIL = 3  # TA, RSSI, BER

_SMONI_FORMS: Mapping[str, tuple[Rat, tuple[str, ...]]] = {
    "2G": ("GSM", ("arfcn", "dbm", "mcc", "mnc", "lac", "cell", "c1", "c2", "ncc", "bcc", "gprs")),
    "3G": (
        "WCDMA",
        ("uarfcn", "psc", "ecn0", "rscp", "mcc", "mnc", "lac", "cell28", "squal", "srxlev"),
    ),
    "4G": (
        "LTE",
        (
            "earfcn",
            "band",
            "bw_dl",
            "bw_ul",
            "duplex",
            "mcc",
            "mnc",
            "tac",
            "cell28",
            "pci",
            "power",
            "rsrp",
            "rsrq",
        ),
    ),
}
_IDLE = frozenset({"NOCONN", "LIMSRV"})

_HEX4 = r"[0-9A-F]{4}"
_SIGNED = r"[-+]?\d{1,3}(?:\.\d{1,2})?"
_FORMS = {  # of a value that is known; anything but these or an unknown mark is damage
    "mcc": r"\d{3}",
    "mnc": r"\d{2,3}",
    "lac": _HEX4,
    "tac": _HEX4,
    "cell": _HEX4,
    "cell28": r"[0-9A-F]{7}",
    "bsic": r"\d{1,2}",
    "chann": r"\d{1,4}",
    "arfcn": r"\d{1,4}",
    "uarfcn": r"\d{1,5}",
    "earfcn": r"\d{1,6}",
    "psc": r"\d{1,3}",
    "pci": r"\d{1,3}",
    "rssi": r"\d{1,2}",
    "gprs": r"\w{1,4}",
    "duplex": r"[FT]DD",
}
_UNKNOWN = re.compile(r"-*")


class Cinterion(Family):
    """The serving cell and six neighbours, by whichever command the modem knows."""

    name = "cinterion"
    claim = Claim(maker=r"\bSIEMENS\b|(?<!TELIT )\bCINTERION\b|\bGEMALTO\b|\bTHALES\b")
    setup_commands = Generic.setup_commands
    ways = (
        (Command("AT^SMONI"), Command("AT^SMONP=255")),
        (Command("AT^SMOND"),),
        (Command("AT^SMONC"),),
        (Command("AT^MONI"), Command("AT^MONP")),
    )
    """From the best to the poorest, that for the neighbours last; none of them is known to all
    modems of the family.
    """
    poll_commands = (
        *(command for way in ways for command in way),
        *Generic.poll_commands,
    )
    survey_commands = (
        Command('AT^SNMON="INS",2', timeout_s=180.0),
        *Generic.survey_commands,
    )
    mode_commands = network_mode.SXRAT

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells by the first way that gives any; neighbours by the next ones where it refuses to
        tell of them.
        """
        found: tuple[Row, ...] = ()
        for *first, last in self.ways:
            serving = yield from self.ask(first)
            neighbours = yield from self.ask([last])
            rows = (
                row
                for row in (*(serving or ()), *(neighbours or ()))
                if isinstance(row, CellReading | NoCell)
            )
            found += tuple(row for row in rows if not found or _is_neighbour(row))
            if found and (neighbours is not None or isinstance(found[0], NoCell)):
                return found
        return found or (yield from Generic().poll())

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in all forms of ^SMONC, ^SMOND, ^SMONI, ^SMONP, ^SNMON, ^MONI and ^MONP."""
        whole = tuple(pieces(lines))
        found: list[Row] = []
        for line in whole:
            found += grouped_cells(line)
            found += (row for text in _SMONI.findall(line) if (row := _smoni(text)) is not None)
            found += scanned(line)
        return (*found, *rows_of_tables(whole))


def _is_neighbour(row: Row) -> bool:
    return isinstance(row, CellReading) and row.role == "neighbour"


def grouped_cells(line: str) -> Iterator[Row]:
    """Cells of a ^SMONC or ^SMOND line, as Huawei's GSM modules print them too (MG323 specification
    8.5, 8.6).
    """
    for kind, text in _GROUPED.findall(line):
        groups = tuple(_smonc_groups(text) if kind in "Cc" else _smond_groups(text))
        cells = [cell for cell in map(_group_reading, groups) if cell is not None]
        yield from cells
        if groups and not cells and all(_well_formed(named) for _, named in groups):
            yield NoCell("GSM")


def _smonc_groups(text: str) -> Iterator[tuple[Role, dict[str, str]]]:
    fields = split(text)
    if len(fields) % len(_SMONC):
        fields.pop()  # the line is cut, perhaps within this value
    for start in range(0, len(fields) - len(_SMONC) + 1, len(_SMONC)):
        yield "neighbour" if start else "serving", dict(zip(_SMONC, fields[start:], strict=False))


def _smond_groups(text: str) -> Iterator[tuple[Role, dict[str, str]]]:
    fields = split(text)
    all_neighbours = len(_SERVING) + _NEIGHBOURS * len(_NEIGHBOUR)
    tail = fields[all_neighbours:]
    if len(_SERVING) != len(fields) < all_neighbours:
        fields.pop()  # cut
    if len(fields) >= len(_SERVING):
        timing = at(tail, 0) if len(tail) == _TAIL else ""
        yield "serving", dict(zip(_SERVING, fields, strict=False)) | {"ta": timing}
    for start in range(
        len(_SERVING), min(len(fields), all_neighbours) - len(_NEIGHBOUR) + 1, len(_NEIGHBOUR)
    ):
        yield "neighbour", dict(zip(_NEIGHBOUR, fields[start:], strict=False))


def _group_reading(group: tuple[Role, dict[str, str]]) -> CellReading | None:
    """Reading of a group; None where there is no cell, or where the group is damaged."""
    role, named = group
    if not _well_formed(named):
        return None
    mcc, mnc = network(named["mcc"], named["mnc"])
    channel = decimal(named["chann"], 0, 1023)
    if channel is None or (mcc is None and channel == 0):
        return None
    smonc = "rssi" in named
    bsic = decimal(named["bsic"], 1, 63) if smonc else None  # 00 is "not decoded"
    return CellReading(
        role=role,
        rat="GSM",
        mcc=mcc,
        mnc=mnc,
        lac=area(named["lac"]) if mcc else None,
        cid=cell_identity(named["cell"], 16) if mcc else None,
        arfcn=channel,
        bsic=bsic,
        rxlev_raw=decimal(named["rssi"], 0, 63) if smonc else None,
        rssi_dbm=None if smonc else rssi_dbm("-" + named["rxlev"].lstrip("-")),
        ta=decimal(named.get("ta", ""), 0, 63),
        c1=decimal(named.get("c1", ""), -255, 255),
        c2=decimal(named.get("c2", ""), -255, 255),
        more={} if smonc else {"bsic_raw": named["bsic"] or None},
    )


def _smoni(text: str) -> Row | None:
    """Row of ^SMONI; None where it is damaged. One more value after the last of the form must
    follow.
    """
    act, *fields = split(text)
    rat, form = _SMONI_FORMS.get(act.upper(), (None, ()))
    if act.upper() == "SEARCH" or (rat is not None and at(fields, 0).upper() == "SEARCH"):
        return NoCell(rat, state="SEARCH")
    named = dict(zip(form, fields, strict=False))
    if rat is None or len(fields) <= len(form) or not _well_formed(named):
        return None
    mcc, mnc = network(named["mcc"], named["mnc"])
    ncc, bcc = (decimal(named.get(name, ""), 0, 7) for name in ("ncc", "bcc"))
    state = re.sub(r"\W+", "", fields[-1]).upper()
    colours: dict[str, int | str | None] = {"ncc": ncc, "bcc": bcc} if rat == "GSM" else {}
    return CellReading(
        role="serving",
        rat=rat,
        mcc=mcc,
        mnc=mnc,
        lac=area(named.get("lac", "")) if mcc else None,
        tac=area(named.get("tac", "")) if mcc else None,
        cid=_cell(named) if mcc else None,
        arfcn=next(decimal(named[name]) for name in ("arfcn", "uarfcn", "earfcn") if name in named),
        band=decimal(named.get("band", ""), 1, 255),
        bsic=None if ncc is None or bcc is None else 8 * ncc + bcc,
        psc=decimal(named.get("psc", ""), 0, 511),
        pci=decimal(named.get("pci", ""), 0, 503),
        rssi_dbm=rssi_dbm(named.get("dbm", "")),
        rscp_dbm=rssi_dbm(named.get("rscp", "")),
        ecio_db=level(named.get("ecn0", ""), -32.0, 0.0),
        rsrp_dbm=rsrp_dbm(named.get("rsrp", "")),
        rsrq_db=rsrq_db(named.get("rsrq", "")),
        ta=_timing_advance(fields[len(form) :]) if rat == "GSM" else None,
        c1=decimal(named.get("c1", ""), -255, 255),
        c2=decimal(named.get("c2", ""), -255, 255),
        more={**colours, **_extras(named, state)},
    )


def _cell(named: Mapping[str, str]) -> int | None:
    return (
        cell_identity(named["cell"], 16)
        if "cell" in named
        else cell_identity(named["cell28"], 28, form=SEVEN)
    )


def _timing_advance(tail: Sequence[str]) -> int | None:
    """TA of the dedicated channel, where there is one: `ARFCN,TS,timAdv,dBm,Q,ChMod` end the
    row.
    """
    return decimal(tail[-4], 0, 63) if len(tail) in {6, 8} else None


def _extras(named: Mapping[str, str], state: str) -> dict[str, int | str | None]:
    found: dict[str, int | str | None] = {}
    if state.isalpha():  # no name of a channel mode (S_FR), no number
        found["state"] = state
    if "duplex" in named:
        found["duplex"] = named["duplex"].upper() or None
    margin = named.get(
        "srxlev", named.get("power", "") if state in _IDLE else ""
    )  # in a connection it is TX power
    if decimal(margin, -255, 255) is not None:
        found["srxlev"] = decimal(margin, -255, 255)
    return found


def _well_formed(named: Mapping[str, str]) -> bool:
    return all(
        _UNKNOWN.fullmatch(text)
        or re.fullmatch(_FORMS.get(name, _SIGNED), text, re.ASCII | re.IGNORECASE)
        for name, text in named.items()
    )
