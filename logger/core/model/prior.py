"""What is assumed before the walk: priors of the coefficients, the noise and the position."""

from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.errors import ConfigError

REACHES_M = MappingProxyType({"near": 200.0, "far": 400.0})
"""Distance from the walk within which every position is as probable, by the name of the reach.

"near" suits a rogue cell, which is looked for where it is strong. On measured walks past a distant
mast it makes regions too small; "far" makes all regions larger.
"""

ANTENNAS = MappingProxyType({"omni": (), "any": (3.5, 1.5), "sector": (9.3, 3.3)})
"""Standard deviations in dB of each harmonic of the antenna pattern, for cosine and sine alike.

A sector antenna with a half-power beam width of 65 degrees and 25 dB front to back (3GPP TR 36.942,
4.2.1: -min(12 (b / 65)^2, 25) dB) has first and second harmonics of 13.1 and 4.6 dB. With a uniform
azimuth of the beam, cosine and sine each have that divided by sqrt(2). The other harmonics together
are 1.1 dB rms and count as noise. "any" lies between: one walk hardly shows such a lobe, and many
walks show a larger one.
"""


class Hypothesis(NamedTuple):
    """Covariance of the residuals: a white share, the rest shadowing over one or two distances.

    Of the shadowing, `long_share` is correlated over `long_m`, the rest over `short_m`.
    """

    white_share: float
    short_m: float = 0.0
    long_share: float = 0.0
    long_m: float = 0.0

    @property
    def decorrelation_m(self) -> float:
        """Integral of the shadowing's correlation over distance; 0 where all is white."""
        if self.white_share >= 1.0:
            return 0.0
        return (1.0 - self.long_share) * self.short_m + self.long_share * self.long_m


WHITE = Hypothesis(1.0)


class NoiseGroup(NamedTuple):
    """Hypotheses that are mixed before their likelihood is raised to the power `trust`.

    `is_long`: readings closer than a coarse block tell nothing about the position under these.
    """

    trust: float
    hypotheses: tuple[Hypothesis, ...]
    is_long: bool = False


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
            Hypothesis(0.05, 30.0, 0.75, 100.0),
            Hypothesis(0.3, 30.0, 0.75, 100.0),
            Hypothesis(0.3, 10.0, 0.35, 100.0),
        ),
        is_long=True,
    ),
)
"""White noise; shadowing that changes along a house front; shadowing of two scales.

On 165 measured walks about three quarters of the variance of the residuals is correlated over 100
to 350 m (hills, streets, the antenna), the rest over 10 to 30 m. With one scale only, a hypothesis
has to give the long part all of the variance, and then cannot rule out positions far away.

Correlated residuals are not quite what a stationary Gaussian process describes, so their likelihood
counts with the power `trust` only (generalised posterior: Bissiri, Holmes & Walker, JRSS-B 78(5),
2016). On 165 measured walks the 95 % region held the transmitter .96 times with 0.45 and .84 times
with 0.7. Under simulated noise of two scales, which is such a process, 1.0 would be true and 0.45
makes regions twelve times too large: what misleads on a measured walk is not in that model. Under
simulated shadowing of 8 dB over 30 m regions hold .90 with 1.0 and .97 with 0.8, since their scale
has to be one of those above.
"""


class Coefficients(NamedTuple):
    """Mean and precision (inverse variance) of P0, eta and the harmonics, shape (q,) each."""

    mean: FloatArray
    precision: FloatArray


@dataclass(frozen=True, slots=True)
class Prior:
    """What is assumed before the walk; printed with every result.

    P0 and eta are normal, sigma is log-normal. The groups of `noise` are equally probable, as are
    the hypotheses within a group. The position is uniform within `near_m` of the walk and falls
    with the distance to the power of `far_power` beyond, up to `reach_m`; with 2 every octave of
    range would count the same. The antenna is `height_m` above the receiver. Modems read too high
    or too low by `offset_sigma_db`: 3GPP TS 45.008, 8.1.2, allows 6 dB. Each harmonic of the
    antenna pattern has the standard deviation in `antenna_db`; without any the antenna is
    omnidirectional.
    """

    environment: str = "any"
    p0_dbm: float = -40.0
    p0_sigma_db: float = 30.0
    eta: float = 2.6
    eta_sigma: float = 0.9
    sigma_db: float = 5.4
    sigma_log_sd: float = 0.45
    noise: tuple[NoiseGroup, ...] = NOISE
    near_m: float = 200.0
    far_power: float = 3.0
    height_m: float = 5.0
    reach_m: float = 30_000.0
    offset_sigma_db: float = 6.0
    antenna_db: tuple[float, ...] = ()

    def radius_m(self, level: float) -> float:
        """Radius around a single reading that holds `level` of the positions.

        Within `near_m` each area is as probable, beyond the density falls with the distance to the
        power of `far_power`, above 2. Lengths are in units of `near_m` and the reach has no end.
        """
        tail = 1.0 / (self.far_power - 2.0)  # integral of r^(1 - far_power) from 1 on
        within = level * (0.5 + tail)
        if within <= 0.5:
            return self.near_m * float(np.sqrt(2.0 * within))
        left = 1.0 - (within - 0.5) / tail
        return self.near_m * float(left ** (1.0 / (2.0 - self.far_power)))

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """All hypotheses of the noise, group by group."""
        return tuple(one for group in self.noise for one in group.hypotheses)

    @property
    def noise_table(self) -> "NoiseTable":
        """The hypotheses as arrays."""
        return _noise_table(self.noise)

    @property
    def coefficients(self) -> Coefficients:
        """Prior of the linear coefficients, in the order of `columns`."""
        return _coefficients(self)


class NoiseTable(NamedTuple):
    """Log prior probability, trust and length of each hypothesis, (c,); first of each group."""

    log_odds: FloatArray
    trust: FloatArray
    is_long: BoolArray
    first: IntArray


@lru_cache(maxsize=16)  # needed after each live reading
def _noise_table(groups: tuple[NoiseGroup, ...]) -> NoiseTable:
    count = [len(group.hypotheses) for group in groups]
    odds = np.repeat([1.0 / (len(groups) * n) for n in count], count)
    trust = np.repeat([group.trust for group in groups], count)
    is_long = np.repeat([group.is_long for group in groups], count)
    return NoiseTable(np.log(odds), trust, is_long, np.cumsum([0, *count[:-1]]))


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
2.7-3.5, shadowed urban 3-5).
"""


def prior_for(
    environment: str, *, height_m: float | None = None, antenna: str = "omni", reach: str = "near"
) -> Prior:
    """Prior by the names of surroundings, antenna and reach.

    Raises `ConfigError` for an unknown name.
    """
    for name, kind, choices in (
        (environment, "environment", ENVIRONMENTS),
        (antenna, "antenna", ANTENNAS),
        (reach, "reach", REACHES_M),
    ):
        if name not in choices:
            raise ConfigError(f"{kind} {name!r} is unknown: one of {', '.join(choices)}")
    prior = replace(
        ENVIRONMENTS[environment], antenna_db=ANTENNAS[antenna], near_m=REACHES_M[reach]
    )
    return prior if height_m is None else replace(prior, height_m=height_m)
