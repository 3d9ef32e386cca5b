"""What is assumed before the walk: priors of the coefficients, the noise and the position."""

from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.errors import ConfigError
from logger.core.model.area import Area


class Reach(NamedTuple):
    """How far from the walk the transmitter may stand, and how probable this is.

    Within `flat_m` of the walk every position is as probable; beyond, the density falls with the
    distance to the power of `power`, above 2.
    """

    probability: float
    flat_m: float
    power: float


_NEAR = (Reach(0.20, 60.0, 4.0), Reach(0.25, 200.0, 4.0))
_FAR = (Reach(0.30, 500.0, 4.0), Reach(0.25, 1300.0, 5.0))

REACHES = MappingProxyType({"any": (*_NEAR, *_FAR), "near": _NEAR, "far": _FAR})
"""Hypotheses of the distance from the walk, by the name of the reach.

A rogue cell is looked for where it is strong, a mast stands 100 to 1500 m off the road, and one
density for both is too wide or too narrow: with "near" alone 95 % regions held .74 of the
transmitters beyond 800 m of 506 measured walks, with "far" alone the regions of walks past a
transmitter are six times as large. "any" lets the levels decide. The probabilities are relative to
each other.
"""


class Station(NamedTuple):
    """An antenna that the transmitter may have, and how probable it is.

    It stands `height_m` above the receiver. Each harmonic of its pattern has the standard deviation
    `antenna_db`, cosine and sine alike; without any it is omnidirectional.
    """

    probability: float
    height_m: float
    antenna_db: tuple[float, ...] = ()


HEIGHTS_M = (3.0, 10.0, 28.0)
"""Heights above the receiver, equally probable: of a street or first floor, a roof, a mast.

The first stands for all where one is needed. A station on a mast that is passed closely looks like
one farther away and lower.
"""

SECTOR_DB = (9.3,)
"""A sector antenna with a half-power beam width of 65 degrees and 25 dB front to back (3GPP TR
36.942, 4.2.1: -min(12 (b / 65)^2, 25) dB) has first and second harmonics of 13.1 and 4.6 dB. With a
uniform azimuth of the beam, cosine and sine each have that divided by sqrt(2). The other harmonics
count as noise: together with the second they are 3.5 dB rms, and each would be two unknowns more.
"""

_SECTOR_PROBABILITY = 0.2
"""Any walk past an omnidirectional antenna is explained by some pattern from close by:
on 506 measured walks a half made regions miss twice as often as a fifth. With patterns under noise
of two scales only, regions past sector antennas under 6 dB over 15 m held .85, now .97.
"""


def _omni(height_m: float | None) -> tuple[Station, ...]:
    heights_m = HEIGHTS_M if height_m is None else (height_m,)
    return tuple(Station(1.0 / len(heights_m), one) for one in heights_m)


def _sector(height_m: float | None) -> tuple[Station, ...]:
    return (Station(1.0, HEIGHTS_M[0] if height_m is None else height_m, SECTOR_DB),)


def _any(height_m: float | None) -> tuple[Station, ...]:
    each = [(1.0 - _SECTOR_PROBABILITY, _omni(height_m)), (_SECTOR_PROBABILITY, _sector(height_m))]
    return tuple(
        one._replace(probability=share * one.probability) for share, some in each for one in some
    )


ANTENNAS = MappingProxyType({"any": _any, "omni": _omni, "sector": _sector})
"""Stations by the name of the antenna, of one height or (None) of any."""


class Hypothesis(NamedTuple):
    """Covariance of the residuals: a white share, the rest shadowing over one or two distances.

    Of the shadowing, `long_share` is correlated over `long_m`, the rest over `short_m`. The modem
    averages it with a memory of `averaged_m` along the way, less than the other distances.
    """

    white_share: float
    short_m: float = 0.0
    long_share: float = 0.0
    long_m: float = 0.0
    averaged_m: float = 0.0

    @property
    def decorrelation_m(self) -> float:
        """Integral of the shadowing's correlation over distance; 0 where all is white."""
        if self.white_share >= 1.0:
            return 0.0
        mean_m = (1.0 - self.long_share) * self.short_m + self.long_share * self.long_m
        return mean_m + self.averaged_m


WHITE = Hypothesis(1.0)


class NoiseGroup(NamedTuple):
    """Hypotheses that are mixed before their likelihood is raised to the power `trust`.

    `is_coarse`: readings closer than a coarse block tell nothing about the position under these.
    The probabilities of groups are relative to each other.
    """

    trust: float
    hypotheses: tuple[Hypothesis, ...]
    is_coarse: bool = False
    probability: float = 1.0


