"""The mode of a modem before the logger set it to GSM only, stored until it is restored.

The file lies beside the runs and has one entry for each model. It survives a power cut.
"""

import os
from collections.abc import Iterable
from pathlib import Path

import msgspec

from logger.core.foreign import decode_json, read_regular

FILE = "modem-modes.json"
_MOST_BYTES = 1 << 20
"""An entry has 200 bytes."""


class SavedMode(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The answer `value` of a modem to the command `asks`, before the logger changed it."""

    driver: str
    model: str
    asks: str
    value: str


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

    def of(self, driver: str, model: str) -> SavedMode | None:
        """The entry of a modem, which is identified by family and model only."""
        return next(
            (mode for mode in self.all() if (mode.driver, mode.model) == (driver, model)), None
        )

    def save(self, entry: SavedMode) -> None:
        """Make an entry durable, replacing one for the same modem."""
        self._write([*self._others(entry.driver, entry.model), entry])

    def drop(self, driver: str, model: str) -> None:
        """Remove the entry of a modem whose mode is restored."""
        self._write(self._others(driver, model))

    def _others(self, driver: str, model: str) -> list[SavedMode]:
        return [mode for mode in self.all() if (mode.driver, mode.model) != (driver, model)]

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
