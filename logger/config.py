"""The site configuration: one TOML file, checked completely before anything is opened."""

import re
import tomllib
from collections.abc import Iterator
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from logger.core.errors import ConfigError
from logger.core.foreign import open_regular
from logger.core.live_settings import LIMITS, LONGEST_TARGET_BYTES, LiveSettings

PollInterval = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]
Percent = Annotated[float, msgspec.Meta(ge=0, le=95)]
Baud = Annotated[int, msgspec.Meta(ge=300, le=4_000_000)]
PortName = Annotated[str, msgspec.Meta(min_length=1)]
FeedAddress = Annotated[str, msgspec.Meta(pattern=r"^(/.+|[1-9]\d{3,4})?$", max_length=107)]
"""Nothing, an absolute path that fits into a socket's address, or a port without privileges."""
LedName = Annotated[str, msgspec.Meta(pattern="^[^/.]*$")]

_LIMITS: dict[str, dict[str, tuple[float, float]]] = {
    # a reply takes longer than 10 ms on the fastest line there is, and a walk less than a day
    "run": {"longest_h": (0.0, 8760.0)},
    "power": {"stop_volts": (0.0, 60.0)},
    "modem": {"poll_interval_s": (0.01, 86_400.0), "full_scan_interval_s": (0.0, 1e6)},
    "live": dict(LIMITS),
}
_MOST_CHARACTERS = 1 << 20
"""Of a configuration; systemd/site.toml has fewer than 3000."""
_LONGEST_LINE = 4096
"""The longest path has as many.

A key of 100 000 dots would take tomllib 9 GB: it stores every prefix of a key.
"""

GNSS_OF_MODEM = "modem"
"""Port of [gnss] where the modem's own receiver gives the fixes."""


class RunSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where runs are stored.

    After `longest_h` hours a run is closed and the next one begins, 0 for never. With
    `delete_oldest` the oldest runs make room on a full card.
    """

    directory: str
    longest_h: NotNegative = 0.0
    delete_oldest: bool = False


class ModemSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A modem: device path, /dev/serial/by-id/... or pyserial URL, and the family that reads it.

    `full_scan_interval_s` is the time between two scans of all networks, 0 for none. `set_mode` is
    "gsm" to restrict the modem to GSM; it may then register again with its network.
    """

    port: PortName
    driver: str = "auto"
    baud: Baud = 115_200
    poll_interval_s: PollInterval = 2.0
    full_scan_interval_s: NotNegative = 0.0
    set_mode: Literal["", "gsm"] = ""


class GnssSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A receiver: a serial port as for a modem, or `gpsd://host[:port][/device]`.

    gpsd has no baud rate.
    """

    port: PortName
    baud: Baud = 9600


class StatusSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Status outputs: an LED by its name under /sys/class/leds, empty for none.

    `feed` is a socket for JSON lines, the path of a Unix socket or a TCP port of this machine.
    """

    led: LedName = ""
    feed: FeedAddress = ""


class PageSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The page for a phone: `address:port` of the Pi in its own Wi-Fi, empty for no page.

    `map` is a PMTiles file for its plan, empty for a plain grid.
    """

    listen: str = ""
    map: str = ""


class PowerSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Limits of a battery below which a run is closed, 0 for none.

    `stop_volts` is for a sensor that knows no percentage.
    """

    stop_percent: Percent = 0.0
    stop_volts: NotNegative = 0.0


class SiteConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All of site.toml."""

    run: RunSettings
    modem: ModemSettings
    gnss: GnssSettings
    live: LiveSettings = LiveSettings()
    status: StatusSettings = StatusSettings()
    page: PageSettings = PageSettings()
    power: PowerSettings = PowerSettings()


def load_config(path: Path) -> tuple[SiteConfig, str]:
    """Read a configuration; return it and its text.

    Raises `ConfigError`, which names the file, the table, the key and the nearest valid key.
    """
    try:
        with TextIOWrapper(open_regular(path), encoding="utf-8") as file:
            text = file.read(_MOST_CHARACTERS + 1)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file in UTF-8") from None
    if len(text) > _MOST_CHARACTERS:
        raise ConfigError(f"{path}: longer than any configuration")
    return parse_config(text, str(path)), text


def parse_config(text: str, name: str) -> SiteConfig:
    """Configuration in a TOML text; `name` is how the text is called in errors."""
    for number, line in enumerate(text.splitlines(), 1):
        if len(line) > _LONGEST_LINE:
            raise ConfigError(f"{name}: line {number} is longer than {_LONGEST_LINE} characters")
    try:
        config = msgspec.convert(tomllib.loads(text), SiteConfig)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{name}: {error}") from None
    except msgspec.ValidationError as error:
        raise ConfigError(f"{name}: {_explain(str(error))}") from None
    except (RecursionError, ValueError, OverflowError) as error:
        raise ConfigError(f"{name}: this TOML cannot be read: {error}") from None
    for problem in _without_meaning(config):
        raise ConfigError(f"{name}: {problem}")
    if config.modem.port == config.gnss.port:
        raise ConfigError(f"{name}: [modem] and [gnss] name the same port {config.modem.port!r}")
    if config.modem.port.startswith("gpsd:"):
        raise ConfigError(f'{name}: [modem] "port": gpsd is a receiver, name it in [gnss]')
    return config


def _without_meaning(config: SiteConfig) -> Iterator[str]:
    """Problems of values that have the right type."""
    for table, table_limits in _LIMITS.items():
        for key, (least, most) in table_limits.items():
            value = getattr(getattr(config, table), key)
            if value is not None and not least <= value <= most:  # NaN is neither
                limits = f"between {least:g} and {most:g}"
                yield f'[{table}] "{key}": {value} has no meaning; it lies {limits}'
    for table in _TABLES:
        settings = getattr(config, table) if table else None
        for key in settings.__struct_fields__ if settings else ():
            if "\0" in str(getattr(settings, key)):
                yield f'[{table}] "{key}": contains a NUL character'
    if config.page.listen:
        yield from _no_address(config.page.listen)
    if not 0 < len(config.live.target.encode()) <= LONGEST_TARGET_BYTES:
        yield f'[live] "target": the name of a cell has between 1 and {LONGEST_TARGET_BYTES} bytes'


def page_address(listen: str) -> tuple[str, int]:
    """IP address and port of "10.42.0.1:8080" or "[::1]:8080"; raises ValueError.

    A page at 0.0.0.0 would be offered in every network of the Pi, so it is refused.
    """
    # not at the start of a run without a page, which must be fast
    from ipaddress import ip_address  # noqa: PLC0415

    host, _, port = listen.rpartition(":")
    address = ip_address(host.removeprefix("[").removesuffix("]"))
    if address.is_unspecified or address.is_multicast or not 0 < int(port) < 65536:
        raise ValueError(listen)
    return str(address), int(port)


def _no_address(listen: str) -> Iterator[str]:
    try:
        page_address(listen)
    except ValueError:
        wanted = 'one address of the Pi and a port, such as "10.42.0.1:8080"'
        yield f'[page] "listen": {listen[:60]!r} is not {wanted}'


_TABLES: dict[str, type[msgspec.Struct]] = {
    "": SiteConfig,
    "run": RunSettings,
    "modem": ModemSettings,
    "gnss": GnssSettings,
    "live": LiveSettings,
    "status": StatusSettings,
    "page": PageSettings,
    "power": PowerSettings,
}


def _explain(problem: str) -> str:
    """Translate msgspec's message for the person who edits the file."""
    what, _, where = problem.partition(" - at `$")
    table = where.removeprefix(".").removesuffix("`")
    unknown = re.search(r"unknown field `(.*)`", what)
    missing = re.search(r"missing required field `(.*)`", what)
    if unknown:
        return f'{_prefix(table)}unknown key "{unknown[1]}"{_nearest(unknown[1], table)}'
    if missing:
        kind = "table" if not table else "key"
        return f'{_prefix(table)}missing {kind} "{missing[1]}"'
    table, _, key = table.rpartition(".")
    if key == "port" and "length" in what:
        return f'{_prefix(table)}"port" is empty; `fieldlogger probe` finds the ports'
    what = what.replace(" | null", "")  # TOML has none: the key is left out
    return f'{_prefix(table)}"{key}": {what[0].lower()}{what[1:]}'


def _prefix(table: str) -> str:
    return f"[{table}] " if table else ""


def _nearest(key: str, table: str) -> str:
    # not at the start of a run, which must be fast
    from difflib import get_close_matches  # noqa: PLC0415

    valid = _TABLES[table].__struct_fields__
    near = get_close_matches(key, valid, n=1)
    return f'; did you mean "{near[0]}"?' if near else f"; valid are {', '.join(valid)}"
