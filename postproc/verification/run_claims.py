"""Every claim about the cells of a run, with the false discovery rate controlled.

Over m claims the p-values are adjusted by Benjamini and Hochberg (J. R. Statist. Soc. B 57(1),
1995): of the claims rejected at most the share `p_fa` is rejected wrongly, on average. A claim that
is not rejected is "consistent" only where the walk would notice some displacement.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.certainty import OnMap, metres
from logger.core.errors import ConfigError
from logger.core.locator.pipeline import locate
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import Squares, with_distant
from logger.core.locator.verdict import contradiction_of, outside_text
from logger.core.model.prior import Prior
from logger.core.places import Places
from logger.core.readings import Readings
from logger.core.runfile import Run
from postproc.cell_work import Failure, attempt
from postproc.ground import apart_m, places_of
from postproc.multi_run import (
    in_one_zone,
    merge,
    modems_of,
    parts_by_cell,
    parts_of_most_heard_modems,
)
from postproc.progress import Progress
from postproc.result import Result
from postproc.scan_counts import check_observed, observed_cells, scans_of, too_rarely
from postproc.smoothing import too_few
from postproc.verification.claims import (
    LEAST_P,
    CellVerdict,
    Claim,
    Detectable,
    Verdict,
    Verified,
    read_claims,
    swap_hint,
)
from postproc.walk import observe_run

# A true claim is the transmitter's place with the claim's own error. So true claims have the
# density of the posterior smeared by that error, and S is the probability of all that are less
# likely than this one. Regions hold the truth a little more often than they say, so on measured
# walks S of the true place is not uniform: the p-value is about the share of measured walks with a
# smaller one.
#
# The power needs no simulated walks: a claim that is some distance off is rejected as often as, on
# average over the posterior, a true one that is moved so far.

POWER = 0.95
BEARINGS_DEG = (0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)

_EXPONENT = 1.1
"""Of S, whose power is the p-value: 5 % of 62 measured transmitters are then rejected at .05.

Within an area there is no such reserve, and S is the p-value.
"""
_DISTANT = 0.8
"""Of the transmitters at a place: where more are distant, a claim is tested among such ones too.

