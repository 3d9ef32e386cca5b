"""A serial port for one thread, which raises `DeviceError` for every failure.

Names are device paths, the URLs of pyserial, and ours for gpsd; they are checked before any port is
opened.
"""

import errno
import fcntl
import re
import socket
import termios
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import Any, Self
from urllib.parse import urlsplit

import serial

from logger.core.errors import ConfigError, DeviceError

GPSD_PORT = 2947
NETWORK = ("socket", "rfc2217", "gpsd")
_SEARCH = "hwgrep://"
WRITE_TIMEOUT_S = 2.0
MAX_CHUNK = 4096
# a lost far end is noticed after half a minute; by default (tcp(7)) after two hours
_PROBES = (
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
    (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 10),
    (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 5),
    (socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3),
)


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
    if parts.scheme in NETWORK:
        number = parts.port  # raises ValueError for what is none
        if parts.scheme != "gpsd" and not (parts.hostname and number):
            raise ValueError(f"a host and a port are wanted: {parts.scheme}://HOST:PORT")
    if url.lower().startswith(_SEARCH):
        _check_search(url[len(_SEARCH) :])
        return
    serial.serial_for_url(pyserial_url(url), do_not_open=True)


def _check_search(wanted: str) -> None:
    """The device need not be present; it may be plugged in later."""
    expression, *options = wanted.split("&")
    re.compile(expression)
    for option in options:
        name, _, value = option.partition("=")
        if name not in {"n", "skip_busy"}:
            raise ValueError(f"hwgrep has no option {name!r}")
        if name == "n" and not (value.isdecimal() and int(value) > 1):
            raise ValueError(f"the option n is a number from 2, not {value!r}")


class Port:
    """An open port; a context manager.

    `url` is a device path, anything pyserial opens (`socket://`, `rfc2217://`) or
    `gpsd://host[:port][/device]`.

    `read` gives up after `read_timeout_s` real seconds of silence.

    Raises `DeviceError` when it cannot be opened now or has gone away.
    """

    def __init__(self, url: str, baud: int, read_timeout_s: float) -> None:
        self._url = url
        options: dict[str, Any] = {"write_timeout": WRITE_TIMEOUT_S, "exclusive": True}
        if "://" in url:
            options = {}  # rfc2217 refuses to be opened with a write timeout
        with _device_errors(url):
            self._serial = serial.serial_for_url(
                pyserial_url(url),
                do_not_open=True,
                baudrate=baud,
                timeout=read_timeout_s,
                **options,
            )
            with _kept_input(self._serial):
                self._serial.open()
        self._read_timeout_s = read_timeout_s
        self._keep_others_out()
        self._probe_far_end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # a pty keeps the lock after the close, and would refuse to be opened again
        with suppress(OSError, AttributeError):
            fcntl.ioctl(self._serial.fileno(), termios.TIOCNXCL)
        with suppress(OSError, termios.error):
            self._serial.close()

    def read(self) -> bytes:
        """Bytes there are, at most a chunk; empty after a silence."""
        with _device_errors(self._url):
            data = bytes(self._serial.read(1))
            with suppress(
                OSError, termios.error, TypeError
            ):  # the next call raises it; these bytes count
                data += self._more() if data else b""
            return data

    def rest(self) -> bytes:
        """What has come and was not read yet, at most a chunk; nothing is waited for."""
        with _device_errors(self._url):
            self._serial.timeout = 0
            try:
                return bytes(self._serial.read(MAX_CHUNK))
            finally:
                self._serial.timeout = self._read_timeout_s

    def write(self, data: bytes) -> None:
        """Write all bytes, or fail within two seconds."""
        with _device_errors(self._url):
            self._serial.write(data)

    def _more(self) -> bytes:
        if not self._url.startswith(("socket://", "gpsd://")):
            return bytes(self._serial.read(min(self._serial.in_waiting, MAX_CHUNK - 1)))
        return (
            self.rest()
        )  # a socket has "some" waiting, no number of bytes: one at a time would keep a Pi busy

    def _keep_others_out(self) -> None:
        # pyserial's lock is a flock that only pyserial asks for; TIOCEXCL stops everybody but root
        with suppress(OSError, AttributeError):
            fcntl.ioctl(self._serial.fileno(), termios.TIOCEXCL)

    def _probe_far_end(self) -> None:
        # one that has lost its power or its network closes nothing, and a receiver is only read
        if (far_end := getattr(self._serial, "_socket", None)) is not None:
            for level, option, value in _PROBES:
                far_end.setsockopt(level, option, value)


@contextmanager
def _kept_input(port: serial.SerialBase) -> Iterator[None]:
    """Keep the input when a port is opened; pyserial would discard it."""
    flushes = [
        name for name in ("reset_input_buffer", "_reset_input_buffer") if hasattr(port, name)
    ]
    for name in flushes:
        setattr(port, name, lambda: None)
    try:
        yield
    finally:
        for name in flushes:
            delattr(port, name)


IN_USE = "in use by another program"
_ADVICE = {
    errno.ENOENT: "no such port; is the device plugged in?",
    errno.EACCES: (
        "no permission; add this user to the group dialout "
        "(sudo usermod -aG dialout $USER) and log in again"
    ),
    errno.EPERM: (  # DevicePolicy=closed of the unit
        "the service may not open it; `systemctl edit fieldlogger` with [Service] DeviceAllow= "
        "lets it"
    ),
    errno.EBUSY: IN_USE,
    errno.EAGAIN: IN_USE,
    errno.ECONNREFUSED: "no answer; is the program at the other end running?",
    errno.ENOTTY: "this is no serial port",
    errno.ENXIO: "no such port; is the device plugged in?",
    errno.ENODEV: "no such port; is the device plugged in?",
}


_NUMBERED = re.compile(r"/dev/tty(?:USB|ACM)\d+")  # by the kernel, as devices come
_ANOTHER_NUMBER = "It may have another number now: configure its name under /dev/serial/by-id/"


@contextmanager
def _device_errors(url: str) -> Iterator[None]:
    """Convert what pyserial raises: OSError, termios.error, and TypeError after a hang-up.

    The other errors come from a URL that is none.
    """
    try:
        yield
    except (OSError, termios.error, TypeError, ValueError, LookupError, re.error) as error:
        number = _errno(error)
        advice = _ADVICE.get(number) or error
        if number == errno.ENOENT and _NUMBERED.fullmatch(url):
            advice = f"{advice} {_ANOTHER_NUMBER}"
        raise DeviceError(f"port {url}: {advice}") from error


def _errno(error: Exception) -> int:
    """The context may hold the original exception, which pyserial hides."""
    while error.__context__ is not None and not getattr(error, "errno", None):
        inner = error.__context__
        if not isinstance(inner, Exception):
            break
        error = inner
    return getattr(error, "errno", None) or (
        error.args[0] if error.args and isinstance(error.args[0], int) else 0
    )
