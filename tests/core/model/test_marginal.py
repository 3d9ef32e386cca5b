import numpy as np
import pytest
import scipy.integrate
import scipy.stats

from logger.core.model.blocks import blocks
from logger.core.model.marginal import NODES, SharedSums, marginal, walk_sums
from logger.core.model.noise import matrices_of, whiteners
from logger.core.model.prior import WHITE, Hypothesis, Prior, Station, prior_for
from logger.core.places import Places
from tests.kit.noise_groups import noise_groups
from tests.kit.walks import observations, simulate

MOST = 300
PLACES = np.array([[90.0, 200.0, -400.0], [40.0, -50.0, 300.0]])
ANY = Prior(noise=noise_groups(Hypothesis(0.3, 30.0)))
PRIOR = ANY.of_station(Station(1.0, 5.0))
SECTOR = ANY.of_station(Station(1.0, 5.0, (9.3, 3.3)))
NOISES = [(1.0, 0.0), (0.3, 30.0)]


def bent_walk(position_sigma=0.0, count=14):
    rng = np.random.default_rng(1)
    x, y = np.arange(count) * 20.0, np.where(np.arange(count) < 7, 0.0, 60.0)
    level = -30 - 28 * np.log10(np.hypot(x - 90, y - 40)) + 4 * rng.normal(size=count)
    return blocks(observations(x, y, level, position_sigma), MOST)


def evidence_of(track, prior, positions, nodes=NODES):
    found = whiteners(track, prior)
    total = walk_sums(track, matrices_of(found), prior, Places.of(*positions))
    return marginal(total, len(track), np.array([[w.log_det] for w in found]), prior, nodes)


# --- oracle: written from the equations, with nothing of the code under test ---


