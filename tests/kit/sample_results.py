"""Small results of runs to draw: real readings and filters, and a posterior on a coarse grid."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from logger.core import answer as answers
from logger.core import ekf
from logger.core.document import json_text
from logger.core.locator.alternatives import ANTENNA, HEIGHT, REACH, Alternative
from logger.core.locator.posterior import Mode, Posterior
from logger.core.locator.region import Squares, highest_density
from logger.core.model.prior import Hypothesis, Prior
from logger.core.places import Places, Utm
from logger.core.readings import Readings, observe
from logger.core.runfile import Run, RunWriter, Truth, read_run
from logger.core.suspicion.rule import Finding, Word
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.words import assess, unnoticed_text
from logger.core.types import CellReading, Fix, Note, Record, Scan
from postproc.estimators import least_squares
from postproc.estimators.filters import FilterPath, reference_ekf
from postproc.result import CellResult, ObservedRun, Result, RunShare
from postproc.summary import document_of, summarise
from postproc.verification.claims import CellVerdict, Claim, Verified
from tests.kit.runs import UTC0_NS, meta

LAT, LON = 52.5, 13.4
UTM = Utm.at(LAT, LON)
START_NS = 5_000_000_000
TRANSMITTER_M = (70.0, 30.0)
"""East and north of the first fix."""
SIDE_M = 120.0
P0_DBM, ETA = -35.0, 3.0

SHADOWED = Hypothesis(0.05, 10.0)


def cell_name(i: int) -> str:
    return f"262-01-4711-{100 + i}"


def write_run(
    path: Path,
    *,
    seconds: int,
    cells: int,
    utc: bool = True,
    truth: bool = True,
    speed_mps=1.4,
    utc0_ns: int = UTC0_NS,
    **changes,
) -> Run:
    """Walk around a square with a fix every second and a scan of all cells every other second.

    A scan takes 200 ms.
    """
    x0, y0 = UTM.to_xy(LAT, LON)
    lat, lon = UTM.to_latlon(x0 + TRANSMITTER_M[0], y0 + TRANSMITTER_M[1])
    known = (Truth(cell_name(0), lat, lon),) if truth else ()
    writer = RunWriter(path, meta(started_ns=START_NS, truth=known, **changes))
    rng = np.random.default_rng(7)
    side = np.arange(5) * SIDE_M
    x, y = (
        np.interp(np.arange(seconds) * speed_mps % side[4], side, corners)
        for corners in ([0, SIDE_M, SIDE_M, 0, 0], [0, 0, SIDE_M, SIDE_M, 0])
    )
    lats, lons = UTM.to_latlon_arrays(x0 + x, y0 + y)
    for i in range(seconds):
        t_ns = START_NS + i * 10**9
        fix = Fix(True, utc0_ns + t_ns if utc else None, float(lats[i]), float(lons[i]), hdop=0.9)
        writer.append(Record(t_ns, "gnss", fix))
        if i % 2 == 0:
            levels = _levels(rng, x[i], y[i], cells)
            readings = tuple(
                CellReading("scan", "GSM", "262", "01", 4711, 100 + k, rssi_dbm=v)
                for k, v in levels
            )
            writer.append(Record(t_ns + 200_000_000, "modem", Scan(t_ns, readings, None)))
        if i % 50 == 0:
            writer.append(
                Record(t_ns + 300_000_000, "logger", Note("warning", "tick", f"second {i}, Grüße"))
            )
    writer.close(START_NS + seconds * 10**9, "test")
    return read_run(path)


def _levels(rng: np.random.Generator, x: float, y: float, cells: int) -> list[tuple[int, float]]:
    distance = np.hypot(x - TRANSMITTER_M[0], y - TRANSMITTER_M[1])
    own = P0_DBM - 10 * ETA * np.log10(distance) + rng.normal(0.0, 2.0)
    return [(0, float(own)), *((k, float(rng.normal(-100.0, 4.0))) for k in range(1, cells))]


def sample_result(run: Run, *, verdict="located", places=1) -> Result:
    """Every estimator for the first cell, none for the others."""
    observations = observe(run.tables["fixes"], run.tables["scans"], run.tables["readings"])
    by_name = {obs.cell: obs for obs in observations.cells}
    rest = [
        CellResult(name, len(obs), obs, "cannot tell", ("not asked",), shares=_whole(obs))
        for name, obs in by_name.items()
    ]
    obs = by_name[cell_name(0)]
    answer = sample_posterior(obs, places)
    filtered, rts = sample_filters(obs, answer)
    fitted = least_squares.fit(obs, Places.of(answer.x_m, answer.y_m))
    warnings = ("one position holds it; <b>not</b> | markup",)
    first = CellResult(
        obs.cell,
        len(obs),
        obs,
        verdict,
        warnings,
        answer,
        reference_ekf(obs),
        filtered,
        rts,
        fitted,
        shares=_whole(obs),
    )
    observed = ObservedRun(run, observations, ("about the run",))
    return Result((observed,), (first, *(cell for cell in rest if cell.cell != obs.cell)))


def _whole(obs: Readings) -> tuple[RunShare, ...]:
    """All readings are of the only run."""
    return (RunShare(0, len(obs), 0.0, 0.0),)


def with_word(result: Result, number: int = 0, word: Word = "suspicious") -> Result:
    """The result after suspicion was asked: one cell has a word, with two findings."""
    named = result.cells[number].cell
    rules = {"L1": "area 9 is that of none of the others", "S3": "appears with -60 dBm"}
    findings = [
        Finding(RULES[rule], named, 0, None, None, text, {}, 4.0 - i)
        for i, (rule, text) in enumerate(rules.items())
    ]
    words = {cell.cell: assess(cell.cell, ()) for cell in result.cells}
    if word != "nothing unusual":
        words[named] = answers.Word(word, 7.0, tuple(findings), named)
    not_asked = {"B1": ("earlier walks",), "T1": ("timing advance",)}
    unnoticed = unnoticed_text(not_asked, 600.0, 0)
    return dataclasses.replace(result, words=words, not_asked=not_asked, unnoticed=unnoticed)


def sample_posterior(obs: Readings, places=1, sigma_m=12.0) -> Posterior:
    """Gaussians of equal probability, the first one near the transmitter.

    Each further one is 150 m farther north.
    """
    centre = np.array([obs.x_m[0] + TRANSMITTER_M[0] + 4.0, obs.y_m[0] + TRANSMITTER_M[1] - 3.0])
    centres = [centre + np.array([0.0, 150.0 * i]) for i in range(places)]
    side = 6.0
    east, north = np.meshgrid(
        np.arange(-20, 21) * side, np.arange(-20, 21 + 25 * (places - 1)) * side
    )
    x, y = centre[0] + east.ravel(), centre[1] + north.ravel()
    mass = sum(np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * sigma_m**2)) for cx, cy in centres)
    cells = Squares(x, y, np.full(len(x), side), mass / mass.sum())
    covariance = np.diag([sigma_m**2, (0.7 * sigma_m) ** 2, 4.0, 0.04])
    covariance[0, 1] = covariance[1, 0] = 0.3 * sigma_m**2
    modes = tuple(
        dataclass_with(
            Mode,
            probability=1 / places,
            state=np.array([*c, P0_DBM, ETA]),
            covariance=covariance,
            place=Places.of(*c, utm=obs.utm),
        )
        for c in centres
    )
    return dataclass_with(
        Posterior,
        squares=cells,
        modes=modes,
        place=Places.of(*centre, utm=obs.utm),
        r50_m=1.18 * sigma_m,
        r95_m=2.45 * sigma_m,
        drms_m=1.4 * sigma_m,
        p0_dbm=P0_DBM,
        p0_sigma_db=2.0,
        eta=ETA,
        eta_sigma=0.2,
        sigma_db=2.0,
        noise_probability=np.array([one == SHADOWED for one in Prior().hypotheses], float),
        station_probability=_even(len(Prior().stations)),
        reach_probability=_even(len(Prior().reaches)),
        strongest=Readings.one("c", "gsm", Places.of(*centre, utm=obs.utm), -60.0),
        limit_share=0.0,
        distant_share=np.zeros(len(cells)),
        prior=Prior(),
        offsets=None,
        alternatives=(
            Alternative(REACH, "near", 0.9, 2500.0, 0.05),
            Alternative(REACH, "far", 0.1, 3100.0, 0.08),
            Alternative(ANTENNA, "omni", 0.8, 2500.0, 0.05),
            Alternative(ANTENNA, "sector", 0.2, 31_000.0, 0.6),
            Alternative(HEIGHT, "5 m", 1.0, 2500.0, 0.05),
        ),
    )


def as_if_distant(cell: CellResult) -> CellResult:
    mostly = np.full(len(cell.posterior.squares), 0.9)
    mostly[highest_density(cell.posterior.squares)] = 0.1
    distant = dataclasses.replace(cell.posterior, distant_share=mostly)
    return dataclasses.replace(cell, posterior=distant)


def _even(count):
    return np.full(count, 1.0 / count)


def dataclass_with(kind, **values):
    """A dataclass from the values that matter here, zero for what it has besides."""
    return kind(**{f.name: 0.0 for f in dataclasses.fields(kind) if f.init} | values)


def sample_filters(obs: Readings, answer: Posterior) -> tuple[FilterPath, FilterPath]:
    """EKF over the second half of the readings, and RTS, which is its last state."""
    half, mode = len(obs) // 2, answer.modes[0]
    state = ekf.EkfState(*mode.state.tolist(), ekf.upper_triangle(mode.covariance))
    steps = []
    for x, y, level in zip(obs.x_m[half:], obs.y_m[half:], obs.level_dbm[half:], strict=True):
        steps.append(ekf.joseph_step(state, float(x), float(y), float(level), q=0.0))
        state = steps[-1].state
    x = np.array([s.state[:4] for s in steps])
    p = np.array([ekf.covariance_matrix(s.state.p) for s in steps])
    innovation, variance = (
        np.array([getattr(s, n) for s in steps]) for n in ("innovation_db", "innovation_var_db2")
    )
    none = np.full(len(x), np.nan)
    ahead = FilterPath(obs.t_ns[half:], x, p, innovation, variance)
    return ahead, FilterPath(
        obs.t_ns[half:], np.repeat(x[-1:], len(x), 0), np.repeat(p[-1:], len(p), 0), none, none
    )


def sample_claims(result: Result) -> Verified:
    """A consistent claim for the first cell, a rejected one for the second, one unclaimed cell."""

    def claim_row(cell, verdict, north_deg):
        return CellVerdict(
            cell.cell,
            cell.n,
            Claim(cell.cell, LAT + north_deg, LON, 20.0, "command line"),
            verdict,
            ("because",),
            followed="indirect",
            p=0.5,
            q=0.5,
            distance_m=33.0,
        )

    first, second = result.cells[:2]
    return Verified(
        0.05,
        (claim_row(first, "consistent", 0.0005), claim_row(second, "rejected", 0.1)),
        ("other",),
        (),
    )


def json_of(result: Result) -> dict[str, Any]:
    """What `postproc smooth --json` prints."""
    return json.loads(json_text(document_of(summarise(result), details=False)[0].content))
