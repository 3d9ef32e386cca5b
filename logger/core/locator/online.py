"""The locator reading by reading, in bounded time and memory, for the device.

It has fewer squares than the desktop program (`EFFORT`) and one set of at most `MOST_BLOCKS` blocks
for short and long noise. Each search weighs all hypotheses of the noise. Until the next one the
positions stay fixed and only the plausible hypotheses are kept; a reading then costs one row of the
whitened system for each (`bordered_sums`). The posterior is computed after every reading at first,
after every eighth one later.
"""

from dataclasses import replace
from statistics import median
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray, SingleArray
from logger.core.locator.bordered_sums import BorderedSums, station_rows
from logger.core.locator.joint_evidence import log_weights_at
from logger.core.locator.mixture import Mixture, mixture
from logger.core.locator.observables import observables
from logger.core.locator.position_evidence import with_possible_exponent
from logger.core.locator.posterior import Mode
from logger.core.locator.preparation import LocatorInput
from logger.core.locator.quadtree import Effort, Tree
from logger.core.locator.region import Squares, mode_regions
from logger.core.locator.search import Walk, search_once
from logger.core.locator.summary import BIAS_SHARE, moments_over
from logger.core.locator.symmetry import Curve, fit_curve
from logger.core.model.area import WalkArea
from logger.core.model.blocks import (
    FINEST_BLOCK_M,
    NOTHING_CENSORED,
    Blocks,
    Censored,
    gather,
    in_fewer_places,
    single,
)
from logger.core.model.evidence import Evidence, mix_stations
from logger.core.model.marginal import marginal
from logger.core.model.prior import Prior, Station
from logger.core.places import Places
from logger.core.readings import Readings, in_order

MOST_BLOCKS = 100
FEWEST_BLOCKS = 4
EFFORT = Effort(most_squares=500, split_share=0.02, nodes=1, first_share=1.0, samples=0, densest=0)

_MOST_CENSORED = 40  # points: their covariance is inverted at each search
_LEAST_MASS = 1e-5  # probability of a position that stays between searches
_PLAUSIBLE = 0.01  # probability relative to the likeliest hypothesis, of one that stays
_ALIKE = 0.1  # of the evidence of stations: the walk does not tell them apart
_NEW_SHARE = 32  # one reading more in so many changes the posterior by far less than its width
_LONGEST_WAIT = 8  # readings, a second each: nobody sees an estimate older than that
_GROWN = 1.4  # times as many blocks or censored points: a new search is due
_TURNED = 2.0  # urgency where the walk has left its curve, or the mass its modes
_MODE_LEVEL = 0.99
_MOST_READINGS = 1024  # of an hour's walk; answers of the device and the desktop are from the same
JOINED = 32  # single readings, a kilobyte each, take ten times the memory of those in one array


class _Searched(NamedTuple):
    """Positions (h,) of the last search, hypotheses (c,) not ruled out, and their sums.

    `prior` has the stations not ruled out, `label` (h,) the mode of a position (-1: none), `gone`
    (c, h) what censored readings add to the log evidence (None: nothing), `log_weight` (c,) as in
    `Tree`.
    """

    square: FloatArray
    log_mass: FloatArray
    numbers: IntArray
    sums: BorderedSums
    label: IntArray
    gone: FloatArray | None
    log_weight: FloatArray | None
    prior: Prior


class _Evaluated(NamedTuple):
    """What is kept of the evidence, which can be computed again."""

    walk: FloatArray  # (5, n)
    near_db: SingleArray | None  # sigma (c, h) of one reading ago, where the fit begins
    sigma_db: SingleArray
    probability: FloatArray
    by_hypothesis: FloatArray
    mode: Mode | None


class ReadingsInOrder:
    """Readings of a walk in order; if there are too many, every second one is dropped."""

    def __init__(self) -> None:
        self._kept: list[Readings] = []
        self._every = 1
        self._count = 0

    def add(self, latest: Readings) -> None:
        """Add the next reading."""
        if self._count % self._every == 0:
            self._kept.append(latest)
        self._count += 1
        if self._count == self._every * _MOST_READINGS:
            every = in_order(self._kept)
            self._kept = [every.part(np.arange(len(every)) % 2 == 0)]
            self._every *= 2
        elif len(self._kept) > JOINED:
            self._kept = [in_order(self._kept)]

    def readings(self) -> Readings:
        """Those that are left, without spikes."""
        return replace(in_order(self._kept), without_spikes=True)


