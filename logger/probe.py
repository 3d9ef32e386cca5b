"""`fieldlogger probe`: what is on the serial ports, and the site.toml that would use it."""

import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal, TypeVar

from serial.tools import list_ports

from logger.core.errors import DeviceError
from logger.device.port import Port
from logger.drivers.at import AtFramer
from logger.drivers.dialogue import Command, Dialogue, Reply, driven
from logger.drivers.nmea import NmeaFramer, Sentence
from logger.drivers.privacy import Blanker
from logger.drivers.registry import identified

T = TypeVar("T")

BAUDS = (115_200, 9600, 38_400, 57_600, 4800, 230_400, 460_800, 19_200)
"""Tried in this order: modems and USB, then receivers, then what is rare."""
LISTEN_S = 1.3
"""A receiver at 1 Hz has said something by then."""
_SENTENCES = 2
"""Right checksums that make a receiver: one may be noise."""
_TRIES = 2
_BY_ID = Path("/dev/serial/by-id")

Kind = Literal["modem", "gnss", "unknown", "busy"]


@dataclass(frozen=True, slots=True)
class Found:
    """One port: a name that stays when it is replugged where there is one, and what answered there."""

    port: str
    usb: str
    kind: Kind
    baud: int | None = None
    driver: str | None = None
    text: str = ""


def serial_ports() -> dict[str, str]:
    """Serial ports of this machine that belong to a device, and what USB says of each."""
    ports = {}
    for found in list_ports.comports():
        usb = "" if found.vid is None else f"{found.vid:04x}:{found.pid:04x} {found.description}"
        if found.vid is not None or found.hwid != "n/a":
            ports[found.device] = usb
    return ports


def probe(ports: dict[str, str], bauds: Iterable[int] = BAUDS) -> list[Found]:
    """Look at all ports at once; each is opened and, where no receiver speaks, sent `AT`."""
    tried = tuple(bauds)
    with ThreadPoolExecutor(max(len(ports), 1)) as pool:
        return list(pool.map(lambda port: _probe_port(port, ports[port], tried), ports))


def site_toml(found: Iterable[Found], folder: str = "/var/lib/cellwalk") -> str:
    """The configuration for the first modem and the first receiver; what was not found is left to be filled in."""
    every = list(found)
    modem = next((one for one in every if one.kind == "modem"), None)
    gnss = next((one for one in every if one.kind == "gnss"), None)
    lines = ["[run]", f'directory = "{folder}"', "", "[modem]"]
    if modem is None:
        lines += ["# no modem has answered: is it powered, and plugged in?", 'port = ""']
    else:
        lines += [f"# {modem.text}", f'port = "{modem.port}"', f'driver = "{modem.driver}"', f"baud = {modem.baud}"]
    lines += ["", "[gnss]"]
    if gnss is None:
        lines += [
            '# no receiver has spoken; port = "modem" uses the modem\'s own, gpsd://localhost one of gpsd',
            'port = ""',
        ]
    else:
        lines += [f'port = "{gnss.port}"', f"baud = {gnss.baud}"]
    return "\n".join(lines) + "\n"


def stable_name(port: str) -> str:
    """The name under /dev/serial/by-id of a port, or its own."""
    if not _BY_ID.is_dir():
        return port
    return next((str(link) for link in sorted(_BY_ID.iterdir()) if link.resolve() == Path(port).resolve()), port)


def _probe_port(port: str, usb: str, bauds: tuple[int, ...]) -> Found:
    name = stable_name(port)
    for baud in bauds:
        try:
            with Port(port, baud, 0.1) as opened:
                if _hears_nmea(opened):
                    return Found(name, usb, "gnss", baud, text="NMEA")
                if _answers(opened) and (who := converse(opened, identified())):
                    driver, text = who
                    return Found(name, usb, "modem", baud, driver.name, text)
        except DeviceError as error:
            return Found(name, usb, "busy", text=str(error))
    return Found(name, usb, "unknown", text="nothing that is known has answered")


def _hears_nmea(port: Port) -> bool:
    framer, heard = NmeaFramer(), 0
    for data in _chunks(port, LISTEN_S):
        heard += sum(isinstance(event, Sentence) for event in framer.feed(data))
        if heard >= _SENTENCES:
            return True
    return False


def _answers(port: Port) -> bool:
    """Whether something answers OK to `AT`, the first of which only tells the modem the rate."""
    return any(_ask(port, AtFramer(), Command("AT", timeout_s=0.5)).ok for _ in range(_TRIES))


def converse(port: Port, dialogue: Dialogue[T]) -> T:
    """Drive a dialogue over an open port."""
    return driven(dialogue, partial(_ask, port, AtFramer()))


def _ask(port: Port, framer: AtFramer, command: Command) -> Reply:
    framer.send(command.text)
    port.write(command.text.encode("ascii") + b"\r")
    blanker = Blanker()
    for data in _chunks(port, command.timeout_s):
        for event in framer.feed(blanker.feed(data)):
            if isinstance(event, Reply):
                return event
    return framer.expire()


def _chunks(port: Port, seconds: float) -> Iterator[bytes]:
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        if data := port.read():
            yield data
