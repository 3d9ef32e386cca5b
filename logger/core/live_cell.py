"""One cell on the device: the locator, and an EKF once the position is close and single.

The EKF starts from the locator's position when that has a sigma of at most 12 m and 0.15 of the
walker's distance (a linearised filter is consistent only if it starts close), and takes the
shadowing from the last readings. `FilterMonitor` decides when to discard it.

One walker carries all modems, so what two of them read of a cell at one place differs only by their
offset and by fading. `LiveScale` takes that offset reading by reading; the desktop program takes
the offsets as unknowns of the model (`logger.core.locator.offsets`).
"""

from collections import deque
from dataclasses import dataclass, field, replace
from math import hypot, nan, sqrt
from typing import NamedTuple

import numpy as np

from logger.core import ekf, shadow_ekf
from logger.core.errors import EstimationError
from logger.core.live_settings import EKF, LOCATOR, ONE_MODE
from logger.core.locator.online import JOINED, OnlineLocator
from logger.core.locator.posterior import Mode
from logger.core.model.area import WalkArea
from logger.core.model.path_loss import level_gradient
from logger.core.model.prior import Prior
from logger.core.places import Places
from logger.core.readings import Readings, in_order
from logger.core.repeated_levels import CacheTest
from logger.core.shadow_ekf import (
    CLOSE,
    FilterMonitor,
    ShadowNoise,
    ShadowState,
    candidates,
    likeliest,
    static_covariance,
    widest,
)
from logger.core.spikes import SpikeFilter
from logger.core.types import LiveEstimate

CERTAIN_DB = 1.0
"""Sigma of an offset below which a modem counts: levels are integers in dB."""
_NEAR_M = 10.0
"""Way of a walker between two polls; shadowing changes over far more."""
_FADING_DB, _FADING_PAIRS = 4.0, 8
"""Difference of two readings with 3 dB of fading each, and how many pairs that is worth: the first
few may agree by chance."""
_MOST_WAITING = 100
MANY_MORE = 30
"""A minute of polls: by then a modem in reach has been compared."""
TIGHT_M = 12.0
"""Largest sigma of the position at the start of the EKF, whatever the distance."""
_RECENT = 200
"""Readings that the shadowing at the start is taken from."""


@dataclass(slots=True)
class _Compared:
    """What a modem reads above the first: mean of `n` pairs, and their sum of squares about it."""

    n: int = 0
    mean_db: float = 0.0
    squares_db2: float = 0.0
    n_waiting: int = 0
    waiting: deque[Readings] = field(default_factory=lambda: deque(maxlen=_MOST_WAITING))
    is_paired: bool = True

    @property
    def sigma_db(self) -> float:
        variance_db2 = _FADING_DB**2 * _FADING_PAIRS + self.squares_db2
        return sqrt(variance_db2 / (_FADING_PAIRS + max(self.n - 1, 0)) / max(self.n, 1))

    def add(self, above_db: float) -> None:
        self.n += 1
        change_db = above_db - self.mean_db
        self.mean_db += change_db / self.n
        self.squares_db2 += change_db * (above_db - self.mean_db)


class LiveScale:
    """Levels of one cell on the scale of the modem that heard it first, `first`."""

    def __init__(self) -> None:
        self.first: str | None = None
        self._latest: Readings | None = None
        self._others: dict[str, _Compared] = {}

    def take(self, modem: str, reading: Readings) -> Readings | None:
        """A reading on the scale of the first modem; None while the offset is not certain."""
        if self.first is None:
            self.first = modem
        if modem == self.first:
            self._latest = reading
            for other in self._others.values():
                other.is_paired = False
            return reading
        other = self._others.setdefault(modem, _Compared(is_paired=False))
        self._compare(other, reading)
        if other.sigma_db > CERTAIN_DB:
            other.n_waiting += 1
            other.waiting.append(reading)
            return None
        other.waiting.clear()
        limit = reading.limit
        return replace(reading, level_dbm=reading.level_dbm - other.mean_db, known_limit=limit)

    def offset_db(self, modem: str) -> float | None:
        """What a modem reads above the first, None while that is not certain."""
        other = self._others.get(modem)
        return None if other is None or other.sigma_db > CERTAIN_DB else other.mean_db

    def waiting(self, modem: str, n: int) -> tuple[Readings, ...]:
        """The latest readings of a modem with many more than `n` that cannot be compared."""
        other = self._others.get(modem)
        if other is None or other.n_waiting <= n + MANY_MORE or not other.waiting:
            return ()
        return tuple(other.waiting)

    def _compare(self, other: _Compared, reading: Readings) -> None:
        """Each reading of the first modem is compared once with each other modem."""
        latest = self._latest
        if latest is None or other.is_paired or latest.limit.item() or reading.limit.item():
            return
        east_m = reading.x_m.item() - latest.x_m.item()
        if hypot(east_m, reading.y_m.item() - latest.y_m.item()) <= _NEAR_M:
            other.add(reading.level_dbm.item() - latest.level_dbm.item())
            other.is_paired = True


