"""The command line of a modem (ITU-T V.250): echo, carriage returns, framed answers."""

from collections.abc import Callable

CARRIAGE_RETURN = 0x0D
LINE_FEED = 0x0A
MAX_COMMAND = 556  # SIM800 AT Command Manual V1.09, 1.4


class AtTerminal:
    """Bytes in, echo and answers out; `answer` gets each command line, returns the answer.

    It returns None for an answer that takes its time: then nothing is read until `finish`, or,
    where commands are `abortable` (V.250 5.6.1), the next character ends the command.
    """

    def __init__(self, answer: Callable[[str], bytes | None], *, abortable: bool = False) -> None:
        self._answer = answer
        self._abortable = abortable
        self._line = bytearray()
        self._waiting = bytearray()
        self.busy = False
        self.echo = True

    def restart(self) -> None:
        """As after power-up."""
        self._line.clear()
        self._waiting.clear()
        self.busy = False
        self.echo = True

    def feed(self, data: bytes) -> bytes:
        """What the modem writes back; a carriage return ends a command."""
        out = bytearray()
        self._waiting += data
        if self.busy and self._abortable and self._waiting:
            self._waiting.pop(0)
            self.busy = False
            out += frame_text("OK")
        while self._waiting and not self.busy:
            byte = self._waiting.pop(0)
            if byte == LINE_FEED:
                continue
            if self.echo:
                out.append(byte)
            if byte == CARRIAGE_RETURN:
                out += self._execute()
            elif len(self._line) < MAX_COMMAND:
                self._line.append(byte)
        return bytes(out)

    def finish(self, answer: bytes) -> bytes:
        """Give the answer that took its time, and go on with what was written meanwhile."""
        self.busy = False
        return answer + self.feed(b"")

    def _execute(self) -> bytes:
        command = self._line.decode("latin-1").strip().upper()
        self._line.clear()
        match command:
            case "AT" | "ATV1":
                return frame_text("OK")
            case "ATE0" | "ATE1" | "ATE":
                self.echo = command == "ATE1"
                return frame_text("OK")
        answer = self._answer(command) if command.startswith("AT") else b""
        self.busy = answer is None
        return answer or b""


def frame_text(*texts: str) -> bytes:
    """Each text between line ends, as a modem with ATV1 prints it."""
    return "".join(f"\r\n{text}\r\n" for text in texts).encode("ascii")