True places of masts 2 to 8 km away are then rejected in .43 instead of .95 of simulated walks, and
claims displaced by five times the distance in .46 instead of .51 of measured ones; with .5 in .28
and .41.
"""
_LEAST_M, _FARTHEST_M, _TRIED = 10.0, 30_000.0, 25
"""Displacements tried, up to the reach of the prior."""
# a displacement by less than 3.9 sigma is not rejected with 95 %, and no square is farther away
_VAGUEST_M = _FARTHEST_M / 3.0
_DRAWS = 300  # true claims that the power is a mean over
_SAMPLE = round(1.0 / LEAST_P)
"""True claims that S is a share of: below one in so many it only orders."""
_NEGLIGIBLE = 1e-6
"""Of the probability: the squares that hold no more together are left out of a sum over all."""
_BLUR = 0.5
"""Standard deviation of what a square adds, by its side: with less, the sum ripples."""
_CHUNK = 256
"""Positions whose distance from every square is in memory at once."""
_NEARLY = 0.9


@dataclass(frozen=True)
class ClaimTest:
    """The test of claims of `sigma_m` per axis in the squares of a posterior.

    `has_area`: the prior of the posterior has one. `distant_share` (h,) is the posterior's: where
    it is large, a claim is tested among distant transmitters too.
    """

    squares: Squares
    sigma_m: float = 0.0
    has_area: bool = False
    distant_share: FloatArray | None = None

    @classmethod
    def of(cls, posterior: Posterior, sigma_m: float = 0.0) -> "ClaimTest":
        """The test in a posterior."""
        has_area = posterior.prior.area is not None
        share = None if has_area else posterior.distant_share
        return cls(posterior.squares, sigma_m, has_area, share)

    def p_values(self, tail: FloatArray) -> FloatArray:
        """Of S; both of one shape."""
        return np.asarray(tail if self.has_area else tail**_EXPONENT, float)

    def p(self, place: Places) -> float:
        """Of a claim."""
        if self._is_distant(place.xy_m)[0]:
            return self.p_if_distant(place)
        return float(self.p_values(np.array(self.tail(place))))

    def p_if_distant(self, place: Places) -> float:
        """Of a claim, where some transmitters are distant."""
        return self.p(place) if self._if_distant is None else self._if_distant.p(place)

    def tail(self, place: Places) -> float:
        """S of a claim."""
        return float(self._tails(self._densities(place.xy_m))[0])

    def power(self, displacement_m: FloatArray, p_fa: float) -> FloatArray:
        """Probability that a claim so far off, (d,), is rejected, by azimuth; shape (8, d)."""
        azimuth = np.radians(BEARINGS_DEG)
        way = np.stack([np.sin(azimuth), np.cos(azimuth)])
        moved_m = way[..., None, None] * displacement_m[:, None]
        at = self._true_claims(_DRAWS)[:, None, None] + moved_m
        p = self.p_by_square(at.reshape(2, -1))
        return np.asarray(np.mean((p <= p_fa).reshape(at.shape[1:]), axis=-1), float)

    def detectable(self, p_fa: float) -> tuple[float | None, tuple[Detectable, ...]]:
        """Displacements that are detected: whatever their direction, and for each azimuth."""
        if self.sigma_m > _VAGUEST_M:
            return None, tuple(Detectable(deg, None, None, _FARTHEST_M) for deg in BEARINGS_DEG)
        radius_m = np.geomspace(_LEAST_M, _FARTHEST_M, _TRIED)
        shares = self.power(radius_m, p_fa)
        directions = tuple(
            Detectable(deg, *_crossing(radius_m, row), _FARTHEST_M)
            for deg, row in zip(BEARINGS_DEG, shares, strict=True)
        )
        return _crossing(radius_m, np.mean(shares, axis=0))[0], directions

    def _true_claims(self, count: int) -> FloatArray:
        """Claims that may be true, equally likely: (2, count), evenly over the probability."""
        share, rng = (np.arange(count) + 0.5) / count, np.random.default_rng(0)
        order = np.argsort(-self.squares.density, kind="stable")
        cumulative = np.cumsum(self.squares.probability[order])
        chosen = order[np.searchsorted(cumulative, share * cumulative[-1])]
        within = rng.uniform(-0.5, 0.5, (2, count)) * self.squares.size_m[chosen]
        error_m = self.sigma_m * rng.standard_normal((2, count))
        return np.asarray(_centres(self.squares)[:, chosen] + within + error_m, float)

    @cached_property
    def _ascending(self) -> FloatArray:
        return np.sort(self._densities(self._true_claims(_SAMPLE)))

    def _tails(self, density: FloatArray) -> FloatArray:
        """S (n,) of claims with some densities; what is less likely than all is ordered too."""
        ascending = self._ascending
        n_less = np.searchsorted(ascending, density, side="right")
        n_less = np.maximum(n_less, np.minimum(density / ascending[0], 1.0))
        return np.asarray(n_less / len(ascending), float)

    def _densities(self, at: FloatArray) -> FloatArray:
        """Density of true claims at positions (2, n), per square metre."""
        p, centres = self.squares.probability, _centres(self.squares)
        ascending = np.argsort(p)
        kept = ascending[np.cumsum(p[ascending]) > _NEGLIGIBLE]
        variance_m2 = self.sigma_m**2 + (_BLUR * self.squares.size_m[kept]) ** 2
        weight, (x_m, y_m) = p[kept] / (2.0 * np.pi * variance_m2), centres[:, kept]
        found = np.empty(at.shape[1])
        for first in range(0, len(found), _CHUNK):
            some = slice(first, first + _CHUNK)
            away2 = (at[0, some, None] - x_m) ** 2 + (at[1, some, None] - y_m) ** 2
            found[some] = np.exp(-0.5 * away2 / variance_m2) @ weight
        return found

    @cached_property
    def _density_of_squares(self) -> FloatArray:
        return self._densities(_centres(self.squares))

    @cached_property
    def _if_distant(self) -> "ClaimTest | None":
        if self.distant_share is None:
            return None
        return ClaimTest(with_distant(self.squares, self.distant_share), self.sigma_m)

    def _is_distant(self, at: FloatArray) -> BoolArray:
        """Whether a transmitter at positions (2, n) would rather be a distant one."""
        if self.distant_share is None:
            return np.zeros(at.shape[1], bool)
        return np.append(self.distant_share > _DISTANT, False)[self._square_around(at)]

    def p_by_square(self, at: FloatArray) -> FloatArray:
        """Of claims at positions (2, n), by the density of the square around; 0 outside of all."""
        density = np.append(self._density_of_squares, 0.0)[self._square_around(at)]
        p = self.p_values(self._tails(density))
        is_distant = self._is_distant(at)
        if self._if_distant is not None and np.any(is_distant):
            p[is_distant] = self._if_distant.p_by_square(at[:, is_distant])
        return p

    def _square_around(self, at: FloatArray) -> IntArray:
        """Index of the square around each of the positions (2, n); -1 outside of all."""
        found = np.full(at.shape[1], -1)
        squares, centres = self.squares, _centres(self.squares)
        corner = np.min(centres, axis=1, keepdims=True)
        for side_m in np.unique(squares.size_m).tolist():
            alike = np.flatnonzero(squares.size_m == side_m)
            # squares of one side lie on one grid
            origin = centres[:, alike[:1]] - 0.5 * side_m
            first = np.floor((corner - origin) / side_m) - 1.0
            keys = _keys((centres[:, alike] - origin) / side_m - first)
            order = np.argsort(keys)
            wanted = _keys((at - origin) / side_m - first)
            place = np.minimum(np.searchsorted(keys[order], wanted), len(alike) - 1)
            match = order[place]
            is_in = keys[match] == wanted
            found[is_in] = alike[match[is_in]]
        return found


def _centres(squares: Squares) -> FloatArray:
    return np.stack([squares.x_m, squares.y_m])


def _keys(steps: FloatArray) -> IntArray:
    """One number for each cell of a grid, (2, n) -> (n,); -1 beyond it."""
    column, row = np.floor(np.clip(steps, -1.0, 2.0**30)).astype(np.int64)
    return np.where((column < 0) | (row < 0), -1, (column << 31) + row)


def _crossing(radius: FloatArray, share: FloatArray) -> tuple[float | None, float | None]:
    """Where the share first reaches 95 %, and where it later falls below 90 %.

    Between the radii it is interpolated by their logarithm.
    """
    reached = np.flatnonzero(share >= POWER)
    if not len(reached):
        return None, None
    k = int(reached[0])
    again = np.flatnonzero(share[k:] < _NEARLY)
    blind = float(radius[k + again[0]]) if len(again) else None
    if k == 0:
        return float(radius[0]), blind
    part = (POWER - share[k - 1]) / (share[k] - share[k - 1])
    return float(radius[k - 1] * (radius[k] / radius[k - 1]) ** part), blind


_LEAST_DISTANCE_M, _MOST_DISTANCES = 25.0, 20.0
"""A walk that notices nothing within so many times the claim's distance from it confirms nothing;
it counts as if it had not passed closer.
"""


# --- all claims of a run ---


# what claims of one cell and sigma share, which takes nearly all of the time
_Shared = tuple[ClaimTest, tuple[float | None, tuple[Detectable, ...]]]


def verify_cell(
    obs: Readings,
    claim: Claim,
    p_fa: float,
    prior: Prior,
    posteriors: dict[str, Posterior | None] | None = None,
    tests: dict[tuple[str, float], _Shared] | None = None,
) -> CellVerdict:
    """Test of a claim; the verdict is open until the p-values of all claims are adjusted.

    `posteriors` by cell, with this prior, and `tests` are kept for other claims.
    """
    usable = obs.usable()
    if why := too_few(obs, usable):
        return undecided_verdict(obs.cell, len(obs), claim, why)
    posteriors, tests = {} if posteriors is None else posteriors, {} if tests is None else tests
    posterior = posteriors[obs.cell] = posteriors.get(obs.cell) or locate(usable, prior)
    if why := contradiction_of(posterior):
        return undecided_verdict(obs.cell, len(obs), claim, why)
    area = posterior.prior.area
    supposed = () if area is None else (f"if it is {area.text}: {outside_text(posterior)}",)
    place = Places.of_degrees(claim.lat_deg, claim.lon_deg, utm=obs.utm)
    # the lasting part of the receiver's error displaces a true claim as well
    lasting_m = float(np.median(usable.places.sigma_m))
    sigma_m = float(np.hypot(claim.sigma_m, lasting_m))
    key = obs.cell, sigma_m
    if key not in tests:
        test = ClaimTest.of(posterior, sigma_m)
        tests[key] = test, test.detectable(p_fa)
    test, (notices_m, power) = tests[key]
    distance_m, p = float(np.min(usable.places.distances_m(place))), test.p(place)
    if p <= p_fa < test.p_if_distant(place):
        supposed = ("if it is no distant mast: the levels alone fit this place too",)
    return CellVerdict(
        obs.cell,
        len(obs),
        claim,
        "cannot tell",
        supposed,
        followed="indirect",
        p=p,
        p_indirect=p,
        level=1.0 - test.tail(place),
        distance_m=distance_m,
        best_deg=obs.utm.to_latlon(posterior.x_m, posterior.y_m),
        power=power,
        notices_m=notices_m,
    )


def undecided_verdict(
    cell: str, n: int, claim: Claim, why: str, error: str | None = None
) -> CellVerdict:
    """A claim that cannot be tested, or whose test failed."""
    return CellVerdict(cell, n, claim, "cannot tell", (why,), error=error)


_MAP_M = 100_000.0
"""Within a few of these a UTM zone is true to a thousandth; beyond, distances are geodesic."""


def verify_claims(
    runs: Run | Sequence[Run],
    claims: Sequence[Claim],
    p_fa: float,
    prior: Prior,
    only: Sequence[str] | None = None,
    *,
    file: Path | None = None,
    result: Result | None = None,
    progress: Progress | None = None,
) -> Verified:
    """Verdicts on all claims about the cells of runs, or about the cells in `only`.

    `file` has more; `result` is that of `smooth` for these runs and the prior, if known.
    Raises `ConfigError` for a cell that was not observed and for a rate outside 0 to 0.5.
    """
    if not 0.0 < p_fa <= 0.5:
        raise ConfigError(f"a false-alarm rate lies between 0 and 0.5, not at {p_fa:g}")
    runs = [runs] if isinstance(runs, Run) else list(runs)
    every_cell, others = observed_cells(runs, None), list[str]()
    check_observed(only or (), every_cell)
    every = [cell for cell in every_cell if not only or cell in only]
    if file is not None:
        in_file, others = read_claims(file, every)
        claims = [*claims, *in_file]
    observed = result.runs if result else in_one_zone([observe_run(run) for run in runs])
    posteriors = {cell.cell: cell.posterior for cell in result.cells} if result else {}
    tracks = [one.observations.track for one in observed if one.observations]
    if prior.area is not None and tracks:
        prior = replace(prior, area=prior.area.at(tracks))
    modems, of_cells = modems_of(runs), parts_by_cell(observed, every_cell)
    by_name = {
        cell: [merge(parts_of_most_heard_modems(near, modems), modems) for near in places_of(parts)]
        for cell, parts in of_cells.items()
    }
    rarely = {cell: why for cell, n in scans_of(runs).items() if (why := too_rarely(n))}
    check_observed((claim.cell for claim in claims if claim.cell), every_cell)
    pairs = [(cell, claim) for claim in claims for cell in ([claim.cell] if claim.cell else every)]
    walk = tracks[0].median.on_map if tracks else None
    tests: dict[tuple[str, float], _Shared] = {}

    def test(cell: str, claim: Claim) -> CellVerdict:
        places = by_name.get(cell, [])
        if cell in rarely or not places:
            why = rarely.get(cell, "none of its readings has both a level and a position")
            return undecided_verdict(cell, sum(map(len, places)), claim, why)
        if len(places) > 1:  # each has a transmitter of its own
            return verify_cell(_nearest(places, claim), claim, p_fa, prior)
        return verify_cell(places[0], claim, p_fa, prior, posteriors, tests)

    def on_earth(verdict: CellVerdict) -> CellVerdict:
        return verdict if walk is None else _geodesic(verdict, walk)

    def test_or_why_not(cell: str, claim: Claim) -> CellVerdict:
        verdict = attempt(cell, "the test of its claim", lambda: on_earth(test(cell, claim)))
        if not isinstance(verdict, Failure):
            return verdict
        n = sum(map(len, by_name.get(cell, ())))
        return undecided_verdict(cell, n, claim, verdict.reason, verdict.error)

    names = [cell for cell, _ in pairs]
    each = (test_or_why_not(*pair) for pair in pairs)
    verdicts = list(progress(each, "verifying", len(names), names) if progress else each)
    return Verified(
        p_fa,
        _adjust(verdicts, p_fa),
        tuple(cell for cell in every if cell not in {*names, *rarely}),
        tuple(warning for one in observed for warning in one.warnings),
        tuple(cell for cell in every if cell in rarely),
        tuple(cell for cell in others if cell not in every_cell),
    )


def benjamini_hochberg(p: FloatArray) -> FloatArray:
    """Adjusted p-values, shape (m,) as `p`."""
    order = np.argsort(p)[::-1]
    rank = np.arange(len(p), 0, -1)
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum.accumulate(p[order] * len(p) / rank)
    return np.minimum(adjusted, 1.0)


def _nearest(places: Sequence[Readings], claim: Claim) -> Readings:
    return min(places, key=lambda obs: apart_m((claim.at, obs.places.on_map)))


def _geodesic(verdict: CellVerdict, walk: OnMap) -> CellVerdict:
    """With a distance that is true off the map, and a hint for a far claim."""
    claim = verdict.claim
    if verdict.distance_m is not None and verdict.distance_m > _MAP_M:
        verdict = replace(verdict, distance_m=apart_m((claim.at, walk)))
    hint = swap_hint(claim, walk)
    return replace(verdict, reasons=(hint, *verdict.reasons)) if hint else verdict


def _adjust(verdicts: Sequence[CellVerdict], p_fa: float) -> tuple[CellVerdict, ...]:
    """The verdicts by their adjusted p-values; a test that failed counts, and rejects nothing."""
    tested = [i for i, verdict in enumerate(verdicts) if verdict.p is not None]
    n_failed = sum(verdict.error is not None for verdict in verdicts)
    q = benjamini_hochberg(np.array([*(verdicts[i].p for i in tested), *[1.0] * n_failed], float))
    q_of = dict(zip(tested, q.tolist(), strict=False))
    return tuple(
        _decide(verdict, q_of[i], p_fa) if i in q_of else verdict
        for i, verdict in enumerate(verdicts)
    )


def _decide(undecided_yet: CellVerdict, q: float, p_fa: float) -> CellVerdict:
    notices_m, distance_m = undecided_yet.notices_m, undecided_yet.distance_m or 0.0
    why = "this walk would notice no claim, however far off"
    if notices_m is not None:
        why = f"this walk would notice a claim that is {metres(notices_m)} off"
    reasons = [why, *undecided_yet.reasons]
    verdict: Verdict = "cannot tell"
    if undecided_yet.p is not None and q <= p_fa:
        verdict = "rejected"
        p = undecided_yet.p
        share = f"fewer than {100.0 * LEAST_P:g}" if p < LEAST_P else f"{100.0 * p:.2g}"
        reasons.append(f"so unlikely a place is the true one in {share} % of all walks")
    elif notices_m is not None:
        is_sharp = notices_m <= _MOST_DISTANCES * max(distance_m, _LEAST_DISTANCE_M)
        verdict = "consistent" if is_sharp else "cannot tell"
    return replace(undecided_yet, verdict=verdict, q=q, reasons=tuple(reasons))
