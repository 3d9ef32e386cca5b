import numpy as np
import pytest

from logger.core.locator import region
from logger.core.locator.region import Squares
from logger.core.places import Places


def gaussians(*peaks, count=100, size=4.0):
    """Cells of a mixture of round Gaussians (weight, x, y, sigma)."""
    at = (np.arange(count) - count / 2 + 0.5) * size
    x, y = (v.ravel() for v in np.meshgrid(at, at))
    mass = sum(
        w / s**2 * np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * s * s)) for w, a, b, s in peaks
    )
    return Squares(x, y, np.full(x.size, size), mass / mass.sum())


def quarter_squares(cells, wanted):
    """The same mass with some cells split in four."""
    quarter = 0.25 * cells.size_m[wanted]
    x, y, size, p = ([v[~wanted]] for v in (cells.x_m, cells.y_m, cells.size_m, cells.probability))
    for i in (-1, 1):
        for j in (-1, 1):
            x.append(cells.x_m[wanted] + i * quarter)
            y.append(cells.y_m[wanted] + j * quarter)
            size.append(2.0 * quarter)
            p.append(0.25 * cells.probability[wanted])
    return Squares(*(np.concatenate(v) for v in (x, y, size, p)))


# --- highest density ---


@pytest.mark.parametrize(("level", "chi2"), [(0.95, 5.991), (0.5, 1.386)])
def test_area_of_a_gaussian(level, chi2):
    cells = gaussians((1.0, 0.0, 0.0, 30.0))
    assert region.area_m2(cells, level) == pytest.approx(np.pi * chi2 * 30.0**2, rel=0.03)


def test_dense_cells_come_first_whatever_their_size():
    cells = Squares(np.array([0.0, 10.0]), np.zeros(2), np.array([1.0, 10.0]), np.array([0.4, 0.6]))
    np.testing.assert_array_equal(region.highest_density(cells, 0.3), [0])
    np.testing.assert_array_equal(region.highest_density(cells, 0.95), [0, 1])


def test_no_other_set_of_the_same_mass_is_smaller():
    rng = np.random.default_rng(1)
    cells = Squares(
        np.arange(12.0), np.zeros(12), rng.uniform(0.5, 3.0, 12), rng.dirichlet(np.ones(12))
    )
    chosen = region.highest_density(cells, 0.8)
    held, area = cells.probability[chosen].sum(), np.sum(cells.size_m[chosen] ** 2)
    assert held >= 0.8
    assert held - cells.probability[chosen[-1]] < 0.8
    for bits in range(1 << 12):
        other = np.flatnonzero([bits >> k & 1 for k in range(12)])
        if cells.probability[other].sum() >= held:
            assert np.sum(cells.size_m[other] ** 2) >= area - 1e-9


def test_how_finely_the_plane_is_cut_does_not_matter():
    cells = gaussians((0.7, -60.0, 0.0, 20.0), (0.3, 60.0, 0.0, 20.0))
    finer = quarter_squares(cells, cells.x_m > 0.0)
    assert region.area_m2(finer) == pytest.approx(region.area_m2(cells), rel=1e-3)
    held = [
        sorted(c.probability[k].sum() for k in region.mode_regions(c, 0.999))
        for c in (cells, finer)
    ]
    assert held[1] == pytest.approx(held[0], abs=1e-3)


def test_all_mass():
    cells = gaussians((1.0, 0.0, 0.0, 30.0), count=10, size=30.0)
    assert len(region.highest_density(cells, 1.0)) == len(cells)
    assert region.area_m2(Squares(np.zeros(1), np.zeros(1), np.full(1, 10.0), np.ones(1))) == 100.0


@pytest.mark.parametrize("level", [0.3, 0.5, 0.95])
def test_among_some_cells_the_others_do_not_count(level):
    cells = gaussians((0.5, -60.0, 0.0, 15.0), (0.5, 60.0, 40.0, 25.0))
    some = np.flatnonzero(cells.x_m > 0.0)
    alone = Squares(*(v[some] for v in (cells.x_m, cells.y_m, cells.size_m, cells.probability)))
    np.testing.assert_array_equal(
        region.highest_density(cells, level, some), some[region.highest_density(alone, level)]
    )


@pytest.mark.parametrize(("x_m", "y_m", "is_in"), [(3.0, 4.0, True), (7.0, 0.0, False)])
def test_a_position_is_in_a_square_only_if_it_is_along_both_axes(x_m, y_m, is_in):
    cells = Squares(np.array([0.0, 7.0]), np.array([0.0, 9.0]), np.full(2, 8.0), np.full(2, 0.5))
    assert region.contains(cells, np.array([0, 1]), Places.of(x_m, y_m)) == is_in
    assert not region.contains(cells, np.array([1]), Places.of(x_m, y_m))


