"""`fieldlogger probe`: what is on the serial ports, and the site.toml that would use it."""

import os
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal, TypeVar

from serial.tools import list_ports

from logger.config import GNSS_OF_MODEM
from logger.core.errors import DeviceError
from logger.device.port import Port
from logger.drivers.family import Family
from logger.drivers.privacy.redaction import Redactor
from logger.drivers.protocols.at import AtFramer, Command, Dialogue, Reply, run_dialogue
from logger.drivers.protocols.nmea import NmeaFramer, Sentence
from logger.drivers.registry import AUTO, FAMILIES, identify

T = TypeVar("T")

BAUDS = (115_200, 9600, 38_400, 57_600, 4800, 230_400, 460_800, 19_200)
"""Tried in this order: modems and USB, then receivers, then what is rare."""
LISTEN_S = 1.3
"""A receiver at 1 Hz has printed an epoch by then."""
_SENTENCES = 2
"""Right checksums that make a receiver: one may be noise."""
_TRIES = 2
RECEIVER_IS_OFF = (": 505", ": 516")
"""+CME ERROR of a Quectel: its receiver is off, or has no fix yet."""
_BY_ID = Path("/dev/serial/by-id")
SERVICE_FOLDER = Path("/var/lib/cellwalk")
"""Where systemd/fieldlogger.service keeps runs."""

Kind = Literal["modem", "gnss", "unknown", "busy"]


@dataclass(frozen=True, slots=True)
class PortReport:
    """One port: a name that stays when it is replugged where there is one, and what answered there.

    `receiver` is whether the modem has one of its own, None where unknown.
    """

    port: str
    usb: str
    kind: Kind
    baud: int | None = None
    driver: str | None = None
    text: str = ""
    receiver: bool | None = None


def serial_ports() -> dict[str, str]:
    """Serial ports of this machine that belong to a device, and the USB description of each."""
    ports = {}
    for found in list_ports.comports():
        usb = "" if found.vid is None else f"{found.vid:04x}:{found.pid:04x} {found.description}"
        if found.vid is not None or found.hwid != "n/a":
            ports[found.device] = usb
    return ports


def probe(ports: dict[str, str], bauds: Iterable[int] = BAUDS) -> list[PortReport]:
    """Look at all ports at once; each is opened and, without a receiver there, sent `AT`."""
    tried = tuple(bauds)
    with ThreadPoolExecutor(max(len(ports), 1)) as pool:
        return list(pool.map(lambda port: _probe_port(port, ports[port], tried), ports))


def stable_name(port: str) -> str:
    """The name under /dev/serial/by-id of a port, or its own."""
    if not _BY_ID.is_dir():
        return port
    return next(
        (str(link) for link in sorted(_BY_ID.iterdir()) if link.resolve() == Path(port).resolve()),
        port,
    )


def _probe_port(port: str, usb: str, bauds: tuple[int, ...]) -> PortReport:
    name = stable_name(port)
    for baud in bauds:
        try:
            with Port(port, baud, 0.1) as opened:
                if _is_receiver(opened):
                    return PortReport(name, usb, "gnss", baud, text="NMEA")
                if _answers(opened) and (found := converse(opened, identify())):
                    driver, text = found
                    receiver = converse(opened, _has_receiver(driver))
                    return PortReport(name, usb, "modem", baud, driver.name, text, receiver)
        except DeviceError as error:
            return PortReport(name, usb, "busy", text=str(error))
    return PortReport(name, usb, "unknown", text="nothing that is known has answered")


def _is_receiver(port: Port) -> bool:
    framer, n_sentences = NmeaFramer(), 0
    for data in _chunks(port, LISTEN_S):
        n_sentences += sum(isinstance(event, Sentence) for event in framer.feed(data))
        if n_sentences >= _SENTENCES:
            return True
    return False


def _answers(port: Port) -> bool:
    """Whether something answers OK to `AT`, the first of which sets the rate."""
    return any(_ask(port, AtFramer(), Command("AT", timeout_s=0.5)).ok for _ in range(_TRIES))


def _has_receiver(driver: Family) -> Dialogue[bool]:
    """Whether the modem has a receiver of its own, which is not switched on for it.

    It has the command that asks for a fix, or the one that switches the receiver on: a test
    command of the form AT+X=? is answered OK where AT+X= is known (ITU-T V.250 5.4.1).
    """
    tests = (Command(on.text.partition("=")[0] + "=?") for on in driver.gnss_start_commands)
    yield Command("AT+CMEE=1")
    for command in (*driver.gnss_poll_commands, *tests):
        reply = yield command
        if reply.ok or (reply.final or "").endswith(RECEIVER_IS_OFF):
            return True
    return False


