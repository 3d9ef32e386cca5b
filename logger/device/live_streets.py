"""The streets on the device: an error never stops the recording, nor the live estimate."""

import logging
from hashlib import sha256
from pathlib import Path

from logger.core.errors import FieldLoggerError, error_place
from logger.core.guidance.street_atlas import StreetAtlas
from logger.core.guidance.street_map import StreetMap
from logger.core.places import Places
from logger.core.types import Note
from logger.street_file import read_lines

log = logging.getLogger(__name__)

READ, UNREADABLE = "streets", "streets-unreadable"
"""Codes of the events."""


class LiveStreets:
    """`Streets` that answer whatever happens; `take_notes` has what is to be recorded.

    An empty `name` is no file. After an error there are no streets any more.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._notes: list[Note] = []
        self._atlas = StreetAtlas(())
        if name:
            self._read()

    def take_notes(self) -> list[Note]:
        """Events since the last call."""
        notes, self._notes = self._notes, []
        return notes

    def near(self, here: Places) -> StreetMap | None:
        """The streets around a walk that is here; None without any."""
        try:
            return self._atlas.near(here)
        except Exception as error:  # noqa: BLE001 (also without memory the estimate goes on)
            self._give_up(error)
        return None

    def _read(self) -> None:
        try:
            lines = read_lines(Path(self._name))
            self._atlas = StreetAtlas(lines)
        except Exception as error:  # noqa: BLE001
            self._give_up(error)
            return
        digest = sha256()
        for line in lines:
            digest.update(repr(line).encode())
        text = f"{len(lines)} streets of {self._name}, digest {digest.hexdigest()}"
        self._notes.append(Note("info", READ, text))

    def _give_up(self, error: Exception) -> None:
        self._atlas = StreetAtlas(())
        why = str(error) if isinstance(error, FieldLoggerError) else error_place(error)
        named = why if self._name in why else f"{self._name}: {why}"
        self._notes.append(Note("warning", UNREADABLE, f"{named}; advice without streets"))
        log.warning("advice without streets: %s", named)
