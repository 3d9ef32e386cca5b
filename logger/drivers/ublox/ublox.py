"""u-blox LISA, SARA, LARA, TOBY: cells from +CGED, +UCELLINFO, +UCGED and AT+COPS=5
(firmware_notes/ublox.md).

    +UCELLINFO:       1,     2,  310,  410, 7f05, 57b14e2, 395, 1032, 255, 255
                   mode, type, mcc, mnc, lac, cell id (hexadecimal), scrambling code, channel, RSCP,
                   Ec/N0; 255 unknown

The rows with labels are in `labels`, those of +UCGED in `ucged`.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from logger.core.types import CellReading, Role
from logger.drivers import network_mode
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.generic.generic import Generic
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.fields import decimal, listed, pieces
from logger.drivers.reading.rows import Operator, Row
from logger.drivers.ublox.cell import reading
from logger.drivers.ublox.labels import labelled_rows
from logger.drivers.ublox.ucged import ucged_rows

_CODE, _HEX, _INDEX = r"\d{1,5}|F{3,4}", r"[0-9A-F]{1,8}", r"\d{1,5}"
_HEAD = (
    ("mode", r"[01]"),
    ("type", r"[0-4]"),
    ("mcc", _CODE),
    ("mnc", _CODE),
    ("lac", _HEX),
    ("ci", _HEX),
)
_2G = listed((*_HEAD, ("rxlev", _INDEX)))
_3G = listed((*_HEAD, ("psc", _INDEX), ("arfcn", _INDEX), ("rscp", _INDEX), ("ecn0", _INDEX)))
_UCELLINFO = re.compile(r"\+UCELLINFO:\s*((?:(?!\+UCELLINFO:).)*)", re.IGNORECASE)
_CUT_LEVEL = re.compile(r",(?=\s)[\s\d]{1,3}\Z")
"""An index at the end of a row with columns, which begin with a blank and are filled to three
digits.
"""
_SERVING = frozenset({0, 2})
_FIRST_3G = 2


class Ublox(Family):
    """Cells by the first of three commands that the model knows, else the serving cell by the
    common ones.
    """

    name = "ublox"
    claim = Claim(maker=r"\bu-?blox\b", series=r"\b(?:SARA|LISA|LARA|TOBY|LENA|LEON|LUCY)-[A-Z]?\d")
    setup_commands = (
        *Generic.setup_commands,
        Command(
            "AT+UCGED=5"
        ),  # all that the SARA-R4 knows; the others refuse it or have it replaced by the next
        Command("AT+UCGED=2"),
    )
    poll_commands = (
        Command("AT+CGED=5", timeout_s=5.0),
        Command("AT+UCELLINFO?", timeout_s=7.0),
        Command("AT+UCGED?", timeout_s=5.0),
    )
    survey_commands = (Command("AT+COPS=5", timeout_s=200.0, silence_s=60.0),)
    mode_commands = network_mode.URAT

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Ask in turn until a reply has cells; zeros that a network code has lost come back from
        AT+COPS?.
        """
        answers: list[tuple[Row, ...]] = []
        network = (yield from self.ask([Command("AT+COPS?")])) or ()
        for command in self.poll_commands:
            rows = yield from self.ask([command])
            if rows and any(isinstance(row, CellReading) for row in rows):
                return completed((*rows, *network))
            answers += [] if rows is None else [rows]
        common = yield from Generic().poll()
        answers += [] if common is None else [common]
        return tuple(row for rows in answers for row in rows) if answers else None

    def survey(self, command: Command) -> Dialogue[tuple[Row, ...] | None]:
        """As for all; zeros that the code of the modem's own network has lost come back from
        AT+COPS?.
        """
        rows = yield from self.ask([command])
        if rows is None:
            return None
        network = (yield from self.ask([Command("AT+COPS?")])) or ()
        return completed((*rows, *network))[: len(rows)]

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in the rows of +UCELLINFO, +UCGED, +CGED and AT+COPS=5."""
        plain = [piece.replace('\\"', '"') for piece in pieces(lines)]
        return (
            *(row for line in plain for row in _ucellinfo(line)),
            *ucged_rows(plain),
            *labelled_rows(plain),
        )


def completed(rows: tuple[Row, ...]) -> tuple[Row, ...]:
    """Rows whose network code is printed as a number get its digits where +COPS names the same
    network in full.
    """
    codes = [
        row.plmn for row in rows if isinstance(row, Operator) and row.stat is None and row.plmn
    ]
    return tuple(
        _completed(row, codes[0]) if codes and isinstance(row, CellReading) else row for row in rows
    )


def _completed(reading: CellReading, plmn: str) -> CellReading:
    number = reading.more.get("mnc_raw")
    same = reading.mcc == plmn[:3] and number is not None and decimal(plmn[3:]) == number
    return replace(reading, mnc=plmn[3:]) if same else reading


def _ucellinfo(line: str) -> Iterator[Row]:
    for text in _UCELLINFO.findall(line):
        head = _2G.match(text)
        is_3g = head is not None and int(head["type"]) >= _FIRST_3G
        row = _3G.match(text) if is_3g else head
        if row is None:
            continue
        role: Role = "serving" if int(row["type"]) in _SERVING else "neighbour"
        texts = row.groupdict() | ({"rxlev": ""} if _CUT_LEVEL.search(text) else {})
        cell = reading(role, "WCDMA" if is_3g else "GSM", texts)
        if cell is not None:
            yield cell
