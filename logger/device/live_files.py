"""The baseline and the streets on the device: only read, and an error never stops the recording.

A file that is missing or damaged is one line in the log and one event in the run. From then on
nothing is known of earlier walks, and rules that need them are not asked, or there are no streets.
What the baseline is asked is recorded (`NotedBaseline`).
"""

import logging
from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

from logger.baseline_file import BaselineFile, bound_heap, configured_file
from logger.core.baseline import (
    CELL,
    CHANNELS,
    DOUBT,
    FILE,
    READ,
    SQUARE,
    TRUST,
    UNREADABLE,
    Baseline,
    KnownCell,
    NotedBaseline,
    SquareHistory,
    answer_line,
)
from logger.core.errors import FieldLoggerError, RunFileError, error_place
from logger.core.guidance.street_atlas import StreetAtlas
from logger.core.guidance.street_map import StreetMap
from logger.core.latest import Latest
from logger.core.places import Places
from logger.core.types import Note
from logger.street_file import read_lines

log = logging.getLogger(__name__)

_MOST_NOTED = 10_000
"""Questions of a walk; what is asked again after so many others is recorded again."""

Answer = TypeVar("Answer")

_STREETS, _NO_STREETS = "streets", "streets-unreadable"
"""Codes of the events about streets."""


class LiveBaseline:
    """A `Baseline` that answers whatever happens; `take_notes` and `take_lines` are to be recorded.

    Used in one thread, in which it must be made: that of the live estimate. `name` is that of
    `LiveSettings.baseline`, and `folder` that of the runs.
    """

    def __init__(self, name: str, folder: Path = Path()) -> None:
        self._notes: list[Note] = []
        self._lines = b""
        self._noted: Latest[None] = Latest(_MOST_NOTED)
        self._baseline: Baseline = NotedBaseline()
        if (path := configured_file(name, folder)) is not None:
            self._open(path)

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

    def take_lines(self) -> bytes:
        """Answers since the last call that were not given before."""
        lines, self._lines = self._lines, b""
        return lines

    def square(self, square: int) -> SquareHistory:
        return self._ask(SQUARE, square, lambda baseline: baseline.square(square))

    def cell(self, name: str) -> KnownCell | None:
        return self._ask(CELL, name, lambda baseline: baseline.cell(name))

    def channels(self, mcc: str, mnc: str, rat: str) -> Mapping[int, int]:
        key = (mcc, mnc, rat)
        return self._ask(CHANNELS, key, lambda baseline: baseline.channels(*key))

    def trust_note(self, name: str) -> str | None:
        return self._ask(TRUST, name, lambda baseline: baseline.trust_note(name))

    def is_doubted(self, name: str) -> bool:
        return self._ask(DOUBT, name, lambda baseline: baseline.is_doubted(name))

    def _open(self, path: Path) -> None:
        try:
            bound_heap()
            self._baseline = BaselineFile(path)
        except Exception as error:  # noqa: BLE001 (also without memory the estimate goes on)
            self._give_up(error)
            return
        text = f"{path}: {self.n_walks} earlier walks, fingerprint {self.fingerprint}"
        self._notes.append(Note("info", READ, text))
        self._lines += answer_line(FILE, self.fingerprint, self.n_walks)

    def _ask(self, kind: str, key: Any, ask: Callable[[Baseline], Answer]) -> Answer:
        try:
            answer = ask(self._baseline)
        except Exception as error:  # noqa: BLE001
            self._give_up(error)
            return ask(self._baseline)
        if (question := f"{kind} {key}") not in self._noted and self.n_walks:
            self._noted.put(question, None)
            self._lines += answer_line(kind, key, answer)
        return answer

    def _give_up(self, error: Exception) -> None:
        self._baseline = NotedBaseline()
        why = str(error) if isinstance(error, RunFileError) else error_place(error)
        text = f"{why}; nothing is known of earlier walks"
        self._notes.append(Note("warning", UNREADABLE, text))
        log.warning("%s", text)


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
        self._notes.append(Note("info", _STREETS, text))

    def _give_up(self, error: Exception) -> None:
        self._atlas = StreetAtlas(())
        why = str(error) if isinstance(error, FieldLoggerError) else error_place(error)
        named = why if self._name in why else f"{self._name}: {why}"
        self._notes.append(Note("warning", _NO_STREETS, f"{named}; advice without streets"))
        log.warning("advice without streets: %s", named)
