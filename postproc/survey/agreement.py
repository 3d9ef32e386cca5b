"""Loggers that contradict the others on the ground that they share.

In a block of 50 m in which others have heard a cell too, a logger's mean level is compared with the
median of the others'. A logger whose differences are large and alike has other levels; one whose
differences scatter more than those of everybody else was not where it says. Both are named and left
out. Nothing can be said of a logger that walked where nobody else did.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.observations import CellObservations
from postproc.comparison.ground import BLOCK_M
from postproc.survey.alignment import levels_by_place

_FEWEST_OTHERS = 2
_FEWEST_BLOCKS = 30
"""Of all cells: fewer tell too little to accuse somebody."""
FEWEST_LOGGERS = 3
_MOST_DB = 15.0
"""3GPP TS 45.008, 8.1.2, allows 6 dB: of 2000 loggers that differ by 4.2 dB, one is beyond."""
_NOTED_DB = 11.0
"""One honest logger of 100. What it reads higher is subtracted, so it counts; but its owner should
look at the antenna and the settings, or it lies."""
_MOST_SCATTER = 3.0
"""Times that of the median logger.

In three synthetic cities honest loggers had up to 2.2 times, one that was 500 m off 5 times.
"""
_MAD = 1.4826


class Agreement(NamedTuple):
    """A logger against the others in the blocks of one cell: median and scatter of differences."""

    logger: str
    n_blocks: int
    offset_db: float
    scatter_db: float


class LoggerReport(NamedTuple):
    """A logger against all others; `contradiction` is empty where nothing speaks against it.

    `remark` says of a logger that counts what is unusual about it.
    """

    logger: str
    n_blocks: int
    offset_db: float
    scatter_db: float
    contradiction: str = ""
    remark: str = ""


def agreements(obs: CellObservations, loggers: Sequence[str]) -> list[Agreement]:
    """Each logger against the others; `obs.modem` numbers the `loggers`."""
    if obs.modem is None or len(loggers) < FEWEST_LOGGERS:
        return []
    levels = levels_by_place(obs, obs.modem, BLOCK_M)
    table = np.full((int(np.max(levels.place, initial=-1)) + 1, len(loggers)), np.nan)
    table[levels.place, levels.modem] = levels.level_dbm
    table = table[np.count_nonzero(np.isfinite(table), axis=1) > _FEWEST_OTHERS]
    found = []
    for number, logger in enumerate(loggers):
        here = np.isfinite(table[:, number])
        others = np.delete(table[here], number, axis=1)
        if np.any(here):
            difference_db = table[here, number] - np.nanmedian(others, axis=1)
            offset_db = float(np.median(difference_db))
            scatter_db = _MAD * float(np.median(np.abs(difference_db - offset_db)))
            found.append(Agreement(logger, len(difference_db), offset_db, scatter_db))
    return found


def report(found: Sequence[Agreement]) -> list[LoggerReport]:
    """Each logger over all cells, by name, with what speaks against it."""
    by_logger: dict[str, list[Agreement]] = {}
    for one in found:
        by_logger.setdefault(one.logger, []).append(one)
    loggers = [_over_cells(logger, some) for logger, some in sorted(by_logger.items())]
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


def _over_cells(logger: str, some: Sequence[Agreement]) -> LoggerReport:
    """Medians over cells, each weighted by its blocks."""
    weight = np.array([one.n_blocks for one in some], float)
    offset_db = _weighted_median(np.array([one.offset_db for one in some]), weight)
    scatter_db = _weighted_median(np.array([one.scatter_db for one in some]), weight)
    return LoggerReport(logger, int(np.sum(weight)), offset_db, scatter_db)


def _weighted_median(values: FloatArray, weight: FloatArray) -> float:
    order = np.argsort(values, kind="stable")
    half = int(np.searchsorted(np.cumsum(weight[order]), 0.5 * np.sum(weight)))
    return float(values[order][min(half, len(order) - 1)])


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
