"""A modem's mode before the logger set it to GSM only: durable until it is restored.

The file lies beside the runs, one entry for a model: a pulled plug leaves it to the next start.
"""

import os
from collections.abc import Iterable
from pathlib import Path

import msgspec

FILE = "modem-modes.json"


class KeptMode(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The answer `value` of a modem to the command `asks`, before the logger changed it."""

    driver: str
    model: str
    asks: str
    value: str


class KeptModes:
    """The entries in a folder. Raises OSError where the file cannot be read or written."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.path = folder / FILE

    def all(self) -> tuple[KeptMode, ...]:
        try:
            return msgspec.json.decode(self.path.read_bytes(), type=tuple[KeptMode, ...])
        except FileNotFoundError:
            return ()
        except msgspec.DecodeError as error:
            raise OSError(f"{self.path} is damaged ({error}); mend it, or remove it") from None

    def of(self, driver: str, model: str) -> KeptMode | None:
        """The entry of a modem; it is known by its family and model alone."""
        return next((one for one in self.all() if (one.driver, one.model) == (driver, model)), None)

    def keep(self, entry: KeptMode) -> None:
        """Make an entry durable, in the place of one for the same modem."""
        self._write([*self._others(entry.driver, entry.model), entry])

    def drop(self, driver: str, model: str) -> None:
        """Forget the entry of a modem that has been set back."""
        self._write(self._others(driver, model))

    def _others(self, driver: str, model: str) -> list[KeptMode]:
        return [one for one in self.all() if (one.driver, one.model) != (driver, model)]

    def _write(self, entries: Iterable[KeptMode]) -> None:
        """Replace the file in one step; returns when the card has it."""
        kept = list(entries)
        if kept:
            part = self.path.with_name(f"{FILE}.part")
            with part.open("wb") as file:
                file.write(msgspec.json.format(msgspec.json.encode(kept), indent=1))
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
