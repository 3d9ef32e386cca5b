"""u-blox LISA, SARA, LARA, TOBY: cells from +CGED, +UCELLINFO, +UCGED and AT+COPS=5.

    +UCELLINFO:       1,     2,  310,  410, 7f05, 57b14e2, 395, 1032, 255, 255
                   mode, type, mcc, mnc, lac, cell id, scrambling code, channel, RSCP, Ec/N0

Area and cell id are hexadecimal, 255 is unknown. `labels` reads the rows with labels, `ucged` those
of +UCGED (firmware_notes/ublox.md).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

from logger.core.types import CellReading, Role
from logger.drivers import network_mode
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.generic import Generic
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.fields import decimal, pieces
from logger.drivers.reading.row_patterns import form, listed_row
from logger.drivers.reading.rows import Row
from logger.drivers.reading.serving_cell import chosen_networks
from logger.drivers.ublox import labels
from logger.drivers.ublox.cell import readings
from logger.drivers.ublox.labels import labelled_rows
from logger.drivers.ublox.ucged import ucged_rows

_PATTERNS = {
    "mode": r"[01]",
    "type": r"[0-4]",
    "code": r"\d{1,5}|F{3,4}",
    "hex": r"[0-9A-F]{1,8}",
    "index": r"\d{1,5}",
}
_HEAD = "mode/mode type/type mcc/code mnc/code lac/hex ci/hex "
_2G = listed_row(form(_HEAD + "rxlev/index", _PATTERNS))
_3G = listed_row(form(_HEAD + "psc/index arfcn/index rscp/index ecn0/index", _PATTERNS))
_UCELLINFO = re.compile(r"\+UCELLINFO:\s*((?:(?!\+UCELLINFO:).)*)", re.IGNORECASE)
_CUT_LEVEL = re.compile(r",(?=\s)[\s\d]{1,3}\Z")
"""An index at the end of a row in columns, which begin with a blank and have three digits."""
_SERVING = frozenset({0, 2})
_FIRST_3G = 2


class Ublox(Family):
    """Cells by the first of three commands that a model has, else by the standard ones."""

    name = "ublox"
    claim = Claim(maker=r"\bu-?blox\b", series=r"\b(?:SARA|LISA|LARA|TOBY|LENA|LEON|LUCY)-[A-Z]?\d")
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
    unnamed_rows: ClassVar[Mapping[str, str]] = {
        "+COPS": labels.WORDS,
        "+CGED": labels.WORDS,
        "+UCGED": "",
    }

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Ask in turn until a reply has cells; AT+COPS? restores lost zeros of a network code."""
        answers: list[tuple[Row, ...]] = []
        network = (yield from self.ask([Command("AT+COPS?")])) or ()
        for command in self.poll_commands:
            rows = yield from self.ask([command])
            if rows and any(isinstance(row, CellReading) for row in rows):
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
            *ucged_rows(plain),
            *labelled_rows(plain),
        )


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
        yield from readings(role, "WCDMA" if is_3g else "GSM", texts)
