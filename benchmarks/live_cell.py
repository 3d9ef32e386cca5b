"""One live reading of one cell, locator and EKF, against one update of filterpy's EKF.

python benchmarks/live_cell.py
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as fieldlogger does, before numpy is imported

import gc
import time

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from logger.core.live import live_prior
from logger.core.live_cell import LiveCell
from logger.core.live_settings import LiveSettings
from logger.core.places import Places
from logger.core.readings import Readings
from logger.device.memory import give_back

READINGS = 2000
STEP_M = 1.4
SOURCE = (160.0, 240.0)
FLOOR_DBM = -110.0
CLIPPED_SHARES = (0.2, 0.45, 0.7)


def walk(seed: int, *, shadow_db: float) -> list[Readings]:
    """A walk round blocks of 200 m, with white noise and shadowing correlated over 15 m."""
    rng = np.random.default_rng(seed)
    s = np.arange(READINGS) * STEP_M % 1600.0
    x = np.interp(s, [0, 200, 400, 600, 800, 1600], [0, 200, 200, 400, 400, 0])
    y = np.interp(s, [0, 200, 400, 600, 800, 1600], [0, 0, 200, 200, 400, 0])
    shadow = np.zeros(READINGS)
    rho = np.exp(-STEP_M / 15.0)
    for k in range(1, READINGS):
        shadow[k] = rho * shadow[k - 1] + np.sqrt(1.0 - rho**2) * rng.normal()
    level = -25.0 - 32.0 * np.log10(np.hypot(x - SOURCE[0], y - SOURCE[1])) + shadow_db * shadow
    level = np.round(level + 2.0 * rng.normal(size=READINGS))
    places = Places.of(x, y, sigma_m=np.full(READINGS, 3.0))
    return [
        Readings.one("cell", None, place, level_dbm)
        for place, level_dbm in zip(places, level.tolist(), strict=True)
    ]


def clip_levels(readings: list[Readings], share: float) -> list[Readings]:
    """The same, so weak that this share of the levels is at the floor of a GSM modem's scale."""
    change_db = FLOOR_DBM - round(
        float(np.quantile([reading.level_dbm.item() for reading in readings], share))
    )
    weaker = [max(reading.level_dbm.item() + change_db, FLOOR_DBM) for reading in readings]
    return [
        Readings.one("cell", None, r.places, dbm, -int(dbm == FLOOR_DBM))
        for r, dbm in zip(readings, weaker, strict=True)
    ]


def live_us(readings: list[Readings]) -> tuple[float, float, float, float]:
    """Median, mean, 99th percentile and worst CPU time of a reading, searches included."""
    gc.collect()
    cell = LiveCell(live_prior(LiveSettings()))
    spent = []
    for reading in readings:
        begun = time.process_time()
        cell.take(reading)
        if cell.stale > 1.0:
            cell.search()
        spent.append(1e6 * (time.process_time() - begun))
    median, p99 = np.quantile(spent, [0.5, 0.99]).tolist()
    return median, float(np.mean(spent)), p99, float(np.max(spent))


def filterpy_us(readings: list[Readings]) -> float:
    """CPU time of one predict and update of the four-state EKF in filterpy."""
    kf = ExtendedKalmanFilter(dim_x=4, dim_z=1)
    kf.x = np.array([[100.0], [100.0], [-40.0], [3.0]])
    kf.P = np.diag([100.0, 100.0, 25.0, 0.2])
    kf.Q, kf.R = 1e-5 * np.eye(4), np.array([[9.0]])
    c = 10.0 / np.log(10.0)
    begun = time.process_time()
    for reading in readings:

        def level(x: np.ndarray, reading: Readings = reading) -> np.ndarray:
            d2 = max((x[0, 0] - reading.x_m.item()) ** 2 + (x[1, 0] - reading.y_m.item()) ** 2, 1.0)
            return np.array([[x[2, 0] - 5.0 * x[3, 0] * np.log10(d2)]])

        def slope(x: np.ndarray, reading: Readings = reading) -> np.ndarray:
            dx, dy = x[0, 0] - reading.x_m.item(), x[1, 0] - reading.y_m.item()
            d2 = max(dx * dx + dy * dy, 1.0)
            return np.array(
                [[-c * x[3, 0] * dx / d2, -c * x[3, 0] * dy / d2, 1.0, -5.0 * np.log10(d2)]]
            )

        kf.predict()
        kf.update(np.array([[reading.level_dbm.item()]]), slope, level)
    return 1e6 * (time.process_time() - begun) / len(readings)


def main() -> None:
    """Print the table."""
    give_back()  # as fieldlogger does: it costs time
    peer = filterpy_us(walk(1, shadow_db=0.0))
    print(f"filterpy EKF, one update: {peer:.1f} us")
    white, shadowed = walk(2, shadow_db=0.0), walk(2, shadow_db=6.0)
    walks = {"white noise 2 dB": white, "and shadowing 6 dB / 15 m": shadowed}
    for share in CLIPPED_SHARES:
        walks[f"white noise 2 dB, {share:.0%} clipped"] = clip_levels(white, share)
        walks[f"and shadowing, {share:.0%} clipped"] = clip_levels(shadowed, share)
    for name, readings in walks.items():
        median, mean, p99, worst = live_us(readings)
        print(
            f"live cell, {name}: median {median:.0f} us, mean {mean:.0f} us a reading (ratio "
            f"{mean / peer:.0f}), 99 % {p99:.0f} us, worst {worst / 1000:.0f} ms (a search)"
        )


if __name__ == "__main__":
    main()
