"""Any modem of 3GPP TS 27.007: the serving cell, from +CxREG, +COPS and +CSQ or +CESQ."""

from collections.abc import Sequence

from logger.drivers.family import Family
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.rows import Row
from logger.drivers.reading.serving_cell import with_serving_cell


class Generic(Family):
    """The serving cell of a modem that no other driver claims."""

    name = "generic"
    setup_commands = (
        Command("AT+CREG=2"),
        Command("AT+CGREG=2"),
        Command("AT+CEREG=2"),
        Command("AT+COPS=3,2"),  # the form in which AT+COPS? names the network; it chooses none
    )
    poll_commands = (
        Command("AT+COPS?"),
        Command("AT+CREG?"),
        Command("AT+CGREG?"),
        Command("AT+CEREG?"),
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
