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


@pytest.mark.parametrize(("lat_deg", "lon_deg"), [(65.0, -18.0), (65.0, 26.0), (-16.5, 30.0)])
def test_a_country_at_the_date_line_is_not_near_everywhere_at_its_latitude(lat_deg, lon_deg):
    """Russia and Fiji: Iceland, Finland and Zimbabwe."""
    near = countries().near(lat_deg, lon_deg)
    assert not {"RU", "FJ"} & set(near), near


def test_russia_is_on_both_sides_of_the_date_line():
    assert countries().near(66.0, 178.0) == countries().near(66.0, -173.0) == ("RU",)


def test_a_network_may_broadcast_two_of_its_three_digits():
    assert countries().is_listed("334", "03")  # 334-030
    assert not countries().is_listed("334", "99")


def test_networks_that_are_switched_off_today_are_in_older_logs():
    assert countries().is_listed("262", "07")
    assert countries().is_listed("404", "24")


def test_networks_and_railways():
    plan = countries()
    assert plan.countries_of("232") == ("AT",)
    assert plan.is_listed("232", "01")
    assert plan.is_listed("232", "001")
    assert not plan.is_listed("232", "77")
    assert plan.is_railway("228", "06")
    assert plan.countries_of("299") == ()


TERRITORIES = {
    "266": (36.14, -5.35),  # Gibraltar
    "340": (16.24, -61.53),  # Guadeloupe
    "362": (12.15, -68.27),  # Bonaire
    "505": (-10.43, 105.68),  # Christmas Island
    "553": (-8.52, 179.2),  # Tuvalu
    "554": (-9.2, -171.85),  # Tokelau
    "647": (-20.88, 55.45),  # Reunion
    "742": (4.94, -52.33),  # French Guiana
}


@pytest.mark.parametrize(("mcc", "place"), TERRITORIES.items())
def test_small_territories_have_a_place(mcc, place):
    plan = countries()
    owners = set(plan.countries_of(mcc))
    assert owners & set(plan.near(*place))
    assert not owners & set(plan.near(47.07, 15.44))


def test_every_country_with_networks_is_on_the_map():
    plan = countries()
    mapped = {code for row in plan.sets for code in row.split()}
    assert {owner for mcc in plan.of_mcc for owner in plan.countries_of(mcc)} <= mapped
