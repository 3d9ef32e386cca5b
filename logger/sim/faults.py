"""Modems that misbehave between two times of the walk, the same way for the same seed."""

from collections.abc import Callable

import numpy as np

from logger.sim.devices import SimulatedModem

BURST_EVERY_S = 0.3
BURST_BYTES = 24  # so many random bytes are hardly ever all printable
SLOW_S_PER_BYTE = 0.03
URCS_PER_S = 200.0
URCS = (
    "+CREG: 2", "+CREG: 1", '+CIEV: "CALL",0', '*PSUTTZ: 2024,5,14,9,0,0,"+4",1', "DST: 1",
    "RING", "Call Ready",
    '+CMTI: "SM",1', "+CGREG: 0", "^BOOT:1,0,0,0,6", "UNDER-VOLTAGE WARNNING", "SMS Ready",
)  # fmt: skip


class Fault:
    """What happens to a modem; the plain one lets everything through.

    Times are seconds since it began.
    """

    def __init__(self, modem: SimulatedModem, rng: np.random.Generator) -> None:
        self.modem = modem
        self.rng = rng

    def begin(self) -> bytes:
        """What the modem writes at its beginning."""
        return b""

    def to_modem(self, data: bytes) -> bytes:
        """What reaches the modem of the bytes written to it."""
        return data

    def from_modem(self, data: bytes, t_s: float) -> bytes:
        """What reaches the port of the bytes that the modem writes."""
        del t_s
        return data

    def end(self) -> bytes:
        """What the modem writes at its end."""
        return b""


class GarbageBytes(Fault):
    """Bursts of random bytes, between and within lines."""

    _bursts = 0

    def from_modem(self, data: bytes, t_s: float) -> bytes:
        due = int(t_s / BURST_EVERY_S) - self._bursts
        self._bursts += due
        for _ in range(due):
            at = int(self.rng.integers(len(data) + 1))
            data = data[:at] + _noise(self.rng) + data[at:]
        return data


class Hang(Fault):
    """Receives and writes nothing."""

    def to_modem(self, data: bytes) -> bytes:
        del data
        return b""

    def from_modem(self, data: bytes, t_s: float) -> bytes:
        del data, t_s
        return b""


class Stall(Hang):
    """A hang that answers everything at its end."""

    def __init__(self, modem: SimulatedModem, rng: np.random.Generator) -> None:
        super().__init__(modem, rng)
        self._pending = b""

    def to_modem(self, data: bytes) -> bytes:
        self._pending += data
        return b""

    def end(self) -> bytes:
        return self.modem.feed(self._pending)


class BrownOut(Hang):
    """The supply sags: noise, silence, then a restart with factory settings."""

    def begin(self) -> bytes:
        return _noise(self.rng)

    def end(self) -> bytes:
        return _noise(self.rng) + self.modem.restart()


class SilentReset(Fault):
    """A restart without a message, as of a modem that waits for AT to find its rate."""

    def begin(self) -> bytes:
        self.modem.restart()
        return b""


class EchoOn(Fault):
    """The echo comes on, and stays on whatever the modem is sent."""

    def to_modem(self, data: bytes) -> bytes:
        self.modem.echo()
        return data


class SlowBytes(Fault):
    """One byte at a time; the modem reads nothing while it has bytes left to write."""

    def __init__(self, modem: SimulatedModem, rng: np.random.Generator) -> None:
        super().__init__(modem, rng)
        self._left = b""
        self._pending = b""
        self._t_s = 0.0

    def to_modem(self, data: bytes) -> bytes:
        self._pending += data
        if self._left:
            return b""
        received, self._pending = self._pending, b""
        return received

    def from_modem(self, data: bytes, t_s: float) -> bytes:
        if not self._left:
            self._t_s = t_s
        self._left += data
        n = int((t_s - self._t_s) / SLOW_S_PER_BYTE)
        self._t_s += n * SLOW_S_PER_BYTE
        out, self._left = self._left[:n], self._left[n:]
        if not self._left and self._pending:
            self._left = self.modem.feed(self.to_modem(b""))
        return out

    def end(self) -> bytes:
        return self._left + self.modem.feed(self._pending)


class DuplicatedLines(Fault):
    """Each line comes twice, its end included."""

    def from_modem(self, data: bytes, t_s: float) -> bytes:
        del t_s
        return b"".join(line * 2 for line in data.splitlines(keepends=True))


class RepeatedAnswers(Fault):
    """Each answer comes again a moment later, before that to the next command."""

    def __init__(self, modem: SimulatedModem, rng: np.random.Generator) -> None:
        super().__init__(modem, rng)
        self._last = b""

    def from_modem(self, data: bytes, t_s: float) -> bytes:
        del t_s
        out, self._last = self._last + data, data
        return out


class UrcStorm(Fault):
    """Unsolicited lines, hundreds a second, each complete."""

    _n_sent = 0

    def from_modem(self, data: bytes, t_s: float) -> bytes:
        due = int(t_s * URCS_PER_S) - self._n_sent
        self._n_sent += due
        lines = "".join(f"\r\n{URCS[int(at)]}\r\n" for at in self.rng.integers(len(URCS), size=due))
        return data + lines.encode("ascii")


FAULTS: dict[str, type[Fault]] = {
    "garbage": GarbageBytes,
    "hang": Hang,
    "stall": Stall,
    "brown-out": BrownOut,
    "silent-reset": SilentReset,
    "echo": EchoOn,
    "slow": SlowBytes,
    "duplicated": DuplicatedLines,
    "repeated": RepeatedAnswers,
    "urc-storm": UrcStorm,
}


class Misbehaving:
    """A modem with one fault from `start_s` to `end_s` of the walk; itself a modem."""

    def __init__(
        self,
        modem: SimulatedModem,
        fault: str,
        start_s: float,
        end_s: float,
        now_s: Callable[[], float],
        seed: int = 0,
    ) -> None:
        self._modem = modem
        self._fault = FAULTS[fault](modem, np.random.default_rng(seed))
        self._start_s = start_s
        self._end_s = end_s
        self._now_s = now_s
        self._stage = 0  # before, during, after

    def feed(self, data: bytes) -> bytes:
        """What the modem writes after these bytes."""
        out = self._turn()
        if self._stage != 1:
            return out + self._modem.feed(data)
        return out + self._fault.from_modem(
            self._modem.feed(self._fault.to_modem(data)), self._now_s() - self._start_s
        )

    def unsolicited(self) -> bytes:
        """What it writes by itself since the last call."""
        out = self._turn()
        if self._stage != 1:
            return out + self._modem.unsolicited()
        return out + self._fault.from_modem(
            self._modem.unsolicited(), self._now_s() - self._start_s
        )

    def _turn(self) -> bytes:
        out = b""
        now_s = self._now_s()
        if self._stage == 0 and now_s >= self._start_s:
            self._stage = 1
            out += self._fault.begin()
        if self._stage == 1 and now_s >= self._end_s:
            self._stage = 2
            out += self._fault.end()
        return out


def _noise(rng: np.random.Generator) -> bytes:
    return rng.integers(0, 256, BURST_BYTES, dtype=np.uint8).tobytes()
