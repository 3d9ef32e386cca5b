"""Quectel M95, M66, MC60, M35 (GSM) and BC26, BC66, BC660, BC95 (NB-IoT): AT+QENG, +NUESTATS.

    AT+QENG?
    +QENG: 1,0                                                     header: mode, dump
    +QENG: 0,460,00,7108,80c4,554,41,-95,18,50,0,10,x,x,x,x,x,x,x  serving cell
    +QENG: 1,1,5,-76,30,35,35,262,01,1b2c,4d5f,2,11,-80,..         neighbours
    +QENG: 4,3,(5,-76,30),(11,-80,17),(16,-101,x)                  channel, dBm, BSIC
    OK

    AT+QENG=0
    +QENG: 0,1769,9,400,"00288516",-103,-9,-94,5,3,"A924",0,14,2   NB-IoT, the same prefix
    NUESTATS:CELL,3740,137,1,-1012,-108,-921,62                    BC95: tenths of a dB

Needs: engineering mode, AT+QENG=1,4, on GSM; nothing on NB-IoT.
Known by: the maker with a series M, MC or BC.
Doubts: the column of the only negative number distinguishes the serving rows. Area and cell are
hexadecimal; of NB-IoT only in quotation marks. +COPS and +CEREG complete its name.
Sources: measured serving rows in public code; neighbours of our own in the layout of public code;
manuals of BC26 and BC660K 4.8; the row of a BC95 is not verified (firmware_notes/quectel.md).
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar

from logger.drivers.family import Claim, Family, cells_with
from logger.drivers.generic import name_nbiot
from logger.drivers.protocols.at import INTERRUPTION, Command, Dialogue
from logger.drivers.quectel import KINDS
from logger.drivers.reading.row_language import (
    TENTHS,
    NoCell,
    Row,
    decimal,
    first_cell,
    form,
    number,
    split,
)

_GSM = form("GSM", "mcc mnc lac cid16 arfcn! bsic! rssi* c1 c2 _ _ _ _ _ _ _ _ _", KINDS)
_GSM_NEIGHBOUR = form("GSM", "order* arfcn* rssi* bsic! c1 c2 mcc mnc lac cid16", KINDS)
_GSM_CHANNEL = form("GSM", "arfcn* rssi* bsic!", KINDS)
_NBIOT = form("NB-IoT", "earfcn* _ pci* cid28 rsrp! rsrq rssi sinr band tac _ _ _", KINDS)
_NBIOT_NEIGHBOURS = (
    form("NB-IoT", "earfcn* _ pci* rsrp*", KINDS),  # BC26: with the offset of the channel
    form("NB-IoT", "earfcn* pci* rsrp* rsrq*", KINDS),  # BC660
)
_NUESTATS_CELL = form(
    "NB-IoT",
    "earfcn* pci* primary* rsrp* rsrq rssi _",
    {**KINDS, **TENTHS, "primary": number("", 0, 1)},
)
_NBIOT_IDS = frozenset({3, 9})  # where cell and area stand; hexadecimal only in quotation marks

_NUESTATS = re.compile(r"\+?NUESTATS\s*:\s*\"?CELL\"?\s*,\s*([-\d, ]*)", re.IGNORECASE)
_ROW = re.compile(r"\+QENG\s*:\s*(\d)\s*,\s*(.*)", re.IGNORECASE)
_NEXT = re.compile(r"\\[rn]|(?=\+Q[A-Z0-9]+\s*:)", re.IGNORECASE)
_VALUES = re.compile(r"[-\dA-Fa-fx,()\s]+")
_HEADER = re.compile(r"\+QENG:\s*(\d)\s*(?:,\s*\d{1,3}\s*)?\Z")
_CHANNEL = re.compile(r"\(([^()]*)\)")

_MOST_ORDER = 9
"""A row that begins with a number so low is a cut one of GSM: no LTE carrier is so close to the
edge of a band."""

_OFF = "0"  # mode in the header


class QuectelGsm(Family):
    """Cells by `AT+QENG?` in engineering mode; NB-IoT modems know `AT+QENG=0` only."""

    name = "quectel_gsm"
    gives = MappingProxyType(
        {
            "GSM": cells_with("neighbours", "C1 and C2"),
            "NB-IoT": cells_with("neighbours", without=("identity", "country code")),
        }
    )
    claim = Claim(
        series=r"Quectel.*?(?<![A-Z0-9-])"
        r"(?:M(?:10|12|20|23|25|26|27|35|50|56|65|66|72|80|85|89|90|95)"
        r"|MC(?:20|25|60|65|90)|BC(?:20|25|26|28|30|32|35|65|66|68|92|95))(?!\d\d)"
    )
    setup_commands = (
        Command("AT+QENG=1,1"),  # neighbours
        Command("AT+QENG=1,4"),  # all channels too; firmware without them keeps 1
    )
    poll_commands = (Command("AT+QENG?"),)
    survey_commands = (Command("AT+COPS=?", timeout_s=180.0),)
    nbiot_poll_commands = (Command("AT+QENG=0", timeout_s=15.0), Command("AT+NUESTATS=CELL"))
    unnamed_rows: ClassVar[Mapping[str, str]] = {"+NUESTATS": "NUESTATS CELL"}
    other_rows = "+NUESTATS"

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells received now; None without an answer or where engineering mode is off.

        A modem that refuses `AT+QENG?` is an NB-IoT modem.
        """
        reply = yield self.poll_commands[0]
        if reply.is_refusal:
            return (yield from self._nbiot_poll())
        modes = [header[1] for header in map(_HEADER.search, reply.lines) if header]
        answered = (reply.ok and modes) or any(map(self.role_of, reply.lines))
        return self.read(reply.marked_lines) if answered and _OFF not in modes else None

    def _nbiot_poll(self) -> Dialogue[tuple[Row, ...] | None]:
        for command in self.nbiot_poll_commands:
            reply = yield command
            if rows := self.read(reply.marked_lines):
                return (yield from name_nbiot(self, rows))
            if not reply.is_refusal:
                return () if reply.ok else None
        return (yield from name_nbiot(self, ()))

    def read(self, lines: Sequence[str]) -> tuple[Row, ...]:
        # no row goes on behind what has cut it
        whole = [
            line
            for before, line in zip(["", *lines], lines, strict=False)
            if before != INTERRUPTION or not _VALUES.fullmatch(line)
        ]
        return super().read(whole)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Cells in rows of QENG and NUESTATS."""
        plain = [line.replace('\\"', '"') for line in lines]
        rows = map(_ROW.search, _join_wrapped_rows(plain))
        found = [
            reading
            for row in rows
            if row and row[1] in _READERS
            for reading in _READERS[row[1]](row[2])
        ]
        found += [_nuestats(text) for line in plain for text in _NUESTATS.findall(line)]
        return tuple(reading for reading in found if reading is not None)


def _nuestats(text: str) -> Row | None:
    texts = split(text)
    return _NUESTATS_CELL.cell("serving" if texts[2:3] == ["1"] else "neighbour", texts)


def _join_wrapped_rows(lines: Iterable[str]) -> Iterator[str]:
    """A line of nothing but values goes on with the row above."""
    # a terminal wraps with a line end; where a log has one as text, the modem has ended the row
    row = ""
    for line in lines:
        for at, piece in enumerate(_NEXT.split(line)):
            text = piece.strip()
            if at == 0 and _ROW.search(row) and _VALUES.fullmatch(text):
                row += text
            elif text or at:
                yield row
                row = text
    yield row


def _serving(body: str) -> Iterator[Row | None]:
    raw, texts = body.split(","), split(body)
    quoted = {at for at, text in enumerate(raw[:-1]) if '"' in text}
    found: Row | None = None if quoted else _GSM.cell("serving", texts)
    if not found and len(texts) > max(_NBIOT_IDS) and texts[0] == "0":
        found = NoCell("NB-IoT")
    elif not found:
        hexadecimal = quoted if quoted <= _NBIOT_IDS else frozenset()
        trusted = [
            text if at in hexadecimal or at not in _NBIOT_IDS else ""
            for at, text in enumerate(texts)
        ]
        found = _NBIOT.cell("serving", trusted)
    yield found


def _neighbours(body: str) -> Iterator[Row | None]:
    texts = split(body)
    groups = _in_order(texts)
    yield from (_GSM_NEIGHBOUR.cell("neighbour", group) for group in groups)
    if not groups and decimal(texts[0], 0, _MOST_ORDER) is None:
        for at in range(0, len(texts), 4):
            yield first_cell(_NBIOT_NEIGHBOURS, "neighbour", texts[at : at + 4])


def _in_order(texts: list[str]) -> list[list[str]]:
    """Groups of ten values, as far as their numbers ascend: else a comma is lost."""
    texts = texts[:-1] if texts[-1] == "" else texts  # a comma ends the row
    groups = [texts[at : at + 10] for at in range(0, len(texts), 10)]
    if not any(map(_GSM_NEIGHBOUR.texts_by_name, groups)):
        return []  # of NB-IoT
    if len(groups[-1][-1]) < 4:
        groups[-1][-1] = ""  # at the end of a row only its width shows that an identity is not cut
    numbers = [decimal(group[0], 1, 9) for group in groups]
    for at in range(1, len(groups)):
        before, number = numbers[at - 1], numbers[at]
        if before is None or number is None or number <= before:
            return groups[: at - 1]
    return groups


def _channels(body: str) -> Iterator[Row | None]:
    for values in _CHANNEL.findall(body):
        yield _GSM_CHANNEL.cell("neighbour", split(values))


_READERS = {"0": _serving, "1": _neighbours, "4": _channels}
