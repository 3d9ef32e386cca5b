"""The readings of one run as a survey keeps them: by cell, at the walker's smoothed positions.

Raw bytes, configuration, notes, names of ports, the number of the boot and the time since it are
left out, as by `share`. The ends of the walk stay, since they are ground that was walked.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from math import nan
from pathlib import Path

import numpy as np

from logger.baseline_store import (
    began_utc_ns,
    channels_heard,
    content_digest,
    marks_of,
    walk_digest,
)
from logger.core.arrays import FloatArray, IntArray
from logger.core.errors import RunFileError
from logger.core.rows import numbered_texts
from logger.core.runfile import Run
from logger.core.runfile.meta import may_be_copy
from postproc.multi_run import modem_identity, with_one_modem
from postproc.scan_counts import scans_of
from postproc.survey.rule_inputs import RuleColumn, rule_inputs
from postproc.walk import observe_run


@dataclass(frozen=True, slots=True)
class SurveyRun:
    """Provenance of a run.

    `content` is the digest of its content (`walk_summary`). `modem` and `logger` are pseudonyms,
    the same in all runs of one survey. `began_utc_ns` is None if no fix had a time. `is_complete`
    is false of a cut run; `replaces` is the digest of one that this one continues. `marks` show a
    copy.
    """

    digest: str
    content: str
    run_id: str
    name: str
    logger: str
    modem: str
    began_utc_ns: int | None
    n_readings: int
    is_complete: bool = True
    replaces: str = ""
    marks: bytes = b""
    is_copy: bool = False


@dataclass(frozen=True, slots=True)
class HeardCell:
    """A cell in a run: its technology, and the scans that named it without doubt.

    `channels` are pairs of channel number and code, -1 where it was not printed.
    """

    cell: str
    rat: str
    n_readings: int
    n_scans: int
    channels: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class WalkReadings:
    """A run with its readings; arrays of shape (n,), cell by cell in the order of `cells`.

    `cell` is the number in `cells`; `x_m, y_m` are in UTM zone `zone` (negative in the south),
    `t_ns` counts from the start of the run. `named_share` is NaN where it is unknown. `rules` is
    what the rules of suspicion see, `remark` what was left out.
    """

    run: SurveyRun
    cells: tuple[HeardCell, ...]
    zone: int
    cell: IntArray
    t_ns: IntArray
    x_m: FloatArray
    y_m: FloatArray
    position_sigma_m: FloatArray
    level_dbm: FloatArray
    scan_seq: IntArray
    ta: IntArray
    named_share: FloatArray
    rules: Sequence[RuleColumn] = ()
    remark: str = ""

    def __len__(self) -> int:
        return len(self.cell)


def pseudonym(identity: object, salt: str) -> str:
    """Eight characters that stand for a device in one survey, and say nothing in another."""
    return sha256(f"{salt}{identity!r}".encode()).hexdigest()[:8]


def readings_of(run: Run, salt: str, logger: str | None = None) -> WalkReadings:
    """The readings of a run, of the modem with most of them; `logger` is who recorded it.

    Raises `RunFileError` for a damaged run and for one without a position.
    """
    if run.damage:
        raise RunFileError(f"it is damaged: {run.damage}")
    one = with_one_modem(run)
    observed = observe_run(one).observations
    if observed is None:
        raise RunFileError("it has no position fix")
    series = sorted(observed.cells, key=lambda obs: obs.cell)
    fixes, readings = run.tables["fixes"], run.tables["readings"]
    digest = walk_digest(run)
    modem, name = _devices(run, salt, logger, digest)
    n_scans, channels = scans_of([run]), _channels(run)

    def column(name: str) -> list[FloatArray | IntArray]:
        return [getattr(obs, name) for obs in series]

    def join(arrays: list[FloatArray | IntArray]) -> FloatArray:
        return np.concatenate(arrays) if arrays else np.zeros(0)

    return WalkReadings(
        SurveyRun(
            digest,
            content_digest(fixes, readings),
            run.meta.run_id,
            run.path.name,
            name,
            modem,
            began_utc_ns(run),
            sum(map(len, series)),
            run.is_complete,
            marks=marks_of(run),
            is_copy=may_be_copy(run.meta.origin),
        ),
        tuple(
            HeardCell(o.cell, o.rat or "", len(o), n_scans.get(o.cell, 0), channels.get(o.cell, ()))
            for o in series
        ),
        observed.track.utm.zone,
        np.repeat(np.arange(len(series)), [len(obs) for obs in series]),
        (join(column("t_ns")).astype(np.int64) - run.meta.started_ns)
        * all(obs.is_timed for obs in series),
        join(column("x_m")),
        join(column("y_m")),
        join(column("position_sigma_m")),
        join(column("level_dbm")),
        join(column("scan_seq")).astype(np.int64),
        join([np.full(len(o), -1) if o.ta is None else o.ta for o in series]).astype(np.int64),
        join([np.full(len(o), nan) if o.named_share is None else o.named_share for o in series]),
        rule_inputs(one),
        "" if one is run else "of its modems, the one with most readings counts",
    )


def _devices(run: Run, salt: str, logger: str | None, digest: str) -> tuple[str, str]:
    """Pseudonym of the modem and name of the logger; an unknown modem is like no other."""
    known = modem_identity(run)
    modem = pseudonym(logger or digest if known is None else known, salt)
    return modem, logger or modem


def _channels(run: Run) -> dict[str, tuple[tuple[int, int], ...]]:
    rows = run.named_readings
    names, cell = numbered_texts(rows["cell"])
    sure = rows["identity_unsure"] == 0
    cells = [name.decode() for name in names]
    found: dict[str, list[tuple[int, int]]] = {}
    for name, channel, code in channels_heard(rows[sure], cell[sure], cells):
        found.setdefault(name, []).append((channel, code))
    found.pop("", None)
    return {name: tuple(pairs) for name, pairs in found.items()}


def with_name(path: Path, error: Exception) -> str:
    """What is wrong with a file, beginning with its name."""
    text = str(error)
    return text if str(path) in text else f"{path}: {text}"
