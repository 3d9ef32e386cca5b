"""Commands and replies on a modem's port, and the lines that come unsolicited."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from logger.core.cell_names import each_once
from logger.core.errors import DeviceError
from logger.core.types import CellReading, Scan
from logger.device.link import Link
from logger.device.scan_timeout import LATE_S, PAUSE_S, Wait
from logger.drivers.family import Family
from logger.drivers.generic import Generic
from logger.drivers.protocols.at import (
    INTERRUPTION,
    AtFramer,
    Command,
    Dialogue,
    Reply,
    Unsolicited,
    run_dialogue,
)
from logger.drivers.protocols.line_noise import Garbage
from logger.drivers.reading.recognition import mark_doubtful
from logger.drivers.reading.row_language import Row

BLOCK_GAP_S = 0.5
"""Silence that ends a block of unsolicited rows; such blocks have no final line."""
T = TypeVar("T")

MANY_UNSOLICITED = 100
"""Unsolicited lines in ten seconds that are worth a note; a working modem sends a few."""


class UnsolicitedBlock:
    """One block of such rows, whose cells were received from `begin_ns` to `end_ns`."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        self.begin_ns = 0
        self.end_ns = 0

    def add(self, line: str, t_ns: int, since_ns: int) -> None:
        """Add a row received at `t_ns` whose content is not older than `since_ns`."""
        self.begin_ns = min(since_ns, self.begin_ns) if self._lines else since_ns
        self.end_ns = t_ns
        self._lines.append(line)

    def interrupt(self) -> None:
        """Mark that other data came, which may have cut the last row."""
        if self._lines:
            self._lines.append(INTERRUPTION)

    def is_over(self, now_ns: int) -> bool:
        """Whether there is a block that has been silent for long enough."""
        return bool(self._lines) and now_ns - self.end_ns > BLOCK_GAP_S * 1e9

    def take(self) -> list[str]:
        """Return the lines of the block and empty it."""
        lines, self._lines = self._lines, []
        return lines


