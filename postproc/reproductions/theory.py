"""Position verification by ranges, as its report describes it: the theory, and its table beside it.

**The tests.** N ranges r_i = |p - q_i| + eps_i to known receivers q_i, eps ~ N(0, V), V =
diag(sigma_i^2); the claimed position c is p + w, w ~ N(0, W). With A the unit vectors from
receivers to position, shape (N, d):

    direct     T = b' (V + A W A')^-1 b ~ chi2(N, delta_direct),    b_i = r_i - |c - q_i|
    indirect   T = Delta' (P + W)^-1 Delta ~ chi2(d, delta_loc),    Delta = c - p^,
                                                                    P = (A' V^-1 A)^-1

p^ results from c by Gauss-Newton steps. Both noncentralities are zero where the claim is true, and
o' (P + W)^-1 o for a small offset o. A position of d coordinates takes d + 1 receivers; with fewer
there is the direct test alone.

**Its table 1** has detection probabilities of both tests for sigma 100 m and 20 km, with and
without uncertainty of the claim (37.8, 37.8, 87.0 m), four receivers, false positions off by 2
sigma in two coordinates. Positions of receivers and false-alarm rate are not given; its two columns
have one noncentrality, with 4 degrees of freedom and with 3.

**The distance that a level gives.** True levels z = B - 10 eta log10 d + n, n ~ N(0, Gamma^2). The
distance is computed with B~ instead of B: d~ = 10^((B~ - z) / (10 eta)) = d 10^((B~ - B - n) / (10
eta)). With the slope of the level by the distance,

    C = -10 eta / (d ln 10)    dB per metre,

the first term of the Taylor series is eps = d~ - d = (B - B~ + n) / C, so eps ~ N((B - B~) / C,
Gamma^2 / C^2). In truth d~ / d is log-normal: the normal law holds while Gamma is small against 10
eta / ln 10, which is 11 to 17 dB.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from math import erf, exp, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from scipy.special import chndtrinc
from scipy.stats import chi2, ncx2

from logger.core.arrays import BoolArray, FloatArray
from logger.core.errors import ConfigError
from logger.core.model.path_loss import DB_PER_E_FOLD
from postproc.estimators.metrics import SIGMA_PER_MAD, nees
from postproc.reproductions.checks import Check, Json, theirs, under

_MOST_STEPS = 60  # Gauss-Newton converges in some 5; the rest is for poor geometry
_CONVERGED = 1e-6  # of the smallest sigma
_WORST_CONDITION = 1e8  # beyond it half of the digits are lost
_HALVINGS = 8
_SAMPLES = 200  # resolves p to 0.005
_FEWEST = 8  # with fewer values the test rejects next to nothing


@dataclass(frozen=True)
class Scene:
    """Receivers (n, d) in metres, d = 2 or 3, sigma of each range (n,), of the claim per axis (d,).

    Raises `ConfigError` for shapes that do not fit, or a sigma that is negative or not finite.
    """

    receivers_m: FloatArray
    sigma_m: FloatArray
    claim_sigma_m: FloatArray

    def __post_init__(self) -> None:
        n, d = self.receivers_m.shape if self.receivers_m.ndim == 2 else (0, 0)
        if n == 0 or d not in {2, 3}:
            raise ConfigError(
                "receivers are points of 2 or 3 coordinates, and there is at least one"
            )
        if self.sigma_m.shape != (n,) or not np.all(_is_sigma(self.sigma_m) & (self.sigma_m > 0)):
            raise ConfigError("each receiver needs a sigma of its range, larger than zero")
        if self.claim_sigma_m.shape != (d,) or not np.all(_is_sigma(self.claim_sigma_m)):
            raise ConfigError(
                f"the claim needs a sigma for each of the {d} coordinates, zero or larger"
            )

    @property
    def dimensions(self) -> int:
        """2 or 3."""
        return int(self.receivers_m.shape[1])


def _is_sigma(values_m: FloatArray) -> BoolArray:
    return np.isfinite(values_m) & (values_m >= 0.0)


def detection(p_fa: float, dof: int, noncentrality: float) -> float:
    """Probability that a noncentral chi-square exceeds the central one's limit for `p_fa`."""
    if noncentrality <= 0.0:
        return p_fa
    return float(ncx2.sf(chi2.isf(p_fa, dof), dof, noncentrality))


def noncentrality_of(p_fa: float, dof: int, power: float) -> float:
    """The noncentrality that gives this power; 0 where the power is no larger than `p_fa`."""
    return float(chndtrinc(chi2.isf(p_fa, dof), dof, 1.0 - power)) if power > p_fa else 0.0


