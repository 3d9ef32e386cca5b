"""Position and advice in degrees."""

from math import atan2, cos, degrees, radians, remainder

from logger.core.answer import DEGREE_DECIMALS
from logger.core.guidance.advice import Advice
from logger.core.guidance.next_way import NextWay
from logger.core.places import Places


def next_way(advice: Advice | None) -> NextWay | None:
    """The advice in degrees."""
    if advice is None:
        return None
    lat, lon = (round(angle, DEGREE_DECIMALS) for angle in advice.end.first_deg)
    distance_m = advice.end.away_m(advice.start)
    azimuth_deg = true_azimuth_deg(advice.start, advice.end)
    nats_per_km = round(advice.nats_per_km, 2)
    return NextWay(azimuth_deg, round(distance_m, 1), lat, lon, nats_per_km, advice.text)


def true_azimuth_deg(start: Places, end: Places) -> float:
    """Direction from true north, 0 to 360 degrees, over distances of a walk.

    True and grid north differ by up to 3 degrees at the border of a zone.
    """
    lat_deg, lon_deg = start.first_deg
    to_lat_deg, to_lon_deg = end.first_deg
    east_deg = remainder(to_lon_deg - lon_deg, 360.0)  # 180 and -180 are one meridian
    east = east_deg * cos(radians(0.5 * (lat_deg + to_lat_deg)))
    return round(degrees(atan2(east, to_lat_deg - lat_deg)) % 360.0, 1) % 360.0
