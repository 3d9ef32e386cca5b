"""Telit: cells from AT#MONI, AT#SERVINFO (`monitor`) and the network surveys (`survey`)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

from logger.core.types import CellReading
from logger.drivers import network_mode
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.fields import network, pieces
from logger.drivers.reading.rows import Registration, Row
from logger.drivers.reading.serving_cell import is_serving
from logger.drivers.telit import survey, survey_broadcast
from logger.drivers.telit.monitor import monitor_rows
from logger.drivers.telit.survey import SLICES, survey_rows


class Telit(Family):
    """Serving cell and neighbours by `AT#MONI`; all carriers by `AT#CSURV`, a slice at a time."""

    name = "telit"
    claim = Claim(
        maker=r"\btelit\b(?! cinterion)",
        series=r"\b(?:G[CELMT]86\d|UC864|U[EL]86\d|HE86\d|[CDGHLMU]E9[124]0"
        r"|L[MN]9[4-6]\d|F[NT]9\d0)",
    )
    setup_commands = (
        Command("AT#SELINT=2"),
        Command("AT+CREG=2"),
        Command("AT+CEREG=2"),
        Command("AT#CSURVF=0"),  # numbers of a survey are decimal
        Command("AT#CSURVEXT=1"),  # surveys print the neighbour lists of all cells
        Command("AT#CSURVEXT=3"),  # of newer models: reselection values too; others keep 1
        Command("AT#MONI=7"),  # all cells; without it AT#MONI prints the serving cell
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
    unnamed_rows: ClassVar[Mapping[str, str]] = {
        "#CSURV": f"{survey.WORDS} {survey_broadcast.WORDS}",
        "#MONI": "Cell BSIC LAC CellId ARFCN Power C1 C2 TA RxQual PLMN Id PWR",
        "+WS46": "",
    }

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Ask, and put together what the replies contain of the serving cell."""
        rows = yield from self.ask(self.poll_commands)
        return None if rows is None else complete_serving_cell(rows)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in #MONI and #SERVINFO rows and in network surveys."""
        plain = [piece.replace('\\"', '"') for piece in pieces(lines)]
        return (*(row for line in plain for row in monitor_rows(line)), *survey_rows(plain))


def complete_serving_cell(rows: tuple[Row, ...]) -> tuple[Row, ...]:
    """Rows of one poll with one serving cell, first.

    #MONI names the cell, #SERVINFO the network, +CxREG what is missing.
    """
    serving = [row for row in rows if is_serving(row)]
    if not serving:
        return rows
    best = max(serving, key=lambda row: (row.cid is not None, _area(row) is not None))
    alike = [row for row in serving if row.rat == best.rat and _area(row) == _area(best)]
    plmns = [str(row.more["plmn"]) for row in alike if row.more.get("plmn")]
    if plmns and best.mcc is None:
        mcc, mnc = network(plmns[0][:3], plmns[0][3:])
        best = replace(best, mcc=mcc, mnc=mnc)
    if best.cid is None and _area(best) is not None:
        registered = (row for row in rows if isinstance(row, Registration))
        cids = (row.cid for row in registered if _area(row) == _area(best))
        best = replace(best, cid=next(cids, None))
    return (best, *(row for row in rows if row not in serving))


def _area(row: CellReading | Registration) -> int | None:
    return row.tac if row.lac is None else row.lac
