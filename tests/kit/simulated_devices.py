"""Simulated devices on ptys, for tests that need something to talk to."""

from collections.abc import Iterator
from contextlib import contextmanager

from logger.device.clock import ScaledClock
from logger.sim.ptys import PtyDevice, answering, talking
from logger.sim.scenario import scenario
from logger.sim.walk import WalkTime


@contextmanager
def simulated_devices(
    seed: int = 1, rate: float = 20.0
) -> Iterator[tuple[PtyDevice, PtyDevice, PtyDevice]]:
    """A modem and a receiver on one walk, `rate` times faster than real time, and a silent port."""
    walk, time = scenario("block", seed, 600.0), WalkTime(ScaledClock(rate))
    sessions = (
        answering(walk.modem(time.now_s)),
        talking(walk.receiver(), time),
        lambda _line: None,
    )
    with (
        PtyDevice(sessions[0]) as modem,
        PtyDevice(sessions[1]) as gnss,
        PtyDevice(sessions[2]) as silent,
    ):
        yield modem, gnss, silent
