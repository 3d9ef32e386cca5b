"""`fieldlogger check`: all that can be known without opening a port."""

import os
import pwd
import re
import socket
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit

from pyproj.exceptions import ProjError

from logger.baseline_file import BaselineFile, bound_heap, configured_file
from logger.command_line import SERVICE_FOLDER, SITE_TOML, missing_library
from logger.config import FIRST_FREE_PORT, SiteConfig, SourceSettings, load_config, page_address
from logger.core.document import Document, Word, facts, number_of
from logger.core.errors import ConfigError, GeoError, RunFileError
from logger.core.guidance.street_atlas import StreetAtlas
from logger.core.places import Utm
from logger.device.leds import LEDS
from logger.device.link import Line
from logger.device.machine import SYS
from logger.device.memory import MOST_CELLS
from logger.device.port import NETWORK
from logger.device.sources import source_of
from logger.device.startup import LIBRARIES, usable_folder, version_of
from logger.street_file import read_lines

_PMTILES = b"PMTiles\3"
"""Begin of the file, and its version (github.com/protomaps/PMTiles, spec/v3)."""

# folder of a USB device before that of its interface (kernel's sysfs-bus-usb)
_USB = re.compile(r"(.*)/[0-9.-]+:\d+\.\d+(?:/|\Z)")
_HIDDEN = ("/home", "/root", "/run/user")  # by ProtectHome= of the units
_LOCAL = ("localhost", "127.", "::1")  # what fieldlogger.service reaches
_PAGE, _OF_PAGE = "10.42.0.1:8080", ("10.42.0.", "127.")  # where fieldlogger-page.service serves

_STYLES = {"ok": "", "warn": "yellow", "fail": "red"}


def document_of(lines: Sequence[Line]) -> Document:
    """What was checked, a line each."""
    said = [(Word(line.state, _STYLES[line.state]), f"{line.what}: {line.text}") for line in lines]
    return Document(lines, body=facts(said, len("fail")))


def exit_code(lines: Sequence[Line]) -> int:
    """2 if a check failed."""
    return 2 if any(line.state == "fail" for line in lines) else 0


def check(config_path: Path | None) -> list[Line]:
    """Check the installation and, if given, a configuration.

    Raises `ConfigError` for an unusable configuration.
    """
    lines = [*_libraries(), _map()]
    if config_path is None:
        lines.append(Line("warn", "site.toml", "none was checked: name it with --config"))
    else:
        config, _ = load_config(config_path)
        lines.append(Line("ok", str(config_path), "configuration is valid"))
        lines += _site(config)
        folder = Path(config.run.directory)
        if config_path == SITE_TOML and not folder.resolve().is_relative_to(SERVICE_FOLDER):
            text = f"the service writes below {SERVICE_FOLDER}; `systemctl edit fieldlogger` with"
            text = f"{text} [Service] ReadWritePaths={folder} lets it, where its user may write"
            lines.append(Line("warn", "directory", text))
        lines += (*_hidden_files(config), *_cut_off(config)) if config_path == SITE_TOML else ()
    return lines


def _hidden_files(config: SiteConfig) -> Iterator[Line]:
    live = {"streets": config.live.streets, "baseline": config.live.baseline}
    for what, name in {**live, "map": config.page.map}.items():
        path = Path(name).resolve()
        if name.startswith("/") and any(path.is_relative_to(hidden) for hidden in _HIDDEN):
            text = f"no service sees {path} (ProtectHome=): move the file below {SITE_TOML.parent}"
            yield Line("fail", what, text)


def _cut_off(config: SiteConfig) -> Iterator[Line]:
    # packets that a unit does not allow are dropped without a word
    for source in config.source:
        url = urlsplit(source.port)
        host = url.hostname or "localhost"
        if url.scheme in NETWORK and not host.startswith(_LOCAL):
            text = f"the service reaches {host} only after `systemctl edit fieldlogger` with"
            yield Line("warn", source.name, f"{text} [Service] IPAddressAllow= its address")
    address, port = page_address(config.page.listen or _PAGE)
    if not address.startswith(_OF_PAGE) or port != page_address(_PAGE)[1]:
        text = "no phone reaches it before `systemctl edit fieldlogger-page`: systemd/README.md"
        yield Line("warn", "page", f"{address}, port {port}: {text}, Page on the phone")


def _libraries() -> Iterator[Line]:
    for name in LIBRARIES:
        try:
            yield Line("ok", name, version_of(name))
        except ImportError as error:
            yield Line("fail", name, f"cannot be imported ({error}); install cellwalk again")


def _map() -> Line:
    """PROJ needs its files, which a virtual environment over Debian's pyproj may not find."""
    try:
        Utm.at(52.0, 13.0).to_xy(52.0, 13.0)
    except ProjError as error:
        return Line("fail", "map", f"positions cannot be mapped ({error}); install cellwalk again")
    return Line("ok", "map", "positions can be mapped")


