"""`fieldlogger probe`: what is on the serial ports, and the site.toml that would use it."""

import os
import re
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from serial.tools import list_ports

from logger.command_line import SERVICE_FOLDER
from logger.core.errors import DeviceError
from logger.core.live_settings import OWN, SUSPICIOUS
from logger.core.source_tables import GNSS_OF_MODEM
from logger.device.port import IN_USE, Port
from logger.device.sources import SOURCES
from logger.drivers.generic import UNKNOWN_MODEL, Generic
from logger.drivers.registry import AUTO, FAMILIES

BAUDS = (115_200, 9600, 38_400, 57_600, 4800, 230_400, 460_800, 19_200)
"""Tried in this order: modems and USB, then receivers, then what is rare."""
_NAMES = Path("/dev/serial")


@dataclass(frozen=True, slots=True)
class PortReport:
    """One port: a name that stays when it is replugged where there is one, and what answered there.

    `kind` is "modem", "gnss", "unknown" or "busy". `receiver` is whether the modem has one, None
    where unknown.
    """

    port: str
    usb: str
    kind: str
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
    """The name of a port under by-id, by-path where some share one, or its own."""
    by_id, by_path = (
        {link.resolve(): str(link) for link in sorted((_NAMES / kind).glob("*"), reverse=True)}
        for kind in ("by-id", "by-path")
    )
    # equal devices without a number have one name, which after the next start may be the other's
    names = by_id | by_path if by_path.keys() - by_id.keys() else by_id
    return port if "\0" in port else names.get(Path(port).resolve(), port)


def _probe_port(port: str, usb: str, bauds: tuple[int, ...]) -> PortReport:
    name = stable_name(port)
    for baud in bauds:
        try:
            with Port(port, baud, 0.1) as opened:
                for source in SOURCES.values():
                    if (found := source.probe(opened)) is not None:
                        return PortReport(
                            name, usb, found.kind, baud, found.driver, found.text, found.receiver
                        )
        except DeviceError as error:
            return PortReport(name, usb, "busy", text=str(error))
    return PortReport(name, usb, "unknown", text="nothing that is known has answered")


@dataclass(frozen=True, slots=True)
class Proposal:
    """Text of a site.toml or of one of its tables, which `fieldlogger check` accepts if complete.

    `advice` is one line on what is missing and what to do; the text has it as comments.
    """

    text: str
    advice: str = ""


def propose_config(found: Iterable[PortReport], folder: Path | None = None) -> Proposal:
    """The configuration for all modems and the first receiver."""
    every = list(found)
    modems = {_device(port): port for port in reversed(every) if port.kind == "modem"}
    modem, *more = reversed(modems.values()) if modems else (None,)
    gnss = next((port for port in every if port.kind == "gnss"), None)
    tables = [_modem(modem), _gnss(gnss, modem)]
    missing = [table.advice for table in tables if table.advice]
    busy = [port.text for port in every if port.kind == "busy"] if missing else []
    run = ["[run]", f"directory = {_text(str(folder or usual_folder()))}"]
    if busy:
        run = [*(f"# {_comment(text)}" for text in busy), *run]
    live = ["[live]", f"target = {_text(SUSPICIOUS)}", f"baseline = {_text(OWN)}"]
    parts = (
        "\n".join(run),
        *(table.text for table in tables),
        *map(_further_modem, more),
        "\n".join(live),
    )
    advice = [*missing, *busy]
    if any(IN_USE in text for text in busy):  # what is missing may be there
        advice = [*busy, "the logger ends by sudo systemctl stop fieldlogger", *missing]
    return Proposal("\n\n".join(parts) + "\n", "; ".join(advice))


def usual_folder() -> Path:
    """The folder of the service if it is there or can be made, else one of this user's."""
    if SERVICE_FOLDER.is_dir() or os.access(SERVICE_FOLDER.parent, os.W_OK):
        return SERVICE_FOLDER
    return Path.home() / "cellwalk"


def _modem(modem: PortReport | None) -> Proposal:
    if modem is None:
        return _empty("modem", "no modem has answered: powered, plugged in? fill in [modem] port")
    driver = f"driver = {_text(modem.driver or AUTO)}"
    comments = [modem.text, *([UNKNOWN_MODEL] if modem.driver == Generic.name else [])]
    return _table("[modem]", *(f"# {_comment(text)}" for text in comments), *_at(modem), driver)


def _further_modem(modem: PortReport | None) -> str:
    _, lines = _modem(modem).text.split("\n", 1)
    return f'[[source]]\nkind = "modem"\n{lines}'


def _table(*lines: str) -> Proposal:
    return Proposal("\n".join(lines))


def _device(found: PortReport) -> str:
    """The device that a port belongs to, as far as its name tells.

    A modem has several ports for AT commands. Where they have numbers only, all of one make count
    as one modem.
    """
    if not found.port.startswith(str(_NAMES)):
        return found.usb or found.port
    return re.sub(r"(-if[0-9a-f]{2}|:\d+\.\d+)(-port\d+)?$", "", found.port)


def _gnss(gnss: PortReport | None, modem: PortReport | None) -> Proposal:
    if gnss is not None:
        return _table("[gnss]", *_at(gnss))
    if modem is not None and _locates(modem):
        comment = "# no separate receiver has answered; that of the modem needs an antenna too"
        return _table("[gnss]", comment, f"port = {_text(GNSS_OF_MODEM)}")
    others = '"gpsd://localhost" is that of gpsd, "modem" the modem\'s own where it has one'
    return _empty("gnss", f"no receiver has answered: plugged in? fill in [gnss] port; {others}")


def _locates(modem: PortReport) -> bool:
    driver = FAMILIES.get(modem.driver or "")
    return driver is not None and bool(driver.gnss_poll_commands) and modem.receiver is not False


def _empty(table: str, missing: str) -> Proposal:
    return Proposal(f'[{table}]\n# {missing}\nport = ""', missing)


def _at(found: PortReport) -> list[str]:
    baud = [] if found.baud is None else [f"baud = {found.baud}"]
    return [f"port = {_text(found.port)}", *baud]


def _text(value: str) -> str:
    plain = value.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in plain) + '"'


def _comment(text: str) -> str:
    """Without the characters that TOML forbids in comments."""
    return "".join(c if c.isprintable() else "?" for c in text)
