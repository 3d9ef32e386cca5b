"""The site configuration: one TOML file, checked completely before anything is opened."""

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_type_hints

import msgspec

from logger.core.cell_names import is_by_channel, is_identity, why_no_name
from logger.core.errors import ConfigError
from logger.core.foreign import open_regular
from logger.core.live_settings import (
    LIMITS,
    LONGEST_TARGET_BYTES,
    STRONGEST,
    SUSPICIOUS,
    LiveSettings,
)
from logger.core.source_tables import GPSD, MODEM, NMEA, is_of_modem, source_tables

PollInterval = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]
Percent = Annotated[float, msgspec.Meta(ge=0, le=95)]
Baud = Annotated[int, msgspec.Meta(ge=300, le=4_000_000)]
PortName = Annotated[str, msgspec.Meta(min_length=1)]
_A_PORT = re.compile(r"/[^*?]*[^*?\s]|(?!gpsd://$)[a-z][a-z0-9]*://.*")
"""A device, or a URL; a pattern of names would be any of them."""
LedName = Annotated[str, msgspec.Meta(pattern="^[^/.]*$")]
SourceName = Annotated[str, msgspec.Meta(pattern="^[a-z][a-z0-9_-]{0,15}$")]
"""As long as the column of the run file."""

_LIMITS: dict[str, dict[str, tuple[float, float]]] = {
    # a reply takes longer than 10 ms on the fastest line there is, and a walk less than a day
    "source": {"poll_interval_s": (0.01, 86_400.0), "full_scan_interval_s": (0.0, 1e6)},
    "run": {"longest_h": (0.0, 8760.0)},
    "power": {"stop_volts": (0.0, 60.0)},
    "live": dict(LIMITS),
}
_MOST_CHARACTERS = 1 << 20
"""Of a configuration; systemd/site.toml has fewer than 3000."""
_LONGEST_LINE = 4096
"""The longest path has as many.

A key of 100 000 dots would take tomllib 9 GB: it stores every prefix of a key.
"""

_LONGEST_SOCKET_BYTES = 107
"""Of the path in a socket's address (unix(7))."""
FIRST_FREE_PORT = 1024
"""Those below are root's."""
_SHORT_FORMS = ("modem", "gnss")
_RESERVED = frozenset({"battery", "live", "logger", "page"})
"""Names of what else writes records."""


class RunSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where runs are stored.

    After `longest_h` hours the next run begins, 0 for never. With `delete_oldest` the oldest runs
    make room on a full card.
    """

    directory: Annotated[str, msgspec.Meta(min_length=1)]
    longest_h: NotNegative = 0.0
    delete_oldest: bool = False


class SourceSettings(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="kind"
):
    """What every source has: the name of its records, and its port or program.

    `gives_cells` of a modem, `gives_positions` of a receiver.
    """

    name: SourceName
    port: PortName

    @property
    def gives_cells(self) -> bool:
        return False

    @property
    def gives_positions(self) -> bool:
        return not self.gives_cells


class ModemSettings(SourceSettings, frozen=True, kw_only=True, tag=MODEM):
    """A modem: device path, /dev/serial/by-id/... or pyserial URL, and the family that reads it.

    `full_scan_interval_s` is the time between two scans of all networks, 0 for none. `set_mode` is
    "gsm" to restrict the modem to GSM; it may then register again with its network. With `fixes`
    its own receiver gives the fixes.
    """

    driver: str = "auto"
    baud: Baud = 115_200
    poll_interval_s: PollInterval = 2.0
    full_scan_interval_s: NotNegative = 0.0
    set_mode: Literal["", "gsm"] = ""
    fixes: bool = False

    @property
    def gives_cells(self) -> bool:
        return True

    @property
    def gives_positions(self) -> bool:
        return self.fixes


class NmeaSettings(SourceSettings, frozen=True, kw_only=True, tag=NMEA):
    """A receiver at a serial port, named as for a modem."""

    baud: Baud = 9600


class GpsdSettings(SourceSettings, frozen=True, kw_only=True, tag=GPSD):
    """The receivers of a gpsd, `gpsd://host[:port][/device]`."""


class StatusSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Status outputs: an LED by its name under /sys/class/leds, empty for none.

    `feed` is a socket for JSON lines, the path of a Unix socket or a TCP port of this machine.
    """

    led: LedName = ""
    feed: str = ""


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
    """All of site.toml; `[modem]` and `[gnss]` are the first of `source`."""

    run: RunSettings
    source: tuple[ModemSettings | NmeaSettings | GpsdSettings, ...]
    live: LiveSettings = LiveSettings()
    status: StatusSettings = StatusSettings()
    page: PageSettings = PageSettings()
    power: PowerSettings = PowerSettings()


