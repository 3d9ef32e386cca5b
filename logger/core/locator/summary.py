"""From the tree to the posterior: modes, median, radius, and means of the other unknowns."""

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.certainty import LEAST_PEAK
from logger.core.locator.alternatives import Alternative, alternatives
from logger.core.locator.mixture import Mixture, log_sum, rows_of_groups
from logger.core.locator.observables import pool
from logger.core.locator.offsets import offsets
from logger.core.locator.packing import around, compact_groups
from logger.core.locator.posterior import Mode, Posterior
from logger.core.locator.preparation import LocatorInput
from logger.core.locator.quadtree import PositionPrior, Tree, nearest_m
from logger.core.locator.region import (
    HALF,
    LEVEL,
    Squares,
    contains,
    highest_density,
    mode_regions,
)
from logger.core.model.evidence import PAIRS, Evidence
from logger.core.model.prior import Prior
from logger.core.places import Places, Utm

BIAS_SHARE = 1.0
"""Share of the variance of the receiver's position that lasts for the walk."""
END_OF_REACH = 0.7
"""Beyond this part of the prior's reach a position is at the end of the searched area."""
DISTANT_SHARE, DISTANT_M = 0.1, 10_000.0
"""Of the transmitters, those that the prior's reaches leave out: masts in open country."""

_MODE_LEVEL = 0.999
"""Modes are the separate parts of the region with this probability."""
_LEAST_MODE = 0.01
"""A mode with this probability is listed, however flat it is."""
_LEAST_BLUR_M = 0.5
"""A displacement smaller than the smallest square is not applied."""
_LEAST_SHARE = 1e-6
"""Less probable squares are not blurred: 10 000 of them have 1 % together."""
_BLUR_REACH = 4.0
"""Squares larger than this many standard deviations of the blur would not change."""
_BLUR_SIGMAS = 7.0
"""Farther than this many standard deviations the blur carries nothing: less than 1e-10."""
_CORNER_SHARE = 0.4
"""Probability, in much noise, that what is found is a corner that the waves come around (ITU-R
P.1411): a walk that crosses the transmitter's street finds the crossing.
"""
_CORNER_M = 35.0  # of the transmitter from that corner: standard deviation per axis
_CORNER_NOISE_DB = 6.5  # sigma at which a corner is half as probable
_CORNER_NOISE_WIDTH_DB = 0.7
"""Without corners 10 of 47 located at street level are wrong, with them 2 of 48
(`benchmarks/streets.py`).
"""
_BESIDE_WALK_M = 25.0
"""A position this close to the walk is beside the street that was walked."""
_PLAUSIBLE_SHARE = 0.8
"""Of a mode. With a half, of 31 measured walks past a transmitter, four are 16 to 35 m worse and
one is 31 m better."""
_MEDIAN_TURNS = 30
"""Weiszfeld's iteration halves its error in a turn or two."""


def summarise(task: LocatorInput, tree: Tree) -> Posterior:
    """Step 4: the posterior of the leaves of a tree."""
    walk, evidence = task.walk, _on_recorded_scale(tree.evidence, task.mean_dbm)
    mixed = pool(tree.mixture(walk.prior), tree.squares, task.seen)
    bias_m = float(np.sqrt(BIAS_SHARE) * np.median(walk.blocks.places.sigma_m))
    p = _displace(task.prior, tree, evidence, mixed, bias_m)
    squares = Squares(tree.x_m, tree.y_m, tree.size_m, p)
    regions = _regions(task, squares, evidence, mixed)
    modes = tuple(mode for mode, _ in regions)
    place = modes[0].place
    between_modems = None
    if task.n_modems > 1:
        of_first = regions[0][1]
        between_modems = offsets(walk.blocks, walk.prior, tree, mixed, of_first, task.n_modems)
    mean, covariance = moments_over(tree.squares, evidence, mixed.share, np.arange(len(p)), p)
    r50_m, r95_m = _radii_m(squares, place)
    away_m = nearest_m(walk.blocks, Places.of(tree.x_m, tree.y_m))
    reach = _reach_share(task, tree)
    return Posterior(
        squares=squares,
        modes=modes,
        place=place,
        r50_m=r50_m,
        r95_m=r95_m,
        drms_m=_drms_m(squares, place),
        p0_dbm=float(mean[2]),
        p0_sigma_db=float(np.sqrt(covariance[2, 2])),
        eta=float(mean[3]),
        eta_sigma=float(np.sqrt(covariance[3, 3])),
        sigma_db=float(np.sum(mixed.share * evidence.sigma_db)),
        noise_probability=_noise_probability(task, tree, mixed),
        station_probability=np.einsum("ch,sch->s", mixed.share, evidence.station),
        reach_probability=reach @ p,
        strongest=task.strongest,
        limit_share=float(np.sum(p[away_m > END_OF_REACH * walk.prior.reach_m])),
        distant_share=_distant_share(task.prior, tree, away_m),
        log_evidence=mixed.log_evidence,
        prior=task.prior,
        offsets=between_modems,
        alternatives=_alternatives(walk.prior, tree, mixed, reach, squares),
        outside_share=task.outside_share,
    )


