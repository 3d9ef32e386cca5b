"""Any modem of 3GPP TS 27.007: the serving cell, from +CxREG, +COPS and +CSQ or +CESQ.

    AT+CSQ;+COPS=3,2;+COPS?;+CREG=2;+CREG?
    +CSQ: 28,99
    +COPS: 0,2,"22288",7
    +CREG: 2,1,"3AC9","243800E",7                  n, state, area, cell, technology
    OK

Needs: AT+CREG=2 and its like for area and cell, AT+COPS=3,2 for the network as a number.
Known by: nothing; it serves a modem that no other driver claims.
Doubts: one cell, its level on a scale of 2 dB, no neighbours.
Sources: 3GPP TS 27.007 7.2, 7.3, 8.5 and 8.69; a measured reply (github
4IceG/luci-app-3ginfo-lite issue 111; firmware_notes/at.md).
"""

from collections.abc import Sequence
from types import MappingProxyType

from logger.drivers.family import Family, cells_with
from logger.drivers.protocols.at import Command, Dialogue
from logger.drivers.reading.row_language import Row
from logger.drivers.reading.standard_replies import is_serving, with_name, with_serving_cell

UNKNOWN_MODEL = (
    "no driver knows this model: only its serving cell is recorded, while it is registered"
)
NAME = tuple(map(Command, ("AT+COPS=3,2", "AT+CEREG=2", "AT+COPS?", "AT+CEREG?")))  # of LTE


class Generic(Family):
    """The serving cell of a modem that no other driver claims."""

    name = "generic"
    gives = MappingProxyType(
        {
            "GSM": cells_with(without=("channel", "colour code")),
            "WCDMA": cells_with(without=("channel", "colour code")),
            "LTE": cells_with(without=("channel", "colour code")),
            "NR": cells_with(without=("channel", "colour code")),
        }
    )
    setup_commands = (
        Command("AT+CREG=2"),
        Command("AT+CGREG=2"),
        Command("AT+CEREG=2"),
        Command("AT+C5GREG=2"),
        Command("AT+COPS=3,2"),  # the form in which AT+COPS? names the network; it chooses none
    )
    poll_commands = (
        Command("AT+COPS?"),
        Command("AT+CREG?"),
        Command("AT+CGREG?"),
        Command("AT+CEREG?"),
        Command("AT+C5GREG?"),
        Command("AT+CSQ"),
        Command("AT+CESQ"),
    )
    survey_commands = (Command("AT+COPS=?", timeout_s=180.0),)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:  # noqa: ARG002
        return ()

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Ask, and put together what describes the serving cell."""
        rows = yield from self.ask(self.poll_commands)
        return None if rows is None else with_serving_cell(rows)


def standard_poll() -> Dialogue[tuple[Row, ...] | None]:
    """The serving cell of another driver's modem."""
    generic = Generic()
    yield from generic.ask(generic.setup_commands)
    rows = (yield from generic.poll()) or ()
    return rows if any(map(is_serving, rows)) else None


def name_nbiot(family: Family, rows: Sequence[Row]) -> Dialogue[tuple[Row, ...] | None]:
    """Rows with names, or the registered cell."""
    common = (yield from family.ask(NAME)) or ()
    if rows:
        return with_name(rows, with_serving_cell(common))
    common = (yield from Generic().poll()) or ()
    return common if any(map(is_serving, common)) else None
