"""Estimates of all cells of a survey, each computed once for the same runs."""

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import msgspec

from postproc.result import Options
from postproc.results import program_digest
from postproc.survey.cell_location import LocatedCell
from postproc.survey.dataset import Survey
from postproc.survey.kept_lines import append_lines, whole_lines
from postproc.survey.tasks import RunChoice


class _Line(msgspec.Struct, frozen=True):
    key: str
    cell: LocatedCell


class EstimateFile:
    """Estimates that have been computed, a line of JSON each, durable one by one.

    `key` is a digest of all that an estimate depends on, so what changes it makes a new one. A line
    that was torn is computed again.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known = {line.key: line.cell for line in whole_lines(path, _Line)}

    def get(self, key: str) -> LocatedCell | None:
        """The estimate with this key; None where there is none."""
        return self._known.get(key)

    def put(self, found: Sequence[tuple[str, LocatedCell]]) -> None:
        """Add estimates; raises `RunFileError` where they cannot be written."""
        append_lines(self._path, [_Line(*one) for one in found])
        self._known.update(found)


def keys_of(survey: Survey, choice: RunChoice, options: Options) -> dict[str, str]:
    """Key of each cell: its runs, the options and the program."""
    allowed = {digest for digest, run in survey.runs.items() if choice.allows(run)}
    digests: dict[str, list[str]] = {}
    table = survey.cells_of_runs
    for cell, run in zip(table["cell"].to_pylist(), table["run"].to_pylist(), strict=True):
        if run in allowed:
            digests.setdefault(cell, []).append(run)
    about = msgspec.json.encode((program_digest(), options))
    return {
        cell: sha256(about + cell.encode() + "".join(sorted(runs)).encode()).hexdigest()
        for cell, runs in digests.items()
    }
