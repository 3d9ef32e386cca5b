"""The mode of a modem before the logger set it to GSM only, stored until it is restored.

The file lies beside the runs and has one entry for each source and model. It survives a power cut.
"""

import os
import threading
from collections.abc import Iterable
from pathlib import Path

import msgspec

from logger.core.foreign import decode_json, read_regular

FILE = "modem-modes.json"
_MOST_BYTES = 1 << 20
"""An entry has 200 bytes."""
_ONE_AT_A_TIME = threading.RLock()
"""Several modems change the file."""


class SavedMode(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The answer `value` of a modem to the command `asks`, before the logger changed it.

    `source` is the modem's name in the configuration; empty, in files of earlier versions, is any.
    """

    driver: str
    model: str
    asks: str
    value: str
    source: str = ""


class SavedModes:
    """The entries in a folder. Raises OSError if the file cannot be read or written."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.path = folder / FILE

    def all(self) -> tuple[SavedMode, ...]:
        try:
            text = read_regular(self.path, _MOST_BYTES)
            return decode_json(text, tuple[SavedMode, ...])
        except FileNotFoundError:
            return ()
        except msgspec.DecodeError as error:
            raise OSError(f"{self.path} is damaged ({error}); repair or remove it") from None

    def of_source(self, source: str) -> tuple[SavedMode, ...]:
        """The entries that may be of a modem with this name."""
        return tuple(mode for mode in self.all() if mode.source in {"", source})

    def save(self, entry: SavedMode) -> None:
        """Make an entry durable, replacing one for the same modem."""
        with _ONE_AT_A_TIME:
            self._write([*self._others(entry), entry])

    def drop(self, entry: SavedMode) -> None:
        """Remove the entry of a modem whose mode is restored."""
        with _ONE_AT_A_TIME:
            self._write(self._others(entry))

    def _others(self, entry: SavedMode) -> list[SavedMode]:
        key = entry.driver, entry.model, entry.source
        return [mode for mode in self.all() if (mode.driver, mode.model, mode.source) != key]

    def _write(self, entries: Iterable[SavedMode]) -> None:
        """Replace the file in one step; returns when the card has it."""
        saved = list(entries)
        if saved:
            part = self.path.with_name(f"{FILE}.part")
            with part.open("wb") as file:
                file.write(msgspec.json.format(msgspec.json.encode(saved), indent=1))
                file.flush()
                os.fsync(file.fileno())
            part.replace(self.path)
        else:
            self.path.unlink(missing_ok=True)
        folder = os.open(self._folder, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
