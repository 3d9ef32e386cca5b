"""Rows of a walk past one transmitter, as a logger gives them to `postproc guide`."""

import numpy as np

from logger.core.places import Utm

LAT_DEG, LON_DEG = 52.5, 13.4
P0_DBM, ETA = -25.0, 2.8


def rows(points_m, emitter_m, *, seed=0, noise_db=2.0, step_s=3.0):
    """Rows as text by column name, for points (n, 2) in metres from the start."""
    rng = np.random.default_rng(seed)
    utm = Utm.at(LAT_DEG, LON_DEG)
    start_m = utm.to_xy(LAT_DEG, LON_DEG)
    for k, (east_m, north_m) in enumerate(points_m):
        lat_deg, lon_deg = utm.to_latlon(start_m[0] + east_m, start_m[1] + north_m)
        away_m = np.hypot(np.hypot(east_m - emitter_m[0], north_m - emitter_m[1]), 5.0)
        level_dbm = P0_DBM - 10.0 * ETA * np.log10(away_m) + rng.normal(0.0, noise_db)
        yield {
            "t_s": f"{k * step_s:.1f}",
            "lat": f"{lat_deg:.7f}",
            "lon": f"{lon_deg:.7f}",
            "rssi_dbm": f"{max(level_dbm, -109.0):.0f}",
        }


def line(*corners_m, step_m=4.0):
    """Points along straight lines between corners, (n, 2)."""
    corners = np.asarray(corners_m, float)
    along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    at_m = np.arange(0.0, along_m[-1], step_m)
    return np.stack([np.interp(at_m, along_m, v) for v in corners.T], axis=1)
