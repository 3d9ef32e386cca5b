"""Names of ports: device paths, the URLs of pyserial, and ours for gpsd.

They are checked before any port is opened.
"""

import re
from urllib.parse import urlsplit

import serial

from logger.core.errors import ConfigError

GPSD_PORT = 2947
_NETWORK = ("socket", "rfc2217", "gpsd")
_SEARCH = "hwgrep://"


def pyserial_url(url: str) -> str:
    """The socket of a gpsd; every other URL as it is."""
    parts = urlsplit(url)
    if parts.scheme != "gpsd":
        return url
    host = parts.netloc or "localhost"
    return f"socket://{host}" if parts.port else f"socket://{host.removesuffix(':')}:{GPSD_PORT}"


def check_url(url: str) -> None:
    """Raise `ConfigError` for a name that can never be opened; nothing is opened."""
    try:
        _check(url)
    except (ValueError, LookupError, OSError, re.error) as error:
        raise ConfigError(f"port {url!r}: {error}") from None


def _check(url: str) -> None:
    if "\0" in url:
        raise ValueError("it holds a NUL character")
    if "://" not in url and not url.startswith("gpsd:"):
        return
    parts = urlsplit(url)
    if parts.scheme in _NETWORK:
        number = parts.port  # raises ValueError for what is none
        if parts.scheme != "gpsd" and not (parts.hostname and number):
            raise ValueError(f"a host and a port are wanted: {parts.scheme}://HOST:PORT")
    if url.lower().startswith(_SEARCH):
        _check_search(url[len(_SEARCH) :])
        return
    serial.serial_for_url(pyserial_url(url), do_not_open=True)


def _check_search(wanted: str) -> None:
    """Check a search expression and its options.

    The device need not be present; it may be plugged in later.
    """
    expression, *options = wanted.split("&")
    re.compile(expression)
    for option in options:
        name, _, value = option.partition("=")
        if name not in {"n", "skip_busy"}:
            raise ValueError(f"hwgrep has no option {name!r}")
        if name == "n" and not (value.isdecimal() and int(value) > 1):
            raise ValueError(f"the option n is a number from 2, not {value!r}")
