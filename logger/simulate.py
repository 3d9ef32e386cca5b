"""`fieldlogger simulate`: the real service on a simulated walk, the devices behind real ptys."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from logger.config import parse_config
from logger.core.errors import ConfigError
from logger.core.runfile import Truth
from logger.device.clock import ScaledClock
from logger.device.service import Service
from logger.device.signals import stop_signals
from logger.device.startup import begin_run
from logger.sim.dialects import DIALECTS
from logger.sim.faults import FAULTS, Misbehaving
from logger.sim.ptys import AnsweringDevice, PtyDevice, answering, talking
from logger.sim.scenario import SCENARIOS, SIMULATED, Scenario, scenario
from logger.sim.walk import WalkTime

_SITE = """\
# made by `fieldlogger simulate`
[run]
directory = {directory}
[gnss]
port = "{gnss}"
[live]
max_fix_age_s = {max_fix_age_s}
"""
_MODEM = """\
[[source]]
kind = "modem"
port = "{port}"
poll_interval_s = 2.0
"""


def simulate(
    folder: Path,
    name: str,
    seed: int,
    duration_s: float | None,
    speed: float,
    modem_names: Sequence[str] = ("sim800",),
    fault: str | None = None,
) -> Path:
    """Record a walk `speed` times faster than real; return the run, with its true positions.

    `fault` is NAME:FROM:TO, a misbehaviour of the first modem between two times of the walk in
    seconds.
    """
    if name not in SCENARIOS:
        raise ConfigError(f"no scenario is called {name!r}; known are: {', '.join(SCENARIOS)}")
    for modem_name in modem_names:
        if modem_name not in DIALECTS:
            raise ConfigError(
                f"no simulated modem is called {modem_name!r}; known are: {', '.join(DIALECTS)}"
            )
    misbehaviour = None if fault is None else _fault(fault)
    walk = scenario(name, seed, duration_s)
    clock = ScaledClock(speed)
    time = WalkTime(clock)
    modems: list[AnsweringDevice] = []
    for number, modem_name in enumerate(modem_names):
        well = walk.modem(time.now_s, DIALECTS[modem_name], number)
        if misbehaviour is not None and not number:
            modems.append(Misbehaving(well, *misbehaviour, time.now_s, seed))
        else:
            modems.append(well)
    receiver = talking(walk.receiver(), time)
    with (
        ExitStack() as opened,
        PtyDevice(receiver) as gnss_port,
        stop_signals() as (ended, signals),
    ):
        ports = [opened.enter_context(PtyDevice(answering(modem))).path for modem in modems]
        text = _SITE.format(
            directory=_toml_text(str(folder)),
            gnss=gnss_port.path,
            # a busy machine may hold a fix back for a moment of its own time, which is long at this
            # speed
            max_fix_age_s=3.0 + 0.1 * speed,
        )
        text += "".join(_MODEM.format(port=port) for port in ports)
        config = parse_config(text, "simulated site.toml")
        origin = f"{SIMULATED}{name}"
        begun = begin_run(config, text, clock, origin=origin, truth=_truth(walk))
        service = Service(config, begun, clock, ended)
        service.start()
        service.wait(walk.duration_s)
        return service.stop(signals[0] if signals else "end of the simulated walk")


def _fault(text: str) -> tuple[str, float, float]:
    """Name, begin and end in seconds of a fault given as NAME:FROM:TO."""
    name, _, times = text.partition(":")
    try:
        start_s, end_s = (float(time) for time in times.split(":"))
    except ValueError:
        raise ConfigError(
            f"{text!r} is no fault; it is given as NAME:FROM:TO, times in seconds, "
            f"and NAME is one of {', '.join(FAULTS)}"
        ) from None
    if name not in FAULTS:
        raise ConfigError(f"no fault is called {name!r}; known are: {', '.join(FAULTS)}")
    return name, start_s, end_s


def _truth(walk: Scenario) -> tuple[Truth, ...]:
    return tuple(
        Truth(f"{t.mcc}-{t.mnc}-{t.lac}-{t.cid}", *walk.world.to_latlon(t.east_m, t.north_m))
        for t in walk.world.transmitters
    )


def _toml_text(text: str) -> str:
    """A TOML basic string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
