"""Memory, descriptors and processor time of the service over hours, beside an idle Python process.

python benchmarks/soak.py [HOURS]

Its devices are a receiver at 10 Hz and a modem that reports 40 cells every 2 s.
"""

import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from logger.device.clock import Clock
from logger.sim.devices import SimulatedModem, SimulatedReceiver
from logger.sim.dialects import DIALECTS, Answer, Settings, block, ceng_rows
from logger.sim.ptys import PtyDevice, PtyLine, Session, answering
from logger.sim.scenario import BLOCK, ORIGIN_LAT_DEG, ORIGIN_LON_DEG, UTC_START
from logger.sim.walk import Walk, WalkTime
from logger.sim.world import Air, Radio, Transmitter, World

CELLS = 40
RATE_HZ = 10.0
LAPS = 20
"""Of the walk through the block; half an hour each."""
EVERY_S = 60.0
SITE = """\
[run]
directory = "{folder}"
[modem]
port = "{modem}"
driver = "sim800"
poll_interval_s = 2.0
[gnss]
port = "{gnss}"
"""


@dataclass(frozen=True, slots=True)
class Load:
    """What a process has used so far."""

    memory_mb: float
    descriptors: int
    cpu_s: float


def load_of(pid: int) -> Load:
    """Resident memory, open descriptors and processor time, from proc(5)."""
    proc = Path(f"/proc/{pid}")
    pages = int((proc / "statm").read_text().split()[1])
    ticks = sum(map(int, (proc / "stat").read_text().rpartition(")")[2].split()[11:13]))
    return Load(pages * 4096 / 1e6, len(list((proc / "fd").iterdir())), ticks / 100.0)


def town() -> World:
    """40 transmitters around the block, near enough to be read from everywhere in it."""
    rng = np.random.default_rng(1)
    transmitters = tuple(
        Transmitter(
            *rng.uniform(-500.0, 700.0, 2),
            -8.0,
            2.9,
            "001",
            "01",
            300 + i % 5,
            20_000 + i,
            1 + 3 * i,
            i,
        )
        for i in range(CELLS)
    )
    return World.build(transmitters, ORIGIN_LAT_DEG, ORIGIN_LON_DEG, Radio(), rng)


def all_cells(air: Air, _: Settings) -> Answer:
    """Every cell, where a real SIM800 reports seven."""
    pairs = [ceng_rows(4, 1, replace(air, others=(one,))) for one in air.decoded_cells[1:]]
    rows = [pairs[0][0], *(neighbour for _, neighbour in pairs)]
    numbered = [row.replace("+CENG: 1", f"+CENG: {number}") for number, row in enumerate(rows)]
    return ["+CENG: 4,1", *block(numbered)]


def fast_receiver(receiver: SimulatedReceiver, walked: WalkTime) -> Session:
    """Session of a receiver at `RATE_HZ`."""

    def session(line: PtyLine) -> None:
        k = 0
        while not walked.wait_until(line.stop, k / RATE_HZ):
            line.write(receiver.epoch(k / RATE_HZ))
            k += 1

    return session


def measure_loads(service: subprocess.Popen, idle: subprocess.Popen, hours: float) -> list[Load]:
    """Loads of the service each minute, printed as they are seen."""
    loads: list[Load] = []
    begun_s = time.monotonic()
    while time.monotonic() - begun_s < hours * 3600.0:
        with suppress(subprocess.TimeoutExpired):
            raise RuntimeError(f"the service ended with {service.wait(EVERY_S)}")
        loads.append(load_of(service.pid))
        passed_s, now, rest = time.monotonic() - begun_s, loads[-1], load_of(idle.pid)
        print(
            f"{passed_s / 60:5.0f} min  {now.memory_mb:6.1f} MB  {now.descriptors} descriptors  "
            f"{100 * now.cpu_s / passed_s:.2f} % of a core  (idle Python: {rest.memory_mb:.1f} "
            f"MB, {rest.cpu_s:.2f} s)",
            flush=True,
        )
    return loads


def main() -> None:
    """Walk, watch, stop, and say how much memory grew after the first hour or the first half."""
    hours = float(sys.argv[1]) if len(sys.argv) > 1 else 2.0
    world, walk, walked = town(), Walk(BLOCK * LAPS), WalkTime(Clock())
    rng = np.random.default_rng(2)
    dialect = replace(
        DIALECTS["sim800"], replies={**DIALECTS["sim800"].replies, "+CENG?": all_cells}
    )
    modem = SimulatedModem(dialect, world, walk, walked.now_s, rng, utc_start=UTC_START)
    receiver = SimulatedReceiver(world, walk, UTC_START, rng)
    idle_command = [sys.executable, "-c", "import threading; threading.Event().wait()"]
    with (
        tempfile.TemporaryDirectory() as folder,
        PtyDevice(answering(modem)) as modem_port,
        PtyDevice(fast_receiver(receiver, walked)) as gnss_port,
        subprocess.Popen(idle_command) as idle,
    ):
        site = Path(folder) / "site.toml"
        site.write_text(SITE.format(folder=folder, modem=modem_port.path, gnss=gnss_port.path))
        command = [sys.executable, "-m", "logger.cli", "run", "--config", str(site)]
        with subprocess.Popen(command) as service:
            try:
                loads = measure_loads(service, idle, hours)
            finally:
                service.terminate()
                idle.kill()
        journal = next(Path(folder).glob("*.journal"))
        print(
            f"journal {journal.stat().st_size / 1e6:.1f} MB, the service ended with "
            f"{service.returncode}"
        )
    settled = loads[min(60, len(loads) // 2) :]
    print(
        f"memory after the settling: {settled[0].memory_mb:.1f} to "
        f"{max(one.memory_mb for one in settled):.1f} MB"
    )


if __name__ == "__main__":
    main()
