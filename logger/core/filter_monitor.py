"""Watches a running EKF and decides when to discard it.

Three values are followed, each over several readings, so that one outlier discards nothing.

- Normalised innovations squared (NIS), 1 on average for a consistent filter: their exponentially
  weighted mean against the upper bound of a chi-square mean with as many degrees of freedom as the
  weights amount to (Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and
  Navigation, sec. 5.4; the quantile by Wilson & Hilferty, PNAS 17(12), 1931).
- Distance from the locator's best position, by both covariances.
- Uncertainty of the position relative to the walker's distance: near the transmitter a linearised
  filter needs a smaller one.

The NIS reveals wrong noise. It reveals a wrong position only with little shadowing: otherwise P0,
eta and shadowing absorb the error, and only the locator reveals it.
"""

from math import hypot, isnan, sqrt
from typing import NamedTuple

from logger.core.arrays import FloatArray
from logger.core.ekf import EkfStep
from logger.core.shadow_ekf import ShadowNoise, ShadowState, static_covariance

CLOSE = 0.15
"""Largest sigma of the position, along its widest axis and by the walker's distance, at a start.

Started there in simulated walks, the last 95 % ellipse held the truth in 93 to 95 %; at 0.3 in 89
to 94 %.
"""
NEAR = 0.25
"""As `CLOSE`, to discard a running filter."""

_MEMORY = 30.0
"""Readings over which the mean NIS forgets."""
_MOST_NIS = 9.0
"""A larger one (3 sigma) counts as this: one gross error does not fill the mean."""
_NIS_SIGMAS = 4.0
"""The bound of the mean is tested at every reading, so chance must seldom exceed it."""
_CHI2_95_2DOF = 5.991
"""Squared distance of two positions that 5 % exceed."""
_NIS_READINGS, _APART_READINGS, _NEAR_READINGS = 5, 3, 3
"""Net readings beyond a bound that raise its alarm."""


class Alarm(NamedTuple):
    """Active from `most` net exceedances on, until as many readings are within the bound."""

    exceedances: int = 0
    active: bool = False

    def update(self, *, exceeded: bool, most: int) -> "Alarm":
        """The alarm after one more reading."""
        change = 1 if exceeded else -1
        exceedances = min(max(self.exceedances + change, 0), most)
        return Alarm(exceedances, exceedances >= most or (self.active and exceedances > 0))


class FilterMonitor(NamedTuple):
    """What has been observed of a filter since it started; a new monitor lets it run.

    `mean_nis` is the weighted mean NIS, with the sums of its weights and of their squares. `apart2`
    is the squared distance from the locator's position by both covariances, `nearness` the sigma of
    the filter's position divided by the walker's distance.
    """

    mean_nis: float = 1.0
    weight: float = 0.0
    weight2: float = 0.0
    apart2: float = 0.0
    nearness: float = 0.0
    nis_alarm: Alarm = Alarm()
    apart_alarm: Alarm = Alarm()
    near_alarm: Alarm = Alarm()

    @property
    def nis_bound(self) -> float:
        """Largest mean NIS of a consistent filter after so many readings."""
        return mean_bound(self.weight**2 / self.weight2) if self.weight2 else float("inf")

    @property
    def disagrees(self) -> str | None:
        """Why the filter is to be discarded; None while it may run."""
        if self.nis_alarm.active:
            return (
                "the innovations are larger than the filter's variance allows: "
                f"mean NIS {self.mean_nis:.1f}, at most {self.nis_bound:.1f} by chance"
            )
        if self.apart_alarm.active:
            apart = sqrt(self.apart2)
            return f"the filter and the locator are {apart:.1f} standard deviations apart"
        if self.near_alarm.active:
            return (
                "the walker is too near for the uncertainty of the position: "
                f"its standard deviation is {self.nearness:.0%} of the distance"
            )
        return None

    def after_step(self, step: EkfStep[ShadowState], noise: ShadowNoise) -> "FilterMonitor":
        """The monitor after one more step of the filter."""
        nearness = _nearness(step.state, noise.height_m)
        near_alarm = self.near_alarm.update(exceeded=nearness > NEAR, most=_NEAR_READINGS)
        monitor = self._replace(nearness=nearness, near_alarm=near_alarm)
        if isnan(step.innovation_db):
            return monitor
        return _after_nis(monitor, step.innovation_db**2 / step.innovation_var_db2)

    def after_search(
        self, state: ShadowState, mean: FloatArray, covariance: FloatArray
    ) -> "FilterMonitor":
        """The monitor beside the locator's mode: [x, y, P0, eta] and its covariance (4, 4)."""
        (mode_xx, mode_xy), (_, mode_yy) = covariance[:2, :2].tolist()
        x_m, y_m, _, _ = mean.tolist()
        xx, xy, _, _, yy, *_ = static_covariance(state.factors)
        xx, xy, yy = xx + mode_xx, xy + mode_xy, yy + mode_yy
        east, north = state.x_m - x_m, state.y_m - y_m
        squares = yy * east * east - 2.0 * xy * east * north + xx * north * north
        apart2 = squares / (xx * yy - xy * xy)
        exceeded = apart2 > _CHI2_95_2DOF
        apart_alarm = self.apart_alarm.update(exceeded=exceeded, most=_APART_READINGS)
        return self._replace(apart2=apart2, apart_alarm=apart_alarm)


def widest(xx: float, xy: float, yy: float) -> float:
    """Standard deviation along the widest axis of a covariance in the plane."""
    return sqrt(0.5 * (xx + yy) + hypot(0.5 * (xx - yy), xy))


def mean_bound(dof: float, sigmas: float = _NIS_SIGMAS) -> float:
    """Bound of the mean of `dof` squared standard normals, as rare as a normal beyond `sigmas`."""
    spread = 2.0 / (9.0 * dof)
    return float((1.0 - spread + sigmas * sqrt(spread)) ** 3)


def _nearness(state: ShadowState, height_m: float) -> float:
    xx, xy, _, _, yy, *_ = static_covariance(state.factors)
    dx_m, dy_m = state.x_m - state.receiver_x_m, state.y_m - state.receiver_y_m
    squared_m2 = dx_m**2 + dy_m**2 + height_m**2
    return widest(xx, xy, yy) / sqrt(max(squared_m2, 1.0))


def _after_nis(monitor: FilterMonitor, nis: float) -> FilterMonitor:
    keep = 1.0 - 1.0 / _MEMORY
    weight = keep * monitor.weight + 1.0
    mean_nis = monitor.mean_nis + (min(nis, _MOST_NIS) - monitor.mean_nis) / weight
    weight2 = keep * keep * monitor.weight2 + 1.0
    monitor = monitor._replace(mean_nis=mean_nis, weight=weight, weight2=weight2)
    exceeded = mean_nis > monitor.nis_bound
    return monitor._replace(
        nis_alarm=monitor.nis_alarm.update(exceeded=exceeded, most=_NIS_READINGS)
    )