def load_config(path: Path) -> tuple[SiteConfig, str]:
    """Read a configuration; return it and its text.

    Raises `ConfigError`, which names the file, the table, the key and the nearest valid key.
    """
    try:
        with TextIOWrapper(open_regular(path), encoding="utf-8-sig") as file:
            text = file.read(_MOST_CHARACTERS + 1)
    except OSError as error:
        writes = f"; `fieldlogger probe --write {path}` writes one"
        raise ConfigError(
            f"{path}: {error.strerror}{writes * isinstance(error, FileNotFoundError)}"
        ) from error
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file in UTF-8") from None
    if len(text) > _MOST_CHARACTERS:
        raise ConfigError(f"{path}: longer than any configuration")
    if "\0" in text:
        raise ConfigError(f"{path}: has NUL bytes, as after a power cut: write it anew")
    return parse_config(text, str(path)), text


def parse_config(text: str, name: str) -> SiteConfig:
    """Configuration in a TOML text, which errors call `name`."""
    for number, line in enumerate(text.splitlines(), 1):
        if len(line) > _LONGEST_LINE:
            raise ConfigError(f"{name}: line {number} is longer than {_LONGEST_LINE} characters")
    labels, sources = list[str](), list[Any]()
    try:
        site = tomllib.loads(text)
        labels, sources = _labels_of_sources(site), source_tables(site)
        for key in _unknown_of_own_receiver(site):
            valid = ("port", "baud")
            raise ConfigError(f'{name}: [gnss] unknown key "{key}"{_nearest(key, valid)}')
        if isinstance(site.get("source"), dict):
            raise ConfigError(f"{name}: [source] takes two brackets: [[source]], for each of them")
        if isinstance(site.get("source", []), list):
            site = {key: value for key, value in site.items() if key not in _SHORT_FORMS}
            site["source"] = sources
        config = msgspec.convert(site, SiteConfig)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{name}: {error}{_line_of(str(error), text)}") from None
    except msgspec.ValidationError as error:
        raise ConfigError(f"{name}: {_explain(str(error), labels, sources)}") from None
    except (RecursionError, ValueError, OverflowError) as error:
        raise ConfigError(f"{name}: this TOML cannot be read: {error}") from None
    for problem in (*_without_meaning(config, labels), *_of_sources(config, labels)):
        raise ConfigError(f"{name}: {problem}")
    return config


def _labels_of_sources(site: Mapping[str, Any]) -> list[str]:
    """Labels are in the order of `source_tables`."""
    labels = ["[modem]"] if "modem" in site else []
    gnss = site.get("gnss")
    if gnss is not None and not is_of_modem(gnss):
        labels.append("[gnss]")
    more = site.get("source")
    for number, table in enumerate(more if isinstance(more, list) else (), 1):
        name = table.get("name", number) if isinstance(table, dict) else number
        labels.append(f"[[source]] {name}")
    return labels


def _unknown_of_own_receiver(site: Mapping[str, Any]) -> list[str]:
    gnss = site.get("gnss")
    return [key for key in gnss if key not in {"port", "baud"}] if is_of_modem(gnss) else []


