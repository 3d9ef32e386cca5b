"""Table 1 of the report beside the theory, and what of it cannot be known.

The report prints detection probabilities of both tests for sigma 100 m and 20 km, with and without
uncertainty of the claim (37.8, 37.8, 87.0 m), four receivers, false positions off by 2 sigma in two
coordinates. Its text contains neither the positions of the receivers nor the false-alarm rate. The
relation of its two columns can be tested: one noncentrality, with 4 degrees of freedom and with 3.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.document import Column, Document, Line, Part, Table, Value
from logger.core.errors import ConfigError
from postproc.reproductions.position_verification import ranging, theory
from postproc.reproductions.position_verification.theory import Scene, detection, noncentrality_of
from postproc.verification.normality import normality

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

CANNOT_BE_KNOWN = (
    (
        "the positions of the receivers: the text of the report does not give them; "
        "those here are an input"
    ),
    (
        "the false-alarm rate: not given either, and it does not follow from the pairs, since the "
        "direct column fixes the indirect one within 0.03 for any rate; a printed 1.00 needs 0.02 "
        "or more where the noncentrality is at most 8 per receiver"
    ),
    "which printed pair belongs to which row, and the direction of the offset",
)

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
    direct = theory.direct(scene, true_m, claim_m)
    indirect = theory.indirect(scene, true_m, claim_m)
    alarms = theory.simulate(scene, true_m, true_m, p_fa, trials, rng)
    detections = theory.simulate(scene, true_m, claim_m, p_fa, trials, rng)
    return Row(
        sigma_m,
        tuple(scene.claim_sigma_m.tolist()),
        tuple(claim_m.tolist()),
        direct.noncentrality,
        indirect.noncentrality if indirect else None,
        Rates(p_fa, alarms.direct),
        Rates(p_fa if indirect else None, alarms.indirect),
        Rates(direct.power(p_fa), detections.direct),
        Rates(indirect.power(p_fa) if indirect else None, detections.indirect),
        detection(p_fa, scene.dimensions, direct.noncentrality),
        theory.not_observable(scene, true_m),
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
    """What `postproc verify-theory --json` prints; raises `ConfigError`."""
    if not 1 <= trials <= _MOST_TRIALS:
        raise ConfigError(f"between 1 and {_MOST_TRIALS} trials")
    rng = np.random.default_rng(seed)
    rows = table(p_fa, receivers_m, sigmas_m, trials, rng)
    error, errors_m = ranging.range_errors(**_RANGE, trials=trials, rng=rng)
    sample_m = errors_m[:_SAMPLE]
    samples_m = {
        "first_taylor_term": rng.normal(error.mean_m, error.sigma_m, len(sample_m)),
        "exact": sample_m,
    }
    return {
        "p_fa": p_fa,
        "trials": trials,
        "receivers": "ours: a regular tetrahedron" if receivers_m is None else receivers_m.tolist(),
        "rows": [asdict(row) for row in rows],
        "printed": [asdict(pair) for pair in printed_pairs(p_fa)],
        "cannot_be_known": list(CANNOT_BE_KNOWN),
        "range_error": _RANGE | error._asdict(),
        "normality": {name: _normality(values, rng) for name, values in samples_m.items()},
    }


def _normality(values: FloatArray, rng: np.random.Generator) -> list[dict[str, Any]]:
    checks = (normality(values, limit, rng) for limit in (None, _CUT_SIGMAS))
    return [check._asdict() for check in checks if check]


def document_of(found: dict[str, Any]) -> Document:
    """The report's table beside the theory."""
    return Document(found, body=_parts(found))


def _parts(found: dict[str, Any]) -> Iterator[Part]:
    trials = f"{found['trials']} trials; receivers: {found['receivers']}"
    yield f"false-alarm rate {found['p_fa']:g}, {trials}"
    titles = ["sigma (m)", "claim sigma (m)", "offset (m)", "P_FA direct", "P_FA indirect"]
    titles += ["P_D direct", "P_D indirect", "indirect from direct"]
    yield Table([Column(title) for title in titles], [_theory_row(row) for row in found["rows"]])
    yield Line("each: theory / simulated", bullet="  ")
    for note in sorted({row["note"] for row in found["rows"] if row["note"]}):
        yield Line(note, bullet="  ")
    yield (
        "\nprinted in the report, and the indirect value that follows from the direct one, "
        "by degrees of freedom"
    )
    columns = [
        Column("direct", ".2f"),
        Column("indirect", ".2f"),
        *(Column(title, ".3f") for title in ("3 (ours)", "2", "4")),
        Column("printed - ours", "+.3f"),
    ]
    keys = ("printed_direct", "printed_indirect", "dof3", "dof2", "dof4", "difference")
    yield Table(columns, [[pair[key] for key in keys] for pair in found["printed"]])
    yield "cannot be known"
    yield from (Line(what, bullet="  - ") for what in found["cannot_be_known"])
    error = found["range_error"]
    yield (
        f"\nranging by level at {error['distance_m']:g} m, eta {error['eta']:g}, "
        f"{error['sigma_db']:g} dB, {error['offset_db']:g} dB off: "
        f"C = {error['slope_db_per_m']:.4f} dB/m"
    )
    columns = [
        Column("range error"),
        *(Column(title, ".1f", "m") for title in ("first Taylor term", "exact", "simulated")),
    ]
    ways = ("{}_m", "exact_{}_m", "simulated_{}_m")
    rows = [[name, *(error[way.format(name)] for way in ways)] for name in ("mean", "sigma")]
    yield Table(columns, rows)
    for law, checks in found["normality"].items():
        for check in checks:
            limit = check["limit_sigmas"]
            values = "all values" if limit is None else f"within {limit:g} sigma"
            result = f"KS {check['distance']:.3f}, p {check['p']:.3f}"
            yield Line(f"normal? {law.replace('_', ' ')}, {values}: {result}", bullet="  ")


def _theory_row(row: dict[str, Any]) -> list[Value]:
    rates = (
        " / ".join("–" if rate is None else f"{rate:.3f}" for rate in row[key].values())
        for key in ("false_alarm_direct", "false_alarm_indirect", "direct", "indirect")
    )
    where = (" ".join(f"{v:g}" for v in row[key]) for key in ("claim_sigma_m", "offset_m"))
    return [f"{row['sigma_m']:g}", *where, *rates, f"{row['indirect_from_direct']:.3f}"]
