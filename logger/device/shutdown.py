"""The last commands to a modem, after the stop of the session."""

from logger.device.link import Link
from logger.device.scan_timeout import LATE_S, PAUSE_S, Wait
from logger.drivers.protocols.at import AtFramer, Command, Reply


class AfterStop:
    """Commands on a port that is still open; other lines of the modem are recorded raw only."""

    def __init__(self, link: Link, framer: AtFramer) -> None:
        self._link = link
        self._framer = framer

    def drain(self) -> None:
        """Receive what is still to come, which must not be mistaken for a later answer."""
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
        """Events of one chunk, none after silence."""
        _, data = self._link.read()
        return list(self._framer.feed(data))

    def _now_s(self) -> float:
        return self._link.clock.real_s(self._link.clock.now_ns() / 1e9)