class OnlineLocator:
    """Posterior of one transmitter after each reading; call `search` when `stale` exceeds 1.

    Positions are searched in the area `where`, which grows with the walk.
    `level_sigma_db` is the standard deviation of a level with the latest `strongest_mode`.
    """

    def __init__(self, prior: Prior, where: WalkArea | None = None) -> None:
        self._prior = prior
        self._where = where or WalkArea(None)
        self._white = np.array([h.white_share for h in prior.hypotheses])
        self._apart_m = np.array([h.decorrelation_m for h in prior.hypotheses])
        self._block = np.zeros(
            (5, MOST_BLOCKS)
        )  # means of x, y, level, variance of position; count
        self._curve: Curve | None = None  # that the track may be, by the last search
        self._n = 0
        self._size_m = FINEST_BLOCK_M
        self._gone: list[tuple[float, ...]] = []
        self._n_gone = 0  # censored points so far, as if none were merged
        self._searched: _Searched | None = None
        self._n_searched = self._gone_searched = 0
        self._sigma_db = np.full(
            len(prior.hypotheses), prior.sigma_db
        )  # where readings are censored
        self._evaluated: _Evaluated | None = None
        self.level_sigma_db = prior.sigma_db
        self._lost = False
        self._strongest: Readings | None = None
        self.readings = ReadingsInOrder()
        self._n_readings = self._n_evaluated = 0

    @property
    def prior(self) -> Prior:
        """The prior of the next search."""
        return replace(self._prior, area=self._where.area)

    @property
    def stale(self) -> float:
        """How urgent a new search is; above 1 it is due."""
        if self._n < FEWEST_BLOCKS:
            return 0.0
        if self._searched is None:
            return float(self._n)
        if self._lost or (
            self._curve is not None and not self._curve.holds(self._block[:2, : self._n])
        ):
            return _TURNED
        if self._where.has_outgrown(self._prior.area):
            return _TURNED
        of_blocks = self._n / max(_GROWN * self._n_searched, 1.0)
        of_censored = self._n_gone / max(_GROWN * self._gone_searched, FEWEST_BLOCKS)
        return max(of_blocks, of_censored)

    def take(self, latest: Readings) -> None:
        """Take a reading that is no spike."""
        place, level_dbm = latest.places, latest.level_dbm.item()
        x_m, y_m, position_sigma_m = place.x_m.item(), place.y_m.item(), place.sigma_m.item()
        self.readings.add(latest)
        if self._strongest is None or level_dbm > self._strongest.level_dbm.item():
            self._strongest = latest
        if latest.limit.item():
            self._censor(latest)
            return
        if self._n and max(
            abs(x_m - self._block[0, self._n - 1]), abs(y_m - self._block[1, self._n - 1])
        ) <= (0.5 * self._size_m):
            last = self._block[:, self._n - 1]
            last[4] += 1.0
            last[:4] += (np.array([x_m, y_m, level_dbm, position_sigma_m**2]) - last[:4]) / last[4]
        else:
            self._open(np.array([x_m, y_m, level_dbm, position_sigma_m**2, 1.0]))
        self._n_readings += 1
        waiting = self._n_readings - self._n_evaluated
        if self._searched is not None and waiting >= self._wait:
            near_db = None if self._evaluated is None else self._evaluated.sigma_db
            walk = self._on_curve(0, self._n).copy()
            self._keep(self._searched, walk, _evidence(self._searched, walk, near_db), near_db)

    @property
    def _wait(self) -> int:
        return min(1 + self._n_readings // _NEW_SHARE, _LONGEST_WAIT)

    def search(self) -> None:
        """Search the positions again with all blocks so far."""
        if self._n < FEWEST_BLOCKS:
            return
        self._prior = self.prior
        self._lost = False
        point_m, variance_m2 = self._block[:2, : self._n], self._block[3, : self._n]
        self._curve = fit_curve(point_m, np.sqrt(variance_m2))
        walk = single(self._on_curve(0, self._n), self._size_m, self._censored_points())
        tree = search_once(walk, self._prior, EFFORT, log_weight=self._hypothesis_weights(walk))
        mixed = tree.mixture(self._prior)
        retained = np.flatnonzero(mixed.probability > _LEAST_MASS)
        alive = np.flatnonzero(mixed.by_hypothesis > _PLAUSIBLE * np.max(mixed.by_hypothesis))
        square = np.stack([tree.x_m, tree.y_m, tree.size_m])[:, retained]
        cells = Squares(square[0], square[1], square[2], mixed.probability[retained])
        label = np.full(len(retained), -1)
        for k, indices in enumerate(mode_regions(cells, _MODE_LEVEL)):
            label[indices] = k
        log_mass = (tree.log_prior + 2.0 * np.log(tree.size_m))[retained]
        prior = replace(self._prior, stations=self._plausible_stations(tree, mixed))
        searched = self._start(square, log_mass, tree.numbers[alive], label, prior)
        self._n_searched, self._gone_searched = self._n, self._n_gone
        so_far = self._on_curve(0, self._n).copy()
        evidence = _evidence(searched, so_far, None)
        if tree.log_weight is not None:
            gone = tree.evidence.log_p[np.ix_(alive, retained)] - evidence.log_p
            searched = searched._replace(gone=gone, log_weight=tree.log_weight[alive])
            evidence = evidence._replace(log_p=evidence.log_p + gone)
        self._keep(searched, so_far, evidence, None)

    def _plausible_stations(self, tree: Tree, mixed: Mixture) -> tuple[Station, ...]:
        """Stations that are not ruled out; one of those that the walk does not tell apart.

        Far from the walk all heights explain the levels alike, and the first stands for all.
        """
        stations = self._prior.stations
        share = np.einsum("ch,sch->s", mixed.share, tree.evidence.station)
        gain = share / np.array([one.probability for one in stations])
        kept: dict[int, float] = {}
        for k, station in enumerate(stations):
            alike = [
                i
                for i in kept
                if stations[i].antenna_db == station.antenna_db
                and abs(gain[i] - gain[k]) < _ALIKE * max(gain[i], gain[k])
            ]
            if alike:
                kept[alike[0]] += station.probability
            elif not k or share[k] > _PLAUSIBLE * np.max(share):  # the first stands for all
                kept[k] = station.probability
        return tuple(stations[k]._replace(probability=one) for k, one in kept.items())

    def _hypothesis_weights(self, walk: Blocks) -> FloatArray | None:
        """Log weights at the likeliest position; None where no reading is censored."""
        if self._searched is None or self._evaluated is None or not len(walk.censored.places):
            return None
        x_m, y_m, size_m = self._searched.square
        best = int(np.argmax(self._evaluated.probability / size_m**2))
        at = Places.of(x_m[best], y_m[best])
        log_weight, self._sigma_db = log_weights_at(walk, self._prior, at, self._sigma_db)
        hopeless = log_weight < np.max(log_weight) + np.log(_PLAUSIBLE)
        return np.where(hopeless, -np.inf, log_weight)

    def last_search(self) -> tuple[LocatorInput, Tree] | None:
        """The walk and its tree as the desktop has them, for `summarise`; None without a search.

        Without the share outside of an area, which takes another search.
        """
        if self._searched is None or self._evaluated is None or self._strongest is None:
            return None
        found, of = self._searched, self._evaluated
        x_m, y_m, size_m = found.square
        log_prior = found.log_mass - 2.0 * np.log(size_m)
        evidence, log_weight = _evidence(found, of.walk, of.near_db), found.log_weight
        tree = Tree(x_m, y_m, size_m, log_prior, evidence, found.numbers, log_weight)
        walk = single(self._on_curve(0, self._n), self._size_m, self._censored_points())
        given = Walk(walk, walk, found.prior, EFFORT)
        obs = self.readings.readings()
        if self._curve is not None:
            x_m, y_m = self._curve.project(obs.places.xy_m)
            obs = replace(obs, places=replace(obs.places, x_m=x_m, y_m=y_m))
        seen = observables(obs)
        return LocatorInput(given, found.prior, 0.0, 1, self._strongest, seen), tree

    def strongest_mode(self) -> Mode | None:
        """The mode with most probability at its mean, None before the first search."""
        return None if self._evaluated is None else self._evaluated.mode

    def _mode(self, searched: _Searched, evidence: Evidence, mixed: Mixture) -> Mode | None:
        if self._strongest is None:
            return None
        p, label = mixed.probability, searched.label
        masses = np.bincount(label[label >= 0], p[label >= 0])
        if (
            not np.max(masses, initial=0.0) > 0.0
        ):  # all of it lies outside the modes of the last search
            self._lost = True
            return None
        indices = np.flatnonzero(label == int(np.argmax(masses)))
        state, covariance = moments_over(
            searched.square, evidence, mixed.share, indices, p[indices]
        )
        bias_m2 = BIAS_SHARE * median(self._block[3, : self._n].tolist())
        covariance[[0, 1], [0, 1]] += bias_m2
        self.level_sigma_db = float(np.sum(mixed.share * evidence.sigma_db))
        place = Places.of(state[0], state[1], utm=self._strongest.utm)
        return Mode(float(np.max(masses)), 1.0, state, covariance, place)

    def noise(self) -> tuple[float, float]:
        """White share and decorrelation distance in metres, means over the hypotheses."""
        if self._searched is None or self._evaluated is None:
            return 1.0, 0.0
        share, numbers = self._evaluated.by_hypothesis, self._searched.numbers
        return float(share @ self._white[numbers]), float(share @ self._apart_m[numbers])

    def _censor(self, latest: Readings) -> None:
        """Adds to the last point if close; too many points are merged."""
        place, level_dbm = latest.places, latest.level_dbm.item()
        limit, position_sigma_m = latest.limit.item(), place.sigma_m.item()
        x_m, y_m = place.x_m.item(), place.y_m.item()
        if self._gone:
            x0_m, y0_m, dbm, side, count, sigma_m = self._gone[-1]
            if side == limit and np.hypot(x_m - x0_m, y_m - y0_m) <= self._size_m:
                self._gone[-1] = (x0_m, y0_m, dbm, side, count + 1.0, sigma_m)
                return
        self._n_gone += 1
        self._gone.append((x_m, y_m, level_dbm, float(limit), 1.0, position_sigma_m))
        if len(self._gone) > _MOST_CENSORED:
            fewer = in_fewer_places(self._censored_points(), _MOST_CENSORED // 2)
            at, *others = fewer
            columns = (at.x_m, at.y_m, *others, at.sigma_m)
            self._gone = list(zip(*(column.tolist() for column in columns), strict=True))

    def _censored_points(self) -> Censored:
        x_m, y_m, limit_dbm, side, count, sigma_m = np.array(self._gone).reshape(-1, 6).T
        return Censored(Places.of(x_m, y_m, sigma_m=sigma_m), limit_dbm, side, count)

    def _open(self, block: FloatArray) -> None:
        if self._n == MOST_BLOCKS:
            self._coarsen()
        self._block[:, self._n] = block
        self._n += 1

    def _coarsen(self) -> None:
        merged = gather(self._block[:, : self._n], MOST_BLOCKS // 2, NOTHING_CENSORED)
        self._n, self._size_m = len(merged), merged.size_m
        self._block[:, : self._n] = merged.rows
        self.search()

    def _on_curve(self, first: int, end: int) -> FloatArray:
        column = self._block[:, first:end]
        return (
            column
            if self._curve is None
            else np.concatenate([self._curve.project(column[:2]), column[2:]])
        )

    def _start(
        self,
        square: FloatArray,
        log_mass: FloatArray,
        numbers: IntArray,
        label: IntArray,
        prior: Prior,
    ) -> _Searched:
        """The last block is still open and left out."""
        closed = single(self._on_curve(0, self._n - 1), self._size_m, NOTHING_CENSORED)
        sums = BorderedSums(prior, numbers, Places.of(*square[:2]), closed, MOST_BLOCKS)
        return _Searched(square, log_mass, numbers, sums, label, None, None, prior)

    def _keep(
        self, searched: _Searched, walk: FloatArray, evidence: Evidence, near_db: SingleArray | None
    ) -> None:
        self._searched, self._n_evaluated = searched, self._n_readings
        numbers, log_weight = searched.numbers, searched.log_weight
        mixed = mixture(evidence.log_p, searched.log_mass, numbers, self._prior, log_weight)
        mode = self._mode(searched, evidence, mixed)
        of_mixture = mixed.probability, mixed.by_hypothesis
        sigma_db = evidence.sigma_db.astype(np.float32)
        self._evaluated = _Evaluated(walk, near_db, sigma_db, *of_mixture, mode)


def _evidence(searched: _Searched, walk: FloatArray, near_db: SingleArray | None) -> Evidence:
    # of the blocks `walk` (5, n); `near_db` is as in `marginal`
    totals, log_det = searched.sums.over(walk)
    prior, numbers = searched.prior, searched.numbers
    everywhere = np.arange(searched.square.shape[1])
    parts: list[Evidence] = []
    for one, total, rows in zip(prior.stations, totals, station_rows(prior, numbers), strict=True):
        of_rows = None if near_db is None else near_db[rows].astype(float)
        alone = prior.of_station(one)
        found = marginal(total, walk.shape[1], log_det[rows], alone, EFFORT.nodes, of_rows)
        found = with_possible_exponent(found, prior.least_eta)
        parts.append(parts[0].replace(rows, everywhere, found) if parts else found)
    found = parts[0]
    if len(parts) > 1:
        found = mix_stations(parts, prior.station_log_odds[:, numbers])
    return found if searched.gone is None else found._replace(log_p=found.log_p + searched.gone)
