"""Runs and logs of folders, added to a survey: each once, without damaged ones, whole batches."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

from logger import baseline_file
from logger.baseline_file import LONGEST_NS
from logger.baseline_store import CONTRADICTION, COPY, SHORTER_COPY, is_same_walk
from logger.core.errors import FieldLoggerError, RunFileError
from logger.core.runfile import RESULTS, read_sound_run, sealing_of
from logger.sqlite_file import application_id
from postproc.interop.importing import import_walk
from postproc.processes import outcome_of, read_ahead
from postproc.survey import layout
from postproc.survey.dataset import Survey, is_survey
from postproc.survey.parquet_batch import Batch
from postproc.survey.walk_readings import SurveyRun, WalkReadings, readings_of, with_name
from postproc.verification import celldb


@dataclass(frozen=True, slots=True)
class Added:
    """What became of a file: added, there already, or left out because of `problem`."""

    path: Path
    digest: str = ""
    n_readings: int = 0
    n_cells: int = 0
    is_known: bool = False
    problem: str = ""
    remark: str = ""


def add_files(survey: Survey, files: Sequence[Path], logger: str | None = None) -> Iterator[Added]:
    """Add each run that is not in the survey, and yield what became of each file.

    What is yielded is durable at the end of a batch; the last one ends with the iteration. A bad
    file does not stop the others. Raises `RunFileError` where nothing can be written.
    """
    with survey.exclusive() as current:
        known = {run.digest for run in current.all_runs}
        states: dict[str, list[SurveyRun]] = {}
        for run in current.runs.values():
            states.setdefault(run.run_id, []).append(run)
        number = max((int(batch) for batch in current.batches), default=0)
        batch = Batch()
        for path, walk in _walks(files, current.salt, logger):
            if isinstance(walk, FieldLoggerError):
                yield Added(path, problem=with_name(path, walk))
                continue
            if walk.run.digest in known:
                yield Added(path, walk.run.digest, is_known=True)
                continue
            same = states.setdefault(walk.run.run_id, [])
            earlier = next((one for one in same if _continues(path, one)), None)
            others = [one.name for one in same if one is not earlier]
            if others and not walk.run.is_complete:
                yield Added(path, problem=f"{path}: another state of {others[0]}, which is there")
                continue
            copy = None if same else _copy_of(walk.run, chain.from_iterable(states.values()))
            is_longer = copy and copy.is_copy and copy.n_readings < walk.run.n_readings
            if copy and walk.run.is_copy and not is_longer:
                remark = COPY.format(copy.name)
                yield Added(path, walk.run.digest, is_known=True, remark=remark)
                continue
            replaced = earlier or copy
            run = replace(walk.run, replaces=replaced.digest if replaced else "")
            known.add(run.digest)
            states[run.run_id] = [*(one for one in same if one is not earlier), run]
            batch.take(replace(walk, run=run))
            remark = CONTRADICTION.format(others[0]) if others else walk.remark
            if copy:
                states[copy.run_id].remove(copy)
                remark = SHORTER_COPY.format(copy.name)
            yield Added(path, run.digest, len(walk), len(walk.cells), remark=remark)
            if batch.is_full:
                number += 1
                batch.write(current.folder, f"{number:06d}")
                batch = Batch()
        if batch.walks:
            batch.write(current.folder, f"{number + 1:06d}")


def _copy_of(run: SurveyRun, others: Iterable[SurveyRun]) -> SurveyRun | None:
    """A shared copy of this run, or its original."""
    began_ns = run.began_utc_ns
    if began_ns is None:
        return None
    near = (
        other
        for other in others
        if (run.is_copy or other.is_copy)
        and other.began_utc_ns is not None
        and abs(other.began_utc_ns - began_ns) <= LONGEST_NS
    )
    return next((other for other in near if is_same_walk(other.marks, run.marks)), None)


def _continues(path: Path, earlier: SurveyRun) -> bool:
    return is_run(path) and sealing_of(path, earlier.digest).continues


def _walks(
    files: Sequence[Path], salt: str, logger: str | None
) -> Iterator[tuple[Path, WalkReadings | FieldLoggerError]]:
    runs = [path for path in files if is_run(path)]
    yield from read_ahead(runs, partial(readings_of, salt=salt, logger=logger))
    for path in files:
        if not is_run(path):
            yield path, outcome_of(path, partial(_readings_of_log, path, salt, logger))


def _readings_of_log(log: Path, salt: str, logger: str | None) -> WalkReadings:
    with TemporaryDirectory() as scratch:
        target = Path(scratch) / log.name
        import_walk(log, target)
        return readings_of(read_sound_run(target), salt, logger)


_LOGS = frozenset(
    {".csv", ".db", ".gz", ".json", ".jsonl", ".kismet", ".kml", ".ndjson", ".sqlite", ".zip"}
)
"""A folder has other files too; one that is named itself is read whatever it is called."""
_OWN_DATABASES = baseline_file.APPLICATION_ID, celldb.APPLICATION_ID


def files_of(paths: Sequence[Path]) -> list[Path]:
    """Files that are named, and those of folders, in the order of their names.

    Left out of folders: a journal where the HDF5 file made of it is beside, surveys, and databases
    of this program. Raises `RunFileError`.
    """
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise RunFileError(f"{path}: no such file or folder")
        files += sorted(_files_in(path)) if path.is_dir() else [path]
    return list(dict.fromkeys(files))


def is_run(path: Path) -> bool:
    """Whether the name is that of a run, and not of a log of another program."""
    return path.suffix in {".h5", ".journal"}


def _files_in(folder: Path) -> Iterator[Path]:
    described = {path.parent for path in folder.rglob(layout.description(folder).name)}
    surveys = set(filter(is_survey, described))
    for path in folder.rglob("*"):
        if path.name.startswith(".") or path.name.endswith(RESULTS) or not path.is_file():
            continue
        is_finished = path.suffix == ".journal" and path.with_suffix(".h5").exists()
        is_log = path.suffix in _LOGS and application_id(path) not in _OWN_DATABASES
        if (is_log or (is_run(path) and not is_finished)) and surveys.isdisjoint(path.parents):
            yield path
