"""One cell on the device: the locator, and the EKF it hands over to once the place is close and
single.

The EKF starts from the locator's place when its standard deviation is at most 12 m and 0.15 of the
walker's distance to it (a linearised filter is honest only when it starts close), and takes up the
shadowing from the last readings. It is followed by `watch`, and taken back when the watch
disagrees.
"""

from collections import deque
from math import hypot, sqrt
from typing import NamedTuple

import numpy as np

from logger.core import ekf, shadow_ekf
from logger.core.errors import EstimationError
from logger.core.filter_monitor import CLOSE, Watch, compare, follow, widest
from logger.core.locator.online import Heard, OnlineLocator, Place
from logger.core.model.path_loss import level_gradient
from logger.core.model.prior import Prior
from logger.core.shadow_ekf import ShadowNoise, ShadowState, ShadowStep, static_covariance
from logger.core.shadow_noise import candidates, likeliest
from logger.core.spikes import SpikeFilter

LOCATOR, EKF = "locator", "ekf"

ONE_PLACE = 0.98
TIGHT_M = 12.0
_RECENT = 200


class CellEstimate(NamedTuple):
    """State [x, y, P0, eta] after a reading, upper triangle of its covariance, and the stage that
    it comes from.

    `probability` is that of the place; the innovation belongs to the reading and is NaN where
    nothing was expected.
    """

    stage: str
    probability: float
    state: tuple[float, float, float, float]
    p: ekf.Covariance
    innovation_db: float
    innovation_var_db2: float


class _Running(NamedTuple):
    state: ShadowState
    noise: ShadowNoise
    watch: Watch


class LiveCell:
    """Estimate of one cell, reading by reading; `news` holds what happened at the last reading, as
    (code, text).
    """

    def __init__(self, prior: Prior, spikes: SpikeFilter[Heard] | None = None) -> None:
        self._prior = prior
        self._locator = OnlineLocator(prior, spikes)
        self._running: _Running | None = None
        self._recent: deque[Heard] = deque(maxlen=_RECENT)
        self._barred = False
        self.n = 0
        self.n_set_aside = 0
        self.news: list[tuple[str, str]] = []

    @property
    def stale(self) -> float:
        """As `OnlineLocator.stale`."""
        return self._locator.stale

    def take(self, heard: Heard) -> CellEstimate | None:
        """Take a reading; None while there is nothing to be said.

        A level far from that of its forerunner waits until the next ones share it: the estimate is
        then after all of them. One that they do not share is set aside.
        """
        self.news = []
        estimate = None
        for reading, spike_db in self._locator.judged(heard):
            if spike_db:
                self._set_aside(reading, spike_db)
            else:
                estimate = self._taken(reading)
        return estimate

    def _set_aside(self, heard: Heard, spike_db: float) -> None:
        self.n_set_aside += 1
        how = "above" if spike_db > 0.0 else "below"
        text = f"{heard.level_dbm:.0f} dBm is {abs(spike_db):.0f} dB {how} the readings around it and was set aside"
        self.news.append(("level-set-aside", text))

    def _taken(self, heard: Heard) -> CellEstimate | None:
        self.n += 1
        before = self._locator.place()
        self._locator.take(heard)
        self._recent.append(heard)
        place = self._locator.place()
        step = self._stepped(heard, place)
        if step is not None:
            return _of_filter(step)
        if place is None:
            return None
        estimate = _of_locator(place, before, heard, self._prior.height_m)
        if not self._barred and _is_close(place, heard):
            self._start(place)
        return estimate

    def search(self) -> None:
        """Let the locator search anew."""
        self._locator.search()
        self._barred = False

    def _stepped(self, heard: Heard, place: Place | None) -> ShadowStep | None:
        """The running filter's next step; None without one, or where it has just been taken
        back.
        """
        if self._running is None:
            return None
        step = shadow_ekf.step(self._running.state, self._running.noise, *heard)
        seen = follow(self._running.watch, step, self._running.noise)
        if place is not None:
            p = place.covariance
            spread = (float(p[0, 0]), float(p[0, 1]), float(p[1, 1]))
            seen = compare(seen, step.state, float(place.state[0]), float(place.state[1]), spread)
        self._running = self._running._replace(state=step.state, watch=seen)
        if seen.disagrees is None:
            return step
        self.news.append(("ekf-taken-back", seen.disagrees))
        self._running, self._barred = None, True
        return None

    def _start(self, place: Place) -> None:
        white_share, decorrelation_m = self._locator.noise()
        found = candidates(place.sigma_db, decorrelation_m, white_share, self._prior.height_m)
        noise = likeliest(found, place.state, list(self._recent))
        state = shadow_ekf.hold(place.state, noise, self._recent[0].x_m, self._recent[0].y_m)
        for heard in self._recent:
            state = shadow_ekf.step(state, noise, *heard).state
        try:
            state = shadow_ekf.release(state, place.covariance)
        except EstimationError:
            return
        self._running = _Running(state, noise, Watch())
        spread_m = sqrt(place.covariance[0, 0] + place.covariance[1, 1])
        self.news.append(
            ("ekf-started", f"the locator holds one place with a DRMS of {spread_m:.0f} m")
        )


def _is_close(place: Place, heard: Heard) -> bool:
    """Whether a Gaussian may stand for the place, seen from where the walker is."""
    (xx, xy), (_, yy) = place.covariance[:2, :2].tolist()
    distance_m = hypot(float(place.state[0]) - heard.x_m, float(place.state[1]) - heard.y_m)
    return place.probability >= ONE_PLACE and widest(xx, xy, yy) <= min(CLOSE * distance_m, TIGHT_M)


def _of_filter(step: ShadowStep) -> CellEstimate:
    s = step.state
    state = (s.x_m, s.y_m, s.p0_dbm, s.eta)
    return CellEstimate(
        EKF, 1.0, state, static_covariance(s.factors), step.innovation_db, step.innovation_var_db2
    )


def _of_locator(place: Place, before: Place | None, heard: Heard, height_m: float) -> CellEstimate:
    x_m, y_m, p0_dbm, eta = place.state.tolist()
    innovation_db, variance_db2 = np.nan, np.nan
    if before is not None and not heard.limit:
        innovation_db, variance_db2 = _innovation(before, heard, height_m)
    triangle = ekf.upper_triangle(place.covariance)
    return CellEstimate(
        LOCATOR, place.probability, (x_m, y_m, p0_dbm, eta), triangle, innovation_db, variance_db2
    )


def _innovation(before: Place, heard: Heard, height_m: float) -> tuple[float, float]:
    """How far a level was from what the place before it let expect, and the variance of that."""
    x_m, y_m, p0_dbm, eta = before.state.tolist()
    by_x, by_y, by_eta, _ = level_gradient(x_m - heard.x_m, y_m - heard.y_m, eta, height_m**2)
    h = np.array([by_x, by_y, 1.0, by_eta])
    variance_db2 = float(h @ before.covariance @ h) + before.sigma_db**2
    return heard.level_dbm - (p0_dbm + eta * by_eta), variance_db2
