"""What is carried along a walk: a modem of any dialect, and a GNSS receiver as a u-blox M8."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import reduce
from operator import xor

import numpy as np

from logger.core.arrays import FloatArray
from logger.drivers.reading.row_language import MPS_PER_KNOT
from logger.sim.dialects import ANYWHERE, NO_CARD, REGISTERED, Dialect, Listing, angle_text
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


# --- the receiver ---

SPEED_SIGMA_MPS = 0.05
COURSE_FROM_MPS = 0.3
"""Slower than this no course is printed."""
GEOID_M = 48.0
SATELLITES = (2, 5, 12, 15, 21, 24, 25, 29, 67, 68, 77, 84)  # GPS and GLONASS by NMEA numbers
PDOP, HDOP, VDOP = 1.68, 0.92, 1.41

NO_FIX = (
    "GNRMC,,V,,,,,,,,,,N",
    "GNGGA,,,,,,0,00,99.99,,,,,,",
    "GNGSA,A,1,,,,,,,,,,,,,99.99,99.99,99.99",
)


@dataclass(frozen=True, slots=True)
class GnssNoise:
    """Error on each axis: a first-order Gauss-Markov part and a white part of each epoch."""

    wander_sigma_m: float = 3.0
    wander_time_s: float = 60.0
    white_sigma_m: float = 0.2


class SimulatedReceiver:
    """One receiver from power-up on, without a fix for `cold_start_s` seconds."""

    def __init__(
        self,
        world: World,
        walk: Walk,
        utc_start: datetime,
        rng: np.random.Generator,
        noise: GnssNoise | None = None,
        cold_start_s: float = 0.0,
    ) -> None:
        self._world = world
        self._walk = walk
        self._utc_start = utc_start
        self._rng = rng
        self._noise = noise or GnssNoise()
        self._cold_start_s = cold_start_s
        self._wander_m = rng.normal(0.0, self._noise.wander_sigma_m, 3)  # east, north, up
        self._t_s = 0.0

    def epoch(self, t_s: float) -> bytes:
        """The sentences of one epoch; epochs come in order."""
        error_m = self._advance(t_s)
        texts = NO_FIX if t_s < self._cold_start_s else self._fix(t_s, error_m.tolist())
        return b"".join(sentence(text) for text in texts)

    def _advance(self, t_s: float) -> FloatArray:
        """East, north and up error, m: x' = a x + sqrt(1 - a^2) sigma w, a = exp(-dt / T)."""
        noise = self._noise
        decay = float(np.exp(-(t_s - self._t_s) / noise.wander_time_s))
        drive_m = self._rng.normal(0.0, noise.wander_sigma_m, 3)
        self._wander_m = decay * self._wander_m + np.sqrt(1.0 - decay**2) * drive_m
        self._t_s = t_s
        return np.asarray(self._wander_m + self._rng.normal(0.0, noise.white_sigma_m, 3), float)

    def _fix(self, t_s: float, error_m: Sequence[float]) -> Sequence[str]:
        """RMC, GGA and GSA."""
        east_m, north_m = self._walk.position(t_s)
        lat_deg, lon_deg = self._world.to_latlon(east_m + error_m[0], north_m + error_m[1])
        utc = self._utc_start + timedelta(seconds=t_s)
        time = f"{utc:%H%M%S}.{utc.microsecond // 10_000:02d}"
        position = f"{angle_text(lat_deg, 2, 'NS')},{angle_text(lon_deg, 3, 'EW')}"
        altitude = f"{ALTITUDE_M + error_m[2]:.1f}"
        quality = f"{len(SATELLITES):02d},{HDOP:.2f}"
        satellites = ",".join(f"{number:02d}" for number in SATELLITES)
        return (
            f"GNRMC,{time},A,{position},{self._speed_course(t_s)},{utc:%d%m%y},,,A",
            f"GNGGA,{time},{position},1,{quality},{altitude},M,{GEOID_M:.1f},M,,",
            f"GNGSA,A,3,{satellites},{PDOP:.2f},{HDOP:.2f},{VDOP:.2f}",
        )

    def _speed_course(self, t_s: float) -> str:
        speed_mps, course_deg = self._walk.motion(t_s)
        speed_mps = abs(speed_mps + float(self._rng.normal(0.0, SPEED_SIGMA_MPS)))
        course = f"{course_deg:.2f}" if speed_mps >= COURSE_FROM_MPS else ""
        return f"{speed_mps / MPS_PER_KNOT:.3f},{course}"


def sentence(text: str) -> bytes:
    """Text between `$` and a checksum, with its line end."""
    body = text.encode("ascii")
    return b"$%b*%02X\r\n" % (body, reduce(xor, body))
