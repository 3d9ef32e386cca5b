"""Watches a running EKF and says when it is to be taken back.

Three things are followed, each with patience, so that one outlier takes nothing back:

- the normalised innovations squared (NIS), 1 on average for an honest filter: their exponentially weighted mean
  against the upper bound of a chi-square mean with as many degrees of freedom as the weights amount
  to (Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, sec.
  5.4; the quantile by Wilson & Hilferty, PNAS 17(12), 1931);
- the distance from the place which the locator holds for the best, by both covariances;
- the walker coming nearer to the place than its uncertainty allows a linearised filter.

The NIS finds a filter whose noise is wrong. A wrong place it finds only where there is little
shadowing: otherwise power, exponent and shadowing take the error up, and it is the locator that
tells.
"""

from math import hypot, isnan, sqrt
from typing import NamedTuple

from logger.core.shadow_ekf import ShadowNoise, ShadowState, ShadowStep, static_covariance

CLOSE = 0.15
"""Largest standard deviation of the place, along its widest axis and by the walker's distance, to
start a filter with.

Started at it in simulated walks, the last 95 % ellipse held the truth in 93 to 95 %; at 0.3 in 89
to 94 %. """
NEAR = 0.25
"""As `CLOSE`, to take a filter back."""

_MEMORY = 30.0
_MOST_NIS = 9.0
_NIS_SIGMAS = 4.0
_APART2 = 5.991
_NIS_PATIENCE, _APART_PATIENCE, _NEAR_PATIENCE = 5, 3, 3


class Alarm(NamedTuple):
    """Rings when findings outnumber denials by its patience, and until they have evened out."""

    findings: int = 0
    rings: bool = False


class Watch(NamedTuple):
    """What has been seen of a filter since it started: a fresh watch knows nothing and lets it run.

    `mean_nis` is the weighted mean NIS, with the sums of its weights and of their squares; `apart2`
    the squared distance from the locator's place by both covariances, `nearness` the standard
    deviation of the filter's place by the walker's distance.
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
        """Largest mean NIS of an honest filter after the readings seen."""
        return mean_bound(self.weight**2 / self.weight2) if self.weight2 else float("inf")

    @property
    def disagrees(self) -> str | None:
        """Why the filter is to be taken back, in plain words; None while it may run."""
        if self.nis_alarm.rings:
            return (
                "the levels are farther off than the filter says they can be: "
                f"mean NIS {self.mean_nis:.1f}, where chance allows {self.nis_bound:.1f}"
            )
        if self.apart_alarm.rings:
            return f"the filter's place and the locator's are {sqrt(self.apart2):.1f} standard deviations apart"
        if self.near_alarm.rings:
            return (
                "the walker has come too near for what is known of the place: "
                f"its standard deviation is {self.nearness:.0%} of the distance"
            )
        return None


def follow(watch: Watch, step: ShadowStep, noise: ShadowNoise) -> Watch:
    """The watch after one more step of the filter."""
    state = step.state
    xx, xy, _, _, yy, *_ = static_covariance(state.factors)
    d2 = (
        (state.x_m - state.receiver_x_m) ** 2
        + (state.y_m - state.receiver_y_m) ** 2
        + noise.height_m**2
    )
    nearness = widest(xx, xy, yy) / sqrt(max(d2, 1.0))
    watch = watch._replace(
        nearness=nearness, near_alarm=_heard(watch.near_alarm, nearness > NEAR, _NEAR_PATIENCE)
    )
    if isnan(step.innovation_db):
        return watch
    nis = min(step.innovation_db**2 / step.innovation_var_db2, _MOST_NIS)
    keep = 1.0 - 1.0 / _MEMORY
    weight = keep * watch.weight + 1.0
    mean_nis = watch.mean_nis + (nis - watch.mean_nis) / weight
    watch = watch._replace(
        mean_nis=mean_nis, weight=weight, weight2=keep * keep * watch.weight2 + 1.0
    )
    return watch._replace(
        nis_alarm=_heard(watch.nis_alarm, mean_nis > watch.nis_bound, _NIS_PATIENCE)
    )


def compare(
    watch: Watch, state: ShadowState, x_m: float, y_m: float, covariance: tuple[float, float, float]
) -> Watch:
    """The watch after the locator has found its best place anew; `covariance` is the place's xx,
    xy, yy.
    """
    xx, xy, _, _, yy, *_ = static_covariance(state.factors)
    xx, xy, yy = xx + covariance[0], xy + covariance[1], yy + covariance[2]
    east, north = state.x_m - x_m, state.y_m - y_m
    apart2 = (yy * east * east - 2.0 * xy * east * north + xx * north * north) / (xx * yy - xy * xy)
    return watch._replace(
        apart2=apart2, apart_alarm=_heard(watch.apart_alarm, apart2 > _APART2, _APART_PATIENCE)
    )


def widest(xx: float, xy: float, yy: float) -> float:
    """Standard deviation along the widest axis of a covariance in the plane."""
    return sqrt(0.5 * (xx + yy) + hypot(0.5 * (xx - yy), xy))


def mean_bound(dof: float, sigmas: float = _NIS_SIGMAS) -> float:
    """What the mean of `dof` squared standard normals exceeds as seldom as a normal exceeds
    `sigmas`.
    """
    spread = 2.0 / (9.0 * dof)
    return float((1.0 - spread + sigmas * sqrt(spread)) ** 3)


def _heard(alarm: Alarm, found: bool, patience: int) -> Alarm:
    findings = min(alarm.findings + 1, patience) if found else max(alarm.findings - 1, 0)
    return Alarm(findings, findings >= patience or (alarm.rings and findings > 0))