def test_a_common_corner_is_in_the_squares_in_spite_of_rounding():
    size_m = 14.892578065686848
    middle_m = 691_600.1 - 0.5 * size_m
    cells = Squares(np.array([middle_m]), np.array([middle_m]), np.full(1, size_m), np.ones(1))
    corner_m = np.nextafter(middle_m + 0.5 * size_m, np.inf)
    assert region.contains(cells, np.zeros(1, int), Places.of(corner_m, corner_m))
    assert not region.contains(cells, np.zeros(1, int), Places.of(corner_m + 1e-3, corner_m))


# --- cover ---


@pytest.mark.parametrize("most", [4, 40, 400, 10_000])
def test_few_squares_cover_the_whole_region(most):
    cells = gaussians((0.6, -100.0, 50.0, 12.0), (0.4, 80.0, -60.0, 30.0), count=64)
    cells = quarter_squares(cells, cells.x_m < 0.0)
    chosen = region.highest_density(cells)
    x_m, y_m, side_m = region.coarse_cover(cells, most)
    assert len(side_m) <= most
    reach_m = 0.5 * (side_m - cells.size_m[chosen, None]) + 1e-6
    inside = np.abs(x_m - cells.x_m[chosen, None]) <= reach_m
    inside &= np.abs(y_m - cells.y_m[chosen, None]) <= reach_m
    assert (np.sum(inside, axis=1) == 1).all()
    if most >= len(chosen):
        assert np.sum(side_m**2) == pytest.approx(region.area_m2(cells))


# --- modes ---


def test_two_peaks_are_two_modes():
    cells = gaussians((0.7, -80.0, 0.0, 20.0), (0.3, 80.0, 0.0, 20.0))
    found = region.mode_regions(cells, 0.999)
    assert sorted(cells.probability[k].sum() for k in found) == pytest.approx([0.3, 0.7], abs=0.01)


def test_near_peaks_are_one_mode():
    assert (
        len(region.mode_regions(gaussians((0.5, -22.0, 0.0, 20.0), (0.5, 22.0, 0.0, 20.0)), 0.999))
        == 1
    )


@pytest.mark.parametrize(("apart_m", "count"), [(62.0, 1), (70.0, 2)])
def test_the_pass_between_two_peaks_decides(apart_m, count):
    """Two Gaussians of sigma 20 m: the pass is at half the height when they are 66.6 m apart."""
    cells = gaussians(
        (0.5, -apart_m / 2, 0.0, 20.0), (0.5, apart_m / 2, 0.0, 20.0), count=200, size=2.0
    )
    assert len(region.mode_regions(cells, 0.999)) == count


def test_a_ring_is_one_mode():
    """Peaks along it meet one after the other, the last one the first."""
    angle = np.linspace(0.0, 2.0 * np.pi, 17)[:-1]
    ring = [(1.0, 120.0 * np.cos(a), 120.0 * np.sin(a), 20.0) for a in angle]
    assert len(region.mode_regions(gaussians(*ring), 0.99)) == 1


def test_cells_that_meet_at_a_corner_touch():
    cells = Squares(
        np.array([0.0, 1.0, 3.0]),
        np.array([0.0, 1.0, 3.0]),
        np.ones(3),
        np.array([0.4, 0.35, 0.25]),
    )
    assert sorted(len(k) for k in region.mode_regions(cells, 1.0)) == [1, 2]


def test_all_squares_that_touch_are_neighbours():
    """Squares of several sizes, each compared with each."""
    cells = gaussians((0.6, -50.0, 0.0, 30.0), (0.4, 60.0, 20.0, 15.0), count=30, size=10.0)
    rng = np.random.default_rng(3)
    for _ in range(3):
        cells = quarter_squares(cells, rng.random(len(cells)) < 0.3)
    chosen = region.highest_density(cells, 0.99)
    reach_m = 0.5 * (cells.size_m[chosen, None] + cells.size_m[chosen]) * (1.0 + 1e-6)
    apart_m = [np.abs(v[chosen, None] - v[chosen]) for v in (cells.x_m, cells.y_m)]
    touches = np.tril((apart_m[0] <= reach_m) & (apart_m[1] <= reach_m), -1)
    found = region._denser_neighbours(cells, chosen)
    assert len(found) == len(chosen)
    for neighbours, row in zip(found, touches, strict=True):
        np.testing.assert_array_equal(np.sort(neighbours), np.flatnonzero(row))


def test_large_cells_touch_small_ones():
    cells = Squares(
        np.array([0.0, 5.5]), np.array([0.0, 4.9]), np.array([1.0, 10.0]), np.array([0.02, 0.98])
    )
    assert len(region.mode_regions(cells, 1.0)) == 1


def test_modes_share_no_square_and_contain_the_level():
    cells = gaussians((0.5, -60.0, 0.0, 15.0), (0.3, 60.0, 40.0, 25.0), (0.2, 0.0, -90.0, 10.0))
    together = np.concatenate(region.mode_regions(cells, 0.99))
    assert len(np.unique(together)) == len(together)
    assert cells.probability[together].sum() == pytest.approx(0.99, abs=0.001)
