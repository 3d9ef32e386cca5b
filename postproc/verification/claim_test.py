"""One claim against the posterior of a cell.

A true claim is the transmitter's place with the claim's own error. So true claims have the density
of the posterior smeared by that error, and S is the probability of all that are less likely than
this one. Regions hold the truth a little more often than they say, so on measured walks S of the
true place is not uniform: the p-value is about the share of measured walks with a smaller one.

The power needs no simulated walks: a claim that is some distance off is rejected as often as, on
average over the posterior, a true one that is moved so far.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.region import Squares
from logger.core.places import Places
from postproc.verification.verdicts import Detectable

POWER = 0.95
BEARINGS_DEG = (0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)

_EXPONENT = 1.1
"""Of S, whose power is the p-value: 5 % of 62 measured transmitters are then rejected at .05.

Within an area there is no such reserve, and S is the p-value.
"""
_LEAST_M, _FARTHEST_M, _TRIED = 10.0, 30_000.0, 25
"""Displacements tried, up to the reach of the prior."""
_DRAWS = 300
"""True claims that the power is a mean over."""
_SAMPLE = 2000
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
    """The test of the claim of one place, of `sigma_m` per axis, in the squares of a posterior.

    `has_area`: the prior of the posterior has one.
    """

    squares: Squares
    place: Places
    sigma_m: float = 0.0
    has_area: bool = False

    def p_values(self, tail: FloatArray) -> FloatArray:
        """Of S; both of one shape."""
        return np.asarray(tail if self.has_area else tail**_EXPONENT, float)

    @property
    def p(self) -> float:
        """Of the claim."""
        return float(self.p_values(np.array(self.tail())))

    def tail(self) -> float:
        """S of the claim."""
        return float(self._tails(self._densities(self.place.xy_m))[0])

    def power(self, displacement_m: FloatArray, p_fa: float) -> FloatArray:
        """Probability that a claim so far off, (d,), is rejected, by azimuth; shape (8, d)."""
        azimuth = np.radians(BEARINGS_DEG)
        way = np.stack([np.sin(azimuth), np.cos(azimuth)])
        moved_m = way[..., None, None] * displacement_m[:, None]
        at = self._true_claims(_DRAWS)[:, None, None] + moved_m
        tails = self._tails(self._densities_by_square(at.reshape(2, -1)))
        is_rejected = (self.p_values(tails) <= p_fa).reshape(at.shape[1:])
        return np.asarray(np.mean(is_rejected, axis=-1), float)

    def detectable(self, p_fa: float) -> tuple[float | None, tuple[Detectable, ...]]:
        """Displacements that are detected: whatever their direction, and for each azimuth."""
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

    def _densities_by_square(self, at: FloatArray) -> FloatArray:
        """As `_densities`, that of the square around each position; 0 outside of all."""
        found = np.zeros(at.shape[1])
        squares, density, centres = self.squares, self._density_of_squares, _centres(self.squares)
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
            found[is_in] = density[alike[match[is_in]]]
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
