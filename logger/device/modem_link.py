"""The session with a modem: set-up, polls and full scans, one command at a time."""

from logger.config import ModemSettings
from logger.core.errors import DeviceError
from logger.core.types import CellReading, Fix
from logger.device.gnss_link import count_unmeasured, credible
from logger.device.link import Link
from logger.device.mode_switch import ModeSwitch
from logger.device.modem_exchange import ModemExchange
from logger.device.saved_modes import SavedModes
from logger.device.shutdown import AfterStop
from logger.drivers.family import Family
from logger.drivers.generic import Generic
from logger.drivers.protocols.at import Command, run_dialogue
from logger.drivers.reading.row_language import Operator
from logger.drivers.registry import driver_of, identify

SILENT_POLLS = 3
"""Polls without an answer after which the port is closed and opened again."""


def modem_session(
    link: Link, settings: ModemSettings, modes: SavedModes, *, locates: bool = False
) -> None:
    """Set the modem up and poll it until stopped.

    `modes` stores the mode that the modem had before it was set to GSM only. With `locates` the
    modem's own receiver gives the fixes. Raises `DeviceError` when the modem falls silent or its
    port is lost.
    """
    mode = ModeSwitch(link, modes, gsm_only=settings.set_mode == "gsm")
    _Session(link, settings, mode, locates=locates).run()


class _Session:
    """From the opening of the port until it is lost."""

    def __init__(
        self, link: Link, settings: ModemSettings, mode: ModeSwitch, *, locates: bool
    ) -> None:
        self._link = link
        self._settings = settings
        self._mode = mode
        self._locates = locates
        self._modem = ModemExchange(link, driver_of(settings.driver))
        self._echoes = False
        self._survey: list[Command] = []
        self._survey_ns = link.clock.now_ns()

    def run(self) -> None:
        unanswered = 0
        while not self._modem.wire.is_over:
            due_ns = self._link.clock.now_ns() + round(self._settings.poll_interval_s * 1e9)
            self._modem.is_answered = False
            self._turn()
            unanswered = 0 if self._modem.is_answered else unanswered + 1
            if unanswered >= SILENT_POLLS and not self._modem.wire.is_over:
                raise DeviceError(
                    f"modem gives no answer ({unanswered} polls); opening the port again"
                )
            self._listen_until(due_ns)
        self._modem.close_block()
        self._modem.wire.raise_loss()
        self._mode.set_back(self._modem.driver, AfterStop(self._link, self._modem.framer))

    def _turn(self) -> None:
        """Poll once, after the set-up if it is due and before the next command of a full scan."""
        if not self._modem.is_set_up:
            self._prepare()
        if self._modem.driver is None or not (self._modem.is_set_up or self._modem.is_answered):
            return
        self._poll(self._modem.driver)
        if self._modem.is_set_up:
            self._mode.settle(self._modem.driver, self._modem.ask)
            self._continue_survey(self._modem.driver)

    def _prepare(self) -> None:
        """Identify the modem and set it up."""
        self._modem.driver = self._modem.driver or self._identify()
        if self._modem.driver is None:
            return
        self._modem.is_restarted = False
        accepted = self._modem.talk(self._modem.driver.setup()) or self._modem.is_restarted
        self._modem.is_set_up = accepted and not self._modem.is_restarted
        if self._modem.is_set_up:
            self._mode.renew()
            if self._locates:
                self._modem.talk(self._modem.driver.ask(self._modem.driver.gnss_start_commands))
            if not self._modem.is_announced:
                self._modem.is_announced = True
                self._link.note(
                    "info", "modem-ready", f"modem set up by driver {self._modem.driver.name}"
                )
        elif self._modem.is_answered and not accepted and not self._modem.wire.is_over:
            self._link.count(
                "setup-refused", 1, "times the modem did not accept its set-up; trying again"
            )

    def _identify(self) -> Family | None:
        """Ask for the modem's identity; twice if it fits no family, since it may be damaged."""
        found = self._modem.talk(identify())
        if found is None:
            return None
        driver, text = found
        if driver.name == Generic.name and self._modem.talk(identify()) != found:
            self._link.count("unidentified", 1, "times the modem's identity was unclear")
            return None
        self._link.note("info", "modem-identified", f"modem is {text!r}: driver {driver.name}")
        return driver

    def _poll(self, driver: Family) -> None:
        start_ns = (
            self._modem.late_ns if self._modem.framer.late_final_due else self._link.clock.now_ns()
        )
        self._modem.is_damaged = False
        rows = self._modem.talk(driver.poll())
        if self._modem.framer.echo_seen and self._modem.is_set_up and not self._echoes:
            self._modem.set_up_again("modem echoes again, as after a restart; setting it up again")
        self._echoes = self._modem.framer.echo_seen
        if rows is None:
            if self._modem.is_set_up and self._modem.is_answered and not self._modem.wire.is_over:
                self._link.count(
                    "poll-refused", 1, "polls were refused or lost; setting the modem up again"
                )
            self._modem.is_set_up = False
            return
        self._modem.emit_scan(start_ns, self._modem.wire.received_ns, rows)
        if self._locates:
            for row in self._modem.talk(driver.ask(driver.gnss_poll_commands)) or ():
                if isinstance(row, Fix):
                    self._link.emit(credible(row), self._modem.wire.received_ns, source="gnss")
                    count_unmeasured(self._link, row)

    def _continue_survey(self, driver: Family) -> None:
        """Send the next command of a full scan, one between two polls; start a scan that is due."""
        now_ns = self._link.clock.now_ns()
        if (
            not self._survey
            and self._settings.full_scan_interval_s > 0
            and now_ns >= self._survey_ns
        ):
            self._survey = list(driver.survey_commands)
            self._survey_ns = now_ns + round(self._settings.full_scan_interval_s * 1e9)
        if self._survey:
            command = self._survey.pop(0)
            self._modem.is_damaged = False
            rows = run_dialogue(driver.survey(command), self._modem.ask_survey)
            if rows is not None:
                cells = [row for row in rows if isinstance(row, CellReading)]
                networks = sum(isinstance(row, Operator) for row in rows)
                self._link.note(
                    "info", "full-scan", f"{command.text}: {len(cells)} cells, {networks} networks"
                )
                if cells or not networks:  # a list of networks has no cells
                    self._modem.emit_scan(now_ns, self._modem.wire.received_ns, cells)
            elif not self._modem.wire.is_over:
                self._link.note("warning", "scan-refused", f"no answer to {command.text}")

    def _listen_until(self, due_ns: int) -> None:
        """Receive unsolicited lines, and the rest of the poll, until the next poll is due."""
        while not self._modem.wire.is_over:
            self._modem.receive()
            now_ns = self._link.clock.now_ns()
            if self._modem.unsolicited.is_over(now_ns):
                self._modem.close_block()
            if now_ns >= due_ns:
                return
