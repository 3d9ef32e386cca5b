"""The results of `smooth` as `run.post.h5`, beside the run, which is never changed.

`report`, `view`, `plot`, `export` and `verify` read them instead of estimating again, where they
were made from the same data, with the same options and by the same program.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from hashlib import sha256
from pathlib import Path

import msgspec
import numpy as np

import logger.core
from logger.core.document import json_text
from logger.core.errors import RunFileError
from logger.core.runfile import Run, read_results
from postproc.atomic_write import whole_file
from postproc.result import Options, Result, joint_warnings, program_version
from postproc.result_encoding import Array, Encoded, decode, encode
from postproc.scan_counts import observed_cells

_TABLES = ("fixes", "scans", "readings")
"""What is estimated from; notes, raw bytes and the live estimate change no result."""
_SOURCES = ("*.py", "estimators/*.py", "survey/*.py")
"""Of this package: what may change a result. Pictures, reports and exports are made from one."""


class MadeFrom(msgspec.Struct, frozen=True):
    """What determines a result, besides the selection of cells.

    `runs` are digests of the data, whatever their order; `program` is the version with a digest of
    the source code.
    """

    runs: tuple[str, ...]
    options: Options
    program: str


class NotStored(Exception):  # noqa: N818 (no error: the result can be computed)
    """Why stored results cannot be used; empty where there are none."""


def path_beside(runs: Sequence[Path]) -> Path:
    """`run-x.h5` -> `run-x.post.h5`, or `run-x.together.post.h5` for the first name of several."""
    first = min(runs, key=lambda path: (path.name, path))
    return first.with_suffix(".together.post.h5" if len(runs) > 1 else ".post.h5")


def write(result: Result, summary: object, path: Path, cells: Sequence[str] = ()) -> None:
    """Write what `smooth --json` prints and the complete result, complete or not at all.

    `cells` are those that the result was limited to. Arrays are datasets named by the fields of
    `Result`: `cells/0/obs/x_m`, `cells/0/ekf/x`. Equal arrays are stored once. Raises
    `RunFileError`.
    """
    import h5py  # noqa: PLC0415 (files are read in another process)

    encoded = encode(result)
    runs = [observed.run for observed in result.runs]
    made_from = _made_from_text(runs, result.options)
    selected = msgspec.json.encode(list(cells))
    run_ids = [run.meta.run_id for run in runs]
    with whole_file(path) as part, h5py.File(part, "w", libver=("earliest", "v108")) as file:
        file.attrs["format"] = "cellwalk results"
        file.attrs["digest"] = _digest(made_from, selected, encoded)
        if len(run_ids) == 1:
            file.attrs["run_id"] = run_ids[0]
        else:
            file.attrs["run_ids"] = run_ids
        file["summary"] = np.bytes_(json_text(summary).encode())
        file["made_from"] = np.bytes_(made_from)
        file["selected"] = np.bytes_(selected)
        file["values"] = np.frombuffer(encoded.values, np.uint8)
        for name, array in encoded.arrays.items():
            file[name] = array
        for i, cell in enumerate(result.cells):
            file.require_group(f"cells/{i}").attrs["cell"] = cell.cell


def read(path: Path, runs: Sequence[Run], only: Sequence[str] | None, options: Options) -> Result:
    """The result that `write` has stored, as it would be computed for these cells.

    Its runs are in the order in which they were estimated.

    Raises `NotStored` where the file was made from something else, lacks a cell or is damaged,
    `ConfigError` for a cell that was not observed.
    """
    wanted = observed_cells(runs, only)
    made_from = _made_from_text(runs, options)
    if not path.exists():
        raise NotStored
    try:
        stored = read_results(path, made_from.decode())
        if stored.made_from != made_from:
            raise NotStored(_difference(stored.made_from, made_from))
        encoded = Encoded(stored.values, stored.arrays)
        if stored.digest != _digest(made_from, stored.selected, encoded):
            raise NotStored("it is damaged")
        selected: list[str] = msgspec.json.decode(stored.selected, type=list[str])
        result = decode(encoded, runs)
    except (RunFileError, msgspec.MsgspecError, ValueError) as error:
        raise NotStored(f"it is damaged ({error})") from error
    if selected and (missing := set(wanted) - set(selected)):
        raise NotStored(f"it lacks the cell {min(missing)}")
    return _select_cells(result, wanted)


def _select_cells(result: Result, wanted: dict[str, int]) -> Result:
    cells = tuple(cell for cell in result.cells if cell.cell in wanted)
    return replace(result, cells=cells, warnings=joint_warnings(len(result.runs), cells))


def _made_from_text(runs: Sequence[Run], options: Options) -> bytes:
    return msgspec.json.encode(
        MadeFrom(tuple(sorted(map(_digest_of_run, runs))), options, program_digest())
    )


def _digest_of_run(run: Run) -> str:
    """SHA-256 of what is estimated from; the digest in the file only says what was sealed."""
    digest = sha256(msgspec.json.encode(run.meta))
    for name in _TABLES:
        digest.update(np.ascontiguousarray(run.tables[name]).view(np.uint8).data)
    return digest.hexdigest()


def _digest(made_from: bytes, selected: bytes, encoded: Encoded) -> str:
    digest = sha256(msgspec.json.encode([made_from.decode(), selected.decode()]))
    digest.update(encoded.values)
    for name in sorted(encoded.arrays):
        array: Array = np.ascontiguousarray(encoded.arrays[name])
        digest.update(msgspec.json.encode([name, array.dtype.str, array.shape]))
        digest.update(array.data)
    return digest.hexdigest()


@cache
def program_digest() -> str:
    """Version, and digest of the source code that determines a result."""
    core, package = Path(logger.core.__file__).parent, Path(__file__).parent
    files = [*core.rglob("*.py"), *(path for some in _SOURCES for path in package.glob(some))]
    digest = sha256()
    for path in sorted(files):
        digest.update(path.read_bytes())
    return f"{program_version()} {digest.hexdigest()[:16]}"


def _difference(stored: bytes, made_from: bytes) -> str:
    """What a result was made from, where it is not from `made_from`."""
    try:
        theirs, ours = (msgspec.json.decode(text, type=MadeFrom) for text in (stored, made_from))
    except msgspec.MsgspecError:
        return "it is of another version of the program"
    if theirs.program != ours.program:
        return "it is of another version of the program"
    if theirs.runs != ours.runs:
        return "it was made from other data"
    return "it was made with other options"
