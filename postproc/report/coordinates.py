"""A position as others write it: decimal, in degrees, UTM, MGRS, and as links to maps.

Sources: RFC 5870 (geo URI), wiki.openstreetmap.org/wiki/Browsing (links), NGA.STND.0037 (MGRS).
"""

from dataclasses import dataclass

from logger.core.certainty import OnMap
from logger.core.errors import GeoError
from logger.core.places import MAX_LATITUDE_DEG, Places, Utm

_DECIMALS = 5
"""A metre."""
_ZOOM = 18
"""Of a link to OpenStreetMap: some streets."""
_BANDS = "CDEFGHJKLMNPQRSTUVWX"
"""Latitude bands of 8 degrees from 80 south on, the last one of 12."""
_COLUMNS = ("ABCDEFGH", "JKLMNPQR", "STUVWXYZ")
"""Letters of the 100 km columns of zones 1, 2, 3 and so on."""
_ROWS = "ABCDEFGHJKLMNPQRSTUV"
"""Letters of the 100 km rows; in even zones they begin with F."""
_SOUTHMOST_DEG = -80.0


@dataclass(frozen=True, slots=True)
class Coordinates:
    """One position in each notation; UTM and MGRS are empty where they do not exist.

    `share` is its probability if others fit, `street` the nearest street, empty if unknown.
    """

    decimal: str
    degrees: str
    utm: str
    mgrs: str
    geo: str
    osm: str
    share: str = ""
    street: str = ""


def coordinates(
    at: OnMap,
    r95_m: float | None = None,
    share: str = "",
    street: str = "",
    decimals: int = _DECIMALS,
) -> Coordinates:
    """Every notation of a position; `r95_m` becomes the uncertainty of the geo URI.

    `decimals` are those of `decimal`.
    """
    lat, lon = (f"{value:.{_DECIMALS}f}" for value in (at.lat, at.lon))
    uncertain = "" if r95_m is None else f";u={r95_m:.0f}"
    return Coordinates(
        decimal=f"{at.lat:.{decimals}f}, {at.lon:.{decimals}f}",
        degrees=f"{_dms(at.lat, 'NS')} {_dms(at.lon, 'EW')}",
        utm=_utm(at),
        mgrs=_mgrs(at),
        geo=f"geo:{lat},{lon}{uncertain}",
        osm=f"https://www.openstreetmap.org/?mlat={lat}&mlon={lon}#map={_ZOOM}/{lat}/{lon}",
        share=share,
        street=street,
    )


def _dms(value_deg: float, letters: str) -> str:
    """Degrees, minutes and seconds to a hundredth, which is 0.3 m: a tenth is another place."""
    hundredths = round(abs(value_deg) * 360_000)
    degrees, rest = divmod(hundredths, 360_000)
    minutes, rest = divmod(rest, 6_000)
    letter = letters[0] if value_deg >= 0.0 else letters[1]
    return f"{degrees}°{minutes:02d}'{rest / 100:05.2f}\"{letter}"


def _in_standard_zone(at: OnMap) -> Places | None:
    """The place in the standard grid, which has wider zones in Norway and Svalbard."""
    lat_deg, lon_deg = at.lat, at.lon
    if not _SOUTHMOST_DEG <= lat_deg < MAX_LATITUDE_DEG:
        return None
    zone = int((lon_deg + 180.0) // 6.0) % 60 + 1
    if 56.0 <= lat_deg < 64.0 and 3.0 <= lon_deg < 12.0:
        zone = 32
    if lat_deg >= 72.0 and 0.0 <= lon_deg < 42.0:
        zone = 31 + 2 * int((lon_deg + 3.0) // 12.0)
    utm = Utm(zone if lat_deg >= 0.0 else -zone)
    try:
        return Places.of_degrees(lat_deg, lon_deg, utm=utm)
    except GeoError:
        return None


def _band(lat_deg: float) -> str:
    return _BANDS[min(int((lat_deg - _SOUTHMOST_DEG) // 8.0), len(_BANDS) - 1)]


def _utm(at: OnMap) -> str:
    place = _in_standard_zone(at)
    if place is None:
        return ""
    zone = abs(place.utm.zone)
    return f"{zone}{_band(at.lat)} {place.x_m.item():.0f} {place.y_m.item():.0f}"


def _mgrs(at: OnMap) -> str:
    """To a metre; digits of MGRS are cut off, not rounded."""
    place = _in_standard_zone(at)
    if place is None:
        return ""
    zone = abs(place.utm.zone)
    east, north = int(place.x_m.item()), int(place.y_m.item())
    column = _COLUMNS[(zone - 1) % 3][east // 100_000 - 1]
    row = _ROWS[(north // 100_000 + (5 if zone % 2 == 0 else 0)) % len(_ROWS)]
    return f"{zone}{_band(at.lat)} {column}{row} {east % 100_000:05d} {north % 100_000:05d}"
