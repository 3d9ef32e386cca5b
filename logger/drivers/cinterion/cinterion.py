"""Siemens, Cinterion, Gemalto and Thales: cells from ^SMOND, ^SMONC, ^SMONI and tables.

    ^SMONI: 2G,71,-61,262,02,0143,83BA,33,33,3,6,G,NOCONN    serving cell of later modems

Area and cell have their full width in hexadecimal (EHS6 manual V03.001 8.12), so that a lost digit
or comma shows. `grouped_cells` and `tables` read the older commands (firmware_notes/cinterion.md).
"""

import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import ClassVar

from logger.core.types import CellReading, Rat
from logger.drivers import network_mode
from logger.drivers.cinterion import tables
from logger.drivers.cinterion.grouped_cells import grouped_cells, is_well_formed
from logger.drivers.cinterion.tables import scan_cells, table_rows
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.generic.generic import Generic
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.cell_values import VALUES, Readers, read_values
from logger.drivers.reading.fields import (
    SEVEN,
    at,
    bsic_of,
    cell_identity,
    decimal,
    network,
    pieces,
)
from logger.drivers.reading.fields import values as split
from logger.drivers.reading.rows import NoCell, Row

_SMONI = re.compile(r"\^SMONI\s*:\s*([^\^]*)", re.IGNORECASE)
_NETWORK = ("mcc", "mnc")
_SMONI_FORMS: Mapping[str, tuple[Rat, tuple[str, ...]]] = {
    "2G": (
        "GSM",
        ("arfcn", "rssi", *_NETWORK, "lac", "cid16", "c1", "c2", "ncc", "bcc", "gprs"),
    ),
    "3G": (
        "WCDMA",
        ("uarfcn", "psc", "ecn0", "rscp", *_NETWORK, "lac", "cid28", "squal", "srxlev"),
    ),
    "4G": (
        "LTE",
        (
            *("earfcn", "band", "bw_dl", "bw_ul", "duplex", *_NETWORK, "tac", "cid28", "pci"),
            *("power", "rsrp", "rsrq"),
        ),
    ),
}
_READERS: Readers = {**VALUES, "cid28": ("cid", partial(cell_identity, bits=28, form=SEVEN))}
_IDLE = frozenset({"NOCONN", "LIMSRV"})


class Cinterion(Family):
    """The serving cell and six neighbours, by the command that the modem has."""

    name = "cinterion"
    claim = Claim(maker=r"\bSIEMENS\b|(?<!TELIT )\bCINTERION\b|\bGEMALTO\b|\bTHALES\b")
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
    unnamed_rows: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("^MONI", "^MONP", "^SMONP"), tables.WORDS
    )

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells by the first way that gives any; neighbours by a later one where that refuses."""
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
        split_lines = tuple(pieces(lines))
        rows: list[Row | None] = []
        for line in split_lines:
            rows += grouped_cells(line)
            rows += map(_smoni, _SMONI.findall(line))
            rows += scan_cells(line)
        return (*(row for row in rows if row is not None), *table_rows(split_lines))


def _is_neighbour(row: Row) -> bool:
    return isinstance(row, CellReading) and row.role == "neighbour"


def _smoni(text: str) -> Row | None:
    """Row of ^SMONI; None where it is damaged. One more value must follow the last of the form."""
    act, *fields = split(text)
    rat, form = _SMONI_FORMS.get(act.upper(), (None, ()))
    if act.upper() == "SEARCH" or (rat is not None and at(fields, 0).upper() == "SEARCH"):
        return NoCell(rat, state="SEARCH")
    named = dict(zip(form, fields, strict=False))
    if rat is None or len(fields) <= len(form) or not is_well_formed(named):
        return None
    mcc, mnc = network(named["mcc"], named["mnc"])
    values = read_values(named, _READERS)
    if not mcc:
        values |= dict.fromkeys(values.keys() & {"lac", "tac", "cid"})
    ncc, bcc = (decimal(named.get(name, ""), 0, 7) for name in ("ncc", "bcc"))
    colours: dict[str, int | str | None] = {"ncc": ncc, "bcc": bcc} if rat == "GSM" else {}
    state = re.sub(r"\W+", "", fields[-1]).upper()
    return CellReading(
        role="serving",
        rat=rat,
        mcc=mcc,
        mnc=mnc,
        bsic=bsic_of(ncc, bcc),
        ta=_timing_advance(fields[len(form) :]) if rat == "GSM" else None,
        more={**colours, **_extras(named, state)},
        **values,
    )


def _timing_advance(tail: Sequence[str]) -> int | None:
    """TA of the dedicated channel, where `ARFCN,TS,timAdv,dBm,Q,ChMod` end the row."""
    return decimal(tail[-4], 0, 63) if len(tail) in {6, 8} else None


def _extras(named: Mapping[str, str], state: str) -> dict[str, int | str | None]:
    found: dict[str, int | str | None] = {}
    if state.isalpha():  # no name of a channel mode (S_FR), no number
        found["state"] = state
    if "duplex" in named:
        found["duplex"] = named["duplex"].upper() or None
    # `power` is the TX power during a connection
    margin = named.get("srxlev", named.get("power", "") if state in _IDLE else "")
    if decimal(margin, -255, 255) is not None:
        found["srxlev"] = decimal(margin, -255, 255)
    return found
