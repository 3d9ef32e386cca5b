"""What a survey holds, as far as its batches are complete."""

import fcntl
import json
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple, Self

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from logger.core.errors import ConfigError, RunFileError
from logger.core.foreign import check_regular, open_regular
from logger.core.places import Places, Utm
from logger.core.readings import Readings
from postproc.atomic_write import whole_file
from postproc.ground import Ground
from postproc.survey import layout
from postproc.survey.parquet_batch import read_columns
from postproc.survey.rule_inputs import RuleColumn
from postproc.survey.walk_readings import HeardCell, SurveyRun

_FORMAT, _VERSION = "cellwalk survey", 2


class _Description(msgspec.Struct, frozen=True):
    """What a survey's folder says of itself; `salt` of its fingerprints."""

    format: str = ""
    version: int = 0
    salt: str = ""

    @property
    def is_of_this_version(self) -> bool:
        return (self.format, self.version) == (_FORMAT, _VERSION)


_MOST_BYTES = 1 << 16
"""Of survey.json, which has a line."""
_ARRAYS = ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq")


class SurveyCell(NamedTuple):
    """A cell of a survey: readings with a position, scans that named it, and runs."""

    cell: str
    rat: str
    area: str
    n_readings: int
    n_scans: int
    n_runs: int


@dataclass(frozen=True)
class Survey:
    """A survey at one moment: the batches that were complete when it was opened."""

    folder: Path
    batches: tuple[str, ...]
    salt: str

    @classmethod
    def open(cls, folder: Path) -> Self:
        """Raises `RunFileError` for a folder that is no survey or lacks files."""
        about = _description_of(folder)
        if not about.is_of_this_version:
            raise RunFileError(
                f"{folder} is a survey of another version of this program; "
                "add its runs to a new folder"
            )
        batches = sorted(path.stem for path in (folder / "runs").glob("*.parquet"))
        survey = cls(folder, tuple(batches), about.salt)
        for batch in batches:
            survey.check(batch)
        return survey

    @classmethod
    def open_or_make(cls, folder: Path) -> Self:
        """The survey of a folder, a new one in a folder that is empty or not there."""
        if not layout.description(folder).exists():
            if folder.exists() and any(folder.iterdir()):
                raise ConfigError(f"{folder} has other files; choose an empty or a new folder")
            folder.mkdir(parents=True, exist_ok=True)
            about = _Description(_FORMAT, _VERSION, secrets.token_hex(8))
            with whole_file(layout.description(folder)) as part:
                part.write_bytes(msgspec.json.encode(about))
        return cls.open(folder)

    def without_contents(self, *batches: str) -> "Survey":
        """The same for another process, which reads for itself; of some batches, or of all."""
        return Survey(self.folder.absolute(), batches or self.batches, self.salt)

    def check(self, batch: str) -> None:
        """Raise `RunFileError` where a file of a batch is missing or has another size."""
        path = layout.runs_file(self.folder, batch)
        try:
            check_regular(path)
            sizes = dict(json.loads(pq.read_schema(path).metadata[layout.FILES_KEY]))
        except (
            OSError,
            ValueError,
            LookupError,
            TypeError,
            RecursionError,
            pa.ArrowException,
        ) as error:
            raise RunFileError(f"{path} is damaged: {error}") from error
        for name, size in sizes.items():
            file = self.folder / name
            if not file.is_file() or file.stat().st_size != size:
                raise RunFileError(
                    f"{file} is missing or damaged: remove {path} and add its runs again"
                )

    @cached_property
    def all_runs(self) -> list[SurveyRun]:
        """Runs in the order in which they began, also those that others continue."""
        rows = [
            SurveyRun(**row)
            for batch in self.batches
            for row in read_columns(layout.runs_file(self.folder, batch), layout.RUNS).to_pylist()
        ]
        return sorted(rows, key=lambda run: (run.began_utc_ns or 0, run.digest))

    @cached_property
    def runs(self) -> dict[str, SurveyRun]:
        """The runs that count, by digest, in the order in which they began."""
        continued = {run.replaces for run in self.all_runs}
        return {run.digest: run for run in self.all_runs if run.digest not in continued}

    @cached_property
    def cells_of_runs(self) -> pa.Table:
        """What each run that counts heard of each cell (`layout.CELLS`)."""
        files = [layout.cells_file(self.folder, batch) for batch in self.batches]
        tables = [read_columns(file, layout.CELLS) for file in files]
        heard = pa.concat_tables(tables) if tables else layout.CELLS.empty_table()
        return heard.filter(_is_one_of("run", list(self.runs)))

    @cached_property
    def rats(self) -> dict[str, str]:
        """Technology of each cell, empty where it is unknown."""
        return {cell.cell: cell.rat for cell in self.cells()}

    def cells(self, runs: Sequence[str] | None = None) -> list[SurveyCell]:
        """Cells that all runs heard, or only these `runs`, by area and name."""
        heard = self.cells_of_runs
        if runs is not None:
            heard = heard.filter(_is_one_of("run", runs))
        sums = heard.group_by("cell").aggregate(
            [("rat", "max"), ("n_readings", "sum"), ("n_scans", "sum"), ("run", "count")]
        )
        cells = [
            SurveyCell(
                row["cell"],
                row["rat_max"],
                layout.area_of(row["cell"]),
                row["n_readings_sum"],
                row["n_scans_sum"],
                row["run_count"],
            )
            for row in sums.to_pylist()
        ]
        return sorted(cells, key=lambda cell: (cell.area, cell.cell))

    def runs_that_heard(self, cells: Sequence[str], runs: Sequence[str]) -> list[str]:
        """The `runs` that heard one of the cells; all of them where no cell is named."""
        if not cells:
            return list(runs)
        heard = set(self.cells_of_runs.filter(_is_one_of("cell", cells))["run"].to_pylist())
        return [run for run in runs if run in heard]

    def scans_of(self, cells: Sequence[str], runs: Sequence[str]) -> dict[str, dict[str, int]]:
        """Scans of each of some runs that named each of some cells without doubt."""
        heard = self.cells_of_runs.filter(_is_one_of("cell", cells) & _is_one_of("run", runs))
        n_scans: dict[str, dict[str, int]] = {}
        for row in heard.select(["cell", "run", "n_scans"]).to_pylist():
            n_scans.setdefault(row["cell"], {})[row["run"]] = row["n_scans"]
        return n_scans

    def rows(self, area: str, cells: Sequence[str] | None = None) -> pa.Table:
        """Readings of some cells of an area, or of all (`layout.READINGS`)."""
        files = [layout.readings_file(self.folder, area, batch) for batch in self.batches]
        chosen = None if cells is None else _is_one_of("cell", cells)
        tables = [
            read_columns(file, layout.READINGS, filters=chosen) for file in files if file.exists()
        ]
        if not tables:
            return layout.READINGS.empty_table()
        return pa.concat_tables(tables).unify_dictionaries()

    def batch_rows(self, batch: str, columns: Sequence[str] | None = None) -> pa.Table:
        """Readings of one batch in all areas."""
        files = sorted((self.folder / "readings").glob(f"*/{batch}.parquet"))
        tables = [read_columns(file, layout.READINGS, columns) for file in files]
        return pa.concat_tables(tables).unify_dictionaries()

    def rule_inputs(
        self, batch: str, runs: Sequence[str]
    ) -> Iterator[tuple[str, list[RuleColumn]]]:
        """What the rules see of some runs of a batch; nothing of runs that came otherwise."""
        file = layout.rules_file(self.folder, batch)
        if not file.exists():
            return
        table = read_columns(file, layout.RULES, filters=_is_one_of("run", runs))
        columns = (table[name].to_pylist() for name in layout.RULES.names)
        for run, rows in groupby(zip(*columns, strict=True), key=itemgetter(0)):
            yield run, [RuleColumn(*row[1:]) for row in rows]

    @cached_property
    def runs_of_batches(self) -> dict[str, list[str]]:
        """Digests of the runs of each batch."""
        return {
            batch: read_columns(layout.runs_file(self.folder, batch), layout.RUNS, ["digest"])[
                "digest"
            ].to_pylist()
            for batch in self.batches
        }

    def heard_in(self, batch: str) -> dict[str, list[HeardCell]]:
        """What each run of a batch heard."""
        heard: dict[str, list[HeardCell]] = {}
        for row in read_columns(layout.cells_file(self.folder, batch), layout.CELLS).to_pylist():
            run, numbers = row.pop("run"), row.pop("channels")
            channels = tuple(zip(numbers[::2], numbers[1::2], strict=True))
            heard.setdefault(run, []).append(HeardCell(**row, channels=channels))
        return heard

    def ground(self, runs: Sequence[str]) -> Iterator[Ground]:
        """Where some runs have readings, part by part."""
        for batch in self.batches:
            rows = self.batch_rows(batch, ["run", "zone", "x_m", "y_m"])
            rows = rows.filter(_is_one_of("run", runs))
            yield Ground(*(rows[name].to_numpy() for name in ("zone", "x_m", "y_m")))

    def observations(
        self, area: str, cells: Sequence[str], runs: Sequence[str] | None = None
    ) -> dict[str, dict[str, Readings]]:
        """Readings by cell and, in the order in which these began, by digest of the run.

        Equal to the readings of `postproc smooth` of each run.
        """
        order = {digest: i for i, digest in enumerate(self.runs)}
        wanted = set(order if runs is None else runs)
        series: dict[str, dict[str, Readings]] = {}
        for run, obs in _series(self.rows(area, cells), self.rats):
            if run in wanted:
                series.setdefault(obs.cell, {})[run] = obs
        return {
            cell: dict(sorted(by_run.items(), key=lambda item: order[item[0]]))
            for cell, by_run in sorted(series.items())
        }

    @contextmanager
    def exclusive(self) -> Iterator["Survey"]:
        """To change the survey of now alone, without what a killed program left."""
        with (self.folder / ".lock").open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise RunFileError(
                    f"{self.folder} is being changed by another program; try again when it has "
                    "ended"
                ) from None
            survey = Survey.open(self.folder)  # another may have added to it since this was opened
            _remove_leftovers(survey)
            yield survey


