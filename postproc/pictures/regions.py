"""Outlines of highest-density regions, from an origin."""

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import HALF, LEVEL, Squares
from postproc.estimators.region_outline import outline

Rings = list[FloatArray]
"""Outline of a region: closed rings (k, 2), outer ones counterclockwise, holes clockwise."""


def regions_of(posterior: Posterior, origin_m: tuple[float, float]) -> dict[str, Rings]:
    """Outlines of the 95 % and the 50 % region; the latter is empty where it would not be true."""
    regions = {"95": region_rings(posterior.squares, LEVEL, origin_m), "50": list[FloatArray]()}
    if posterior.is_strongest_inside:
        regions["50"] = region_rings(posterior.squares, HALF, origin_m)
    return regions


def region_rings(cells: Squares, share: float, origin_m: tuple[float, float]) -> Rings:
    """Outline of the smallest region with this share of the probability, from `origin_m` in m."""
    return [
        np.asarray(ring.coords, float) - origin_m
        for polygon in outline(cells, share)
        for ring in (polygon.exterior, *polygon.interiors)
    ]
