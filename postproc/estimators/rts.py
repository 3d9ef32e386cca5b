"""Rauch-Tung-Striebel smoother of a linear filter's output.

With x_k, P_k filtered and x_k+1|k = F_k x_k, P_k+1|k = F_k P_k F_k' + Q_k:

    G_k = P_k F_k' P_k+1|k^-1
    x^s_k = x_k + G_k (x^s_k+1 - x_k+1|k)
    P^s_k = (I - G_k F_k) P_k (I - G_k F_k)' + G_k (Q_k + P^s_k+1) G_k'

(AIAA Journal 3(8), 1965; the covariance in the symmetric form, which cannot lose positive definiteness). Of a state
that does not move (F = I, Q = 0) the smoothed series is the last filtered state: smoothing repairs no bad start.
"""

import numpy as np

from logger.core.arrays import FloatArray


def smooth(x: FloatArray, p: FloatArray, transition: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Smoothed states (n, k) and covariances (n, k, k) from filtered ones of the same shapes.

    `transition` F and `noise` Q have shape (k, k), or (n - 1, k, k): entry i leads from state i to state i + 1.
    """
    steps, size = max(len(x) - 1, 0), x.shape[-1]
    f = np.broadcast_to(transition, (steps, size, size))
    q = np.broadcast_to(noise, (steps, size, size))
    x_ahead = np.einsum("nij,nj->ni", f, x[:-1])
    p_ahead = f @ p[:-1] @ np.swapaxes(f, 1, 2) + q
    gain = _gains(f @ p[:-1], p_ahead)
    rest = np.eye(size) - gain @ f
    own = rest @ p[:-1] @ np.swapaxes(rest, 1, 2) + gain @ q @ np.swapaxes(gain, 1, 2)
    x_smooth, p_smooth = x.copy(), p.copy()
    for k in range(steps - 1, -1, -1):
        x_smooth[k] += gain[k] @ (x_smooth[k + 1] - x_ahead[k])
        after = own[k] + gain[k] @ p_smooth[k + 1] @ gain[k].T
        p_smooth[k] = 0.5 * (after + after.T)
    return x_smooth, p_smooth


def _gains(cross: FloatArray, p_ahead: FloatArray) -> FloatArray:
    """G' = P_ahead^-1 (F P), solved with unit diagonals since metres, dB and eta differ by orders of magnitude."""
    scale = np.sqrt(np.diagonal(p_ahead, axis1=1, axis2=2))
    scale = np.where(scale > 0.0, scale, 1.0)
    even = p_ahead / (scale[:, :, None] * scale[:, None, :])
    solved = np.linalg.solve(even, cross / scale[:, :, None])
    return np.asarray(np.swapaxes(solved / scale[:, :, None], 1, 2), float)
