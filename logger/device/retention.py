"""Frees space on the card for the current run, in a thread that nothing waits for."""

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from logger.core.runfile import free_bytes, make_room, remove_oldest_runs
from logger.core.types import Level

LOOK_EVERY_S = 30.0


class RoomKeeper:
    """Removes spare journals while the free space is below the floor.

    With `delete_oldest` whole runs follow, the oldest first. `note` (level, code, text) is called
    from its thread. Reading runs again takes a Pi minutes, hence the thread.
    """

    def __init__(
        self,
        folder: Path,
        floor_bytes: int,
        note: Callable[[Level, str, str], None],
        *,
        delete_oldest: bool = False,
    ) -> None:
        self._folder = folder
        self._floor_bytes = floor_bytes
        self._note = note
        self._delete_oldest = delete_oldest
        self._thread: threading.Thread | None = None
        self._next_s = 0.0
        self._complaint = ""

    def look(self) -> None:
        """Start to make room where it is needed; returns at once."""
        if time.monotonic() < self._next_s or (
            self._thread is not None and self._thread.is_alive()
        ):
            return
        self._next_s = time.monotonic() + LOOK_EVERY_S
        with suppress(OSError):
            if free_bytes(self._folder) >= self._floor_bytes:
                self._complaint = ""
                return
        self._thread = threading.Thread(target=self._make_room, name="room", daemon=True)
        self._thread.start()

    def finish(self) -> None:
        """Begin nothing more."""
        self._next_s = float("inf")

    def _make_room(self) -> None:
        try:
            for journal in make_room(self._folder, self._floor_bytes):
                self._note(
                    "info",
                    "journal-removed",
                    f"{journal.name} made room: its HDF5 file holds the same",
                )
            for run in remove_oldest_runs(self._folder, self._floor_bytes, self._delete_oldest):
                self._note("warning", "run-removed", f"{run} made room on the card (delete_oldest)")
            left = free_bytes(self._folder)
            complaint = "the card is nearly full" if left < self._floor_bytes else ""
        except OSError as error:
            complaint = f"cannot make room: {error}"
        if complaint and complaint != self._complaint:
            self._note("warning", "card-nearly-full", complaint)
        self._complaint = complaint
