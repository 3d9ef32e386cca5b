"""`fieldlogger simulate`: the real service on a simulated walk, the devices behind real ptys.

With the page there is a second process, as on a Pi, and the folders that systemd would make.
"""

import os
import socket
import subprocess
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import sleep

from logger.config import parse_config
from logger.core.errors import ConfigError
from logger.core.runfile import Truth
from logger.core.runfile.meta import SIMULATED
from logger.device.clock import ScaledClock
from logger.device.live_view import LiveView
from logger.device.notify import stop_signals
from logger.device.service import Service
from logger.device.startup import begin_run
from logger.device.status import write_status
from logger.sim.devices import SimulatedModem
from logger.sim.dialects import DIALECTS
from logger.sim.faults import FAULTS, Misbehaving
from logger.sim.ptys import PtyDevice, answering, talking
from logger.sim.scenario import CITIES, SCENARIOS, Scenario, scenario
from logger.sim.walk import GuidedWalk, WalkTime

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
_PAGE = """\
[page]
listen = "{listen}"
"""
_TRIES = 20


def simulate(
    folder: Path,
    name: str,
    seed: int,
    duration_s: float | None,
    speed: float,
    modem_names: Sequence[str] = ("sim800",),
    fault: str | None = None,
    *,
    city_name: str = "graz",
    is_led: bool = False,
    page_command: Sequence[str] = (),
    show_page: Callable[[str], None] = print,
) -> Path:
    """Record a walk `speed` times faster than real; return the run, with its true positions.

    `fault` is NAME:FROM:TO, a misbehaviour of the first modem between two times of the walk in
    seconds. With `is_led` the walker follows the advice. `page_command` serves the page until a
    signal; `show_page` receives its address.
    """
    _check_names("scenario", [name], SCENARIOS)
    _check_names("city", [city_name], CITIES)
    _check_names("simulated modem", modem_names, DIALECTS)
    walk = scenario(name, seed, duration_s, city_name)
    view = LiveView()
    if is_led:
        led = GuidedWalk(walk.walk.waypoints, walk.world, lambda: view.goal)
        walk = replace(walk, walk=led)
    clock = ScaledClock(speed)
    time = WalkTime(clock)
    first, *more = (walk.modem(time.now_s, DIALECTS[each], k) for k, each in enumerate(modem_names))
    faulty = first if fault is None else _misbehaving(first, fault, time.now_s, seed)
    receiver = talking(walk.receiver(), time)
    with (
        ExitStack() as opened,
        PtyDevice(receiver) as gnss_port,
        stop_signals() as (ended, signals),
    ):
        devices = [PtyDevice(answering(modem)) for modem in (faulty, *more)]
        ports = [opened.enter_context(device).path for device in devices]
        text = _SITE.format(
            directory=_toml_text(str(folder)),
            gnss=gnss_port.path,
            # a busy machine may hold a fix back for a moment of its own time, which is long at this
            # speed
            max_fix_age_s=3.0 + 0.1 * speed,
        )
        text += "".join(_MODEM.format(port=port) for port in ports)
        status = None
        if page_command:
            text += _PAGE.format(listen=f"127.0.0.1:{_free_port()}")
            status = opened.enter_context(_page(text, page_command, show_page))
        config = parse_config(text, "simulated site.toml")
        origin = f"{SIMULATED}{name}"
        writer = begin_run(config, text, clock, origin=origin, truth=_truth(walk))
        service = Service(config, writer, clock, ended)

        def publish() -> None:
            nonlocal view
            view = service.recorder.estimator.view
            if status is not None:
                write_status(status, service.snapshot())

        service.start()
        service.wait(walk.duration_s, publish)
        run = service.stop(signals[0] if signals else "end of the simulated walk", publish)
        for device in (gnss_port, *devices):
            device.unplug()  # else the receiver would talk on until Ctrl-C
        if status is not None:
            ended.wait()
        return run


def _check_names(kind: str, names: Sequence[str], known: Collection[str]) -> None:
    for name in names:
        if name not in known:
            raise ConfigError(f"no {kind} is called {name!r}; known are: {', '.join(known)}")


@contextmanager
def _page(site: str, program: Sequence[str], show: Callable[[str], None]) -> Iterator[Path]:
    """In a process of its own; yields the folder of the status, which it reads."""
    with TemporaryDirectory(prefix="cellwalk-") as name:
        status, runtime, state = (Path(name) / one for one in ("status", "status-page", "state"))
        for one in (status, runtime, state):
            one.mkdir()
        file = Path(name) / "site.toml"
        file.write_text(site)
        here = os.environ.get("RUNTIME_DIRECTORY")
        os.environ["RUNTIME_DIRECTORY"] = str(status)  # the service finds the requests beside it
        environ = os.environ | {"RUNTIME_DIRECTORY": str(runtime), "STATE_DIRECTORY": str(state)}
        command = [*program, "--config", str(file)]
        # a Ctrl-C ends the walk, and only then the page
        with subprocess.Popen(command, env=environ, start_new_session=True) as process:  # noqa: S603
            try:
                show(_address(process, [*command, "--show"], environ))
                yield status
            finally:
                process.terminate()
                if here is None:
                    del os.environ["RUNTIME_DIRECTORY"]
                else:
                    os.environ["RUNTIME_DIRECTORY"] = here


def _address(
    page: "subprocess.Popen[bytes]", command: list[str], environ: Mapping[str, str]
) -> str:
    for _ in range(_TRIES):
        if page.poll() is not None:
            # it has said why on stderr
            raise ConfigError("the walk has not begun, as its page has ended")
        said = subprocess.run(  # noqa: S603
            command, env=environ, capture_output=True, text=True, check=False
        )
        if not said.returncode:
            return said.stdout.splitlines()[0]
        sleep(0.2)
    raise ConfigError(f"the page has not started: {said.stderr.strip()}")


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])


def _misbehaving(
    modem: SimulatedModem, text: str, now_s: Callable[[], float], seed: int
) -> Misbehaving:
    """A modem with the fault NAME:FROM:TO; raises `ConfigError`."""
    name, _, times = text.partition(":")
    try:
        start_s, end_s = (float(time) for time in times.split(":"))
    except ValueError:
        raise ConfigError(
            f"{text!r} is no fault; it is given as NAME:FROM:TO, times in seconds, "
            f"and NAME is one of {', '.join(FAULTS)}"
        ) from None
    _check_names("fault", [name], FAULTS)
    if not 0.0 <= start_s < end_s:
        raise ConfigError(f"{text!r} ends before it begins: NAME:FROM:TO, times in seconds")
    return Misbehaving(modem, name, start_s, end_s, now_s, seed)


def _truth(walk: Scenario) -> tuple[Truth, ...]:
    return tuple(
        Truth(t.name, *walk.world.to_latlon(t.east_m, t.north_m)) for t in walk.world.transmitters
    )


def _toml_text(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