def converse(port: Port, dialogue: Dialogue[T]) -> T:
    """Drive a dialogue over an open port."""
    return run_dialogue(dialogue, partial(_ask, port, AtFramer()))


def _ask(port: Port, framer: AtFramer, command: Command) -> Reply:
    framer.send(command.text)
    port.write(command.text.encode("ascii") + b"\r")
    redactor = Redactor()
    redactor.send(command.text.encode("ascii"))
    for data in _chunks(port, command.timeout_s):
        for event in framer.feed(redactor.feed(data)):
            if isinstance(event, Reply):
                return event
    return framer.expire()


def _chunks(port: Port, seconds: float) -> Iterator[bytes]:
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        if data := port.read():
            yield data


@dataclass(frozen=True, slots=True)
class Proposal:
    """Text of a site.toml, which `fieldlogger check` accepts where nothing is missing.

    `advice` is one line on what is missing and what to do; the text has it as comments.
    """

    text: str
    advice: str = ""


def propose_config(found: Iterable[PortReport], folder: Path | None = None) -> Proposal:
    """The configuration for the first modem and the first receiver."""
    every = list(found)
    modem = next((port for port in every if port.kind == "modem"), None)
    gnss = next((port for port in every if port.kind == "gnss"), None)
    tables = [_modem(modem), _gnss(gnss, modem)]
    missing = [table.missing for table in tables if table.missing]
    busy = [port.text for port in every if port.kind == "busy"] if missing else []
    run = ["[run]", f"directory = {_text(str(folder or usual_folder()))}"]
    if busy:
        run = [*(f"# {_comment(text)}" for text in busy), *run]
    parts = (run, *(table.lines for table in tables))
    text = "\n\n".join("\n".join(lines) for lines in parts)
    return Proposal(text + "\n", "; ".join([*missing, *busy]))


def usual_folder() -> Path:
    """The folder of the service where there is one or it can be made, else one of this user's."""
    if SERVICE_FOLDER.is_dir() or os.access(SERVICE_FOLDER.parent, os.W_OK):
        return SERVICE_FOLDER
    return Path.home() / "cellwalk"


def site_toml(found: Iterable[PortReport], folder: Path | None = None) -> str:
    """The text alone."""
    return propose_config(found, folder).text


@dataclass(frozen=True, slots=True)
class _Table:
    lines: list[str]
    missing: str = ""


def _modem(modem: PortReport | None) -> _Table:
    if modem is None:
        return _empty("modem", "no modem has answered: powered, plugged in? fill in [modem] port")
    driver = f"driver = {_text(modem.driver or AUTO)}"
    return _Table(["[modem]", f"# {_comment(modem.text)}", *_at(modem), driver])


def _gnss(gnss: PortReport | None, modem: PortReport | None) -> _Table:
    if gnss is not None:
        return _Table(["[gnss]", *_at(gnss)])
    if modem is not None and _locates(modem):
        comment = "# no separate receiver has answered; that of the modem needs an antenna too"
        return _Table(["[gnss]", comment, f"port = {_text(GNSS_OF_MODEM)}"])
    others = '"gpsd://localhost" is that of gpsd, "modem" the modem\'s own where it has one'
    return _empty("gnss", f"no receiver has answered: plugged in? fill in [gnss] port; {others}")


def _locates(modem: PortReport) -> bool:
    """Whether the modem's own receiver can give the fixes."""
    driver = FAMILIES.get(modem.driver or "")
    return driver is not None and bool(driver.gnss_poll_commands) and modem.receiver is not False


def _empty(table: str, missing: str) -> _Table:
    return _Table([f"[{table}]", f"# {missing}", 'port = ""'], missing)


def _at(found: PortReport) -> list[str]:
    baud = [] if found.baud is None else [f"baud = {found.baud}"]
    return [f"port = {_text(found.port)}", *baud]


def _text(value: str) -> str:
    """A TOML basic string."""
    plain = value.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in plain) + '"'


def _comment(text: str) -> str:
    """Text from a modem without the characters that TOML forbids in comments."""
    return "".join(c if c.isprintable() else "?" for c in text)
