"""The baseline on the device: it is only read, and an error never stops the recording.

A file that is missing or damaged is one line in the log and one event in the run. From then on
nothing is known of earlier walks, and rules that need them are not asked.
"""

import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from logger.baseline_file import BaselineFile, bound_heap
from logger.core.baseline import Baseline, KnownCell, NoBaseline, SquareHistory
from logger.core.errors import RunFileError, error_place
from logger.core.types import Note

log = logging.getLogger(__name__)

READ, UNREADABLE = "baseline", "baseline-unreadable"
"""Codes of the events."""

Answer = TypeVar("Answer")


class LiveBaseline:
    """A `Baseline` that answers whatever happens; `take_notes` has what is to be recorded.

    Used in one thread, in which it must be made: that of the live estimate. An empty `name` is no
    baseline.
    """

    def __init__(self, name: str) -> None:
        self._notes: list[Note] = []
        self._baseline: Baseline = NoBaseline()
        if name:
            self._open(Path(name))

    @property
    def n_walks(self) -> int:
        """Number of walks, 0 without a readable file."""
        return self._baseline.n_walks

    @property
    def fingerprint(self) -> str:
        """Digest of what it answers from, empty without a readable file."""
        return self._baseline.fingerprint

    def take_notes(self) -> list[Note]:
        """Events since the last call."""
        notes, self._notes = self._notes, []
        return notes

    def square(self, square: int) -> SquareHistory:
        return self._ask(lambda baseline: baseline.square(square))

    def cell(self, name: str) -> KnownCell | None:
        return self._ask(lambda baseline: baseline.cell(name))

    def channels(self, mcc: str, mnc: str, rat: str) -> Mapping[int, int]:
        return self._ask(lambda baseline: baseline.channels(mcc, mnc, rat))

    def trust_note(self, name: str) -> str | None:
        return self._ask(lambda baseline: baseline.trust_note(name))

    def _open(self, path: Path) -> None:
        try:
            bound_heap()
            self._baseline = BaselineFile(path)
        except Exception as error:  # noqa: BLE001 (also without memory the estimate goes on)
            self._give_up(error)
            return
        text = f"{path}: {self.n_walks} earlier walks, fingerprint {self.fingerprint}"
        self._notes.append(Note("info", READ, text))

    def _ask(self, question: Callable[[Baseline], Answer]) -> Answer:
        try:
            return question(self._baseline)
        except Exception as error:  # noqa: BLE001
            self._give_up(error)
            return question(self._baseline)

    def _give_up(self, error: Exception) -> None:
        self._baseline = NoBaseline()
        why = str(error) if isinstance(error, RunFileError) else error_place(error)
        text = f"{why}; nothing is known of earlier walks"
        self._notes.append(Note("warning", UNREADABLE, text))
        log.warning("%s", text)
