"""What the online locator takes and gives."""

from typing import NamedTuple

from logger.core.arrays import FloatArray


class LevelReading(NamedTuple):
    """A reading with the receiver's position; `limit` as in `censoring.limits`."""

    x_m: float
    y_m: float
    sigma_m: float
    level_dbm: float
    limit: int


class StrongestMode(NamedTuple):
    """Strongest mode: mean [x, y, P0, eta], covariance (4, 4), probability, sigma of a level."""

    state: FloatArray
    covariance: FloatArray
    probability: float
    sigma_db: float