def _description_of(folder: Path) -> _Description:
    try:
        with open_regular(layout.description(folder)) as file:
            return msgspec.json.decode(file.read(_MOST_BYTES), type=_Description)
    except msgspec.ValidationError:
        return _Description()
    except (FileNotFoundError, NotADirectoryError):
        raise RunFileError(f"{folder} is no survey; `postproc survey add` makes one") from None
    except (OSError, msgspec.DecodeError, RecursionError) as error:
        raise RunFileError(f"{folder} cannot be read as a survey: {error}") from error


def is_survey(folder: Path) -> bool:
    """Whether a folder is a survey, of this version or another."""
    try:
        return _description_of(folder).format == _FORMAT
    except RunFileError:
        return False


def _remove_leftovers(survey: Survey) -> None:
    for path in survey.folder.glob("*/**/*"):
        is_unknown = path.suffix == ".parquet" and path.stem not in survey.batches
        if path.suffix == ".part" or is_unknown:
            path.unlink(missing_ok=True)


def _is_one_of(column: str, texts: Sequence[str]) -> pc.Expression:
    return pc.field(column).isin(pa.array(texts, pa.string()))


def _series(table: pa.Table, rats: Mapping[str, str]) -> Iterator[tuple[str, Readings]]:
    """Run and readings of each cell of each run, of which one batch has all, in their order."""
    if not len(table):
        return
    cell, run = (table["cell"].combine_chunks(), table["run"].combine_chunks())
    columns = {name: table[name].to_numpy() for name in (*_ARRAYS, "zone", "ta", "named_share")}
    cell_of, run_of = cell.indices.to_numpy(), run.indices.to_numpy()
    change = np.flatnonzero((np.diff(cell_of) != 0) | (np.diff(run_of) != 0)) + 1
    for first, end in zip([0, *change.tolist()], [*change.tolist(), len(table)], strict=True):
        rows = {name: values[first:end] for name, values in columns.items()}
        name = cell.dictionary[int(cell_of[first])].as_py()
        digest = run.dictionary[int(run_of[first])].as_py()
        yield digest, _observations(name, rats[name] or None, rows)


def _observations(cell: str, rat: str | None, rows: dict[str, np.ndarray[Any, Any]]) -> Readings:
    ta, named_share = rows["ta"].astype(np.int64), rows["named_share"]
    return Readings(
        cell=cell,
        rat=rat,
        places=Places.of(
            rows["x_m"],
            rows["y_m"],
            utm=Utm(int(rows["zone"][0])),
            sigma_m=rows["position_sigma_m"],
            t_ns=rows["t_ns"],
        ),
        level_dbm=rows["level_dbm"],
        scan_seq=rows["scan_seq"],
        ta=ta if np.any(ta >= 0) else None,
        named_share=None if np.any(np.isnan(named_share)) else named_share,
        is_timed=bool(np.any(rows["t_ns"])),
    )