def _without_meaning(config: SiteConfig, labels: Sequence[str]) -> Iterator[str]:
    """Problems of values that have the right type."""
    plain = [table for table in _TABLES if table not in {"", *_SHORT_FORMS}]
    tables = [(f"[{table}]", getattr(config, table), table) for table in plain]
    of_sources = zip(labels, config.source, strict=True)
    tables += [(label, settings, "source") for label, settings in of_sources]
    for label, settings, table in tables:
        for key, (least, most) in _LIMITS.get(table, {}).items():
            value = getattr(settings, key, None)
            if value is not None and not least <= value <= most:  # NaN is neither
                limits = f"between {least:g} and {most:g}"
                yield f'{label} "{key}": {value} has no meaning; it lies {limits}'
        for key in settings.__struct_fields__:
            if "\0" in str(getattr(settings, key)):
                yield f'{label} "{key}": contains a NUL character'
        port = getattr(settings, "port", None)
        if port is not None and not _A_PORT.fullmatch(port):
            yield f'{label} "port": {port!r} is no device: name one, like /dev/ttyUSB0'
    yield from _no_address(config)
    if not 0 < len(config.live.target.encode()) <= LONGEST_TARGET_BYTES:
        yield f'[live] "target": the name of a cell has between 1 and {LONGEST_TARGET_BYTES} bytes'
    if why := _no_target(config.live.target):
        yield f'[live] "target": {why}'


def _of_sources(config: SiteConfig, labels: Sequence[str]) -> Iterator[str]:
    """Why the sources cannot work together."""
    ports: dict[str, str] = {}
    names: dict[str, str] = {}
    for label, source in zip(labels, config.source, strict=True):
        if source.port in ports:
            yield f"{ports[source.port]} and {label} name the same port {source.port!r}"
        if source.name in names:
            yield f'{names[source.name]} and {label} have the same name "{source.name}"'
        ports[source.port], names[source.name] = label, label
        if source.name in _RESERVED:
            yield f'{label} "name": {source.name!r} is the name of a part of the program'
        is_gpsd = source.port.startswith("gpsd:")
        if is_gpsd and isinstance(source, ModemSettings):
            yield f'{label} "port": gpsd is a receiver, name it in [gnss]'
        elif is_gpsd != isinstance(source, GpsdSettings):
            yield f'{label} "port": kind "{GPSD}" is for gpsd://host, no other kind is'
    of_sources = zip(labels, config.source, strict=True)
    positions = [label for label, one in of_sources if one.gives_positions]
    if not any(source.gives_cells for source in config.source):
        yield 'missing table "modem": no source receives cells'
    elif not positions:
        yield 'missing table "gnss": no source gives positions; a modem can with fixes = true'
    elif len(positions) > 1:
        yield f"{' and '.join(positions)} give positions: only one can"


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


def _no_target(target: str) -> str:
    """Why no modem can hear this target; empty where one can."""
    if target in {STRONGEST, SUSPICIOUS} or is_identity(target) or is_by_channel(target):
        return ""
    other = f"{target!r} is neither a cell, like 262-01-801-86355, nor {STRONGEST} or {SUSPICIOUS}"
    return why_no_name(target) or other


def _is_feed(address: str) -> bool:
    if address.startswith("/"):
        return len(address.encode()) <= _LONGEST_SOCKET_BYTES
    return address.isascii() and address.isdecimal() and FIRST_FREE_PORT <= int(address) < 65536


def _no_address(config: SiteConfig) -> Iterator[str]:
    listen, feed = config.page.listen, config.status.feed
    if feed and not _is_feed(feed):
        path = f"an absolute path of at most {_LONGEST_SOCKET_BYTES} bytes"
        wanted = f"{path} or a port from {FIRST_FREE_PORT} to 65535"
        yield f'[status] "feed": {feed[:60]!r} is not {wanted}'
    if not listen:
        return
    try:
        page_address(listen)
    except ValueError:
        wanted = 'one address of the Pi and a port, such as "10.42.0.1:8080"'
        yield f'[page] "listen": {listen[:60]!r} is not {wanted}'


_TABLES: dict[str, type[msgspec.Struct]] = {
    "": SiteConfig,
    "run": RunSettings,
    "modem": ModemSettings,
    "gnss": NmeaSettings,
    "live": LiveSettings,
    "status": StatusSettings,
    "page": PageSettings,
    "power": PowerSettings,
}
_KINDS: dict[str, type[SourceSettings]] = {
    MODEM: ModemSettings,
    NMEA: NmeaSettings,
    GPSD: GpsdSettings,
}