def direct_noncentrality(scene: Scene, true_m: FloatArray, claim_m: FloatArray) -> float:
    """Of the direct test of a claim (d,), with n degrees, where the transmitter is at `true_m`."""
    missed = _ranges(scene, true_m) - _ranges(scene, claim_m)
    return float(nees(missed, _direct_covariance(scene, claim_m)))


def indirect_noncentrality(scene: Scene, true_m: FloatArray, claim_m: FloatArray) -> float | None:
    """Of the indirect test of it, with d degrees; None where `not_observable` says why."""
    if not_observable(scene, true_m):
        return None
    return float(nees(claim_m - true_m, _indirect_covariance(scene, true_m)))


def not_observable(scene: Scene, at_m: FloatArray) -> str | None:
    """Why the receivers do not determine a position there, None where they do."""
    n, d = scene.receivers_m.shape
    if n <= d:
        return (
            f"the indirect test needs {d + 1} receivers in {d} dimensions and has {n}: "
            "the direct test alone"
        )
    if np.linalg.cond(_information(scene, at_m)) > _WORST_CONDITION:
        return (
            "the receivers stand so that a direction is not observed at all: the direct test alone"
        )
    return None


def simulate(
    scene: Scene,
    true_m: FloatArray,
    claim_m: FloatArray,
    p_fa: float,
    trials: int,
    rng: np.random.Generator,
) -> tuple[float, float | None]:
    """Share of simulated trials in which the direct and the indirect test rejected."""
    claims = claim_m + scene.claim_sigma_m * rng.normal(size=(trials, scene.dimensions))
    ranges = _ranges(scene, true_m) + scene.sigma_m * rng.normal(size=(trials, len(scene.sigma_m)))
    exceeded = direct_statistic(scene, ranges, claims) > chi2.isf(p_fa, len(scene.sigma_m))
    if not_observable(scene, true_m):
        return float(np.mean(exceeded)), None
    statistic = indirect_statistic(scene, ranges, claims)
    found = float(np.mean(statistic > chi2.isf(p_fa, scene.dimensions)))
    return float(np.mean(exceeded)), found


def direct_statistic(scene: Scene, ranges_m: FloatArray, claims_m: FloatArray) -> FloatArray:
    """T of ranges (t, n) against claims (t, d), shape (t,)."""
    b = ranges_m - _ranges(scene, claims_m)
    return nees(b, _direct_covariance(scene, claims_m))


def indirect_statistic(scene: Scene, ranges_m: FloatArray, claims_m: FloatArray) -> FloatArray:
    """T of ranges (t, n) against claims (t, d), shape (t,).

    The provisional solution is the claim; a step is halved until it does not make the fit worse.
    """
    position = claims_m.copy()
    moved = np.full(len(position), np.inf)
    weight = 1.0 / scene.sigma_m**2
    least_m = _CONVERGED * float(np.min(scene.sigma_m))
    for _ in range(_MOST_STEPS):
        going = np.flatnonzero(moved > least_m)
        if not len(going):
            break
        step = _step(scene, ranges_m[going], position[going], weight)
        position[going] += step
        moved[going] = np.linalg.norm(step, axis=1)
    return nees(claims_m - position, _indirect_covariance(scene, position))


def _step(
    scene: Scene, ranges_m: FloatArray, position: FloatArray, weight: FloatArray
) -> FloatArray:
    """Delta = (A' V^-1 A)^-1 A' V^-1 b for positions (t, d), halved where it overshoots."""
    a, b = _directions(scene, position), ranges_m - _ranges(scene, position)
    right = np.einsum("tnd,tn->td", a, weight * b)
    step = np.linalg.solve(_information(scene, position), right[..., None])[..., 0]
    before = np.sum(weight * b**2, axis=1)
    for _ in range(_HALVINGS):
        after = np.sum(weight * (ranges_m - _ranges(scene, position + step)) ** 2, axis=1)
        step = np.where((after > before * (1.0 + 1e-12))[:, None], 0.5 * step, step)
    return np.asarray(step, float)


def _ranges(scene: Scene, position_m: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(position_m[..., None, :] - scene.receivers_m, axis=-1), float)


def _directions(scene: Scene, position_m: FloatArray) -> FloatArray:
    """A, shape (..., n, d)."""
    away = position_m[..., None, :] - scene.receivers_m
    return np.asarray(away / np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-9), float)


