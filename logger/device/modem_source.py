"""An AT modem of any family: set-up, polls and full scans, one command at a time."""

import re
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TypeVar

from logger.config import ModemSettings
from logger.core.errors import DeviceError
from logger.core.source_tables import GNSS, MODEM
from logger.core.types import CellReading, Fix, utc_text
from logger.device.gnss_source import credible, emit_fix, note_impossible_date
from logger.device.link import DRIVER, Device, Line, Link, Source
from logger.device.mode_switch import ModeSwitch, SavedModes
from logger.device.modem_exchange import AfterStop, ModemExchange
from logger.device.port import Port
from logger.drivers.family import Family, wake
from logger.drivers.generic import UNKNOWN_MODEL, Generic, standard_poll
from logger.drivers.protocols.at import AtFramer, Command, Dialogue, Reply, run_dialogue
from logger.drivers.protocols.redaction import Redactor
from logger.drivers.reading.row_language import Operator
from logger.drivers.registry import check_mode, driver_of, identify

T = TypeVar("T")

SILENT_POLLS = 3
"""Polls without an answer after which the port is closed and opened again."""
SCAN_S, SURVEY_S = 60.0, 360.0
"""A modem without a scan for this long has failed; `SURVEY_S` is for a full scan."""
_RARE_POLL_S = 60.0  # a walker is 80 m on; who writes more may mean milliseconds
PROBE_TRIES = 2
RECEIVER_IS_OFF = (": 505", ": 516")
"""+CME ERROR of a Quectel: its receiver is off, or has no fix yet."""
_EITHER_OR = "this model may hear no cells while its own receiver works: use a separate one"


class ModemSource(Source[ModemSettings]):
    """Gives a scan for each poll of a modem; with `fixes`, those of its own receiver too."""

    may_be_swapped = True

    @property
    def patience_s(self) -> float:
        is_surveyed = self.settings.full_scan_interval_s > 0.0
        return SCAN_S + 3.0 * self.settings.poll_interval_s + is_surveyed * SURVEY_S

    def open(self, read_timeout_s: float) -> Port:
        return Port(self.port, self.settings.baud, read_timeout_s)

    def session(self, link: Link, folder: Path) -> None:
        """Set the modem up and poll it; a silent modem is a `DeviceError`.

        The mode that it had before it was set to GSM only is stored in the folder.
        """
        _Session(link, self.settings, SavedModes(folder)).run()

    def validate(self) -> None:
        super().validate()
        check_mode(self.settings.driver, self.settings.set_mode)

    def check(self) -> Iterator[Line]:
        yield from super().check()
        if (interval_s := self.settings.poll_interval_s) > _RARE_POLL_S:
            text = f"polled every {interval_s:g} s only: poll_interval_s counts seconds"
            yield Line("warn", self.name, text)
        if not self.settings.fixes:
            return
        driver = driver_of(self.settings.driver)
        if driver is None or driver.gnss_poll_commands:
            yield Line("ok", GNSS, "the modem's own receiver")
        else:
            text = f"driver {driver.name} reads no receiver of the modem: name a port"
            yield Line("fail", GNSS, text)

    def examine(self) -> Iterator[Line]:
        """The state of the SIM, which the modem does not need."""
        try:
            with self.open(0.1) as port:
                state = converse(port, _sim_state())
        except DeviceError as error:
            yield Line("fail", self.name, str(error))
            return
        if state is None:
            text = "gives no answer to AT: powered? right port and baud? see fieldlogger probe"
            yield Line("fail", self.name, text)
        else:
            what = "SIM" if self.name == MODEM else f"SIM {self.name}"
            yield Line("ok", what, f"{state} (recording needs none)")

    @classmethod
    def probe(cls, port: Port) -> Device | None:
        """A modem answers OK to `AT`, the first of which sets the rate, and names itself."""
        at = Command("AT", timeout_s=0.5)
        if not any(_ask(port, AtFramer(), at).ok for _ in range(PROBE_TRIES)):
            return None
        identity = converse(port, identify())
        if identity is None:
            return None
        driver, text = identity
        is_either_or = re.search(driver.either_or, text) is not None
        receiver = not is_either_or and converse(port, _has_receiver(driver))
        return Device("modem", text, driver.name, receiver)