def _line_of(problem: str, text: str) -> str:
    # with the rules that are broken most often
    line = re.search(r"at line (\d+)", problem)
    if line is None:
        return ""
    shown = text.split("\n")[int(line[1]) - 1].strip()[:60]
    advice = "a text has straight quotes, a decimal a point; true and false are small"
    if " twice" in problem or "overwrite" in problem:
        advice = "a table and each of its keys stand once; a second modem is a [[source]]"
    return f": {shown!r}; {advice}"


_QUOTES = {"`str`, got": 'a text has quotes, like "this"', "got `str`": "without quotes"}


def _explain(problem: str, labels: Sequence[str], sources: Sequence[Any]) -> str:
    """Translate msgspec's message."""
    what, _, where = problem.partition(" - at `$")
    table = where.removeprefix(".").removesuffix("`")
    unknown = re.search(r"unknown field `(.*)`", what)
    missing = re.search(r"missing required field `(.*)`", what)
    is_table = unknown or missing or re.fullmatch(r"source\[\d+\]", table)
    key = ""
    if not is_table:
        table, _, key = table.rpartition(".")
    label, settings = _label_and_settings(table, labels, sources)
    if unknown:
        key = unknown[1]
        tables = [f"[{name}]" for name, one in _TABLES.items() if name and key in _keys(one)]
        elsewhere = f"; it stands under {' or '.join(tables)}" if tables else ""
        return f'{label}unknown key "{key}"{elsewhere or _nearest(key, _keys(settings))}'
    if missing:
        kind = f" (one of {', '.join(_KINDS)})" if missing[1] == "kind" else ""
        return f'{label}missing {"key" if table else "table"} "{missing[1]}"{kind}'
    if key == "port" and "length" in what:
        return f'{label}"port" is empty; `fieldlogger probe` finds the ports'
    if key == "kind":
        return f'{label}"kind": {what[0].lower()}{what[1:]}; valid are {", ".join(_KINDS)}'
    if key == "led":
        what = "the name of an LED under /sys/class/leds, like ACT"
    if key == "name" and "regex" in what:
        what = "a lower-case letter, then letters, digits, - and _, 16 at most"
    if what.startswith("Invalid enum value"):
        what += f"; valid: {_choices(settings, key)}"
    if key == "directory" and "length" in what:
        what = "it is empty"
    what = what.replace(" | null", "")  # TOML has none: the key is left out
    what = "; ".join([what, *(rule for wrong, rule in _QUOTES.items() if wrong in what)])
    place = f'{label}"{key}": ' if key else label
    return f"{place}{what[0].lower()}{what[1:]}"


def _label_and_settings(
    table: str, labels: Sequence[str], sources: Sequence[Any]
) -> tuple[str, type[msgspec.Struct]]:
    if of_source := re.fullmatch(r"source\[(\d+)\]", table):
        number = int(of_source[1])
        kind = sources[number].get("kind") if isinstance(sources[number], dict) else None
        return f"{labels[number]} ", _KINDS.get(str(kind), SourceSettings)
    return f"[{table}] " if table else "", _TABLES[table]


def _keys(settings: type[msgspec.Struct]) -> tuple[str, ...]:
    if issubclass(settings, SourceSettings):
        return ("kind", *settings.__struct_fields__)
    short_forms = _SHORT_FORMS if settings is SiteConfig else ()
    return (*short_forms, *settings.__struct_fields__)


def _choices(settings: type[msgspec.Struct], key: str) -> str:
    """The texts that a key may have."""
    texts = get_args(get_type_hints(settings)[key])
    return ", ".join(f'"{text}"' for text in texts if text)


# What others call a table or a key. The spelling of some is nearest to one that they do not mean:
# `model` to `set_mode`, with which a modem may transmit.
_OTHER_WORDS = {
    "gps": "gnss",
    "receiver": "gnss",
    "device": "port",
    "tty": "port",
    "speed": "baud",
    "model": "driver",
    "family": "driver",
    "folder": "directory",
    "path": "directory",
}


def _nearest(key: str, valid: Sequence[str]) -> str:
    # not at the start of a run, which must be fast
    from difflib import get_close_matches  # noqa: PLC0415

    meant = _OTHER_WORDS.get(key.lower())
    near = [meant] if meant in valid else get_close_matches(key, valid, n=1)
    return f'; did you mean "{near[0]}"?' if near else f"; valid are {', '.join(valid)}"
