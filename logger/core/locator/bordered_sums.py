"""Sums over the blocks of a walk that grows, at fixed positions, for each hypothesis and station.

A new block is conditioned on all earlier ones: its row of W = R^-1 is [-k' K^-1, 1] / s with
s^2 = k_nn - k' K^-1 k (bordered Cholesky factor), and the sums of `marginal` grow by that row.
"""

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.model.blocks import NOTHING_CENSORED, Blocks, single
from logger.core.model.columns import receiver_variance, varying_columns
from logger.core.model.elimination import packed_index
from logger.core.model.marginal import SharedSums, walk_sums
from logger.core.model.noise import (
    correlation,
    independent_variance,
    matrices_of,
    shares,
    whiteners,
)
from logger.core.model.prior import Prior
from logger.core.places import Places

_ROWS = 8  # room for more blocks: a square of all that may come takes a third of a cell's memory
_LEAST_VARIANCE = 1e-12  # of a block given all others, by sigma^2: above rounding errors


class BorderedSums:
    """Sums over the first blocks of a walk, to which others are added one by one.

    Positions (h,), hypotheses `numbers` (c,) and the prior's stations do not change; at most `most`
    blocks are held.
    """

    def __init__(
        self,
        prior: Prior,
        numbers: IntArray,
        positions: Places,
        closed: Blocks,
        most: int,
    ) -> None:
        hypotheses = [prior.hypotheses[number] for number in numbers]
        noises = whiteners(closed, prior, numbers.tolist())
        matrices = matrices_of(noises)
        self._prior, self._rows = prior, len(closed)
        self._scales_m = sorted({scale_m for h in hypotheses for _, scale_m in shares(h)})
        self._share = np.zeros((len(numbers), len(self._scales_m)))
        for i, hypothesis in enumerate(hypotheses):
            for share, scale_m in shares(hypothesis):
                self._share[i, self._scales_m.index(scale_m)] += share
        self._white_share = np.array([h.white_share for h in hypotheses])
        self._whitener = matrices
        self._log_det = np.array([noise.log_det for noise in noises])
        self._shared = SharedSums.of(prior, np.isfinite(prior.station_log_odds[:, numbers]))
        rows_of = [self._shared.rest, *station_rows(prior, numbers)[1:]]
        self._stations: list[_StationSums] = []
        of_height: dict[float, FloatArray] = {}
        for one, rows_of_station in zip(prior.stations, rows_of, strict=True):
            alone = prior.of_station(one)
            station = _StationSums(alone, closed, matrices, positions, most, rows_of_station)
            station.columns[0] = of_height.setdefault(alone.height_m, station.columns[0])
            self._stations.append(station)

    def over(self, walk: FloatArray) -> tuple[list[FloatArray], FloatArray]:
        """Sums (m + 1, k, h) of each station and log |K| (c, 1); the last block is still open.

        k are the station's hypotheses (`station_rows`).

        `walk` (5, n) has rows x, y, level, variance of the position, readings.
        """
        for k in range(self._rows, walk.shape[1] - 1):
            row, variance = self._conditional(walk[:, : k + 1])
            if k == self._whitener.shape[1]:
                self._whitener = np.pad(self._whitener, ((0, 0), (0, _ROWS), (0, _ROWS)))
            self._whitener[:, k, : k + 1] = row
            for station in self._stations:
                station.total = station.total + station.of_last(row, walk[:, : k + 1])
            self._log_det = self._log_det + np.log(variance)
            self._rows = k + 1
        row, variance = self._conditional(walk)
        log_det = self._log_det + np.log(variance)
        totals = [station.total + station.of_last(row, walk) for station in self._stations]
        if len(self._shared.rows):
            totals[0] = self._shared.join(totals[0], totals[self._shared.patterned])
        return totals, log_det[:, None]

    def _conditional(self, walk: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Row of W (c, n) of the last block, and its variance given all others (c,)."""
        x, y, _, _, readings = walk
        before = self._whitener[:, : len(x) - 1, : len(x) - 1]
        apart_m = np.hypot(x[:-1] - x[-1], y[:-1] - y[-1])
        each = [correlation(apart_m, scale_m) for scale_m in self._scales_m]
        between = self._share @ np.reshape(each, (len(each), len(apart_m)))
        known = np.matmul(before, between[..., None])[..., 0]
        alone = independent_variance(readings[-1], self._white_share, self._prior.sigma_db)
        variance = 1.0 - self._white_share + alone - np.sum(known**2, axis=1)
        variance = np.maximum(variance, _LEAST_VARIANCE)
        row = np.ones((len(variance), len(x)))
        row[:, :-1] = -np.matmul(known[:, None], before)[:, 0]
        return row / np.sqrt(variance)[:, None], variance


def station_rows(prior: Prior, numbers: IntArray) -> list[IntArray]:
    """Which of the hypotheses `numbers` (c,) each station is possible under."""
    return [np.flatnonzero(np.isfinite(odds)) for odds in prior.station_log_odds[:, numbers]]


class _StationSums:
    def __init__(
        self,
        prior: Prior,
        closed: Blocks,
        matrices: FloatArray,
        positions: Places,
        most: int,
        rows: IntArray,
    ) -> None:
        self._prior, self._positions, self._rows = prior, positions, rows
        # the most memory of a device's cell: in single precision L is off by a millionth of a dB
        self.columns: list[FloatArray] = []
        for column in varying_columns(closed, prior, positions):
            self.columns.append(np.zeros((most, len(positions)), np.float32))
            self.columns[-1][: len(closed)] = column
        self.total = walk_sums(closed, matrices[rows], prior, positions)

    def of_last(self, row: FloatArray, walk: FloatArray) -> FloatArray:
        """Sums of the last block of a walk (5, n); `row` (c, n) is its row of W."""
        k = walk.shape[1] - 1
        last = single(walk[:, k:], 0.0, NOTHING_CENSORED)
        varying = varying_columns(last, self._prior, self._positions)
        for column, value in zip(self.columns, varying, strict=True):
            column[k] = value[0]
        extra = receiver_variance(last, self._prior, -varying[0])
        return _row_sums(row[self._rows], walk[2], self.columns, extra)


def _row_sums(
    row: FloatArray, level_dbm: FloatArray, columns: list[FloatArray], extra: FloatArray | None
) -> FloatArray:
    """As `marginal.sums` for one row of each hypothesis: (m + 1, c, h)."""
    varying = [row @ column[: row.shape[1]] for column in columns]
    fixed = row @ level_dbm, np.sum(row, axis=1)
    white = [*(value[:, None] for value in fixed), *varying]
    weight = np.ones_like(varying[0])
    if extra is not None:
        weight /= 1.0 + row[:, -1:] ** 2 * extra
    total = np.empty((packed_index(len(white), 0) + 1, *weight.shape))
    for i, one in enumerate(white):
        weighted = weight * one
        for j in range(i + 1):
            np.multiply(weighted, white[j], out=total[packed_index(i, j)])
    np.log(weight, out=total[-1])
    total[-1] *= 0.5
    return total
