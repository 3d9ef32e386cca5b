"""`fieldlogger check`: everything that can be known without opening a port."""

import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Literal

from logger.config import GNSS_OF_MODEM, SiteConfig, load_config
from logger.device.port import check_url
from logger.device.service import usable_folder
from logger.drivers.registry import driver_of

_LIBRARIES = {"numpy": "numpy", "h5py": "h5py", "pyproj": "pyproj", "pyserial": "serial", "pynmea2": "pynmea2"}


@dataclass(frozen=True, slots=True)
class Line:
    """One thing checked: `warn` may still come right by itself, `fail` will not."""

    state: Literal["ok", "warn", "fail"]
    what: str
    text: str


def check(config_path: Path | None) -> list[Line]:
    """Check the installation and, if given, a configuration; raises `ConfigError` for one that cannot be used."""
    lines = list(_libraries())
    if config_path is not None:
        config, _ = load_config(config_path)
        lines.append(Line("ok", str(config_path), "configuration is valid"))
        lines += _site(config)
    return lines


def _libraries() -> Iterator[Line]:
    for name, module in _LIBRARIES.items():
        try:
            import_module(module)
            yield Line("ok", name, version(name))
        except ImportError as error:
            yield Line("fail", name, f"cannot be imported ({error}); install cellwalk again")


def _site(config: SiteConfig) -> Iterator[Line]:
    driver_of(config.modem.driver)
    folder = usable_folder(config.run.directory)
    writable = os.access(folder, os.W_OK)
    yield Line("ok" if writable else "fail", "directory", f"{folder} is {'' if writable else 'not '}writable")
    yield _port("modem", config.modem.port)
    if config.gnss.port == GNSS_OF_MODEM:
        yield Line("ok", "gnss", "the modem's own receiver")
    else:
        yield _port("gnss", config.gnss.port)


def _port(name: str, url: str) -> Line:
    check_url(url)
    if "://" in url:
        return Line("ok", name, f"{url} is a network port, not looked at")
    path = Path(url)
    try:
        is_device = stat.S_ISCHR(path.stat().st_mode)
    except FileNotFoundError:
        return Line("warn", name, f"{url} is not there now; it is picked up when it is plugged in")
    except OSError as error:
        return Line("fail", name, f"{url}: {error.strerror}")
    if not is_device:
        return Line("fail", name, f"{url} is no serial port")
    if not os.access(path, os.R_OK | os.W_OK):
        return Line("fail", name, f"no permission for {url}; add this user to the group dialout")
    return Line("ok", name, url)
