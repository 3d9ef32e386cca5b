"""Tracks of simulated walkers with the errors of a receiver."""

import numpy as np

from logger.core.places import Track, Utm

S = 10**9
EAST_M, NORTH_M = 5e5, 5.8e6


def track(t_s, xy_m, sigma_m=3.7):
    n = len(t_s)
    x, y = np.asarray(xy_m, float).T
    t_ns = np.round(np.asarray(t_s) * S).astype(np.int64) + 77 * S
    sigmas_m = np.broadcast_to(sigma_m, n) * 1.0
    nowhere = np.full(n, np.nan)
    return Track(x + EAST_M, y + NORTH_M, nowhere, sigmas_m, t_ns, Utm(33), seq=np.arange(n))


def at(smoothed, t_s):
    """Positions and sigma per axis at times as those of `track`."""
    result = smoothed.at(np.round(np.asarray(t_s) * S).astype(np.int64) + 77 * S)
    return np.column_stack([result.x_m - EAST_M, result.y_m - NORTH_M]), result.sigma_m


def streets(rng, seconds, speed_mps=1.4):
    """A walk round blocks of 80 m with sharp turns and stops: times 1 s apart, positions (n, 2)."""
    t_s = np.arange(float(seconds))
    stands = np.zeros(seconds, bool)
    for begin in rng.integers(0, seconds, seconds // 200):
        stands[begin : begin + rng.integers(5, 60)] = True
    length = np.cumsum(np.where(stands, 0.0, speed_mps))
    corner = 80.0 * np.arange(200)
    turn = np.arange(200) % 8
    x = np.interp(length, corner, 80.0 * np.array([0, 1, 1, 2, 2, 1, 1, 0])[turn])
    y = np.interp(length, corner, 80.0 * np.array([0, 0, 1, 1, 2, 2, 3, 3])[turn])
    return t_s, np.column_stack([x, y])


def wander(rng, t_s, sigma_m, tau_s):
    """Gauss-Markov error of both axes (n, 2)."""
    error = sigma_m * rng.normal(size=(len(t_s), 2))
    for k in range(1, len(t_s)):
        rho = np.exp(-(t_s[k] - t_s[k - 1]) / tau_s)
        error[k] = rho * error[k - 1] + np.sqrt(1.0 - rho**2) * error[k]
    return error