def _information(scene: Scene, position_m: FloatArray) -> FloatArray:
    """A' V^-1 A, shape (..., d, d)."""
    a = _directions(scene, position_m)
    return np.asarray(np.einsum("...ni,n,...nj->...ij", a, scene.sigma_m**-2.0, a), float)


def _direct_covariance(scene: Scene, position_m: FloatArray) -> FloatArray:
    a = _directions(scene, position_m)
    of_claim = np.einsum("...ni,i,...mi->...nm", a, scene.claim_sigma_m**2, a)
    return np.asarray(np.diag(scene.sigma_m**2) + of_claim, float)


def _indirect_covariance(scene: Scene, position_m: FloatArray) -> FloatArray:
    of_position = np.linalg.inv(_information(scene, position_m))
    return np.asarray(of_position + np.diag(scene.claim_sigma_m**2), float)


class RangeError(NamedTuple):
    """Mean and sigma of d~ - d in metres: by the first Taylor term, exact, and simulated."""

    slope_db_per_m: float
    mean_m: float
    sigma_m: float
    exact_mean_m: float
    exact_sigma_m: float
    simulated_mean_m: float
    simulated_sigma_m: float


def slope_db_per_m(distance_m: float, eta: float) -> float:
    """C: how fast the level changes with the distance."""
    return -DB_PER_E_FOLD * eta / distance_m


def range_errors(
    distance_m: float,
    eta: float,
    sigma_db: float,
    offset_db: float,
    trials: int,
    rng: np.random.Generator,
) -> tuple[RangeError, FloatArray]:
    """The error of ranging by level, `offset_db` = B - B~, and simulated errors (trials,)."""
    c = slope_db_per_m(distance_m, eta)
    log_scale = 1.0 / (DB_PER_E_FOLD * eta)
    noise_db = offset_db + sigma_db * rng.normal(size=trials)
    errors_m = distance_m * (np.exp(-log_scale * noise_db) - 1.0)
    variance = (log_scale * sigma_db) ** 2
    mean_m = distance_m * exp(-log_scale * offset_db + 0.5 * variance)
    error = RangeError(
        slope_db_per_m=c,
        mean_m=offset_db / c,
        sigma_m=sigma_db / abs(c),
        exact_mean_m=mean_m - distance_m,
        exact_sigma_m=mean_m * (exp(variance) - 1.0) ** 0.5,
        simulated_mean_m=float(np.mean(errors_m)),
        simulated_sigma_m=float(np.std(errors_m)),
    )
    return error, np.asarray(errors_m, float)


SIGMAS_M = (100.0, 20_000.0)
CLAIM_SIGMA_M = (37.8, 37.8, 87.0)
P_FA = 0.05
"""The smallest customary rate that allows the printed values; the report gives none."""

PRINTED = (
    (0.98, 0.98),
    (1.00, 1.00),
    (1.00, 1.00),
    (0.97, 0.98),
    (0.83, 0.85),
    (0.84, 0.85),
    (0.93, 0.95),
    (0.93, 0.95),
)
"""Printed pairs, direct and indirect; the row of the table that each belongs to is not known."""

_UNKNOWN = (
    (
        "the positions of the receivers",
        "the text of the report does not give them; those here are an input",
    ),
    (
        "the false-alarm rate",
        (
            "not given either, and it does not follow from the pairs, since the direct column "
            "fixes the indirect one within 0.03 for any rate; a printed 1.00 needs 0.02 or more "
            "where the noncentrality is at most 8 per receiver"
        ),
    ),
    ("which printed pair belongs to which row, and the direction of the offset", "not stated"),
)

_SIGMAS_APART = 4.0  # of a simulated share: chance exceeds it once in 16 000
_PAIR_APART = 0.03  # printed with two digits, and a noncentrality that follows from one of them
_TAYLOR_APART = 0.1
_APART_SIGMAS = 15.0  # so far away, ranges are linear over an offset of 2 sigma
_OFFSETS = ((2.0, 2.0), (2.0, -2.0))  # in sigmas: the report's size, and both directions of it
_CAP_PER_RECEIVER = 8.0  # |offset|^2 / sigma^2, where a receiver lies in the offset's direction
_ROUNDING = 0.005  # of the printed values
_RANGE = {"distance_m": 500.0, "eta": 3.0, "sigma_db": 4.0, "offset_db": 1.0}  # a usual street
_CUT_SIGMAS = 3.0
_SAMPLE = 500  # values for the check of normality, which is quadratic in time
_MOST_TRIALS = 5_000_000  # 1 GB