class _RunningEkf(NamedTuple):
    state: ShadowState
    noise: ShadowNoise
    monitor: FilterMonitor = FilterMonitor()


class LiveCell:
    """Estimate of one cell; `news` are the events of the last reading, as (code, text).

    `latest` is the newest estimate, None before the first; `locator` has the posterior of the
    position. Levels are on the scale of `LiveScale`.
    """

    def __init__(
        self,
        prior: Prior,
        spikes: SpikeFilter[Readings] | None = None,
        where: WalkArea | None = None,
    ) -> None:
        self._prior, self._where = prior, where
        self.locator = OnlineLocator(prior, where=where)
        self._first_spikes = spikes
        self._modems: dict[str, tuple[SpikeFilter[Readings], CacheTest]] = {}
        self._scale = LiveScale()
        self._ekf: _RunningEkf | None = None
        self._recent: list[Readings] = []
        self._may_start = True
        self.n = 0
        self.n_set_aside = self.n_repeated = 0
        self.news: list[tuple[str, str]] = []
        self.latest: LiveEstimate | None = None

    @property
    def stale(self) -> float:
        """As `OnlineLocator.stale`."""
        return self.locator.stale

    def away_m(self, place: Places) -> float:
        """Distance of a place from where the cell was heard last; 0 before that."""
        return self._recent[-1][-1].places.away_m(place) if self._recent else 0.0

    def take(self, latest: Readings, modem: str = "", scan_seq: int = 0) -> LiveEstimate | None:
        """Take a reading of a modem's scan; None while there is no estimate.

        A level far from its predecessor waits until the next ones confirm it: the estimate is then
        after all of them. One that they do not confirm is set aside, and one that the modem repeats
        from its cache is passed over.
        """
        self.news = []
        if modem not in self._modems:
            first = None if self._modems else self._first_spikes
            self._modems[modem] = first or SpikeFilter[Readings](), CacheTest()
        spikes, cache = self._modems[modem]
        level = latest.places, latest.level_dbm.item(), latest.limit.item()
        if cache.take(*level) and cache.is_cached:
            if not self.n_repeated:
                text = "the modem repeats its last level while the receiver moves: it counts once"
                self.news.append(("level-repeated", text))
            self.n_repeated += 1
            return None
        estimate = None
        for reading, spike_db in spikes.take(latest, *level):
            if spike_db:
                self._set_aside(reading, spike_db)
            elif (on_scale := self._on_scale(modem, reading)) is not None:
                estimate = self._update(on_scale, scan_seq)
        self.latest = estimate or self.latest
        return estimate

    def _on_scale(self, modem: str, reading: Readings) -> Readings | None:
        """None while the offset of the modem is not certain.

        Where a modem hears a cell far more often than the first and they cannot be compared, the
        estimate begins anew with it.
        """
        before_db = self._scale.offset_db(modem)
        on_scale = self._scale.take(modem, reading)
        offset_db = self._scale.offset_db(modem)
        if before_db is None and offset_db is not None:
            text = f"{modem} reads {offset_db:+.1f} dB against {self._scale.first}: it counts now"
            self.news.append(("modem-offset", text))
        if waiting := self._scale.waiting(modem, self.n):
            text = f"begun anew with {modem}, which cannot be compared with {self._scale.first}"
            self.news.append(("modem-changed", text))
            self.locator = OnlineLocator(self._prior, where=self._where)
            self._scale = LiveScale()
            self._recent.clear()
            self._ekf, self._may_start, self.n = None, True, 0
            for one in waiting[:-1]:
                self._scale.take(modem, one)
                self._update(one, scan_seq=0)  # its estimate is not recorded
            return self._scale.take(modem, waiting[-1])
        return on_scale

    def search(self) -> None:
        """Search the positions again."""
        self.locator.search()
        self._may_start = True

    def _set_aside(self, latest: Readings, spike_db: float) -> None:
        self.n_set_aside += 1
        side = "above" if spike_db > 0.0 else "below"
        off = f"{abs(spike_db):.0f} dB {side} the readings around it"
        self.news.append(
            ("level-set-aside", f"{latest.level_dbm.item():.0f} dBm is {off} and was set aside")
        )

    def _update(self, latest: Readings, scan_seq: int) -> LiveEstimate | None:
        self.n += 1
        before, before_db = self.locator.strongest_mode(), self.locator.level_sigma_db
        self.locator.take(latest)
        self._recent.append(latest)
        if len(self._recent) > JOINED:
            self._recent = [self._latest_readings()]
        mode = self.locator.strongest_mode()
        step = self._step_ekf(latest, mode)
        source = latest.cell, self.n, latest.utm.zone
        if step is not None:
            now, innovation = step.state, (step.innovation_db, step.innovation_var_db2)
            state = now.x_m, now.y_m, now.p0_dbm, now.eta
            p = static_covariance(now.factors)
            return LiveEstimate(scan_seq, EKF, *source, *state, *p, *innovation, 1.0)
        if mode is None:
            return None
        if self._may_start and _is_close(mode, latest):
            self._start_ekf(mode)
        innovation = nan, nan
        if before is not None and not latest.limit.item():
            innovation = _innovation(before, before_db, latest, self._prior.height_m)
        x_m, y_m, p0_dbm, eta = mode.state.tolist()
        state, p = (x_m, y_m, p0_dbm, eta), ekf.upper_triangle(mode.covariance)
        share = mode.probability
        return LiveEstimate(scan_seq, LOCATOR, *source, *state, *p, *innovation, share)

    def _step_ekf(self, latest: Readings, mode: Mode | None) -> ekf.EkfStep[ShadowState] | None:
        """None without an EKF, or if it has just been discarded."""
        if self._ekf is None:
            return None
        step = shadow_ekf.correct(self._ekf.state, self._ekf.noise, latest)
        monitor = self._ekf.monitor.after_step(step, self._ekf.noise)
        if mode is not None:
            monitor = monitor.after_search(step.state, mode.state, mode.covariance)
        self._ekf = self._ekf._replace(state=step.state, monitor=monitor)
        if monitor.disagrees is None:
            return step
        self.news.append(("ekf-taken-back", monitor.disagrees))
        self._ekf, self._may_start = None, False
        return None

    def _latest_readings(self) -> Readings:
        return in_order(self._recent).part(slice(-_RECENT, None))

    def _start_ekf(self, mode: Mode) -> None:
        white_share, decorrelation_m = self.locator.noise()
        height_m = self._prior.height_m
        noises = candidates(self.locator.level_sigma_db, decorrelation_m, white_share, height_m)
        recent = self._latest_readings()
        noise = likeliest(noises, mode.state, recent)
        state = shadow_ekf.hold(mode.state, noise, recent[0].places)
        for k in range(len(recent)):
            state = shadow_ekf.correct(state, noise, recent[k]).state
        try:
            state = shadow_ekf.release(state, mode.covariance)
        except EstimationError:
            return
        self._ekf = _RunningEkf(state, noise)
        drms_m = sqrt(mode.covariance[0, 0] + mode.covariance[1, 1])
        text = f"the locator has one position with a DRMS of {drms_m:.0f} m"
        self.news.append(("ekf-started", text))


def _is_close(mode: Mode, latest: Readings) -> bool:
    (xx, xy), (_, yy) = mode.covariance[:2, :2].tolist()
    x_m, y_m, _, _ = mode.state.tolist()
    distance_m = hypot(x_m - latest.x_m.item(), y_m - latest.y_m.item())
    is_tight = widest(xx, xy, yy) <= min(CLOSE * distance_m, TIGHT_M)
    return is_tight and mode.probability >= ONE_MODE


def _innovation(
    before: Mode, before_db: float, latest: Readings, height_m: float
) -> tuple[float, float]:
    """Level minus the expected one in dB, and the variance of the difference."""
    x_m, y_m, p0_dbm, eta = before.state.tolist()
    by_x, by_y, by_eta, _ = level_gradient(
        x_m - latest.x_m.item(), y_m - latest.y_m.item(), eta, height_m**2
    )
    h = np.array([by_x, by_y, 1.0, by_eta])
    variance_db2 = float(h @ before.covariance @ h) + before_db**2
    return latest.level_dbm.item() - (p0_dbm + eta * by_eta), variance_db2
