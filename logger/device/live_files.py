"""The baseline and the streets on the device: only read, and an error never stops the recording.

A missing or damaged file is one line in the log and one event in the run. From then on nothing is
known of earlier walks, and rules that need them are not asked, or there are no streets. What the
baseline is asked is recorded (`NotedBaseline`).
"""

import logging
from contextlib import ExitStack, closing
from hashlib import sha256
from pathlib import Path
from typing import Any

from logger.baseline_file import BaselineFile, bound_heap, configured_file
from logger.core.baseline import (
    FILE,
    READ,
    UNREADABLE,
    Baseline,
    NotedBaseline,
    answer_line,
)
from logger.core.errors import FieldLoggerError, RunFileError, error_place
from logger.core.guidance.street_atlas import StreetAtlas
from logger.core.guidance.street_map import StreetMap
from logger.core.latest import Latest
from logger.core.live_settings import LiveSettings
from logger.core.places import Places
from logger.core.types import Note
from logger.street_file import read_lines

log = logging.getLogger(__name__)

_MOST_NOTED = 10_000
"""Questions of a walk; what is asked again after so many others is recorded again."""

_STREETS, _NO_STREETS = "streets", "streets-unreadable"
"""Codes of the events about streets."""


class LiveFiles(Baseline):
    """A `Baseline` and `Streets` that answer whatever happens, from the files that settings name.

    `take_notes` and `take_lines` are to be recorded. Made and used in one thread, that of the live
    estimate. `folder` is that of the runs.
    """

    def __init__(self, settings: LiveSettings, folder: Path = Path()) -> None:
        self._notes: list[Note] = []
        self._lines = b""
        self._noted: Latest[None] = Latest(_MOST_NOTED)
        self._opened = ExitStack()
        self._use(NotedBaseline())
        self._streets = StreetAtlas(())
        self._streets_file = settings.streets
        if (path := configured_file(settings.baseline, folder)) is not None:
            self._open_baseline(path)
        if self._streets_file:
            self._read_streets()

    def close(self) -> None:
        """Release the files."""
        self._opened.close()

    def take_notes(self) -> list[Note]:
        """Events since the last call."""
        notes, self._notes = self._notes, []
        return notes

    def take_lines(self) -> bytes:
        """Answers of the baseline since the last call that were not given before."""
        lines, self._lines = self._lines, b""
        return lines

    def near(self, here: Places) -> StreetMap | None:
        """As `Streets.near`."""
        try:
            return self._streets.near(here)
        except Exception as error:  # noqa: BLE001 (also without memory the estimate goes on)
            self._give_up_streets(error)
        return None

    def ask(self, kind: str, key: Any) -> Any:
        try:
            answer = self._baseline.ask(kind, key)
        except Exception as error:  # noqa: BLE001
            self._give_up_baseline(error)
            return None
        if (question := f"{kind} {key}") not in self._noted and self.n_walks:
            self._noted.put(question, None)
            self._lines += answer_line(kind, key, answer)
        return answer

    def _use(self, baseline: Baseline) -> None:
        self._baseline = baseline
        self.n_walks, self.fingerprint = baseline.n_walks, baseline.fingerprint

    def _open_baseline(self, path: Path) -> None:
        try:
            bound_heap()
            self._use(self._opened.enter_context(closing(BaselineFile(path))))
        except Exception as error:  # noqa: BLE001
            self._give_up_baseline(error)
            return
        text = f"{path}: {self.n_walks} earlier walks, fingerprint {self.fingerprint}"
        self._notes.append(Note("info", READ, text))
        self._lines += answer_line(FILE, self.fingerprint, self.n_walks)

    def _give_up_baseline(self, error: Exception) -> None:
        self.close()
        self._use(NotedBaseline())
        why = str(error) if isinstance(error, RunFileError) else error_place(error)
        self._warn(UNREADABLE, f"{why}; nothing is known of earlier walks")

    def _read_streets(self) -> None:
        try:
            lines = read_lines(Path(self._streets_file))
            self._streets = StreetAtlas(lines)
        except Exception as error:  # noqa: BLE001
            self._give_up_streets(error)
            return
        digest = sha256()
        for line in lines:
            digest.update(repr(line).encode())
        text = f"{len(lines)} streets of {self._streets_file}, digest {digest.hexdigest()}"
        self._notes.append(Note("info", _STREETS, text))

    def _give_up_streets(self, error: Exception) -> None:
        self._streets = StreetAtlas(())
        why = str(error) if isinstance(error, FieldLoggerError) else error_place(error)
        named = why if self._streets_file in why else f"{self._streets_file}: {why}"
        self._warn(_NO_STREETS, f"{named}; advice without streets")

    def _warn(self, code: str, text: str) -> None:
        self._notes.append(Note("warning", code, text))
        log.warning("%s", text)
