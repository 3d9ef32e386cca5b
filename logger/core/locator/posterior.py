"""The result of the locator: all that is known about one transmitter after a walk."""

from dataclasses import dataclass
from functools import cached_property

from logger.core.arrays import FloatArray
from logger.core.ellipse import Ellipse, ellipse95
from logger.core.locator.offsets import Offsets
from logger.core.locator.region import Squares, area_m2
from logger.core.model.prior import Prior

LEAST_PEAK = 0.05
"""A position with this share of the highest density is a mode, however improbable."""
_LIMIT_SHARE = 0.01
"""With more probability than this at the end of the searched area, the search ended too early."""


@dataclass(frozen=True)
class Mode:
    """One separate position where the transmitter may stand.

    `state` is the mean [x, y, P0, eta] in m, m, dBm and 1, `covariance` (4, 4) that of the mode's
    probability alone. `peak` is its highest density divided by the highest of all modes.
    """

    probability: float
    peak: float
    state: FloatArray
    covariance: FloatArray

    @property
    def x_m(self) -> float:
        """East."""
        return float(self.state[0])

    @property
    def y_m(self) -> float:
        """North."""
        return float(self.state[1])

    @cached_property
    def ellipse(self) -> Ellipse:
        """95 % ellipse of the mode as a Gaussian."""
        return ellipse95(self.covariance[0, 0], self.covariance[0, 1], self.covariance[1, 1])


@dataclass(frozen=True)
class Posterior:
    """All that is known about one transmitter after a walk.

    `x_m, y_m` is the median of the strongest mode: the point with the least mean distance to the
    transmitter. `r95_m` is the radius around it that holds 95 % of the probability, `drms_m` the
    root mean square distance from it. `p0_dbm` to `white_share` are means and standard deviations
    over the complete posterior. `limit_share` is the probability at the end of the searched area.
    `log_evidence` is the log probability density of the levels under the model, to compare models;
    with timing advances it is that of the levels given those, and `prior` reaches as far as they.
    `offsets` are those of several modems at the strongest mode; P0 then is on the scale of the
    first.
    """

    squares: Squares
    modes: tuple[Mode, ...]
    x_m: float
    y_m: float
    r95_m: float
    drms_m: float
    p0_dbm: float
    p0_sigma_db: float
    eta: float
    eta_sigma: float
    sigma_db: float
    decorrelation_m: float
    white_share: float
    limit_share: float
    log_evidence: float
    prior: Prior
    offsets: Offsets | None = None

    @property
    def at_limit(self) -> bool:
        """Whether probability reaches the end of the searched area."""
        return self.limit_share > _LIMIT_SHARE

    @property
    def region_area_m2(self) -> float:
        """Area of the 95 % highest-density region."""
        return area_m2(self.squares)
