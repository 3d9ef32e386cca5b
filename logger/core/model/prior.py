"""What is assumed before the walk: priors of the coefficients, the noise and the position."""

from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError

ANTENNAS = MappingProxyType({"omni": (), "sector": (9.3, 3.3)})
"""Standard deviations in dB of each harmonic of the antenna pattern, for cosine and sine alike.

A sector antenna with a half-power beam width of 65 degrees and 25 dB front to back (3GPP TR 36.942,
4.2.1: -min(12 (b / 65)^2, 25) dB) has first and second harmonics of 13.1 and 4.6 dB. With a uniform
azimuth of the beam, cosine and sine each have that divided by sqrt(2). The other harmonics together
are 1.1 dB rms and count as noise.
"""


class Hypothesis(NamedTuple):
    """Covariance of the residuals: a white share, the rest with a decorrelation distance.

    `decorrelation_m` is 0 where all is white. The likelihood is raised to the power `trust`.
    """

    white_share: float
    decorrelation_m: float
    trust: float


class Coefficients(NamedTuple):
    """Mean and precision (inverse variance) of P0, eta and the harmonics, shape (q,) each."""

    mean: FloatArray
    precision: FloatArray


@dataclass(frozen=True, slots=True)
class Prior:
    """What is assumed before the walk; printed with every result.

    P0 and eta are normal, sigma is log-normal. White noise alone has probability `white_alone`, the
    pairs of white share and decorrelation distance divide the rest evenly. The position is uniform
    within `near_m` of the walk and falls with the distance to the power of `far_power` beyond, up
    to `reach_m`; with 2 every octave of range would count the same. The antenna is `height_m` above
    the receiver. Modems read too high or too low by `offset_sigma_db`: 3GPP TS 45.008, 8.1.2,
    allows 6 dB. Each harmonic of the antenna pattern has the standard deviation in `antenna_db`;
    without any the antenna is omnidirectional.

    Residuals that are correlated over more than `stationary_m` are not shadowing, which a
    stationary Gaussian process describes, but hills, streets and the pattern of the antenna: there
    the likelihood counts with the power `trust` only (generalised posterior: Bissiri, Holmes &
    Walker, JRSS-B 78(5), 2016).
    """

    environment: str = "any"
    p0_dbm: float = -40.0
    p0_sigma_db: float = 30.0
    eta: float = 2.6
    eta_sigma: float = 0.9
    sigma_db: float = 5.4
    sigma_log_sd: float = 0.45
    decorrelation_m: tuple[float, ...] = (6.0, 12.0, 18.0, 27.0, 50.0, 100.0, 250.0, 700.0)
    white_shares: tuple[float, ...] = (0.02, 0.15, 0.5)
    white_alone: float = 0.25
    near_m: float = 200.0
    far_power: float = 3.0
    height_m: float = 5.0
    stationary_m: float = 60.0
    trust: float = 0.3
    reach_m: float = 30_000.0
    offset_sigma_db: float = 6.0
    antenna_db: tuple[float, ...] = ()

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """All hypotheses of the noise; the first is white noise alone."""
        pairs = [(a, d) for a in self.white_shares for d in self.decorrelation_m]
        correlated = [
            Hypothesis(a, d, 1.0 if d <= self.stationary_m else self.trust) for a, d in pairs
        ]
        return [Hypothesis(1.0, 0.0, 1.0), *correlated]

    @property
    def log_odds(self) -> FloatArray:
        """Log prior probability of each hypothesis, shape (c,)."""
        pairs = len(self.white_shares) * len(self.decorrelation_m)
        each = (1.0 - self.white_alone) / max(pairs, 1)
        return np.asarray(np.log([self.white_alone] + [each] * pairs), float)

    @property
    def coefficients(self) -> Coefficients:
        """Prior of the linear coefficients, in the order of `columns`."""
        return _coefficients(self)


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


def prior_for(environment: str, *, height_m: float | None = None, antenna: str = "omni") -> Prior:
    """Prior by the names of surroundings and antenna; raises `ConfigError` for an unknown name."""
    for name, kind, choices in (
        (environment, "environment", ENVIRONMENTS),
        (antenna, "antenna", ANTENNAS),
    ):
        if name not in choices:
            raise ConfigError(f"{kind} {name!r} is unknown: one of {', '.join(choices)}")
    prior = replace(ENVIRONMENTS[environment], antenna_db=ANTENNAS[antenna])
    return prior if height_m is None else replace(prior, height_m=height_m)