def outside_share(task: LocatorInput, everywhere: Tree) -> float | None:
    """Probability outside of the prior's area, by a tree searched without it."""
    if task.prior.area is None:
        return None
    mixed = pool(everywhere.mixture(task.walk.prior), everywhere.squares, task.seen)
    return 1.0 - float(task.prior.area.share(everywhere.squares) @ mixed.probability)


def moments_over(
    square: FloatArray, evidence: Evidence, share: FloatArray, indices: IntArray, mass: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean (4,) and covariance (4, 4) of [x, y, P0, eta] over the squares `indices`.

    `square` (3, h) has rows x, y, side, `share` (c, h) the joint probability of hypothesis and
    square, `mass` the probability of the chosen squares. The covariance adds that between and
    within squares, and that of P0 and eta given the position.
    """
    position, side_m = square[:2, indices], square[2, indices]
    share = np.take(share, indices, axis=-1)
    theta = np.take(evidence.theta[:2], indices, axis=-1)
    theta_cov = np.take(evidence.theta_cov, indices, axis=-1)
    total = share.sum(axis=0)
    weight = mass / mass.sum()
    joint = share * (weight / np.where(total > 0.0, total, 1.0))
    mean = np.concatenate([position @ weight, [np.vdot(joint, v) for v in theta]])
    from_mean = position - mean[:2, None]
    theta_off = theta - mean[2:, None, None]
    weighted_off = joint * theta_off
    within_m2 = float(weight @ side_m**2) / 12.0
    v00, v01, v11 = (
        np.vdot(joint, v) + np.vdot(weighted_off[i], theta_off[k])
        for v, (i, k) in zip(theta_cov, PAIRS, strict=True)
    )
    covariance = np.empty((4, 4))
    covariance[:2, :2] = (weight * from_mean) @ from_mean.T + np.eye(2) * within_m2
    covariance[:2, 2:] = from_mean @ weighted_off.sum(axis=1).T
    covariance[2:, :2] = covariance[:2, 2:].T
    covariance[2:, 2:] = [[v00, v01], [v01, v11]]
    return mean, covariance


def _on_recorded_scale(evidence: Evidence, mean_dbm: float) -> Evidence:
    """Adds `mean_dbm`, which was subtracted from all levels, to P0."""
    theta = evidence.theta.copy()
    theta[0] += mean_dbm
    return evidence._replace(theta=theta)


def _regions(
    task: LocatorInput, squares: Squares, evidence: Evidence, mixed: Mixture
) -> list[tuple[Mode, IntArray]]:
    """Modes with much probability or a high peak, and their squares, the likeliest first."""
    square = np.stack([squares.x_m, squares.y_m, squares.size_m])
    highest = float(np.max(squares.density))
    regions = []
    for indices in mode_regions(squares, _MODE_LEVEL):
        p = squares.probability[indices]
        mass = float(np.sum(p))
        peak = float(np.max(squares.density[indices])) / highest
        if mass >= _LEAST_MODE or peak >= LEAST_PEAK:
            moments = moments_over(square, evidence, mixed.share, indices, p)
            place = _place(task, squares, indices)
            regions.append((Mode(mass, peak, *moments, place), indices))
    return sorted(regions, key=lambda region: -region[0].probability)


def _distance_m(squares: Squares, place: Places) -> FloatArray:
    return np.hypot(squares.x_m - place.x_m, squares.y_m - place.y_m)


def _radii_m(squares: Squares, place: Places) -> tuple[float, float]:
    """Radii with 50 % and 95 %."""
    p, distance_m = squares.probability, _distance_m(squares, place)
    order = np.argsort(distance_m)
    last = np.searchsorted(np.cumsum(p[order]), [HALF, LEVEL])
    outer_m = np.hypot(distance_m, 0.5 * squares.size_m)[order]
    r50_m, r95_m = outer_m[np.minimum(last, len(p) - 1)].tolist()
    return min(r50_m, r95_m), r95_m  # a large square near the point may reach farther


def _drms_m(squares: Squares, place: Places) -> float:
    within_m2 = squares.size_m**2 / 6.0  # mean square distance from the centre of a square
    mean_m2 = np.sum(squares.probability * (_distance_m(squares, place) ** 2 + within_m2))
    return float(np.sqrt(mean_m2))


def _reach_share(task: LocatorInput, tree: Tree) -> FloatArray:
    """Shape (r, h)."""
    squares = tree.squares
    each = PositionPrior(task.walk.blocks, task.walk.prior, squares).log_by_reach(squares)
    return np.asarray(np.exp(each - log_sum(each.T)), float)


def _distant_share(prior: Prior, tree: Tree, away_m: FloatArray) -> FloatArray:
    """Distant transmitters stand anywhere within `DISTANT_M` of the walk, squares `away_m` (h,)."""
    if prior.area is not None:
        return np.zeros(len(away_m))
    mass, room = np.exp(tree.log_mass(0.0)), np.where(away_m < DISTANT_M, tree.size_m**2, 0.0)
    distant = DISTANT_SHARE * room / np.sum(room)
    return np.asarray(distant / (distant + (1.0 - DISTANT_SHARE) * mass / np.sum(mass)), float)


def _alternatives(
    prior: Prior, tree: Tree, mixed: Mixture, reach: FloatArray, squares: Squares
) -> tuple[Alternative, ...]:
    groups = [rows for rows, _ in rows_of_groups(tree.numbers, prior)]
    of_reach = np.stack([reach * np.sum(mixed.share[rows], axis=0) for rows in groups])
    given = tree.evidence.station
    of_station = np.stack(
        [np.einsum("ch,sch->sh", mixed.share[rows], given[:, rows]) for rows in groups]
    )
    return alternatives(prior, squares, of_reach, of_station)


def _noise_probability(task: LocatorInput, tree: Tree, mixed: Mixture) -> FloatArray:
    """Shape (c,); 0 for hypotheses that the tree does not have."""
    probability = np.zeros(len(task.walk.prior.hypotheses))
    probability[tree.numbers] = mixed.by_hypothesis
    return probability


def _displace(
    prior: Prior, tree: Tree, evidence: Evidence, mixed: Mixture, bias_m: float
) -> FloatArray:
    """Probability (h,) after an error of the receiver and a corner."""
    steepness = (evidence.sigma_db - _CORNER_NOISE_DB) / _CORNER_NOISE_WIDTH_DB
    around_corner = np.sum(mixed.share * (_CORNER_SHARE / (1.0 + np.exp(-steepness))), axis=0)
    room_m2 = tree.size_m**2
    if prior.area is not None:
        room_m2 *= prior.area.share(tree.squares)
    direct = _blur(tree, mixed.probability - around_corner, bias_m, room_m2)
    return direct + _blur(tree, around_corner, float(np.hypot(bias_m, _CORNER_M)), room_m2)


def _blur(tree: Tree, p: FloatArray, sigma_m: float, room_m2: FloatArray) -> FloatArray:
    """After a displacement of this standard deviation; `room_m2` (h,) is where it may lead."""
    if sigma_m < _LEAST_BLUR_M:
        return p
    is_small = tree.size_m < _BLUR_REACH * sigma_m
    targets = np.flatnonzero(is_small)
    sources = np.flatnonzero(is_small & (p > _LEAST_SHARE))
    blurred = p.copy()
    blurred[sources] = 0.0
    square = tree.squares
    for group in compact_groups(square[:2, sources]):
        rows = sources[group]
        variance_m2 = sigma_m**2 + tree.size_m[rows] ** 2 / 12.0
        reach_m = _BLUR_SIGMAS * float(np.sqrt(np.max(variance_m2)))
        near = targets[around(square[:, targets], square[:, rows], reach_m)]
        x_m, y_m, _ = square[:, rows, None]
        apart_m2 = (x_m - tree.x_m[near]) ** 2 + (y_m - tree.y_m[near]) ** 2
        share = room_m2[near] * np.exp(-0.5 * apart_m2 / variance_m2[:, None])
        blurred[near] += (p[rows] / np.sum(share, axis=1)) @ share
    return blurred


def _place(task: LocatorInput, squares: Squares, mode: IntArray) -> Places:
    """The position to show for a mode, from its squares.

    It is the geometric median of the densest half: the tail of a mode is what the prior allows far
    away. Where that lies beside the walk and the strongest reading was in the densest part
    (`_PLAUSIBLE_SHARE`) of the mode, it is the place of that reading: past transmitters within 50 m
    its median error on measured walks is 30 m, that of the geometric median 50 m. Outside of the
    prior's area it is replaced by the densest square inside.
    """
    strongest = task.strongest.places
    median = _median(squares, highest_density(squares, HALF, mode), strongest.utm)
    plausible = highest_density(squares, _PLAUSIBLE_SHARE, mode)
    is_beside = nearest_m(task.walk.blocks, median)[0] <= _BESIDE_WALK_M
    place = strongest if is_beside and contains(squares, plausible, strongest) else median
    area = task.prior.area
    if area is None or area.beyond_m(place)[0] <= 0.0:
        return place
    centres = Places.of(squares.x_m[plausible], squares.y_m[plausible], utm=strongest.utm)
    inside = np.flatnonzero(area.beyond_m(centres) <= 0.0)
    return centres.part(inside[:1]) if len(inside) else place


def _median(squares: Squares, indices: IntArray, utm: Utm) -> Places:
    """By Weiszfeld's iteration."""
    x_m, y_m = squares.x_m[indices], squares.y_m[indices]
    mass = squares.probability[indices]
    inner_m = squares.size_m[indices] / 3.0  # about the mean distance within a square
    x, y = float(mass @ x_m / np.sum(mass)), float(mass @ y_m / np.sum(mass))
    for _ in range(_MEDIAN_TURNS):
        distance_m = np.hypot(np.hypot(x_m - x, y_m - y), inner_m)
        weight = mass / distance_m
        total = float(np.sum(weight))
        x, y = float(weight @ x_m) / total, float(weight @ y_m) / total
    return Places.of(x, y, utm=utm)
