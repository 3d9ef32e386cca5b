"""Notations of a position; values of MGRS and UTM are those of GEOTRANS for the same positions."""

import pytest

from logger.core.certainty import OnMap
from postproc.report.coordinates import coordinates


@pytest.mark.parametrize(
    ("lat", "lon", "utm", "mgrs"),
    [
        (38.8977, -77.0365, "18S 323394 4307396", "18S UJ 23394 07395"),
        (-33.86, 151.21, "56H 334416 6251925", "56H LH 34416 51925"),
        (60.0, 5.0, "32V 276980 6658157", "32V KM 76979 58157"),
        (75.0, 9.1, "33X 329807 8332079", "33X UD 29807 32079"),
        (84.5, 9.1, "", ""),
        (-80.5, 9.1, "", ""),
    ],
)
def test_grids_with_the_wide_zones_of_norway(lat, lon, utm, mgrs):
    at = coordinates(OnMap(lat=lat, lon=lon))
    assert (at.utm, at.mgrs) == (utm, mgrs)


def test_links_and_degrees():
    at = coordinates(OnMap(lat=52.50029, lon=-13.40102), 11.4)
    assert at.decimal == "52.50029, -13.40102"
    assert at.degrees == "52°30'01.04\"N 13°24'03.67\"W"
    assert at.geo == "geo:52.50029,-13.40102;u=11"
    assert at.osm == (
        "https://www.openstreetmap.org/?mlat=52.50029&mlon=-13.40102#map=18/52.50029/-13.40102"
    )


def test_a_full_minute_is_carried_over():
    assert coordinates(OnMap(lat=9.99999999, lon=0.0)).degrees == "10°00'00.00\"N 0°00'00.00\"E"
