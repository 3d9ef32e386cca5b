"""The session with a modem: drives the dialogues of a driver over a port, and hears what comes
unasked.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from logger.config import ModemSettings
from logger.core.errors import DeviceError
from logger.core.types import CellReading, Fix, Scan
from logger.device.deferred_loss import Wire
from logger.device.gnss_link import count_unmeasured, credible
from logger.device.link import Link
from logger.device.mode_switch import ModeSwitch
from logger.device.saved_modes import KeptModes
from logger.device.scan_timeout import PAUSE_S, Wait
from logger.device.shutdown import AfterStop
from logger.device.unsolicited import Unasked
from logger.drivers.family import Family
from logger.drivers.generic.generic import Generic
from logger.drivers.protocols.at import AtFramer, Unsolicited
from logger.drivers.protocols.dialogue import Command, Dialogue, Reply, run_dialogue
from logger.drivers.protocols.garbage import Garbage
from logger.drivers.reading.recognition import mark_doubtful
from logger.drivers.reading.rows import Operator, Row
from logger.drivers.registry import driver_of, identify

T = TypeVar("T")

SILENT_POLLS = 3
"""Polls without an answer after which the port is closed and opened again."""
STORM = 100
"""Unasked lines in ten seconds that are worth a Note; a modem that is well says a few."""


def modem_session(
    link: Link, settings: ModemSettings, modes: KeptModes, *, locates: bool = False
) -> None:
    """Set the modem up and poll it until stopped; raises `DeviceError` when it falls silent or its
    port is lost.

    `modes` keeps what it was set to before it heard GSM only. With `locates` its own receiver gives
    the fixes.
    """
    mode = ModeSwitch(link, modes, gsm_only=settings.set_mode == "gsm")
    _Conversation(link, settings, mode, locates=locates).run()


class _Conversation:
    """From the opening of the port until it is lost."""

    def __init__(
        self, link: Link, settings: ModemSettings, mode: ModeSwitch, *, locates: bool
    ) -> None:
        self._link = link
        self._settings = settings
        self._mode = mode
        self._locates = locates
        self._driver: Family | None = driver_of(settings.driver)
        self._framer = AtFramer()
        self._unasked = Unasked()
        self._wire = Wire(link)
        self._late_ns = 0  # when the last command that expired was written
        self._spoke = False
        self._owed = 0  # answers to questions of the last full scan
        self._set_up = False
        self._told_ready = False
        self._restarted = False
        self._echoes = False
        self._answered = False
        self._damaged = False
        self._survey: list[Command] = []
        self._survey_ns = link.clock.now_ns()

    def run(self) -> None:
        unanswered = 0
        while not self._wire.is_over:
            due_ns = self._link.clock.now_ns() + round(self._settings.poll_interval_s * 1e9)
            self._answered = False
            self._turn()
            unanswered = 0 if self._answered else unanswered + 1
            if unanswered >= SILENT_POLLS and not self._wire.is_over:
                raise DeviceError(
                    f"modem gives no answer ({unanswered} polls); opening the port again"
                )
            self._listen_until(due_ns)
        self._close_block()
        self._wire.tell_loss()
        self._mode.set_back(self._driver, AfterStop(self._link, self._framer))

    def _turn(self) -> None:
        """One poll, with what has to go before it and what may follow it."""
        if not self._set_up:
            self._prepare()
        if self._driver is None or not (self._set_up or self._answered):
            return
        self._poll(self._driver)
        if self._set_up:
            self._mode.settle(self._driver, self._ask)
            self._survey_on(self._driver)

    def _prepare(self) -> None:
        self._driver = self._driver or self._identify()
        if self._driver is None:
            return
        self._restarted = False
        accepted = self._talk(self._driver.setup()) or self._restarted
        self._set_up = accepted and not self._restarted
        if self._set_up:
            self._mode.renew()
            if self._locates:
                self._talk(self._driver.ask(self._driver.gnss_start_commands))
            if not self._told_ready:
                self._told_ready = True
                self._link.note(
                    "info", "modem-ready", f"modem set up by driver {self._driver.name}"
                )
        elif self._answered and not accepted and not self._wire.is_over:
            self._link.count(
                "setup-refused", 1, "times the modem did not accept its set-up; trying again"
            )

    def _identify(self) -> Family | None:
        """Ask the modem who it is; a modem that no family knows is asked twice, as its words may be
        damaged.
        """
        found = self._talk(identify())
        if found is None:
            return None
        driver, text = found
        if driver.name == Generic.name and self._talk(identify()) != found:
            self._link.count("unidentified", 1, "times the modem did not say clearly who it is")
            return None
        self._link.note("info", "modem-identified", f"modem says {text!r}: driver {driver.name}")
        return driver

    def _poll(self, driver: Family) -> None:
        start_ns = self._late_ns if self._framer.late_final_due else self._link.clock.now_ns()
        self._damaged = False
        rows = self._talk(driver.poll())
        if self._framer.echo_seen and self._set_up and not self._echoes:
            self._lose("modem echoes again, as after a restart; setting it up again")
        self._echoes = self._framer.echo_seen
        if rows is None:
            if self._set_up and self._answered and not self._wire.is_over:
                self._link.count(
                    "poll-refused", 1, "polls were refused or lost; setting the modem up again"
                )
            self._set_up = False
            return
        self._emit_scan(start_ns, self._wire.heard_ns, rows)
        if self._locates:
            for row in self._talk(driver.ask(driver.gnss_poll_commands)) or ():
                if isinstance(row, Fix):
                    self._link.emit(credible(row), self._wire.heard_ns, source="gnss")
                    count_unmeasured(self._link, row)

    def _survey_on(self, driver: Family) -> None:
        """Go on with the full scan under way, one command between two polls, or begin one that is
        due.
        """
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
            self._damaged = False
            rows = run_dialogue(driver.survey(command), self._scan)
            if rows is not None:
                cells = [row for row in rows if isinstance(row, CellReading)]
                networks = sum(isinstance(row, Operator) for row in rows)
                self._link.note(
                    "info", "full-scan", f"{command.text}: {len(cells)} cells, {networks} networks"
                )
                if cells or not networks:  # a list of networks says nothing of cells
                    self._emit_scan(now_ns, self._wire.heard_ns, cells)
            elif not self._wire.is_over:
                self._link.note("warning", "scan-refused", f"no answer to {command.text}")

    def _emit_scan(self, start_ns: int, end_ns: int, rows: Sequence[Row]) -> None:
        """Record the cells of one poll, each once however often the modem repeats its lines.

        That there are none is recorded only where nothing was lost that might have told of some.
        """
        told, self._link.known = mark_doubtful(rows, self._link.known)
        readings = tuple(dict.fromkeys(row for row in told if isinstance(row, CellReading)))
        if readings or not self._damaged:
            self._link.emit(Scan(start_ns, readings), end_ns)

    def _talk(self, dialogue: Dialogue[T]) -> T:
        return run_dialogue(dialogue, self._ask)

    def _ask(self, command: Command) -> Reply:
        """Send a command and wait for its reply; a timeout is a reply too, and so is a restart."""
        return self._reply(Wait(command, self._now_s()))

    def _scan(self, command: Command) -> Reply:
        """The same for a full scan; a modem that is silent for too long is asked meanwhile whether
        it is still there.

        Where each question has an answer besides, the lines that came first are the reply of the
        scan. Else the scan is lost: the modem had hung, or a question has ended it.
        """
        patience = self._link.patience
        wait = Wait(command, self._now_s(), patience.silence_s(command))
        self._owed = 0
        reply = self._reply(wait)
        if (
            wait.questions
            and reply.final is not None
            and not (self._has_answered() and reply.lines)
        ):
            self._link.count(
                "silent-scan",
                1,
                "full scans fell silent; the modem answered when asked, polling goes on",
            )
            patience.interrupted(command)
            self._damaged = True
            return replace(reply, final=None)
        if reply.ok and reply.lines:
            patience.completed(command, wait.longest_silence_s)
        return reply

    def _reply(self, wait: Wait) -> Reply:
        command = wait.command
        self._framer.send(command.text)
        asked_ns = self._link.clock.now_ns()
        self._wire.write(command.text.encode("ascii") + b"\r")
        restarted = self._restarted
        while not self._wire.is_over and not wait.is_over(self._now_s()):
            if wait.asks(self._now_s()):
                self._owed += 1
                self._wire.write(b"AT\r")
            reply = self._hear()
            n_lines = len(reply.lines) if reply else self._framer.n_lines
            wait.hear(self._now_s(), spoke=self._spoke, n_lines=n_lines, over=reply is not None)
            if reply is not None:
                self._answered = True
                self._judge(reply, slow=wait.is_slow(self._now_s()))
                return reply
            if self._restarted and not restarted:
                self._damaged = True
                return self._framer.abandon()
        self._late_ns = asked_ns
        if not self._wire.is_over:
            self._link.count("no-answer", 1, "commands without an answer")
        expired = self._framer.expire()
        self._answered |= bool(expired.lines)
        self._damaged = True
        return expired

    def _has_answered(self) -> bool:
        """True when every question has an answer of its own, which follow a reply at once."""
        end_s = self._now_s() + PAUSE_S
        while self._owed and self._now_s() < end_s and not self._wire.is_over:
            self._hear()
        return not self._owed

    def _now_s(self) -> float:
        """Real time: a modem takes its own to answer, however fast the clock of a simulated walk
        runs.
        """
        return self._link.clock.real_s(self._link.clock.now_ns() / 1e9)

    def _judge(self, reply: Reply, *, slow: bool) -> None:
        """Count what is odd in a reply that is good enough."""
        if slow:
            self._link.count("slow-answer", 1, "answers took more than half of the time they may")
        if reply.lines and len(reply.lines) == 2 * len(set(reply.lines)):
            self._link.count("repeated-lines", 1, "replies with each line twice")

    def _hear(self) -> Reply | None:
        """Read one chunk, all of it, also what follows the reply: one command is pending, so there
        is one at most.
        """
        data = self._wire.read()
        self._spoke = bool(data)
        reply = None
        for event in self._framer.feed(data):
            match event:
                case Reply():
                    reply = event
                case Unsolicited() as unasked:
                    self._hear_unasked(unasked.line, is_late=unasked.is_late)
                case Garbage(data=noise):
                    self._unasked.interrupt()
                    self._link.count_garbage(len(noise))
                    self._damaged = True
        return reply

    def _hear_unasked(self, line: str, *, is_late: bool) -> None:
        driver = self._driver or Generic()
        if driver.is_restart(line):
            if not self._restarted:  # more of such lines may follow
                self._lose(f"modem says {line!r}; setting it up again")
            self._restarted = True
        elif (role := driver.role_of(line)) is not None:
            if role == "serving" or self._unasked.is_over(
                self._wire.heard_ns
            ):  # the first row of a block
                self._close_block()
            self._unasked.add(
                line, self._wire.heard_ns, self._late_ns if is_late else self._wire.heard_ns
            )
            self._answered = True
        elif line.strip() in {"OK", "ERROR"} and self._owed:
            self._owed -= 1
        elif line.strip() in {"OK", "ERROR"}:
            self._link.count(
                "stray-result", 1, "results that end nothing, late ones or repeated ones"
            )
        else:
            self._unasked.interrupt()
            self._link.count("unasked-lines", 1, "lines nobody asked for", least=STORM)

    def _lose(self, why: str) -> None:
        """Have the modem set up again before the next poll."""
        self._link.note("warning", "modem-restarted", why)
        self._set_up = self._told_ready = False

    def _listen_until(self, due_ns: int) -> None:
        """Hear what comes unasked, and in any case what is left of the poll: nothing is pending
        now.
        """
        while not self._wire.is_over:
            self._hear()
            now_ns = self._link.clock.now_ns()
            if self._unasked.is_over(now_ns):
                self._close_block()
            if now_ns >= due_ns:
                return

    def _close_block(self) -> None:
        """Record the rows that came unasked as one scan, which lasted from when they may first have
        been heard.
        """
        lines = self._unasked.take()
        if lines and self._driver is not None:
            self._emit_scan(self._unasked.begin_ns, self._unasked.end_ns, self._driver.read(lines))
