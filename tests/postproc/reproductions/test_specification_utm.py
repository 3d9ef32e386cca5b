from math import asinh, atan, atanh, cos, cosh, radians, sin, sinh, sqrt

import pytest

from postproc.reproductions import specification
from postproc.reproductions.specification import QUICK

A_M, F, SCALE = 6378137.0, 1.0 / 298.257223563, 0.9996


def krueger(lat_deg, lon_deg, zone):
    """Transverse Mercator by Krueger's series in the third flattening n, to n^3 (a tenth of a
    millimetre here).
    """
    n = F / (2.0 - F)
    e = sqrt(F * (2.0 - F))
    lat, lon = radians(lat_deg), radians(lon_deg - (6.0 * abs(zone) - 183.0))
    t = sinh(atanh(sin(lat)) - e * atanh(e * sin(lat)))
    xi, eta = atan(t / cos(lon)), asinh(sin(lon) / sqrt(t * t + cos(lon) ** 2))
    alpha = (n / 2 - 2 * n**2 / 3 + 5 * n**3 / 16, 13 * n**2 / 48 - 3 * n**3 / 5, 61 * n**3 / 240)
    x = eta + sum(a * cos(2 * j * xi) * sinh(2 * j * eta) for j, a in enumerate(alpha, 1))
    y = xi + sum(a * sin(2 * j * xi) * cosh(2 * j * eta) for j, a in enumerate(alpha, 1))
    radius_m = SCALE * A_M / (1 + n) * (1 + n**2 / 4 + n**4 / 64)
    return 500_000.0 + radius_m * x, radius_m * y + (1e7 if zone < 0 else 0.0)


@pytest.mark.parametrize("place", specification.EXAMPLES, ids=lambda place: place.name)
def test_the_true_coordinates_are_those_of_an_independent_series(place):
    assert krueger(place.lat_deg, place.lon_deg, place.zone) == pytest.approx(
        place.true_m, abs=0.051
    )


def test_the_claims_are_wrong_and_ours_are_right():
    verdicts = {check.claim: check.verdict for check in specification._utm_checks(QUICK)}
    assert sum(verdict == "claim is wrong" for verdict in verdicts.values()) == 2
    assert "fails" not in verdicts.values()


def test_a_broken_projection_fails_the_check(monkeypatch):
    true = specification.Utm.to_xy
    monkeypatch.setattr(
        specification.Utm, "to_xy", lambda *place: tuple(value + 1.0 for value in true(*place))
    )
    assert "fails" in {check.verdict for check in specification._utm_checks(QUICK)}
