"""Loggers that contradict the others on the ground that they share.

In blocks of 50 m in which three or more heard a cell, the offsets of loggers are fitted like those
of modems (`alignment`), and each logger is compared with the median of the others. One with a large
offset has other levels; one whose levels scatter around those of the others was not where it says.
Both are named and left out. A logger that walked alone is not tested.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.readings import Readings
from logger.core.rows import rows_of_each
from postproc.comparison.changes import weighted_median
from postproc.comparison.ground import BLOCK_M
from postproc.estimators.metrics import SIGMA_PER_MAD
from postproc.survey.alignment import (
    PlaceLevels,
    clear_of_floor,
    levels_by_place,
    on_common_ground,
    robust_fit,
)

_FEWEST_BLOCKS = 30
"""Of all cells: fewer tell too little to accuse somebody."""
FEWEST_LOGGERS = 3
_MOST_DB = 15.0
"""3GPP TS 45.008, 8.1.2, allows 6 dB: of 2000 loggers that differ by 4.2 dB, one is beyond."""
_NOTED_DB = 11.0
"""One honest logger of 100. Its offset is subtracted, so it counts; but its antenna or its settings
are unusual, or it lies."""
_MOST_SCATTER = 3.0
"""Times that of the median logger.

In three synthetic cities honest loggers had up to 1.4 times, one that was 500 m off 9 times.
"""


class Agreement(NamedTuple):
    """A logger against the others in the blocks of one cell: its offset, and its scatter.

    Offsets of one cell, in one of the places of its identity, have an unknown constant in common.
    """

    logger: str
    cell: str
    n_blocks: int
    offset_db: float
    scatter_db: float
    place: int = 1


class LoggerReport(NamedTuple):
    """A logger against all others; `contradiction` is empty where nothing speaks against it.

    `remark` says what is unusual about a logger that counts.
    """

    logger: str
    n_blocks: int
    offset_db: float
    scatter_db: float
    contradiction: str = ""
    remark: str = ""


def agreements(obs: Readings, loggers: Sequence[str]) -> list[Agreement]:
    """Each logger against the others; `obs.modem` numbers the `loggers`."""
    if obs.modem is None or len(loggers) < FEWEST_LOGGERS:
        return []
    levels = levels_by_place(obs, obs.modem, BLOCK_M)
    levels = clear_of_floor(levels, np.arange(len(loggers)))
    levels = on_common_ground(levels, FEWEST_LOGGERS)
    modem, offset_db = levels.modem, robust_fit(levels, len(loggers)).offset_db
    free_dbm = levels.level_dbm - offset_db[modem]
    away_db = free_dbm - _median_of_others(levels.place, free_dbm)
    found = []
    for number, rows in rows_of_each(modem):
        own_db = away_db[rows]
        scatter_db = SIGMA_PER_MAD * float(np.median(np.abs(own_db - np.median(own_db))))
        offset = float(offset_db[number])
        found.append(Agreement(loggers[number], obs.cell, len(rows), offset, scatter_db))
    return found


def _median_of_others(place: IntArray, level_dbm: FloatArray) -> FloatArray:
    """For each level (n,) the median of the other levels in its place, of which there are some.

    By ranks: leaving out each level in turn takes a hundred times as long for a hundred loggers.
    """
    order = np.lexsort((level_dbm, place))
    counts = np.bincount(place)
    count, first = counts[place], (np.cumsum(counts) - counts)[place]
    rank = np.argsort(order, kind="stable") - first
    sorted_dbm = level_dbm[order]
    # the others are in the same order without this one; an even number has two in the middle
    n_others = count - 1
    middle = ((n_others - 1) // 2, n_others // 2)
    low_dbm, high_dbm = (sorted_dbm[first + k + (k >= rank)] for k in middle)
    return np.asarray(0.5 * (low_dbm + high_dbm), float)


def report(found: Sequence[Agreement]) -> list[LoggerReport]:
    """Each logger over all cells, by name, with what speaks against it."""
    by_logger: dict[str, list[Agreement]] = {}
    for one in found:
        by_logger.setdefault(one.logger, []).append(one)
    offset_db = _offsets(found)
    loggers = [
        _over_cells(logger, some, offset_db[logger]) for logger, some in sorted(by_logger.items())
    ]
    known = [one for one in loggers if one.n_blocks >= _FEWEST_BLOCKS]
    if len(known) < FEWEST_LOGGERS:
        return loggers
    middle_db = float(np.median([one.offset_db for one in known]))
    usual_db = float(np.median([one.scatter_db for one in known]))
    moved = [one._replace(offset_db=one.offset_db - middle_db) for one in loggers]
    return [
        one._replace(contradiction=_contradiction(one, usual_db), remark=_remark(one, usual_db))
        for one in moved
    ]


def liars(reports: Sequence[LoggerReport]) -> Mapping[str, str]:
    """Names of the loggers to leave out, with what speaks against each."""
    return {one.logger: one.contradiction for one in reports if one.contradiction}


def _offsets(found: Sequence[Agreement]) -> Mapping[str, float]:
    loggers = {name: i for i, name in enumerate(dict.fromkeys(one.logger for one in found))}
    places = dict.fromkeys((one.cell, one.place) for one in found)
    cells = {name: i for i, name in enumerate(places)}
    levels = PlaceLevels(
        np.array([cells[one.cell, one.place] for one in found], np.int64),
        np.array([loggers[one.logger] for one in found], np.int64),
        np.array([one.offset_db for one in found], float),
    )
    return dict(zip(loggers, robust_fit(levels, len(loggers)).offset_db.tolist(), strict=True))


def _over_cells(logger: str, some: Sequence[Agreement], offset_db: float) -> LoggerReport:
    weight = np.array([one.n_blocks for one in some], float)
    scatter_db = weighted_median(np.array([one.scatter_db for one in some]), weight)
    return LoggerReport(logger, int(np.sum(weight)), offset_db, scatter_db)


def _remark(one: LoggerReport, usual_db: float) -> str:
    is_known = one.n_blocks >= _FEWEST_BLOCKS
    if not is_known or abs(one.offset_db) <= _NOTED_DB or _contradiction(one, usual_db):
        return ""
    return f"its levels are {one.offset_db:+.0f} dB from those of the others; that is subtracted"


def _contradiction(one: LoggerReport, usual_db: float) -> str:
    if one.n_blocks < _FEWEST_BLOCKS:
        return ""
    if abs(one.offset_db) > _MOST_DB:
        return f"its levels are {one.offset_db:+.0f} dB from those of the others at the same places"
    if one.scatter_db > _MOST_SCATTER * usual_db:
        return (
            f"its levels do not fit its positions: they scatter by {one.scatter_db:.0f} dB around "
            f"those of the others, who scatter by {usual_db:.0f} dB"
        )
    return ""
