"""The two parameters of the path loss model, as estimates report them and pictures show them."""

from typing import Final, NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.posterior import Posterior


class Parameter(NamedTuple):
    """`row` is its index in a state; `mean` and `sigma` are attributes of the posterior."""

    name: str
    unit: str
    decimals: int
    row: int
    mean: str
    sigma: str

    def of_posterior(self, posterior: Posterior) -> tuple[float, float]:
        """Mean and standard deviation."""
        return getattr(posterior, self.mean), getattr(posterior, self.sigma)

    def of_states(self, x: FloatArray, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values and standard deviations of states (..., k) with covariances (..., k, k)."""
        variance = p[..., self.row, self.row]
        return x[..., self.row], np.sqrt(np.maximum(variance, 0.0))

    def of_state(self, x: FloatArray, p: FloatArray) -> tuple[float, float]:
        """Value and standard deviation of one state (k,) with covariance (k, k)."""
        value, sigma = self.of_states(x, p)
        return float(value), float(sigma)

    def text(self, mean: float, sigma: float) -> str:
        """For example "-35.0 ± 2.0 dBm"."""
        unit = f" {self.unit}" if self.unit else ""
        return f"{mean:.{self.decimals}f} ± {sigma:.{self.decimals}f}{unit}"


P0: Final = Parameter("P0", "dBm", 1, 2, "p0_dbm", "p0_sigma_db")
ETA: Final = Parameter("eta", "", 2, 3, "eta", "eta_sigma")