NOISE = (
    NoiseGroup(1.0, (WHITE,)),
    NoiseGroup(
        0.8,
        (
            Hypothesis(0.05, 10.0),
            Hypothesis(0.05, 18.0),
            Hypothesis(0.05, 30.0),
            Hypothesis(0.3, 30.0),
            Hypothesis(0.7, 30.0),
        ),
    ),
    NoiseGroup(
        0.45,
        (
            Hypothesis(0.05, 10.0, 0.75, 350.0),
            Hypothesis(0.3, 10.0, 0.75, 350.0),
            Hypothesis(0.05, 30.0, 0.75, 350.0),
            Hypothesis(0.3, 30.0, 0.75, 350.0),
            Hypothesis(0.7, 30.0, 0.75, 350.0),
            Hypothesis(0.3, 30.0, 0.75, 100.0),
        ),
        is_coarse=True,
    ),
    NoiseGroup(
        0.8,
        (Hypothesis(0.005, 18.0, averaged_m=2.5), Hypothesis(0.005, 30.0, averaged_m=5.0)),
        is_coarse=True,
        probability=0.02,
    ),
    NoiseGroup(
        0.45,
        (Hypothesis(0.005, 30.0, 0.75, 350.0, averaged_m=12.0),),
        is_coarse=True,
        probability=0.02,
    ),
)
"""White noise; shadowing that changes along a house front; shadowing of two scales; and levels that
the modem averages over 3 to 10 s (3GPP TS 45.008, 6.6.1) of a walk or of a ride.

On 165 measured walks about three quarters of the residuals' variance is correlated over 100 to 350
m, the rest over 10 to 30 m. With one scale only, a hypothesis has to give the long part all of the
variance, and then cannot rule out positions far away.

Correlated residuals are not quite what a stationary Gaussian process describes, so their likelihood
counts with the power `trust` only (generalised posterior: Bissiri, Holmes & Walker, JRSS-B 78(5),
2016). On 506 measured walks regions hold .984 with 0.45 and .990 with 0.35, which locates 17, not
31; on 165 .84 with 0.7. Under simulated shadowing of 8 dB over 30 m regions hold .90 with 1.0 and
.97 with 0.8: its scale has to be one of those above.

Averaged levels differ so little from one reading to the next that the others take them for little
noise: of simulated walks under noise of two scales, with means over 10 s, regions held .67, with
averaged hypotheses all. These groups have the probability of few modems: with more, 0.3 dB decide
which group explains a walk with a reading every 6 m.
"""


HIGHEST_M = 10_000
"""Above the receiver; no mountain road sees a greater difference."""
_HALVINGS = 30
"""Of the interval that holds a radius: to a billionth of it."""


class Coefficients(NamedTuple):
    """Mean and precision (inverse variance) of P0, eta and the harmonics, shape (q,) each."""

    mean: FloatArray
    precision: FloatArray


@dataclass(frozen=True, slots=True)
class Prior:
    """What is assumed before the walk; printed with every result.

    P0 and eta are normal, eta from `least_eta` on; sigma is log-normal. Within a group of `noise`
    the hypotheses are equally probable. `reaches` are hypotheses of the distance
    from the walk, up to `reach_m`, and `stations` of the antenna; the first station stands for all
    where one is needed. Nothing outside of an `area` is possible. Modems read too high or too low
    by `offset_sigma_db`: 3GPP TS 45.008, 8.1.2, allows 6 dB.
    """

    environment: str = "any"
    p0_dbm: float = -40.0
    p0_sigma_db: float = 30.0
    eta: float = 2.6
    eta_sigma: float = 0.9
    least_eta: float = 1.0
    sigma_db: float = 5.4
    sigma_log_sd: float = 0.45
    noise: tuple[NoiseGroup, ...] = NOISE
    reaches: tuple[Reach, ...] = REACHES["any"]
    stations: tuple[Station, ...] = _any(None)
    reach_m: float = 30_000.0
    offset_sigma_db: float = 6.0
    area: Area | None = None

    @property
    def height_m(self) -> float:
        """Height of the first station above the receiver."""
        return self.stations[0].height_m

    @property
    def antenna_db(self) -> tuple[float, ...]:
        """Pattern of the first station."""
        return self.stations[0].antenna_db

    def of_station(self, station: Station) -> "Prior":
        """The prior where this is the only station."""
        return replace(self, stations=(station,))

    def radius_m(self, level: float) -> float:
        """Radius around a single reading that holds `level` of the positions; no reach has an end.

        In units of the square of its length, a reach has r^2 / 2 within r of the reading where it
        is flat; the tail beyond is 1 / (power - 2) altogether.
        """
        probability, flat_m, power = np.array(self.reaches).T
        tail = 1.0 / (power - 2.0)

        def within(radius_m: float) -> float:
            ratio = radius_m / flat_m
            beyond = 0.5 + tail * (1.0 - np.maximum(ratio, 1.0) ** (2.0 - power))
            share = np.where(ratio < 1.0, 0.5 * ratio**2, beyond) / (0.5 + tail)
            return float(probability @ share / np.sum(probability))

        low_m, high_m = 0.0, 1.0
        while within(high_m) < level:
            low_m, high_m = high_m, 2.0 * high_m
        for _ in range(_HALVINGS):
            middle_m = 0.5 * (low_m + high_m)
            low_m, high_m = (middle_m, high_m) if within(middle_m) < level else (low_m, middle_m)
        return high_m

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """All hypotheses of the noise, group by group."""
        return tuple(one for group in self.noise for one in group.hypotheses)

    @property
    def station_log_odds(self) -> FloatArray:
        """Log probability of each station under each hypothesis of the noise, shape (s, c).

        It is -inf for a pattern under white noise, unless all stations have one: among houses no
        antenna has a clean pattern.
        """
        return _station_log_odds(self.stations, self.noise)

    @property
    def noise_table(self) -> "NoiseTable":
        """The hypotheses as arrays."""
        return _noise_table(self.noise)

    @property
    def coefficients(self) -> Coefficients:
        """Prior of the linear coefficients, in the order of `columns`."""
        return _coefficients(self)


