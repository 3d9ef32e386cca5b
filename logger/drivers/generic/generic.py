"""Any modem that keeps to 3GPP TS 27.007: the cell it is registered on, from +CxREG, +COPS and +CSQ
or +CESQ.
"""

from collections.abc import Sequence
from typing import ClassVar

from logger.core.types import CellReading
from logger.drivers.family import Family
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.rows import Operator, Registration, Row, Signal


class Generic(Family):
    """The serving cell of a modem that no other family knows."""

    name: ClassVar[str] = "generic"
    setup_commands: ClassVar[tuple[Command, ...]] = (
        Command("AT+CREG=2"),
        Command("AT+CGREG=2"),
        Command("AT+CEREG=2"),
        Command("AT+COPS=3,2"),  # the form in which AT+COPS? names the network; it chooses none
    )
    poll_commands: ClassVar[tuple[Command, ...]] = (
        Command("AT+COPS?"),
        Command("AT+CREG?"),
        Command("AT+CGREG?"),
        Command("AT+CEREG?"),
        Command("AT+CSQ"),
        Command("AT+CESQ"),
    )
    survey_commands: ClassVar[tuple[Command, ...]] = (Command("AT+COPS=?", timeout_s=180.0),)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:  # noqa: ARG002 (it has no form of its own)
        return ()

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Ask, and join what belongs to the serving cell."""
        rows = yield from self.ask(self.poll_commands)
        serving = serving_cell(rows or ())
        return rows if serving is None or rows is None else (serving, *rows)


def serving_cell(rows: Sequence[Row]) -> CellReading | None:
    """The cell that registration, network and level of one poll tell of; None without a cell
    identity.
    """
    place = next(
        (row for row in rows if isinstance(row, Registration) and row.cid is not None), None
    )
    if place is None:
        return None
    plmn = next(
        (row.plmn for row in rows if isinstance(row, Operator) and row.stat is None and row.plmn),
        "",
    )
    level = [row for row in rows if isinstance(row, Signal)]
    own = next((row for row in level if row.rat is not None and row.rat == place.rat), Signal())
    return CellReading(
        role="serving",
        rat=place.rat,
        mcc=plmn[:3] or None,
        mnc=plmn[3:] or None,
        lac=place.lac,
        tac=place.tac,
        cid=place.cid,
        rssi_dbm=next((row.rssi_dbm for row in level if row.rssi_dbm is not None), None),
        rscp_dbm=own.rscp_dbm,
        rsrp_dbm=own.rsrp_dbm,
        rsrq_db=own.rsrq_db,
    )
