"""What has been computed of each cell of a survey, each once for the same runs."""

import errno
from collections.abc import Iterator, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any, Generic, TypeVar

import msgspec

from logger.core.errors import RunFileError
from postproc.result import Options
from postproc.results import program_digest
from postproc.survey.agreement import Agreement
from postproc.survey.cell_location import LocatedCell
from postproc.survey.dataset import Survey
from postproc.survey.tasks import RunChoice, runs_of

Row = TypeVar("Row", Agreement, LocatedCell)


class Estimates(Generic[Row]):
    """Computed rows of the cells of a survey, a line of JSON for each cell.

    `keys` has a digest of all that the rows of a cell depend on. A torn line is computed again.
    """

    def __init__(self, path: Path, kind: type[tuple[Row, ...]], keys: Mapping[str, str]) -> None:
        self._path, self._keys = path, keys
        line: Any = msgspec.defstruct("Line", [("key", str), ("value", kind)], frozen=True)
        self._line = line
        self._known: dict[str, tuple[Row, ...]] = {
            one.key: one.value for one in whole_lines(path, line)
        }

    def of(self, cell: str) -> tuple[Row, ...] | None:
        """Rows of a cell, None without."""
        return self._known.get(self._keys[cell])

    def put(self, cells: Sequence[str], rows: Sequence[Row]) -> None:
        """Add rows of cells; raises `RunFileError`."""
        found = {self._keys[cell]: tuple(r for r in rows if r.cell == cell) for cell in cells}
        append_lines(self._path, [self._line(*one) for one in found.items()])
        self._known |= found


def keys_of(survey: Survey, choice: RunChoice, options: Options) -> dict[str, str]:
    """Key of each cell: its runs, the options and the program."""
    allowed = set(runs_of(survey, choice))
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


Line = TypeVar("Line", bound=msgspec.Struct)


def append_lines(path: Path, lines: Sequence[msgspec.Struct]) -> None:
    """Add lines; raises `RunFileError` where they cannot be written.

    In a survey that is another's to change, which is no error, they are not kept.
    """
    text = b"".join(msgspec.json.encode(line) + b"\n" for line in lines)
    try:
        with path.open("ab") as file:
            # a torn line must not swallow the next one
            file.write(b"\n" + text if file.tell() else text)
    except OSError as error:
        if error.errno in {errno.EROFS, errno.EACCES}:
            return
        raise RunFileError(
            f"cannot write {path}: {error.strerror}; what was computed before is kept"
        ) from error


def whole_lines(path: Path, kind: type[Line]) -> Iterator[Line]:
    """The lines that are whole; none where there is no file."""
    decoder = msgspec.json.Decoder(kind)
    for text in path.read_bytes().splitlines() if path.exists() else []:
        try:
            yield decoder.decode(text)
        except msgspec.MsgspecError:
            continue
