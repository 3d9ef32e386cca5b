"""The street file on the device: an error never stops the recording."""

import logging
from hashlib import sha256
from pathlib import Path

from logger.core.errors import ConfigError
from logger.core.guidance.street_atlas import Line
from logger.core.types import Note
from logger.street_file import read_lines

log = logging.getLogger(__name__)

READ, UNREADABLE = "streets", "streets-unreadable"
"""Codes of the events."""


def street_lines(name: str) -> tuple[list[Line], list[Note]]:
    """Lines of the street file, and what is to be recorded; an empty name is no file."""
    if not name:
        return [], []
    try:
        lines = read_lines(Path(name))
    except ConfigError as error:
        log.warning("advice without a street map: %s", error)
        return [], [Note("warning", UNREADABLE, str(error))]
    digest = sha256(repr(lines).encode()).hexdigest()
    return lines, [Note("info", READ, f"{len(lines)} streets of {name}, digest {digest}")]