def _sim_state() -> Dialogue[str | None]:
    if not (yield from wake()):
        return None
    yield Command("AT+CMEE=2")
    reply = yield Command("AT+CPIN?", timeout_s=5.0)
    if reply.final is None:
        return None
    return " ".join(line.strip() for line in reply.lines) or reply.final


def _has_receiver(driver: Family) -> Dialogue[bool]:
    """Whether the modem has a receiver of its own, which is not switched on for it."""
    # it has the command that asks for a fix, or the one that switches the receiver on: AT+X=? is
    # answered OK where AT+X= is known (ITU-T V.250 5.4.1)
    tests = (Command(on.text.partition("=")[0] + "=?") for on in driver.gnss_start_commands)
    yield Command("AT+CMEE=1")
    for command in (*driver.gnss_poll_commands, *tests):
        reply = yield command
        if reply.ok or (reply.final or "").endswith(RECEIVER_IS_OFF):
            return True
    return False


def converse(port: Port, dialogue: Dialogue[T]) -> T:
    """Drive a dialogue over an open port that no link reads."""
    return run_dialogue(dialogue, partial(_ask, port, AtFramer()))


def _ask(port: Port, framer: AtFramer, command: Command) -> Reply:
    framer.send(command.text)
    port.write(command.text.encode("ascii") + b"\r")
    redactor = Redactor()
    redactor.send(command.text.encode("ascii"))
    end_s = time.monotonic() + command.timeout_s
    while time.monotonic() < end_s:
        for event in framer.feed(redactor.feed(port.read())):
            if isinstance(event, Reply):
                return event
    return framer.expire()