class Oracle:
    """A walk seen from one place: levels jointly normal given sigma, P0 and eta."""

    def __init__(self, track, prior, noise, position):
        self.prior, self.level = prior, track.level_dbm
        d2 = (track.places.x_m - position[0]) ** 2 + (track.places.y_m - position[1]) ** 2
        self.distance_db = 5.0 * np.log10(d2 + prior.height_m**2 + 2.0 * track.places.sigma_m**2)
        self.covariance = self._covariance(track, *noise)
        azimuth = np.arctan2(track.places.y_m - position[1], track.places.x_m - position[0])
        fading = np.hypot(track.places.x_m - position[0], track.places.y_m - position[1]) / 10 ** (
            self.distance_db / 10
        )
        harmonics = [
            fading**k * f(k * azimuth)
            for k in range(1, 1 + len(prior.antenna_db))
            for f in (np.cos, np.sin)
        ]
        self.design = np.column_stack([np.ones(len(d2)), -self.distance_db, *harmonics])
        self.mean = np.array([prior.p0_dbm, prior.eta, *np.zeros(len(harmonics))])
        self.spread = np.array(
            [prior.p0_sigma_db, prior.eta_sigma, *np.repeat(prior.antenna_db, 2)]
        )

    def _covariance(self, track, white_share, d_c):
        """Of the levels by sigma^2, each whitened row's variance grown by the receiver's error."""
        apart = np.hypot(
            track.places.x_m[:, None] - track.places.x_m,
            track.places.y_m[:, None] - track.places.y_m,
        )
        k = (1.0 - white_share) * (np.exp(-apart / d_c) if d_c else np.eye(len(apart)))
        k += np.diag(white_share / track.readings + 1.0 / 12.0 / self.prior.sigma_db**2)
        root = np.linalg.cholesky(k)
        moved_db = (
            10.0
            / np.log(10.0)
            * self.prior.eta
            * track.places.sigma_m
            / 10.0 ** (self.distance_db / 10.0)
        )
        grown = 1.0 + (moved_db / self.prior.sigma_db) ** 2 / np.diag(root) ** 2
        return root @ np.diag(grown) @ root.T

    def theta(self, sigma):
        """Mean and covariance of P0 and eta given sigma."""
        by_noise = np.linalg.solve(self.covariance, self.design).T / sigma**2
        cov = np.linalg.inv(by_noise @ self.design + np.diag(self.spread**-2))
        return cov @ (by_noise @ self.level + self.mean / self.spread**2), cov

    def log_p(self, sigma):
        """Of all levels given sigma: P0 and eta are two more terms of a normal covariance."""
        of_theta = self.design * self.spread
        covariance = sigma**2 * self.covariance + of_theta @ of_theta.T
        return scipy.stats.multivariate_normal.logpdf(
            self.level, self.design @ self.mean, covariance
        )

    def log_p_by_net(self, sigma):
        """The same by summing the likelihood over a net of P0 and eta."""
        (mean, cov), u = self.theta(sigma), np.linspace(-8.5, 8.5, 45)
        root = np.linalg.cholesky(cov)
        theta = mean + np.stack(np.meshgrid(u, u, indexing="ij"), -1) @ root.T
        r = self.level - theta @ self.design.T
        log_p = (
            -0.5
            * np.einsum("abn,nm,abm->ab", r, np.linalg.inv(self.covariance), r, optimize=True)
            / sigma**2
        )
        log_p -= 0.5 * np.linalg.slogdet(2.0 * np.pi * sigma**2 * self.covariance)[1]
        log_p += scipy.stats.norm.logpdf(theta, self.mean, self.spread).sum(-1)
        return (
            np.log(np.sum(np.exp(log_p - log_p.max())) * (u[1] - u[0]) ** 2 * np.linalg.det(root))
            + log_p.max()
        )

    def over_sigma(self, log_p, count=161):
        """Log of the integral over log sigma, the nodes and their weights."""
        log_sigma = np.linspace(np.log(0.8), np.log(25.0), count)
        values = np.array([log_p(s) for s in np.exp(log_sigma)])
        values += scipy.stats.norm.logpdf(
            log_sigma, np.log(self.prior.sigma_db), self.prior.sigma_log_sd
        )
        share = np.exp(values - values.max())
        return (
            np.log(scipy.integrate.trapezoid(share, log_sigma)) + values.max(),
            np.exp(log_sigma),
            share / share.sum(),
        )


# --- the integral ---


@pytest.mark.parametrize("position_sigma", [0.0, 5.0])
@pytest.mark.parametrize("row", [0, 1])
@pytest.mark.parametrize("position", [0, 1, 2])
def test_log_evidence_is_the_integral_over_p0_eta_and_sigma(position, row, position_sigma):
    track = bent_walk(position_sigma)
    ours = evidence_of(track, PRIOR, PLACES, nodes=15).log_p[row, position]
    oracle = Oracle(track, PRIOR, NOISES[row], PLACES[:, position])
    assert ours == pytest.approx(oracle.over_sigma(oracle.log_p_by_net, 81)[0], abs=1e-6, rel=0)
    assert ours == pytest.approx(oracle.over_sigma(oracle.log_p)[0], abs=1e-6, rel=0)


@pytest.mark.parametrize("row", [0, 1])
def test_harmonics_of_an_antenna_are_integrated_as_well(row):
    track = bent_walk(5.0, count=40)
    ours = evidence_of(track, SECTOR, PLACES, nodes=15)
    for h, position in enumerate(PLACES.T):
        oracle = Oracle(track, SECTOR, NOISES[row], position)
        log_p, sigma, share = oracle.over_sigma(oracle.log_p)
        assert ours.log_p[row, h] == pytest.approx(log_p, abs=1e-6, rel=0)
        mean = share @ [oracle.theta(s)[0] for s in sigma]
        np.testing.assert_allclose(ours.theta[:, row, h], mean, rtol=1e-5)