class NoiseTable(NamedTuple):
    """Log prior probability, trust and blocks of each hypothesis, (c,); first of each group."""

    log_odds: FloatArray
    trust: FloatArray
    is_coarse: BoolArray
    first: IntArray


@lru_cache(maxsize=16)  # needed after each live reading
def _noise_table(groups: tuple[NoiseGroup, ...]) -> NoiseTable:
    count = [len(group.hypotheses) for group in groups]
    total = sum(group.probability for group in groups)
    odds = np.repeat([g.probability / (total * len(g.hypotheses)) for g in groups], count)
    trust = np.repeat([group.trust for group in groups], count)
    is_coarse = np.repeat([group.is_coarse for group in groups], count)
    return NoiseTable(np.log(odds), trust, is_coarse, np.cumsum([0, *count[:-1]]))


@lru_cache(maxsize=16)  # needed after each live reading
def _station_log_odds(stations: tuple[Station, ...], groups: tuple[NoiseGroup, ...]) -> FloatArray:
    has_pattern = np.array([bool(one.antenna_db) for one in stations])
    is_shadowed = np.array([one.white_share < 1.0 for group in groups for one in group.hypotheses])
    is_possible = is_shadowed | ~has_pattern[:, None] | np.all(has_pattern)
    odds = np.array([one.probability for one in stations])[:, None] * is_possible
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(odds / np.sum(odds, axis=0)), float)


@lru_cache(maxsize=16)  # needed after each live reading
def _coefficients(prior: Prior) -> Coefficients:
    harmonics = np.repeat(np.array(prior.antenna_db, float), 2)
    mean = np.concatenate([[prior.p0_dbm, prior.eta], np.zeros(len(harmonics))])
    sigma = np.concatenate([[prior.p0_sigma_db, prior.eta_sigma], harmonics])
    return Coefficients(mean, sigma**-2.0)


ENVIRONMENTS = {
    "any": Prior(),
    "open": Prior(environment="open", eta=2.2, eta_sigma=0.5, sigma_db=4.0),
    "suburban": Prior(environment="suburban", eta=2.8, eta_sigma=0.6, sigma_db=5.5),
    "urban": Prior(environment="urban", eta=3.2, eta_sigma=0.7, sigma_db=6.5),
}
"""Priors by surroundings.

"any" is as broad as 464 measured walks demand (eta 0.95 to 4.26 in 90 % of them); the others follow
the usual tables (Rappaport, Wireless Communications, 2nd ed., table 4.2: free space 2, urban
2.7-3.5, shadowed urban 3-5). Waves that spread in a plane have 1; less lets a narrow peak explain
levels that hardly fall. Of 40 measured regions within 150 m four missed the transmitter, three of
them with .6 to 1.1; those that held it had 2 or more.
"""


def prior_for(
    environment: str,
    *,
    height_m: float | None = None,
    antenna: str = "any",
    reach: str = "any",
    area: Area | None = None,
) -> Prior:
    """Prior by the names of surroundings, antenna and reach; without a height all are possible.

    Raises `ConfigError` for an unknown name and for a height that no antenna has.
    """
    for name, kind, choices in (
        (environment, "environment", ENVIRONMENTS),
        (antenna, "antenna", ANTENNAS),
        (reach, "reach", REACHES),
    ):
        if name not in choices:
            raise ConfigError(f"{kind} {name!r} is unknown: one of {', '.join(choices)}")
    if height_m is not None and not 0.0 <= height_m <= HIGHEST_M:
        raise ConfigError(f"an antenna is 0 to {HIGHEST_M} m above the receiver")
    return replace(
        ENVIRONMENTS[environment],
        reaches=REACHES[reach],
        stations=ANTENNAS[antenna](height_m),
        area=area,
    )
