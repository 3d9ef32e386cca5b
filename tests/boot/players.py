"""Modem and receiver of a simulated walk in real time, at the adapters of the rig."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from logger.device.clock import Clock
from logger.sim.scenario import Scenario
from logger.sim.walk import WalkTime

players = pytest.importorskip("players", reason="the boot rig is not beside this repository")


class Modem(players.Player):
    """A simulated modem that is switched on with the machine."""

    def __init__(self, path, device):
        super().__init__(path)
        self._device = device

    def play(self, s):
        self._device.restart()
        super().play(s)

    def heard(self, data):
        self._sock.sendall(self._device.feed(data))

    def tick(self):
        if said := self._device.unsolicited():
            self.send(said)


class Receiver(players.Player):
    """A simulated receiver that sends every second, whether its port is open or not."""

    def __init__(self, path, device, time):
        super().__init__(path)
        self._device = device
        self._time = time
        self._next_s = 0.0

    def tick(self):
        if self._time.now_s() >= self._next_s:
            self.send(self._device.epoch(self._next_s))
            self._next_s = max(self._next_s + 1.0, self._time.now_s() // 1.0)


@contextmanager
def carry(machine, walk: Scenario) -> Iterator[WalkTime]:
    """Carry modem and receiver along a walk that starts now, through all boots of a machine."""
    time = WalkTime(Clock())
    modem = Modem(machine.socket("modem"), walk.modem(time.now_s))
    receiver = Receiver(machine.socket("gps"), walk.receiver(cold_start_s=0.0), time)
    modem.start()
    receiver.start()
    try:
        yield time
    finally:
        modem.stop()
        receiver.stop()