def test_sums_of_a_sector_antenna_contain_those_of_an_omnidirectional_one():
    prior = Prior()
    track, numbers = bent_walk(position_sigma=5.0), range(len(prior.hypotheses))
    matrices = matrices_of(whiteners(track, prior, numbers))
    shared = SharedSums.of(prior, np.isfinite(prior.station_log_odds))
    assert prior.stations[shared.patterned].antenna_db
    assert shared.rest.tolist() == [prior.hypotheses.index(WHITE)]
    first, patterned = (prior.of_station(prior.stations[k]) for k in (0, shared.patterned))
    alone = walk_sums(track, matrices, first, Places.of(*PLACES))
    joined = shared.join(
        walk_sums(track, matrices[shared.rest], first, Places.of(*PLACES)),
        walk_sums(track, matrices[shared.rows], patterned, Places.of(*PLACES)),
    )
    np.testing.assert_allclose(joined, alone, rtol=1e-12)


def test_without_a_pattern_no_sums_are_shared():
    prior = prior_for("any", antenna="omni")
    shared = SharedSums.of(prior, np.isfinite(prior.station_log_odds))
    assert (len(shared.rows), len(shared.rest)) == (0, len(prior.hypotheses))


def test_wide_columns_do_not_change_what_a_narrow_prior_says():
    track, narrow = bent_walk(5.0), PRIOR.of_station(Station(1.0, 5.0, (1e-4,)))
    omni, sector = (evidence_of(track, prior, PLACES) for prior in (PRIOR, narrow))
    np.testing.assert_allclose(sector.log_p, omni.log_p, atol=1e-4, rtol=0)
    np.testing.assert_allclose(sector.theta_cov, omni.theta_cov, rtol=1e-3)


@pytest.mark.parametrize("count", [1, 2, 6, 60])
def test_few_nodes_over_sigma_suffice(count):
    """Those of the search are fewer: a thousandth of a nat decides nothing."""
    track = bent_walk(5.0, count)
    for row, noise in enumerate(NOISES):
        oracles = [Oracle(track, PRIOR, noise, position) for position in PLACES.T]
        expected = [oracle.over_sigma(oracle.log_p)[0] for oracle in oracles]
        np.testing.assert_allclose(
            evidence_of(track, PRIOR, PLACES).log_p[row], expected, atol=1e-3, rtol=0
        )


def test_several_readings_in_a_block_count_as_their_mean():
    rng = np.random.default_rng(4)
    x, y = np.repeat(np.arange(20) * 12.0, 5), np.repeat(np.arange(20) % 2 * 9.0, 5)
    track = blocks(observations(x, y, rng.normal(-80, 4, 100)), MOST)
    assert track.readings.tolist() == [5] * 20
    oracle = Oracle(track, PRIOR, NOISES[1], (100.0, 90.0))
    ours = evidence_of(track, PRIOR, np.array([[100.0], [90.0]]), nodes=15).log_p[1, 0]
    assert ours == pytest.approx(oracle.over_sigma(oracle.log_p)[0], abs=1e-6, rel=0)


