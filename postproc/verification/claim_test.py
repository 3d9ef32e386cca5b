"""One claim against the posterior of a cell.

S is the probability of all positions that are less likely than the claim: 1 - the level of the
smallest region of the posterior that contains it. The density of an uncertain claim is its mean
over the claim's positions. Regions hold the truth a little more often than they say, so on measured
walks S of the true place is not uniform: the p-value is about the share of measured walks with a
smaller one. With the readings of several walks it is the same.

The power needs no simulated walks: the transmitter is where the posterior says, so a claim that is
some distance off is rejected as often as, on average over the posterior, a position so far from
there is.
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
_LEAST = 1e-12
_APART_M = 6.0
_FEWEST_PLACES = 32
_MOST_PLACES = 256
_GOLDEN_RAD = np.pi * (3.0 - 5.0**0.5)
_LEAST_M, _FARTHEST_M, _TRIED = 10.0, 30_000.0, 25
"""Displacements tried, up to the reach of the prior."""
_DRAWS = 300
"""Positions of the transmitter that the power is a mean over."""
_NEARLY = 0.9


@dataclass(frozen=True)
class ClaimTest:
    """The test of one claim of equally likely positions (2, k) in the squares of a posterior.

    `has_area`: the prior of the posterior has one.
    """

    squares: Squares
    claim: FloatArray
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
        return float(self._tails(np.mean(self._densities(self.claim), keepdims=True))[0])

    def power(self, displacement_m: FloatArray, p_fa: float) -> FloatArray:
        """Probability that a claim so far off, (d,), is rejected, by azimuth; shape (8, d)."""
        azimuth = np.radians(BEARINGS_DEG)
        way = np.stack([np.sin(azimuth), np.cos(azimuth)])
        at = self._truths[:, None, None] + way[:, :, None, None] * displacement_m[:, None]
        tails = self._tails(self._densities(at.reshape(2, -1)))
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

    @cached_property
    def _truths(self) -> FloatArray:
        """Where the transmitter may stand, equally likely: (2, t), evenly over the probability."""
        share = (np.arange(_DRAWS) + 0.5) / _DRAWS
        order = np.argsort(-self.squares.density, kind="stable")
        cumulative = np.cumsum(self.squares.probability[order])
        chosen = order[np.searchsorted(cumulative, share * cumulative[-1])]
        within = np.random.default_rng(0).uniform(-0.5, 0.5, (2, _DRAWS))
        centres = np.stack([self.squares.x_m, self.squares.y_m])[:, chosen]
        return np.asarray(centres + within * self.squares.size_m[chosen], float)

    @cached_property
    def _by_density(self) -> tuple[FloatArray, FloatArray]:
        """Densities ascending, and the probability of all squares up to each."""
        density = self.squares.density
        order = np.argsort(density, kind="stable")
        return density[order], np.cumsum(self.squares.probability[order])

    def _tails(self, density: FloatArray) -> FloatArray:
        """S (n,) of positions with some densities; what is less likely than all is ordered too."""
        ascending, cumulative = self._by_density
        count = np.searchsorted(ascending, density, side="right")
        less = np.where(count > 0, cumulative[np.maximum(count - 1, 0)], 0.0) / cumulative[-1]
        return np.asarray(np.minimum(less + _LEAST * density / ascending[-1], 1.0), float)

    def _densities(self, at: FloatArray) -> FloatArray:
        """Probability per square metre at positions (2, n); 0 outside of the searched area."""
        found = np.zeros(at.shape[1])
        squares, density = self.squares, self.squares.density
        corner = np.array([[np.min(squares.x_m)], [np.min(squares.y_m)]])
        centres = np.stack([squares.x_m, squares.y_m])
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


def around(place: Places, sigma_m: float) -> FloatArray:
    """Equally likely places (2, k) of a normal claim, or the place alone.

    They lie on the spiral of a sunflower, which leaves no hole (Vogel, Math. Biosci. 44, 1979), the
    closer together the less a walk may know a place by.
    """
    if sigma_m <= 0.0:
        return place.xy_m
    k = int(np.clip((sigma_m / _APART_M) ** 2, _FEWEST_PLACES, _MOST_PLACES))
    radius = sigma_m * np.sqrt(-2.0 * np.log(1.0 - (np.arange(k) + 0.5) / k))
    angle = _GOLDEN_RAD * np.arange(k)
    away = radius * np.stack([np.cos(angle), np.sin(angle)])
    return np.asarray(place.xy_m + away - np.mean(away, axis=1, keepdims=True), float)
