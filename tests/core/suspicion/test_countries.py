import pytest

from logger.core.suspicion.countries import countries


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg", "near"),
    [
        (46.948, 7.447, "CH"),
        (47.80, 13.05, "DE"),  # Salzburg, at the border
        (51.89, -8.5, "IE"),
        (-16.5, 179.99, "FJ"),  # the date line
        (-16.5, -179.99, "FJ"),
    ],
)
def test_countries_near_a_position(lat_deg, lon_deg, near):
    assert near in countries().near(lat_deg, lon_deg)


def test_the_ocean_has_no_country():
    assert countries().near(0.0, -30.0) == ()


def test_networks_and_railways():
    plan = countries()
    assert plan.countries_of("232") == ("AT",)
    assert plan.is_listed("232", "01")
    assert plan.is_listed("232", "001")
    assert not plan.is_listed("232", "77")
    assert plan.is_railway("228", "06")
    assert plan.countries_of("299") == ()
