"""The session with a modem: drives the dialogues of a driver over a port, and hears what comes unasked."""

from typing import TypeVar

from logger.core.errors import DeviceError
from logger.core.types import Scan
from logger.device.link import Link
from logger.drivers.at import AtFramer, Unsolicited
from logger.drivers.dialogue import Command, Dialogue, ModemDriver, Reply
from logger.drivers.garbage import Garbage

T = TypeVar("T")

SILENT_POLLS = 3
"""Polls without an answer after which the port is closed and opened again."""
BLOCK_GAP_S = 0.5
"""Silence that ends a block of rows nobody asked for; such blocks have no final line."""


def modem_session(link: Link, driver: ModemDriver, poll_interval_s: float) -> None:
    """Set the modem up and poll it until stopped; raises `DeviceError` when it falls silent or its port is lost."""
    _Conversation(link, driver, round(poll_interval_s * 1e9)).run()


class _Conversation:
    """From the opening of the port until it is lost."""

    def __init__(self, link: Link, driver: ModemDriver, interval_ns: int) -> None:
        self._link = link
        self._driver = driver
        self._interval_ns = interval_ns
        self._framer = AtFramer()
        self._rows: list[str] = []
        self._row_ns = 0
        self._heard_ns = 0
        self._set_up = False
        self._answered = False

    def run(self) -> None:
        unanswered = 0
        while not self._link.stop.is_set():
            due_ns = self._link.clock.now_ns() + self._interval_ns
            self._answered = False
            if not self._set_up:
                self._prepare()
            self._poll()
            unanswered = 0 if self._answered else unanswered + 1
            if unanswered >= SILENT_POLLS and not self._link.stop.is_set():
                raise DeviceError(f"modem gives no answer ({unanswered} polls); opening the port again")
            self._listen_until(due_ns)
        self._close_block()

    def _prepare(self) -> None:
        self._set_up = self._talk(self._driver.setup())
        if self._set_up:
            self._link.note("info", "modem-ready", f"modem set up by driver {self._driver.name}")
        elif self._answered and not self._link.stop.is_set():
            self._link.note(
                "warning", "setup-refused", "modem did not accept its set-up; trying again at the next poll"
            )

    def _poll(self) -> None:
        start_ns = self._link.clock.now_ns()
        readings = self._talk(self._driver.poll())
        if readings is None:
            self._set_up = False
            return
        self._link.emit(Scan(start_ns, readings), self._heard_ns)

    def _talk(self, dialogue: Dialogue[T]) -> T:
        try:
            command = next(dialogue)
            while True:
                command = dialogue.send(self._ask(command))
        except StopIteration as done:
            result: T = done.value
            return result

    def _ask(self, command: Command) -> Reply:
        """Send a command and wait for its reply; a timeout is a reply too."""
        self._framer.send(command.text)
        self._link.write(command.text.encode("ascii") + b"\r")
        # a modem takes its real time to answer, however fast the clock of a simulated walk runs
        timeout_s = command.timeout_s / self._link.clock.real_s(1.0)
        deadline_ns = self._link.clock.now_ns() + round(timeout_s * 1e9)
        while self._link.clock.now_ns() < deadline_ns and not self._link.stop.is_set():
            reply = self._hear()
            if reply is not None:
                self._answered = True
                return reply
        expired = self._framer.expire()
        self._answered |= bool(expired.lines)
        return expired

    def _hear(self) -> Reply | None:
        """Read one chunk, all of it, also what follows the reply: one command is pending, so there is one at most."""
        self._heard_ns, data = self._link.read()
        reply = None
        for event in self._framer.feed(data):
            match event:
                case Reply():
                    reply = event
                case Unsolicited(line=line):
                    self._hear_unasked(line)
                case Garbage(data=noise):
                    self._link.count_garbage(len(noise))
        return reply

    def _hear_unasked(self, line: str) -> None:
        if self._driver.says_restarted(line):
            self._link.note("warning", "modem-restarted", f"modem says {line!r}; setting it up again")
            self._set_up = False
        elif self._driver.is_row(line):
            if self._driver.opens_block(line):
                self._close_block()
            self._rows.append(line)
            self._row_ns = self._heard_ns
            self._answered = True

    def _listen_until(self, due_ns: int) -> None:
        while not self._link.stop.is_set():
            now_ns = self._link.clock.now_ns()
            if self._rows and now_ns - self._row_ns > BLOCK_GAP_S * 1e9:
                self._close_block()
            if now_ns >= due_ns:
                return
            self._hear()

    def _close_block(self) -> None:
        """Record the rows that came unasked as one scan."""
        if self._rows:
            readings = self._driver.read_lines(self._rows)
            self._rows = []
            self._link.emit(Scan(self._row_ns, readings), self._row_ns)
