"""A SIM800 without SIM card, carried along a walk: commands in, answers out."""

import re
from collections.abc import Callable

import numpy as np

from logger.sim import ceng
from logger.sim.ceng import Heard
from logger.sim.terminal import AtTerminal, framed
from logger.sim.walk import Walk
from logger.sim.world import World

DECODE_DBM = -104.0
"""Level from which a cell's broadcast is read: access is allowed there (C1 > 0, see `ceng`)."""
UNASKED_EVERY_S = 5.0
"""Period of the rows of mode 2, which is documented nowhere."""

_ENGINEERING = re.compile(r"AT\+CENG=([0-4])(?:,([01]))?")
_ERRORS = re.compile(r"AT\+CMEE=([0-2])")
_NO_SIM = {0: "ERROR", 1: "+CME ERROR: 10", 2: "+CME ERROR: SIM not inserted"}
_INFORMATION = {
    "ATI": "SIM800 R14.18",
    "AT+CGMM": "SIMCOM_SIM800L",
    "AT+CGMR": "Revision:1418B05SIM800L24",
}


class SimulatedSim800:
    """One modem from power-up on; each look at the cells is a new reading with fading of its own.

    `now_s` tells the seconds since the walk began. In mode 2 rows come unasked: see `unasked`.
    """

    def __init__(
        self,
        world: World,
        walk: Walk,
        now_s: Callable[[], float],
        rng: np.random.Generator,
        decode_dbm: float = DECODE_DBM,
    ) -> None:
        self._world = world
        self._walk = walk
        self._now_s = now_s
        self._rng = rng
        self._decode_dbm = decode_dbm
        self._terminal = AtTerminal(self._answer)
        self._mode = 0
        self._ncell = 0
        self._cmee = 0
        self._told_s = 0.0

    def feed(self, data: bytes) -> bytes:
        """What the modem writes after these bytes."""
        return self._terminal.feed(data)

    def unasked(self) -> bytes:
        """What it writes by itself since the last call."""
        if self._mode != 2 or self._now_s() - self._told_s < UNASKED_EVERY_S:
            return b""
        self._told_s = self._now_s()
        return self._rows()

    def _answer(self, command: str) -> bytes:
        if text := _INFORMATION.get(command):
            return framed(text, "OK")
        match command:
            case "AT+CENG?":
                return framed(f"+CENG: {self._mode},{self._ncell}") + self._rows() + framed("OK")
            case "AT+CSQ":
                return framed(f"+CSQ: {self._csq()},0", "OK")
            case "AT+CPIN?":
                return framed(_NO_SIM[self._cmee])
        return framed("OK" if self._set(command) else "ERROR")

    def _set(self, command: str) -> bool:
        """Do as a setting says; False for what is not understood."""
        if engineering := _ENGINEERING.fullmatch(command):
            self._mode = int(engineering[1])
            self._ncell = int(engineering[2] or self._ncell)
            self._told_s = self._now_s()
        elif errors := _ERRORS.fullmatch(command):
            self._cmee = int(errors[1])
        else:
            return False
        return True

    def _rows(self) -> bytes:
        lines = ceng.rows(self._mode, self._ncell, self._listen())
        return framed("\r\n".join(lines)) if lines else b""

    def _listen(self) -> list[Heard]:
        east_m, north_m = self._walk.positions(np.array([self._now_s()]))
        levels_dbm = self._world.heard_dbm(east_m, north_m, self._rng)[:, 0]
        return [
            Heard(cell, float(level_dbm), decoded=bool(level_dbm >= self._decode_dbm))
            for cell, level_dbm in zip(self._world.transmitters, levels_dbm, strict=True)
        ]

    def _csq(self) -> int:
        """Level of the serving cell in steps of 2 dB, by the table of the SIM800 manual (2 is -110 dBm)."""
        level_dbm = max((one.level_dbm for one in self._listen() if one.decoded), default=-115.0)
        return min(max(int(level_dbm + 114.0) // 2, 0), 31)
