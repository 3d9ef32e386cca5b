"""A modem of any dialect, carried along a walk: commands in, answers out."""

import re
from collections.abc import Callable, Mapping
from datetime import datetime, timedelta

import numpy as np

from logger.sim.dialects import ANYWHERE, NO_CARD, REGISTERED, Dialect, Listing
from logger.sim.walk import Walk
from logger.sim.world import Air, ModemFix, ReceivedCell, World

DECODE_DBM = -104.0
"""Level from which broadcasts are decoded: access is allowed there (C1 > 0, see
`world.ACCESS_DBM`)."""
UNSOLICITED_EVERY_S = 5.0
"""Period of unsolicited rows, which no manual gives."""
COLD_START_S = 30.0
ALTITUDE_M = 540.0

_SETTING = re.compile(r"([+#^!%*][A-Z0-9]+)=(.*)")
_PARTS = re.compile(r'((?:[^";]|"[^"]*")+)')
_ERROR_TEXTS = {
    10: "SIM not inserted",
    30: "no network service",
    505: "Session is not active",
    516: "Not fixed now",
}


class SimulatedModem:
    """One modem from power-up on; each reply has new fading.

    `now_s` gives the seconds since the walk began, `utc_start` when that was for its noiseless
    receiver. Levels are read `above_db` too high.
    """

    def __init__(
        self,
        dialect: Dialect,
        world: World,
        walk: Walk,
        now_s: Callable[[], float],
        rng: np.random.Generator,
        *,
        utc_start: datetime | None = None,
        decode_dbm: float = DECODE_DBM,
        above_db: float = 0.0,
    ) -> None:
        self._above_db = above_db
        self._dialect = dialect
        self._world = world
        self._walk = walk
        self._now_s = now_s
        self._rng = rng
        self._utc_start = utc_start
        self._decode_dbm = decode_dbm
        alike = REGISTERED if dialect.registered else NO_CARD
        self._replies: Mapping[str, Listing] = {**ANYWHERE, **alike, **dialect.replies}
        self._terminal = AtTerminal(self._answer, abortable=dialect.abortable)
        self._settings: dict[str, str] = {}
        self._late = b""
        self._due_s = 0.0
        self._sent_s = 0.0
        self._restart()

    def feed(self, data: bytes) -> bytes:
        """What the modem writes after these bytes."""
        return self._terminal.feed(data)

    def unsolicited(self) -> bytes:
        """What it writes by itself since the last call, slow answers among it."""
        if self._terminal.busy:
            return self._terminal.finish(self._late) if self._now_s() >= self._due_s else b""
        if self._dialect.unsolicited is None or self._now_s() - self._sent_s < UNSOLICITED_EVERY_S:
            return b""
        self._sent_s = self._now_s()
        lines = self._dialect.unsolicited(self._listen(), self._settings)
        return b"" if isinstance(lines, int) else frame_text(*lines)

    def restart(self) -> bytes:
        """Lose the power and come back with the settings of power-up.

        Returns the lines that the modem prints when it is ready.
        """
        self._restart()
        return frame_text(*self._dialect.boot)

    def echo(self) -> None:
        """Switch the echo on, as a modem does that loses nothing else."""
        self._terminal.echo = True

    def _restart(self) -> None:
        self._terminal.restart()
        stored = {
            name: value
            for name, value in self._settings.items()
            if self._dialect.settings[name].stored
        }
        self._settings = {
            name: kind.default for name, kind in self._dialect.settings.items()
        } | stored
        self._sent_s = self._now_s()

    def _answer(self, line: str) -> bytes | None:
        """None where the answer comes later."""
        out = b""
        takes_s = 0.0
        final = "OK"
        for text in _PARTS.findall(line.removeprefix("AT")):
            blocks, final = self._do(text.strip())
            out += frame_text(*blocks)
            takes_s = max(takes_s, self._takes_s(text.strip()) if final == "OK" else 0.0)
            if final != "OK":
                break
        out += frame_text(final)
        if not takes_s:
            return out
        self._late, self._due_s = out, self._now_s() + takes_s
        return None

    def _do(self, command: str) -> tuple[list[str], str]:
        """Blocks of text and the final result."""
        if command in self._dialect.identity:
            return list(self._dialect.identity[command]), "OK"
        name, argument = self._reply_name(command)
        if name in self._replies:
            answer = self._replies[name](self._listen(), {**self._settings, "=": argument})
            return ([], self._error(answer)) if isinstance(answer, int) else (list(answer), "OK")
        return [], "OK" if self._set(command) else "ERROR"

    def _reply_name(self, command: str) -> tuple[str, str]:
        """Name of the reply, and the argument of one that takes any."""
        name, equals, argument = command.partition("=")
        return (
            (name + equals, argument)
            if name + equals in self._replies and argument
            else (command, "")
        )

    def _takes_s(self, command: str) -> float:
        return self._dialect.takes_s.get(self._reply_name(command)[0], 0.0)

    def _set(self, command: str) -> bool:
        """False for what is not understood."""
        setting = _SETTING.fullmatch(command)
        kind = self._dialect.settings.get(setting[1]) if setting else None
        if setting is None or kind is None or not kind.form.fullmatch(setting[2]):
            return False
        before, now = self._settings[setting[1]].split(","), setting[2].split(",")
        self._settings[setting[1]] = ",".join(now + before[len(now) :])
        self._sent_s = self._now_s()
        return True

    def _error(self, code: int) -> str:
        form = self._settings["+CMEE"]
        return (
            "ERROR" if form == "0" else f"+CME ERROR: {code if form == '1' else _ERROR_TEXTS[code]}"
        )

    def _listen(self) -> Air:
        now_s = self._now_s()
        east_m, north_m = self._walk.positions(np.array([now_s]))
        levels_dbm = self._world.received_dbm(east_m, north_m, self._rng)[:, 0]
        read_dbm = np.maximum(levels_dbm + self._above_db, self._world.radio.floor_dbm)
        is_decoded = levels_dbm >= self._decode_dbm
        columns = zip(self._world.transmitters, read_dbm.tolist(), is_decoded.tolist(), strict=True)
        cells = [ReceivedCell(cell, level, is_decoded=decoded) for cell, level, decoded in columns]
        return Air.of(cells, lambda: self._fix(now_s))

    def _fix(self, now_s: float) -> ModemFix | None:
        if self._utc_start is None or now_s < COLD_START_S:
            return None
        speed_mps, course_deg = self._walk.motion(now_s)
        lat_deg, lon_deg = self._world.to_latlon(*self._walk.position(now_s))
        utc = self._utc_start + timedelta(seconds=now_s)
        return ModemFix(lat_deg, lon_deg, ALTITUDE_M, utc, speed_mps, course_deg)


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
