"""Values of the command line: one that has no meaning is one line that names its option."""

import math
from collections.abc import Callable
from pathlib import Path

from logger.core.errors import ConfigError

MOST_S = 1e9
"""Thirty years: a longer time is a slip of the pen, and this one fits into 64 bits as
nanoseconds.
"""
HIGHEST_M = 10_000.0
"""An antenna above the receiver; mountains end below."""


def path(text: str) -> Path:
    """A path; no file of any system has a NUL in its name."""
    if "\0" in text:
        raise ConfigError(f"{text!r} is no path: it holds a NUL character")
    return Path(text)


def file_path(text: str) -> Path:
    """A path that names a file, which `/` and `..` never do."""
    found = path(text)
    if found.name in {"", ".."}:
        raise ConfigError(f"{text!r} names no file")
    return found


def input_path(text: str) -> Path:
    """As `file_path`, of something to be read: a device such as /dev/zero never ends."""
    found = file_path(text)
    if found.is_char_device() or found.is_block_device():
        raise ConfigError(f"{text} is a device, no file")
    return found


def number(
    option: str, least: float, most: float, *, unit: str = "", open_below: bool = False
) -> Callable[[str], float]:
    """Reader of a finite number within limits; `open_below` leaves `least` itself out."""
    limits = f"{'more than' if open_below else 'at least'} {least:g} and at most {most:g}{unit and ' ' + unit}"

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if (
            not least <= value <= most
            or not math.isfinite(value)
            or (open_below and value == least)
        ):
            raise ConfigError(f"{option}: {text!r} is not a number of {limits}")
        return value

    return read


def whole(option: str, least: int, most: int) -> Callable[[str], int]:
    """Reader of an integer within limits."""

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if not least <= value <= most:
            raise ConfigError(f"{option}: {text[:40]!r} is not an integer from {least} to {most}")
        return value

    return read


def seconds(option: str) -> Callable[[str], float]:
    """Reader of a length of time."""
    return number(option, 0.0, MOST_S, unit="s", open_below=True)


def height(option: str) -> Callable[[str], float]:
    """Reader of an antenna's height above the receiver."""
    return number(option, 0.0, HIGHEST_M, unit="m")
