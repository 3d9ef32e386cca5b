"""Error ellipses of a 2-D Gaussian."""

from dataclasses import dataclass
from math import atan2, degrees, sqrt

CHI2_95_2DOF = 5.991


@dataclass(frozen=True, slots=True)
class Ellipse:
    """Semi-axes in m; azimuth of the major axis in deg clockwise from grid north, 0 to 180."""

    semi_major_m: float
    semi_minor_m: float
    azimuth_deg: float


def ellipse95(p_xx: float, p_xy: float, p_yy: float) -> Ellipse:
    """Ellipse that holds 95 % of a Gaussian with the given covariance in m^2.

    The squared scale is 5.991, the quantile of chi-square with 2 degrees of freedom.
    """
    mean = 0.5 * (p_xx + p_yy)
    split = sqrt((0.5 * (p_xx - p_yy)) ** 2 + p_xy**2)
    # of the angle east-to-north theta: tan 2 theta = 2 Pxy / (Pxx - Pyy); azimuth = 90 - theta
    azimuth_deg = 90.0 - degrees(0.5 * atan2(2.0 * p_xy, p_xx - p_yy))
    major_m, minor_m = (
        sqrt(max(variance, 0.0) * CHI2_95_2DOF) for variance in (mean + split, mean - split)
    )
    return Ellipse(major_m, minor_m, azimuth_deg % 180.0)
