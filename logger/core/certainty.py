"""How sure a position is: ellipses, radii and decimals, relevant modes, and words for these."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, degrees, exp, isfinite, pi, sin, sqrt
from typing import Protocol, Self, TypeVar

from msgspec import Struct
from msgspec.structs import replace

CHI2_95_2DOF = 5.991
RADII = ("most likely within", "surely within")
"""Names of the radii that hold 50 % and 95 %, in sentences and above columns."""
_DIRECTIONS = 32
"""The mean over so many directions of a quarter turn is exact to 1 %."""
_HALVINGS = 30
"""Of the interval of a radius: a billionth of the first."""


@dataclass(frozen=True, slots=True)
class Ellipse:
    """Semi-axes in m; azimuth of the major axis in deg clockwise from grid north, 0 to 180."""

    semi_major_m: float
    semi_minor_m: float
    azimuth_deg: float


def ellipse95(p_xx: float, p_xy: float, p_yy: float) -> Ellipse:
    """Ellipse that holds 95 % of a Gaussian with the given covariance in m^2.

    The squared scale is 5.991, the quantile of chi-square with 2 degrees of freedom.
    """
    mean = 0.5 * (p_xx + p_yy)
    split = sqrt((0.5 * (p_xx - p_yy)) ** 2 + p_xy**2)
    # of the angle east-to-north theta: tan 2 theta = 2 Pxy / (Pxx - Pyy); azimuth = 90 - theta
    azimuth_deg = 90.0 - degrees(0.5 * atan2(2.0 * p_xy, p_xx - p_yy))
    major_m, minor_m = (
        sqrt(max(variance, 0.0) * CHI2_95_2DOF) for variance in (mean + split, mean - split)
    )
    return Ellipse(major_m, minor_m, azimuth_deg % 180.0)


def radius_m(ellipse: Ellipse, level: float) -> float | None:
    """Radius about the centre that holds `level` of a Gaussian with this 95 % ellipse.

    None from a level of 1 on, which no radius holds.
    """
    if level >= 1.0:
        return None
    major_m2, minor_m2 = ellipse.semi_major_m**2, ellipse.semi_minor_m**2
    turns = [0.5 * pi * (i + 0.5) / _DIRECTIONS for i in range(_DIRECTIONS)]
    variances_m2 = [
        max(major_m2 * cos(turn) ** 2 + minor_m2 * sin(turn) ** 2, 1e-12) / CHI2_95_2DOF
        for turn in turns
    ]
    low_m, high_m = 0.0, 10.0 * ellipse.semi_major_m
    for _ in range(_HALVINGS):
        middle_m = 0.5 * (low_m + high_m)
        outside = sum(exp(-0.5 * middle_m**2 / variance_m2) for variance_m2 in variances_m2)
        if outside / _DIRECTIONS > 1.0 - level:
            low_m = middle_m
        else:
            high_m = middle_m
    return high_m


def metres(value_m: float | None) -> str:
    """A length with its significant digits."""
    if value_m is None or not isfinite(value_m):
        return "unknown"
    if value_m < 1000.0:
        return f"{value_m:.0f} m"
    return f"{value_m / 1000.0:.{1 if value_m < 10_000.0 else 0}f} km"


def radii_text(r50_m: float | None, r95_m: float | None) -> str:
    """How far from the position shown the transmitter is: half of the probability, and 95 %.

    Empty, or the first alone, where a radius is unknown.
    """
    named = zip(RADII, (r50_m, r95_m), strict=True)
    return ", ".join(f"{name} {metres(radius)}" for name, radius in named if radius is not None)


# --- degrees ---

DEGREE_DECIMALS = 6
"""0.1 m."""
# of 95 %, up to which a place has 5 and 4 decimals; beyond, what its 50 % radius leaves
_SHARP_M, _ROUGH_M = 150.0, 1000.0
# from this radius on so many: rounding moves a place by 670 m or 67 m at most
_DECIMALS = ((1000.0, 2), (100.0, 3))
_HALF_OF_LEVEL = 0.48
"""Radius with 50 % by that with 95 %, of a Gaussian."""


def decimals_within(r95_m: float, r50_m: float | None = None) -> int:
    """Decimals of the degrees of a place that these radii hold."""
    if r95_m <= _ROUGH_M:
        return 5 if r95_m <= _SHARP_M else 4
    half_m = _HALF_OF_LEVEL * r95_m if r50_m is None else r50_m
    return next((n for least_m, n in _DECIMALS if half_m >= least_m), 4)


class OnMap(Struct, frozen=True, kw_only=True):
    """A place in degrees, WGS 84."""

    lat: float
    lon: float

    def in_short(self) -> Self:
        """As it is shown while walking: to 0.1 m."""
        lat, lon = (round(angle, DEGREE_DECIMALS) for angle in (self.lat, self.lon))
        return replace(self, lat=lat, lon=lon)

    def within(self, r95_m: float, r50_m: float | None = None) -> str:
        """Latitude and longitude as far as known where these radii hold it."""
        decimals = decimals_within(r95_m, r50_m)
        about = "" if r95_m <= _ROUGH_M else "about "
        return f"{about}{self.lat:.{decimals}f} {self.lon:.{decimals}f}"


# --- modes ---

LEAST_PEAK = 0.05
"""A position with this share of the highest density is a mode, however improbable."""
MINOR_MODE = 0.03
"""A mode with this share is relevant, however flat it is."""
LEAST_SHARE = 0.01
"""A mode with less is irrelevant, however sharp: "0 %" would send people the wrong way."""


class Peak(Protocol):
    """What makes a mode relevant: its highest density beside the best, and its probability."""

    @property
    def peak(self) -> float: ...
    @property
    def probability(self) -> float: ...


Ranked = TypeVar("Ranked", bound=Peak)


def relevant_modes(modes: Sequence[Ranked]) -> tuple[Ranked, ...]:
    """The best mode, and those with much probability or a peak that fits nearly as well."""
    return (*modes[:1], *filter(_is_rival, modes[1:]))


def _is_rival(mode: Peak) -> bool:
    is_sharp = mode.peak >= LEAST_PEAK and mode.probability >= LEAST_SHARE
    return is_sharp or mode.probability >= MINOR_MODE


def whole_percents(modes: Sequence[Peak]) -> list[int]:
    """Probabilities of relevant modes in whole percents with the sum of the probabilities.

    The largest remainders are rounded up. None of several modes has 0 or 100.
    """
    exact = [100.0 * mode.probability for mode in modes]
    percents = [int(value) for value in exact]
    missing = round(sum(exact)) - sum(percents)
    by_remainder = sorted(range(len(exact)), key=lambda i: percents[i] - exact[i])
    for i in by_remainder[:missing]:
        percents[i] += 1
    return percents


def relevant_percents(modes: Sequence[Peak]) -> list[int | None]:
    """As `whole_percents`; None of irrelevant modes."""
    relevant = relevant_modes(modes)
    percents = dict(zip(map(id, relevant), whole_percents(relevant), strict=True))
    return [percents.get(id(mode)) for mode in modes]


def share_text(probability: float) -> str:
    """A probability in whole percents, which is never 0 or 100 %."""
    if probability < LEAST_SHARE:
        return "< 1 %"
    return "> 99 %" if probability > 1.0 - LEAST_SHARE else f"{100.0 * probability:.0f} %"


def area_text(area_m2: float) -> str:
    """An area with its significant digits."""
    rounded_m2 = float(f"{area_m2:.2g}")
    if area_m2 >= 100_000.0:
        return f"{rounded_m2 / 1e6:g} km²"
    return f"{rounded_m2:,.0f} m²".replace(",", "\N{NARROW NO-BREAK SPACE}")