class Wire:
    """Reads and writes a link until it is lost or stopped.

    `received_ns` is the time of the last chunk. None of its bytes came before `since_ns`: a busy
    machine reads a chunk late.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._loss: DeviceError | None = None
        self.received_ns = 0
        self.has_heard = False
        self.since_ns = self._asked_ns = link.clock.now_ns()

    @property
    def is_over(self) -> bool:
        """Whether nothing more can be received."""
        return self._loss is not None or self._link.stop.is_set()

    def read(self) -> bytes:
        """Read the next chunk; empty after a silence, and always after a loss."""
        self.has_heard = False
        if self._loss is None:
            # what this read returns was not there yet when the last one began
            self.since_ns, self._asked_ns = self._asked_ns, self._link.clock.now_ns()
            try:
                self.received_ns, data = self._link.read()
            except DeviceError as error:
                self._loss = error
            else:
                self.has_heard = self._link.has_heard
                return data
        return b""

    def write(self, data: bytes) -> None:
        """Write all data; nothing after a loss."""
        if self._loss is None:
            try:
                self._link.write(data)
            except DeviceError as error:
                self._loss = error

    def raise_loss(self) -> None:
        """Raise the `DeviceError` of a loss."""
        if self._loss is not None:
            raise self._loss


class ModemExchange:
    """One open port of a modem, with what its lines have shown of the modem's state.

    `driver` is None until the modem is identified. `is_heard` (any byte), `is_answered` (any
    answer) and `is_damaged` (any damage to them) cover the time since the caller cleared them.
    """

    def __init__(self, link: Link, driver: Family | None) -> None:
        self._link = link
        self._now_s = link.clock.real_now_s
        self.driver = driver
        self.framer = AtFramer()
        self.unsolicited = UnsolicitedBlock()
        self.wire = Wire(link)
        self.late_ns = 0  # when the last command that expired was written
        self.is_set_up = False
        self.is_announced = False
        self.is_restarted = False
        self.is_heard = False
        self.is_answered = False
        self.is_damaged = False
        self.refusal = ""  # of the latest command that had to be accepted
        self.replies: list[Reply] = []  # of the latest dialogue
        self._has_bytes = False
        self._n_pending_queries = 0  # queries of the last full scan without an answer

    def emit_scan(self, start_ns: int, end_ns: int, rows: Sequence[Row]) -> None:
        """Record the cells of one poll, each once.

        A scan without cells is recorded only if no line was lost that might have had one.
        """
        marked, self._link.known = mark_doubtful(rows, self._link.known)
        readings = each_once(row for row in marked if isinstance(row, CellReading))
        if readings or not self.is_damaged:
            self._link.emit(Scan(start_ns, readings), end_ns)

    def talk(self, dialogue: Dialogue[T]) -> T:
        """Run a dialogue of the driver to its result."""
        self.replies = []
        return run_dialogue(dialogue, self.ask)

    def ask(self, command: Command) -> Reply:
        """Send a command and wait for its reply; a timeout or a restart is a reply too."""
        return self._reply(Wait(command, self._now_s()))

    def ask_survey(self, command: Command) -> Reply:
        """As `ask`, for a full scan; a modem that is silent for too long is queried meanwhile.

        If each query has an answer of its own, the lines before them are the reply. Otherwise the
        scan is lost: the modem had hung, or a query has ended it.
        """
        limits = self._link.silence_limits
        wait = Wait(command, self._now_s(), limits.silence_s(command))
        self._n_pending_queries = 0
        reply = self._reply(wait)
        if (
            wait.n_queries
            and reply.final is not None
            and not (self._are_queries_answered() and reply.lines)
        ):
            self._link.count(
                "silent-scan",
                1,
                "full scans fell silent; the modem answered a query, polling goes on",
            )
            limits.learn_interrupted(command)
            self.is_damaged = True
            return replace(reply, final=None)
        if reply.ok and reply.lines:
            limits.learn_completed(command, wait.longest_silence_s)
        return reply

    def _reply(self, wait: Wait) -> Reply:
        command = wait.command
        self.framer.send(
            command.text,
            is_within_line=self._link.is_within_line,
            rows=self.driver.other_rows if self.driver else "",
        )
        sent_ns = self._link.clock.now_ns()
        self.wire.write(command.text.encode("ascii") + b"\r")
        restarted = self.is_restarted
        while not self.wire.is_over and not wait.is_over(self._now_s()):
            if wait.is_query_due(self._now_s()):
                self._n_pending_queries += 1
                self.wire.write(b"AT\r")
            reply = self.receive()
            n_lines = len(reply.lines) if reply else self.framer.n_lines
            wait.observe(
                self._now_s(), has_bytes=self._has_bytes, n_lines=n_lines, is_over=reply is not None
            )
            if reply is not None:
                self.is_answered = True
                if reply.is_refusal and (command.needed or self.is_set_up):
                    self.refusal = f" ({reply.refusal})"
                self.replies.append(reply)
                self._count_anomalies(reply, slow=wait.is_slow(self._now_s()))
                return reply
            if self.is_restarted and not restarted:
                self.is_damaged = True
                return self.framer.abandon()
        self.late_ns = sent_ns
        if not self.wire.is_over:
            self._link.count("no-answer", 1, "commands without an answer")
        expired = self.framer.expire()
        self.is_answered |= bool(expired.lines)
        self.is_damaged = True
        return expired

    def _are_queries_answered(self) -> bool:
        """Whether every query has an answer of its own; these follow a reply at once."""
        end_s = self._now_s() + PAUSE_S
        while self._n_pending_queries and self._now_s() < end_s and not self.wire.is_over:
            self.receive()
        return not self._n_pending_queries

    def _count_anomalies(self, reply: Reply, *, slow: bool) -> None:
        if slow:
            self._link.count("slow-answer", 1, "answers took more than half of the time they may")
        if reply.lines and len(reply.lines) == 2 * len(set(reply.lines)):
            self._link.count("repeated-lines", 1, "replies with each line twice")
        if self.driver is not None and self.driver.is_cut(reply):
            self._link.count("cut-rows", 1, "replies had a row cut by another line")
            self.is_damaged = True

    def receive(self) -> Reply | None:
        """Read one chunk completely and return its reply, if any.

        One command is pending at most.
        """
        data = self.wire.read()
        self._has_bytes = self.wire.has_heard
        self.is_heard |= self._has_bytes
        reply = None
        for event in self.framer.feed(data):
            match event:
                case Reply():
                    reply = event
                case Unsolicited(line=line, is_late=is_late):
                    self._receive_unsolicited(line, is_late=is_late)
                case Garbage(data=noise):
                    self.unsolicited.interrupt()
                    self._link.count_garbage(len(noise))
                    self.is_damaged = True
        return reply

    def _receive_unsolicited(self, line: str, *, is_late: bool) -> None:
        driver = self.driver or Generic()
        if driver.is_restart(line):
            if not self.is_restarted:  # more of such lines may follow
                self.set_up_again(f"modem sent {line!r}; setting it up again")
            self.is_restarted = True
        elif (role := driver.role_of(line)) is not None:
            if role == "serving" or self.unsolicited.is_over(
                self.wire.received_ns
            ):  # the first row of a block
                self.close_block()
            since_ns = self.late_ns if is_late else self.wire.since_ns
            self.unsolicited.add(line, self.wire.received_ns, since_ns)
            self.is_answered = self.is_damaged = True  # a poll without cells has missed these
        elif line.strip() in {"OK", "ERROR"} and self._n_pending_queries:
            self._n_pending_queries -= 1
        elif line.strip() in {"OK", "ERROR"}:
            self._link.count("stray-result", 1, "final results without a command: late or repeated")
        else:
            self.unsolicited.interrupt()
            self._link.count("unasked-lines", 1, "unsolicited lines", least=MANY_UNSOLICITED)

    def set_up_again(self, reason: str) -> None:
        """Note why the modem has to be set up again before the next poll."""
        self._link.note("warning", "modem-restarted", reason)
        self.is_set_up = self.is_announced = False

    def close_block(self) -> None:
        """Record the unsolicited rows as one scan, from the earliest time of the first on.

        They have had cells, so without any their values were cut.
        """
        lines = self.unsolicited.take()
        rows = self.driver.read(lines) if self.driver is not None else ()
        if any(isinstance(row, CellReading) for row in rows):
            self.emit_scan(self.unsolicited.begin_ns, self.unsolicited.end_ns, rows)


class AfterStop:
    """Commands on a port that is still open; other lines are recorded raw only."""

    def __init__(self, link: Link, framer: AtFramer) -> None:
        self._link = link
        self._now_s = link.clock.real_now_s
        self._framer = framer

    def drain(self) -> None:
        """Receive what is still to come, which might be mistaken for a later answer."""
        start_s = byte_s = self._now_s()
        while self._now_s() - byte_s < PAUSE_S and self._now_s() - start_s < LATE_S:
            self._read_events()
            if self._link.has_heard:
                byte_s = self._now_s()

    def ask(self, command: Command) -> Reply:
        """Send a command and wait for its reply; a timeout is a reply too."""
        wait = Wait(command, self._now_s())
        self._framer.send(command.text, is_within_line=self._link.is_within_line)
        self._link.write(command.text.encode("ascii") + b"\r")
        while not wait.is_over(self._now_s()):
            for event in self._read_events():
                if isinstance(event, Reply):
                    return event
        return self._framer.expire()

    def _read_events(self) -> list[object]:
        _, data = self._link.read()
        return list(self._framer.feed(data))