def test_more_readings_of_one_block_than_sixteen_are_not_believed():
    at = [np.repeat(np.arange(12) * 20.0, n) for n in (16, 400)]
    level = -80.0 - np.arange(12) % 5
    few, many = (
        evidence_of(
            blocks(observations(x, 0 * x, np.repeat(level, len(x) // 12)), MOST), PRIOR, PLACES
        )
        for x in at
    )
    np.testing.assert_allclose(few.log_p, many.log_p, rtol=1e-12)


@pytest.mark.parametrize("row", [0, 1])
def test_p0_eta_and_sigma_given_the_position(row):
    track = bent_walk(5.0)
    ours = evidence_of(track, PRIOR, PLACES, nodes=15)
    for h, position in enumerate(PLACES.T):
        oracle = Oracle(track, PRIOR, NOISES[row], position)
        _, sigma, share = oracle.over_sigma(oracle.log_p)
        means, covs = (
            np.array(values) for values in zip(*(oracle.theta(s) for s in sigma), strict=True)
        )
        mean = share @ means
        cov = np.einsum("s,sij->ij", share, covs) + (share * (means - mean).T) @ (means - mean)
        np.testing.assert_allclose(ours.theta[:, row, h], mean, rtol=1e-5)
        np.testing.assert_allclose(ours.theta_cov[:, row, h], cov[[0, 0, 1], [0, 1, 1]], rtol=1e-4)
        assert ours.sigma_db[row, h] == pytest.approx(share @ sigma, rel=1e-5)


def test_without_a_prior_p0_and_eta_are_those_of_least_squares():
    obs, source = simulate(np.random.default_rng(2), "square")
    flat = Prior(
        p0_sigma_db=1e4,
        eta_sigma=1e3,
        noise=noise_groups(Hypothesis(0.3, 30.0)),
        stations=(Station(1.0, 0.0),),
    )
    track = blocks(obs, MOST)
    ours = evidence_of(track, flat, np.array(source)[:, None])
    distance_db = 10 * np.log10(
        np.hypot(track.places.x_m - source[0], track.places.y_m - source[1])
    )
    root = np.sqrt(1.0 / (1.0 / track.readings + 1.0 / 12.0 / flat.sigma_db**2))
    design = np.column_stack([np.ones_like(distance_db), -distance_db])
    expected = np.linalg.lstsq(root[:, None] * design, root * track.level_dbm, rcond=None)[0]
    np.testing.assert_allclose(ours.theta[:, 0, 0], expected, rtol=2e-3)


@pytest.mark.parametrize("away_m", [40.0, 2000.0, 26_000.0])
def test_levels_with_no_noise_but_their_rounding_keep_their_digits(away_m):
    """Sums of squared levels exceed the residuals ten thousand times."""
    x = np.arange(40) * 10.0
    level = np.round(-40 - 26 * np.log10(np.hypot(x - 90, 40)))
    at = np.array([[90.0], [away_m]])
    one, other = (
        evidence_of(blocks(observations(x, 0 * x, level + tiny), MOST), PRIOR, at)
        for tiny in (0.0, 1e-9)
    )
    np.testing.assert_allclose(other.log_p, one.log_p, atol=1e-3)


# --- several places, larger blocks ---


@pytest.mark.parametrize("position_sigma", [2.0, 4.0, 8.0])
def test_evidence_of_a_place_does_not_depend_on_the_places_beside_it(position_sigma):
    level = np.random.default_rng(6).normal(-80, 6, 150)
    track = blocks(observations(np.arange(150) * 3.0, np.zeros(150), level, position_sigma), MOST)
    far, near = np.array([[100.0], [-30.0 * position_sigma]]), np.array([[100.0], [5.0]])
    alone = evidence_of(track, Prior(), far).log_p[:, 0]
    in_company = evidence_of(track, Prior(), np.hstack([far, near])).log_p[:, 0]
    np.testing.assert_allclose(in_company, alone, rtol=1e-10)


def test_shadowing_does_not_seem_to_last_longer_in_larger_blocks():
    """Drawn over 15 m along 900 m, seen in blocks of 3 to 20 m: the evidence names 15 m, not 30."""
    rng, prior = (
        np.random.default_rng(8),
        Prior(noise=noise_groups(Hypothesis(0.02, 15.0), Hypothesis(0.02, 30.0))),
    )
    x = np.arange(600) * 1.5
    root = np.linalg.cholesky(np.exp(-np.abs(x[:, None] - x) / 15.0))
    for most in (300, 80, 45):
        gains = []
        for _ in range(12):
            level = -70.0 + 6.0 * root @ rng.normal(size=600)
            log_p = evidence_of(
                blocks(observations(x, 0 * x, level), most), prior, PLACES + 1e5
            ).log_p
            gains.append(np.mean(log_p[1] - log_p[2]))
        assert np.mean(gains) > 0.5, most