@dataclass(frozen=True, slots=True)
class Rates:
    """A probability by formula and by simulation; None where there is no such test."""

    theory: float | None
    simulated: float | None


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table: false-alarm rates with a true claim, detection with a false one."""

    sigma_m: float
    claim_sigma_m: tuple[float, ...]
    offset_m: tuple[float, ...]
    noncentrality_direct: float
    noncentrality_indirect: float | None
    false_alarm_direct: Rates
    false_alarm_indirect: Rates
    direct: Rates
    indirect: Rates
    indirect_from_direct: float
    note: str | None


@dataclass(frozen=True, slots=True)
class PrintedPair:
    """A printed pair, and the indirect value that follows from the direct one.

    `dof2`, `dof3` and `dof4` are that value for so many degrees of freedom, `difference` is printed
    minus `dof3`. `possible` is False where the direct value is larger than the offset allows at
    this false-alarm rate.
    """

    printed_direct: float
    printed_indirect: float
    noncentrality: float
    dof2: float
    dof3: float
    dof4: float
    difference: float
    possible: bool


def default_receivers(sigma_m: float) -> FloatArray:
    """Corners of a regular tetrahedron about the true position, shape (4, 3); our choice."""
    corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    return np.asarray(_APART_SIGMAS * sigma_m * corners / 3.0**0.5, float)


def places(texts: Sequence[str]) -> FloatArray:
    """Receivers from X,Y or X,Y,Z in metres, shape (n, d); raises `ConfigError`."""
    try:
        receivers_m = np.array([text.split(",") for text in texts], float)
    except ValueError:
        receivers_m = np.empty((0, 0))
    if receivers_m.shape[1] not in {2, 3} or not np.all(np.isfinite(receivers_m)):
        raise ConfigError("receivers are given as X,Y or X,Y,Z in metres, all alike")
    return receivers_m


def table(
    p_fa: float,
    receivers_m: FloatArray | None,
    sigmas_m: Sequence[float],
    trials: int,
    rng: np.random.Generator,
) -> list[Row]:
    """The report's cases for receivers (n, d) about a true position at the origin.

    Raises `ConfigError`.
    """
    if not 0.0 < p_fa < 1.0:
        raise ConfigError(f"a false-alarm rate lies between 0 and 1, not at {p_fa:g}")
    rows = []
    for sigma_m in sigmas_m:
        if not (np.isfinite(sigma_m) and sigma_m > 0.0):
            raise ConfigError(f"a sigma is larger than zero, not {sigma_m:g} m")
        scene_m = default_receivers(sigma_m) if receivers_m is None else receivers_m
        d = scene_m.shape[1] if scene_m.ndim == 2 else 0
        for claim_sigma in ((0.0,) * d, CLAIM_SIGMA_M[:d]):
            scene = Scene(scene_m, np.full(len(scene_m), sigma_m), np.array(claim_sigma))
            for offset in _OFFSETS:
                offset_m = np.array(offset) * sigma_m
                rows.append(_row(scene, sigma_m, offset_m, p_fa, trials, rng))
    return rows


def _row(
    scene: Scene,
    sigma_m: float,
    offset_m: FloatArray,
    p_fa: float,
    trials: int,
    rng: np.random.Generator,
) -> Row:
    true_m = np.zeros(scene.dimensions)
    claim_m = np.pad(offset_m, (0, scene.dimensions - 2))
    n, d = scene.receivers_m.shape
    direct = direct_noncentrality(scene, true_m, claim_m)
    indirect = indirect_noncentrality(scene, true_m, claim_m)
    alarms_direct, alarms_indirect = simulate(scene, true_m, true_m, p_fa, trials, rng)
    found_direct, found_indirect = simulate(scene, true_m, claim_m, p_fa, trials, rng)
    return Row(
        sigma_m,
        tuple(scene.claim_sigma_m.tolist()),
        tuple(claim_m.tolist()),
        direct,
        indirect,
        Rates(p_fa, alarms_direct),
        Rates(None if indirect is None else p_fa, alarms_indirect),
        Rates(detection(p_fa, n, direct), found_direct),
        Rates(None if indirect is None else detection(p_fa, d, indirect), found_indirect),
        detection(p_fa, d, direct),
        not_observable(scene, true_m),
    )


def printed_pairs(p_fa: float) -> list[PrintedPair]:
    """The relation of the printed columns at a false-alarm rate, whatever the receivers."""
    most = detection(p_fa, 4, 4 * _CAP_PER_RECEIVER)
    return [_pair(direct, indirect, p_fa, most) for direct, indirect in PRINTED]


def _pair(direct: float, indirect: float, p_fa: float, most: float) -> PrintedPair:
    noncentrality = noncentrality_of(p_fa, 4, min(direct, 1.0 - _ROUNDING))
    two, three, four = (detection(p_fa, dof, noncentrality) for dof in (2, 3, 4))
    return PrintedPair(
        direct,
        indirect,
        noncentrality,
        two,
        three,
        four,
        indirect - three,
        possible=direct - _ROUNDING <= most,
    )


def summary(
    p_fa: float, receivers_m: FloatArray | None, sigmas_m: Sequence[float], trials: int, seed: int
) -> dict[str, Any]:
    """What `postproc validate theory --json` prints; raises `ConfigError`."""
    if not 1 <= trials <= _MOST_TRIALS:
        raise ConfigError(f"between 1 and {_MOST_TRIALS} trials")
    rng = np.random.default_rng(seed)
    rows = table(p_fa, receivers_m, sigmas_m, trials, rng)
    error, errors_m = range_errors(**_RANGE, trials=trials, rng=rng)
    sample_m = errors_m[:_SAMPLE]
    samples_m = {
        "first_taylor_term": rng.normal(error.mean_m, error.sigma_m, len(sample_m)),
        "exact": sample_m,
    }
    normal: dict[str, list[dict[str, Any]]] = {}
    for name, values in samples_m.items():
        checks = [normality(values, limit, rng) for limit in (None, _CUT_SIGMAS)]
        normal[name] = [check._asdict() for check in checks if check]
    return {
        "p_fa": p_fa,
        "trials": trials,
        "receivers": "ours: a regular tetrahedron" if receivers_m is None else receivers_m.tolist(),
        "rows": [asdict(row) for row in rows],
        "printed": [asdict(pair) for pair in printed_pairs(p_fa)],
        "cannot_be_known": [f"{what}: {why}" for what, why in _UNKNOWN],
        "range_error": _RANGE | error._asdict(),
        "normality": normal,
    }


def checks(found: Json) -> list[Check]:
    """What the report states, beside `summary`."""
    by_row = [check for row in found["rows"] for check in _checks_of_row(row, found)]
    return [
        *by_row,
        *under("printed in the report", *map(_check_of_pair, found["printed"])),
        *under("ranging by level", *_checks_of_ranging(found)),
        *under(
            "what the report determines",
            *(Check(what, f"cannot be known: {why}", "does not hold") for what, why in _UNKNOWN),
        ),
    ]


def _checks_of_row(row: Json, found: Json) -> list[Check]:
    claim, offset = (" ".join(f"{v:g}" for v in row[key]) for key in ("claim_sigma_m", "offset_m"))
    note = f"; {row['note']}" if row["note"] else ""
    expected = f"; {row['indirect_from_direct']:.3f} follows from the direct one"
    return under(
        f"sigma {row['sigma_m']:g} m, of the claim {claim} m, offset {offset} m, false-alarm rate "
        f"{found['p_fa']:g}, {found['trials']} trials, receivers {found['receivers']}",
        _check_of_rates("the direct test rejects a true claim", row["false_alarm_direct"], found),
        _check_of_rates(
            "the indirect test rejects a true claim", row["false_alarm_indirect"], found, note
        ),
        _check_of_rates("the direct test detects a false claim", row["direct"], found),
        _check_of_rates(
            "the indirect test detects a false claim", row["indirect"], found, note or expected
        ),
    )


def _check_of_rates(claim: str, rates: Json, found: Json, more: str = "") -> Check:
    theory, simulated = rates["theory"], rates["simulated"]
    if theory is None or simulated is None:
        return Check(claim, f"there is no such test{more}", "does not hold")
    chance = (theory * (1.0 - theory) / found["trials"]) ** 0.5
    return Check(
        f"{claim}: {theory:.3f} by theory",
        f"{simulated:.3f} of simulated claims{more}",
        theirs(abs(simulated - theory) <= _SIGMAS_APART * chance + _ROUNDING),
    )


def _check_of_pair(pair: Json) -> Check:
    possible = "" if pair["possible"] else "; such a direct value needs a larger false-alarm rate"
    return Check(
        f"direct {pair['printed_direct']:.2f}, indirect {pair['printed_indirect']:.2f}",
        f"the direct value gives {pair['dof3']:.3f} with 3 degrees of freedom, {pair['dof2']:.3f} "
        f"with 2, {pair['dof4']:.3f} with 4; printed - ours {pair['difference']:+.3f}{possible}",
        theirs(pair["possible"] and abs(pair["difference"]) <= _PAIR_APART),
    )


def _checks_of_ranging(found: Json) -> Iterator[Check]:
    error = found["range_error"]
    at = (
        f"at {error['distance_m']:g} m, eta {error['eta']:g}, {error['sigma_db']:g} dB, "
        f"{error['offset_db']:g} dB off, C = {error['slope_db_per_m']:.4f} dB/m"
    )
    for name in ("mean", "sigma"):
        first, exact, simulated = (error[f"{way}{name}_m"] for way in ("", "exact_", "simulated_"))
        yield Check(
            f"{name} of the error by the first Taylor term: {first:.1f} m",
            f"exact {exact:.1f} m, simulated {simulated:.1f} m {at}",
            theirs(abs(first - exact) <= _TAYLOR_APART * abs(exact)),
        )
    for law, tests in found["normality"].items():
        for test in tests:
            limit = test["limit_sigmas"]
            values = "all values" if limit is None else f"values within {limit:g} sigma"
            yield Check(
                f"the error is normal: {law.replace('_', ' ')}, {values}",
                f"Kolmogorov-Smirnov {test['distance']:.3f}, p {test['p']:.3f}",
                theirs(test["p"] > P_FA),
            )


class Normality(NamedTuple):
    """Distance to the normal law with the sample's mean and sigma, and its p-value.

    `limit_sigmas` is where outliers were cut (None: nowhere); `n` values were left, `n_cut` cut.
    """

    limit_sigmas: float | None
    n: int
    n_cut: int
    distance: float
    p: float


def normality(
    values: FloatArray, limit_sigmas: float | None, rng: np.random.Generator
) -> Normality | None:
    """Check of independent values (n,), None for fewer than 8 or for values that are all equal.

    Values beyond `limit_sigmas` robust sigmas (1.4826 times the median absolute deviation) are cut;
    the rest is compared with a normal law cut at the same points (Kolmogorov and Smirnov, with mean
    and sigma of the sample). The p-value comes from normal samples treated in the same way
    (Lilliefors, J. Am. Stat. Assoc. 62(318), 1967).
    """
    inner, low, high = _trim(values, limit_sigmas)
    if len(inner) < _FEWEST or not np.ptp(inner) > 0.0:
        return None
    distance = _distance(inner, low, high)
    samples = (_trim(rng.normal(size=len(values)), limit_sigmas) for _ in range(_SAMPLES))
    as_far = sum(_distance(*sample) >= distance for sample in samples)
    p = (as_far + 1.0) / (_SAMPLES + 1.0)
    return Normality(limit_sigmas, len(inner), len(values) - len(inner), distance, p)


def _trim(values: FloatArray, limit_sigmas: float | None) -> tuple[FloatArray, float, float]:
    if limit_sigmas is None or not len(values):
        return values, -np.inf, np.inf
    middle = float(np.median(values))
    deviation = np.abs(values - middle)
    reach = limit_sigmas * SIGMA_PER_MAD * float(np.median(deviation))
    return values[deviation <= reach], middle - reach, middle + reach


def _distance(values: FloatArray, low: float, high: float) -> float:
    mean, sigma = float(np.mean(values)), max(float(np.std(values, ddof=1)), 1e-300)
    if np.isfinite(low):
        sigma *= _untrimmed_sigma((high - low) / (2.0 * sigma))
    from scipy.special import ndtr  # noqa: PLC0415 (0.5 s, of all who import `postproc.api`)

    below, above = ndtr((low - mean) / sigma), ndtr((high - mean) / sigma)
    model = (ndtr((np.sort(values) - mean) / sigma) - below) / (above - below)
    step = np.arange(len(values)) / len(values)
    return float(max(np.max(model - step), np.max(step + 1.0 / len(values) - model)))


def _untrimmed_sigma(reach: float) -> float:
    """Sigma of a normal law by that of its part within +-`reach` of the part's sigmas.

    Fixed-point steps; 20 of them settle to 1e-6 for limits of 2 sigma and more.
    """
    factor = 1.0
    for _ in range(20):
        k = reach / factor
        density = exp(-0.5 * k * k) / (2.0 * pi) ** 0.5
        share = 1.0 - 2.0 * k * density / max(erf(k / sqrt(2.0)), 1e-12)
        factor = min(max(share, 0.2) ** -0.5, 2.0)
    return float(factor)
