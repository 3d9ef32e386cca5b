"""Sums over the blocks of a walk that grows, at fixed positions, for each hypothesis and station.

A new block is conditioned on all earlier ones: its row of W = R^-1 is [-k' K^-1, 1] / s with
s^2 = k_nn - k' K^-1 k (bordered Cholesky factor), and the sums of `marginal` grow by that row.
"""

from collections.abc import Sequence
from math import prod
from mmap import MAP_ANONYMOUS, MAP_PRIVATE, mmap

import numpy as np

from logger.core.arrays import FloatArray, IntArray, SingleArray
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
from logger.core.model.prior import Prior, Station
from logger.core.places import Places

_STRIP = 16  # rows of W as long as the last of them: zeros take memory, short strips time
# W and the columns are kept in single precision, which moves positions by 3e-5 m at most; the sums
# are not: their differences then move positions by 10 m
_LINE = 64  # bytes, of the cache
_LEAST_VARIANCE = 1e-12  # of a block given all others, by sigma^2: above rounding errors
_IN_CACHE = 16_384  # entries of columns multiplied at once: smaller than what malloc maps


class BorderedSums:
    """Sums over the first blocks of a walk, to which others are added one by one.

    Positions (h,), hypotheses `numbers` (c,) and the prior's stations do not change; at most `most`
    blocks are held.
    """

    def __init__(
        self, prior: Prior, numbers: IntArray, positions: Places, closed: Blocks, most: int
    ) -> None:
        hypotheses = [prior.hypotheses[number] for number in numbers]
        noises = whiteners(closed, prior, numbers.tolist())
        matrices = matrices_of(noises)
        self._prior, self._positions, self._rows = prior, positions, len(closed)
        self._scales_m = sorted({scale_m for h in hypotheses for _, scale_m in shares(h)})
        self._share = np.zeros((len(numbers), len(self._scales_m)))
        for i, hypothesis in enumerate(hypotheses):
            for share, scale_m in shares(hypothesis):
                self._share[i, self._scales_m.index(scale_m)] += share
        self._white_share = np.array([h.white_share for h in hypotheses])
        self._log_det = np.array([noise.log_det for noise in noises])
        self._shared = SharedSums.of(prior, np.isfinite(prior.station_log_odds[:, numbers]))
        self._fields = _fields(prior)
        found = [varying_columns(closed, of_field, positions) for of_field in self._fields]
        heights_m = [of_field.height_m for of_field in self._fields]
        self._rows_of = [self._shared.rest, *station_rows(prior, numbers)[1:]]
        self._columns_of: list[slice] = []
        totals: list[FloatArray] = []
        for one, rows in zip(prior.stations, self._rows_of, strict=True):
            k = heights_m.index(one.height_m)
            own, first = found[k][: 1 + 2 * len(one.antenna_db)], sum(map(len, found[:k]))
            self._columns_of.append(slice(first, first + len(own)))
            alone = prior.of_station(one)
            totals.append(walk_sums(closed, matrices[rows], alone, positions, own))
        columns = [column for columns in found for column in columns]
        wide, ends = (most, len(positions)), range(_STRIP, most + _STRIP, _STRIP)
        singles = [*[wide] * len(columns), *((len(numbers), _STRIP, end) for end in ends)]
        kept, self._totals = _in_one_piece(singles, [total.shape for total in totals])
        self._columns, self._strips = kept[: len(columns)], kept[len(columns) :]
        for column, value in zip(self._columns, columns, strict=True):
            column[: len(value)] = value
        for total, value in zip(self._totals, totals, strict=True):
            total[:] = value
        for k in range(self._rows):
            self._add_row(k, matrices[:, k, : k + 1])

    def over(self, walk: FloatArray) -> tuple[list[FloatArray], FloatArray]:
        """Sums (m + 1, k, h) of each station and log |K| (c, 1); the last block is still open.

        k are the station's hypotheses (`station_rows`).

        `walk` (5, n) has rows x, y, level, variance of the position, readings.
        """
        for k in range(self._rows, walk.shape[1] - 1):
            row, variance = self._conditional(walk[:, : k + 1])
            self._add_row(k, row)
            for total, of_block in zip(
                self._totals, self._of_last(row, walk[:, : k + 1]), strict=True
            ):
                np.add(total, of_block, out=total)
            self._log_det = self._log_det + np.log(variance)
            self._rows = k + 1
        row, variance = self._conditional(walk)
        log_det = self._log_det + np.log(variance)
        each = zip(self._totals, self._of_last(row, walk), strict=True)
        totals = [np.add(total, of_block, out=of_block) for total, of_block in each]
        if len(self._shared.rows):
            totals[0] = self._shared.join(totals[0], totals[self._shared.patterned])
        return totals, log_det[:, None]

    def _conditional(self, walk: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Row of W (c, n) of the last block, and its variance given all others (c,)."""
        x, y, _, _, readings = walk
        apart_m = np.hypot(x[:-1] - x[-1], y[:-1] - y[-1])
        each = [correlation(apart_m, scale_m) for scale_m in self._scales_m]
        between = self._share @ np.reshape(each, (len(each), len(apart_m)))
        known = _times_lower(self._strips, between)
        alone = independent_variance(readings[-1], self._white_share, self._prior.sigma_db)
        variance = 1.0 - self._white_share + alone - np.sum(known**2, axis=1)
        variance = np.maximum(variance, _LEAST_VARIANCE)
        row = np.ones((len(variance), len(x)))
        row[:, :-1] = -_times_upper(self._strips, known)
        return row / np.sqrt(variance)[:, None], variance

    def _add_row(self, k: int, row: FloatArray) -> None:
        strip, at = divmod(k, _STRIP)
        self._strips[strip][:, at, : k + 1] = row

    def _of_last(self, row: FloatArray, walk: FloatArray) -> list[FloatArray]:
        """Sums of each station over the last block of a walk (5, n); `row` (c, n) is that of W."""
        n = walk.shape[1]
        last = single(walk[:, n - 1 :], 0.0, NOTHING_CENSORED)
        whitened: list[FloatArray] = []
        extras: list[FloatArray | None] = []
        for of_field in self._fields:
            varying = varying_columns(last, of_field, self._positions)
            extra = receiver_variance(last, of_field, -varying[0])
            for value in varying:
                column = self._columns[len(whitened)]
                column[n - 1] = value[0]
                whitened.append(_times(row, column[:n]))
                extras.append(extra)
        fixed = row @ walk[2], np.sum(row, axis=1)
        totals = []
        for rows, used in zip(self._rows_of, self._columns_of, strict=True):
            white = [value[rows, None] for value in fixed]
            white += [value[rows] for value in whitened[used]]
            totals.append(_row_sums(white, row[rows, -1:], extras[used.start]))
        return totals


def station_rows(prior: Prior, numbers: IntArray) -> list[IntArray]:
    """Which of the hypotheses `numbers` (c,) each station is possible under."""
    return [np.flatnonzero(np.isfinite(odds)) for odds in prior.station_log_odds[:, numbers]]


def _fields(prior: Prior) -> list[Prior]:
    # of each height the station with most harmonics: others have some of its columns
    of_height: dict[float, Station] = {}
    for one in prior.stations:
        before = of_height.setdefault(one.height_m, one)
        if len(one.antenna_db) > len(before.antenna_db):
            of_height[one.height_m] = one
    return [prior.of_station(one) for one in of_height.values()]


def _in_one_piece(
    singles: Sequence[tuple[int, ...]], doubles: Sequence[tuple[int, ...]]
) -> tuple[list[SingleArray], list[FloatArray]]:
    # zeros, in pages of their own: in the heap, among arrays of a search, they leave holes, and
    # rows that are not set yet take memory
    sizes = [*(4 * prod(one) for one in singles), *(8 * prod(one) for one in doubles)]
    begin = np.cumsum([0, *(-(-size // _LINE) * _LINE for size in sizes)]).tolist()
    piece = np.frombuffer(mmap(-1, begin[-1], MAP_PRIVATE | MAP_ANONYMOUS), np.uint8)
    parts = [piece[first:][:size] for first, size in zip(begin, sizes, strict=False)]
    n = len(singles)
    return (
        [part.view(np.float32).reshape(one) for part, one in zip(parts[:n], singles, strict=True)],
        [part.view(np.float64).reshape(one) for part, one in zip(parts[n:], doubles, strict=True)],
    )


def _times_lower(strips: list[SingleArray], column: FloatArray) -> FloatArray:
    # W (c, n, n) times (c, n)
    padded = _padded(column)
    product = np.zeros_like(padded)
    for first in range(0, column.shape[1], _STRIP):
        strip, end = strips[first // _STRIP], first + _STRIP
        product[:, first:end] = np.matmul(strip.astype(float), padded[:, :end, None])[..., 0]
    return product[:, : column.shape[1]]


def _times_upper(strips: list[SingleArray], column: FloatArray) -> FloatArray:
    # W' times (c, n)
    padded = _padded(column)
    product = np.zeros_like(padded)
    for first in range(0, column.shape[1], _STRIP):
        strip, end = strips[first // _STRIP], first + _STRIP
        product[:, :end] += np.matmul(padded[:, None, first:end], strip.astype(float))[:, 0]
    return product[:, : column.shape[1]]


def _padded(column: FloatArray) -> FloatArray:
    # (c, n) with zeros up to the end of a strip
    c, n = column.shape
    padded = np.zeros((c, -(-n // _STRIP) * _STRIP))
    padded[:, :n] = column
    return padded


def _times(rows: FloatArray, column: SingleArray) -> FloatArray:
    # rows (c, n) times a column (n, h), in double precision
    product = np.empty((len(rows), column.shape[1]))
    at_once = _IN_CACHE // len(column)
    for first in range(0, column.shape[1], at_once):
        some = slice(first, first + at_once)
        np.matmul(rows, column[:, some].astype(float), out=product[:, some])
    return product


def _row_sums(
    white: list[FloatArray], diagonal: FloatArray, extra: FloatArray | None
) -> FloatArray:
    """As `marginal.sums` for one row of each hypothesis: (m + 1, c, h)."""
    # `white` has the whitened level and columns, (c, 1) or (c, h), `diagonal` (c, 1) is that of W
    weight = np.ones(white[-1].shape)
    if extra is not None:
        weight /= 1.0 + diagonal**2 * extra
    total = np.empty((packed_index(len(white), 0) + 1, *weight.shape))
    for i, one in enumerate(white):
        weighted = weight * one
        for j in range(i + 1):
            np.multiply(weighted, white[j], out=total[packed_index(i, j)])
    np.log(weight, out=total[-1])
    total[-1] *= 0.5
    return total
