"""Estimates of all cells of a survey, each computed once for the same runs."""

from collections.abc import Iterator, Sequence
from hashlib import sha256
from pathlib import Path

import msgspec

from logger.core.errors import RunFileError
from postproc.result import Options
from postproc.results import program_digest
from postproc.survey.cell_location import LocatedCell
from postproc.survey.dataset import Survey
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
        self._known = dict(_lines(path))

    def get(self, key: str) -> LocatedCell | None:
        """The estimate with this key; None where there is none."""
        return self._known.get(key)

    def put(self, found: Sequence[tuple[str, LocatedCell]]) -> None:
        """Add estimates; raises `RunFileError` where they cannot be written."""
        lines = b"".join(msgspec.json.encode(_Line(*one)) + b"\n" for one in found)
        try:
            with self._path.open("ab") as file:
                # a torn line must not swallow the next one
                file.write(b"\n" + lines if file.tell() else lines)
        except OSError as error:
            raise RunFileError(
                f"cannot write {self._path}: {error.strerror}; what was computed before is kept"
            ) from error
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


def _lines(path: Path) -> Iterator[tuple[str, LocatedCell]]:
    if not path.exists():
        return
    decoder = msgspec.json.Decoder(_Line)
    for text in path.read_bytes().splitlines():
        try:
            line = decoder.decode(text)
        except msgspec.MsgspecError:
            continue
        yield line.key, line.cell