class _Session:
    def __init__(self, link: Link, settings: ModemSettings, modes: SavedModes) -> None:
        self._link = link
        self._settings = settings
        self._mode = ModeSwitch(link, modes, gsm_only=settings.set_mode == "gsm")
        self._modem = ModemExchange(link, driver_of(settings.driver))
        self._is_named = False
        self._echoes = False
        self._is_date_noted = False
        self._survey: list[Command] = []
        self._survey_ns = link.clock.now_ns()

    def run(self) -> None:
        unanswered = 0
        while not self._modem.wire.is_over:
            due_ns = self._link.clock.now_ns() + round(self._settings.poll_interval_s * 1e9)
            self._modem.is_answered = False
            self._turn()
            if self._modem.is_answered:
                unanswered, self._modem.is_heard = 0, False
            else:
                unanswered += 1
            if unanswered >= SILENT_POLLS and not self._modem.wire.is_over:
                raise DeviceError(
                    f"modem gives no answer ({unanswered} polls){self._advice}; opening the port "
                    "again"
                )
            self._listen_until(due_ns)
        self._modem.close_block()
        self._modem.wire.raise_loss()
        self._mode.set_back(self._modem.driver, AfterStop(self._link, self._modem.framer))

    @property
    def _advice(self) -> str:
        if not self._modem.is_heard:
            return ""
        baud = self._settings.baud
        return f", nothing readable: is it at {baud} baud, and does no other program use it?"

    def _turn(self) -> None:
        """Polls after the set-up if that is due, and before the next command of a full scan."""
        if not self._modem.is_set_up:
            self._prepare()
        if self._modem.driver is None or not (self._modem.is_set_up or self._modem.is_answered):
            return
        self._poll(self._modem.driver)
        if self._modem.is_set_up:
            self._mode.settle(self._modem.driver, self._modem.ask)
            self._continue_survey(self._modem.driver)

    def _prepare(self) -> None:
        if self._modem.driver is None or not self._is_named:
            # the name shows which of two modems is here, also where site.toml says the driver
            identified = self._identify()
            self._modem.driver = self._modem.driver or identified
            self._is_named = True
        if self._modem.driver is None:
            return
        self._modem.is_restarted, self._modem.refusal = False, ""
        accepted = self._modem.talk(self._modem.driver.setup()) or self._modem.is_restarted
        self._modem.is_set_up = accepted and not self._modem.is_restarted
        if self._modem.is_set_up:
            self._mode.renew()
            if self._settings.fixes:
                self._modem.talk(self._modem.driver.ask(self._modem.driver.gnss_start_commands))
            if not self._modem.is_announced:
                self._modem.is_announced = True
                self._link.note(
                    "info", "modem-ready", f"modem set up by driver {self._modem.driver.name}"
                )
        elif self._modem.is_answered and not accepted and not self._modem.wire.is_over:
            self._link.count(
                "setup-refused",
                1,
                f"times the modem did not accept its set-up{self._modem.refusal}; trying again",
            )

    def _identify(self) -> Family | None:
        """Asks twice if the answer fits no family: it may be damaged."""
        found = self._modem.talk(identify())
        if found is None:
            return None
        driver, text = found
        if driver.name == Generic.name and self._modem.talk(identify()) != found:
            self._link.count("unidentified", 1, "times the modem's identity was unclear")
            return None
        name = (self._modem.driver or driver).name
        self._link.note("info", "modem-identified", f"modem is {text!r}{DRIVER}{name}")
        if self._modem.driver is None and name == Generic.name:
            self._link.note("warning", "unknown-model", UNKNOWN_MODEL)
        if self._settings.fixes and re.search(driver.either_or, text):
            self._link.note("warning", "receiver-or-cells", _EITHER_OR)
        return driver

    def _poll(self, driver: Family) -> None:
        start_ns = (
            self._modem.late_ns if self._modem.framer.late_final_due else self._link.clock.now_ns()
        )
        self._modem.is_damaged, self._modem.refusal = False, ""
        rows = self._modem.talk(driver.poll())
        self._count_unread(driver)
        has_cell = any(isinstance(row, CellReading) for row in rows or ())
        if not has_cell and driver.is_foreign(self._modem.replies):
            refusal = self._modem.refusal
            if (standard := self._modem.talk(standard_poll())) is not None:
                what = f"polls were refused{refusal}; the serving cell is that of standard replies"
                self._link.count("standard-replies", 1, what)
                rows = standard
            self._modem.refusal = refusal
        if self._modem.framer.echo_seen and self._modem.is_set_up and not self._echoes:
            self._modem.set_up_again("modem echoes again, as after a restart; setting it up again")
        self._echoes = self._modem.framer.echo_seen
        if rows is None:
            if self._modem.is_set_up and self._modem.is_answered and not self._modem.wire.is_over:
                what = (
                    f"polls were refused{self._modem.refusal} or lost; setting the modem up again"
                )
                self._link.count("poll-refused", 1, what)
            self._modem.is_set_up = False
            return
        self._modem.emit_scan(start_ns, self._modem.wire.received_ns, rows)
        if self._settings.fixes:
            self._record_fixes(driver)

    def _count_unread(self, driver: Family) -> None:
        if (command := driver.unread(self._modem.replies)) is not None:
            what = f"replies had rows of {command} in no form that driver {driver.name} reads"
            self._link.count("unread-rows", 1, what)
            self._modem.is_damaged = True  # no scan without cells

    def _record_fixes(self, driver: Family) -> None:
        self._modem.refusal = ""
        found = self._modem.talk(driver.ask(driver.gnss_poll_commands)) or ()
        fixes = [row for row in found if isinstance(row, Fix)]
        for fix in fixes:
            self._record_fix(fix)
        if not fixes and not self._modem.wire.is_over:
            what = f"times the modem's receiver said nothing{self._modem.refusal}"
            self._link.count("receiver-silent", 1, what)

    def _record_fix(self, reported: Fix) -> None:
        fix = credible(reported)
        emit_fix(self._link, fix, self._modem.wire.received_ns, source=GNSS)
        if fix.valid and fix.utc_ns != reported.utc_ns and not self._is_date_noted:
            self._is_date_noted = True
            note_impossible_date(self._link, utc_text(reported.utc_ns or 0)[:10])

    def _continue_survey(self, driver: Family) -> None:
        # one command between two polls
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
            self._modem.is_damaged, self._modem.replies = False, []
            rows = run_dialogue(driver.survey(command), self._modem.ask_survey)
            self._count_unread(driver)
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
        """Receives unsolicited lines and the rest of the poll."""
        while not self._modem.wire.is_over:
            self._modem.receive()
            now_ns = self._link.clock.now_ns()
            if self._modem.unsolicited.is_over(now_ns):
                self._modem.close_block()
            if now_ns >= due_ns:
                return