def _site(config: SiteConfig) -> Iterator[Line]:  # noqa: C901 (one check after the other)
    sources = [source_of(settings) for settings in config.source]
    for source in sources:
        source.validate()
    yield _folder(usable_folder(config.run.directory))
    for source in sources:
        yield from source.check()
    yield from _shared_ports(config.source)
    for library in ("tornado", "segno"):
        if config.page.listen and find_spec(library) is None:
            yield Line("fail", "page", missing_library(library))
    path = configured_file(config.live.baseline, Path(config.run.directory).expanduser())
    if path is not None:
        yield _baseline(path)
    if config.live.streets:
        yield _streets(Path(config.live.streets))
    if config.live.most_cells > MOST_CELLS:
        text = f"{config.live.most_cells} take more memory than the service has: {MOST_CELLS} are"
        yield Line("warn", "most_cells", f"{text} tracked at once")
    if config.status.led:
        yield _light(config.status.led)
    if config.status.feed.startswith("/"):
        yield _feed(Path(config.status.feed))
    if config.page.listen:
        yield _address(*page_address(config.page.listen))
    if config.page.map:
        yield _plan(Path(config.page.map))


def _shared_ports(sources: Sequence[SourceSettings]) -> Iterator[Line]:
    # a port has another name under /dev/serial/by-id; opened twice it would be "in use"
    owners: dict[str, SourceSettings] = {}
    modems: dict[str, SourceSettings] = {}
    for source in sources:
        path = Path(os.path.realpath(source.port))
        usb = _USB.match(os.path.realpath(SYS / "class/tty" / path.name / "device"))
        owner = owners.setdefault(str(path), source)
        if owner is not source:
            text = f"{source.port} is the port of {owner.name}, {owner.port}: each has its own"
            yield Line("fail", source.name, text)
        elif usb and source.gives_cells:
            first = modems.setdefault(usb[1], source)
            text = f"{source.port} and {first.port} are of one USB device: one modem counts twice"
            if first is not source:
                yield Line("warn", source.name, text)


def _baseline(path: Path) -> Line:
    """Earlier walks; without them the service records all the same."""
    bound_heap()
    try:
        baseline = BaselineFile(path)
    except RunFileError as error:
        return Line("fail", "baseline", str(error))
    baseline.close()
    walks = number_of(baseline.n_walks, "earlier walk")
    return Line("ok", "baseline", f"{path}: {walks}")


def _streets(path: Path) -> Line:
    """The service records without streets too."""
    try:
        lines = read_lines(path)
        StreetAtlas(lines).near_densest()
    except ConfigError as error:
        return Line("fail", "streets", str(error))
    except GeoError as error:
        return Line("fail", "streets", f"{path}: {error}")
    return Line("ok", "streets", f"{path}: {len(lines)} streets, {lines.n_points} points")


def _light(name: str) -> Line:
    if (LEDS / name / "trigger").is_file():
        return Line("ok", "led", name)
    known = ", ".join(sorted(led.name for led in LEDS.glob("*"))) or "none"
    return Line("warn", "led", f"this machine has no LED {name}; it has: {known}")


def _feed(path: Path) -> Line:
    """A socket left by a service that was killed is replaced, anything else is not."""
    if path.exists() and not path.is_socket():
        return Line("fail", "feed", f"{path} is there and is no socket: remove it")
    if not path.parent.is_dir():  # that of the service is made at its start
        return Line("warn", "feed", f"there is no folder {path.parent} now")
    return Line("ok", "feed", str(path))


def _address(address: str, port: int) -> Line:
    """The page waits for its address, which a hotspot may bring; its port may be its own now."""
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    try:
        with socket.socket(family) as probe:
            probe.bind((address, 0))
    except OSError:
        return Line("warn", "page", f"no network of this machine has the address {address} now")
    if port < FIRST_FREE_PORT:
        return Line("warn", "page", f"port {port} is root's, and the page is not: take 8080")
    return Line("ok", "page", f"{address}, port {port}")


def _plan(path: Path) -> Line:
    """The page runs without the map."""
    start = b""
    if not path.exists():
        return Line("fail", "page", f"map {path}: no such file")
    try:
        if path.is_file():
            with path.open("rb") as file:
                start = file.read(len(_PMTILES))
    except OSError as error:
        return Line("fail", "page", f"map {path}: {error.strerror}")
    if start != _PMTILES:
        return Line("fail", "page", f"map {path} is no PMTiles file of version 3")
    return Line("ok", "page", f"map {path}")


def _folder(folder: Path) -> Line:
    if os.statvfs(folder).f_flag & os.ST_RDONLY:
        text = f"{folder} is read-only, as a card is after an error: restart, or use another card"
        return Line("fail", "directory", text)
    if os.access(folder, os.W_OK):
        return Line("ok", "directory", f"{folder} is writable")
    owner = folder.stat().st_uid
    if owner not in {0, os.geteuid()}:
        return Line(
            "warn",
            "directory",
            f"{folder} belongs to {_name_of(owner)}, and only that user can record there",
        )
    return Line("fail", "directory", f"{folder} is not writable")


def _name_of(uid: int) -> str:
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"user {uid}"
