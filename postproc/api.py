"""The public functions of `postproc`; see `docs/api.md` for examples.

Positions are metres east and north (UTM for runs, any plane for bare arrays), latitudes and
longitudes degrees (WGS84), levels dBm, times nanoseconds since boot. Arrays are numpy. All errors
are `logger.core.errors.FieldLoggerError`.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import get_args, overload

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError, EstimationError
from logger.core.locator.online import FEWEST_BLOCKS
from logger.core.locator.verdict import DESK_M
from logger.core.model.prior import Prior, prior_for
from logger.core.places import NO_MAP, Places
from logger.core.readings import Observations, Readings
from logger.core.runfile import Run, read_sound_run
from logger.core.types import Rat
from postproc.area_file import area_of
from postproc.atomic_write import check_output
from postproc.estimators.least_squares import Loss
from postproc.ground import Group, check_one_place
from postproc.ground import by_place as groups_of
from postproc.interop.exporting import Exported, format_of, walk_of_run, write_answers, write_walk
from postproc.interop.sighting import LEVEL_RANGE_DBM
from postproc.multi_run import named_apart
from postproc.progress import Progress, with_progress
from postproc.result import CellResult, Options, Result
from postproc.scan_counts import observed_cells
from postproc.smoothing import locate_cell, smooth_runs
from postproc.suspicion.run_assessment import Suspicions, assess_runs, conspicuous_first
from postproc.verification.claims import Claim, Verified
from postproc.verification.run_claims import verify_claims
from postproc.walk import observe_run

RunOrPath = Run | Path | str

_TECHNOLOGIES: tuple[str, ...] = get_args(Rat)
_DEGREES_WITHIN = 3.0
"""Degrees that a drive of a day spans; a walk within so few metres could not locate anything."""


def read_run(path: Path | str) -> Run:
    """Read a run file, HDF5 or journal.

    Values that no recorder writes (damage, forgery) are unknown and counted in `Run.damage`. The
    tables and their units: `docs/runfile.md`.

    Raises `RunFileError` for a file that is no run.
    """
    return read_sound_run(path)


def observations(run: RunOrPath) -> Observations:
    """Readings of each cell at the walker's smoothed positions.

    `cells` has one `Readings` per cell, most readings first: arrays of shape (n,) with `t_ns` (ns
    since boot), `x_m` and `y_m` (metres in the UTM zone `utm`), `position_sigma_m` (metres per
    axis) and `level_dbm`. `track` has the k fixes, shape (k,).

    Raises `EstimationError` for a run without a position fix, `RunFileError` for a file that is no
    run.
    """
    observed = observe_run(_run(run))
    if observed.observations is None:
        raise EstimationError(*observed.warnings)
    return observed.observations


@overload
def locate(
    readings: Readings,
    /,
    *,
    environment: str = "any",
    height_m: float | None = None,
    antenna: str = "any",
    reach: str = "any",
    within_walk_m: float | None = None,
    area: Path | str | None = None,
    within_m: float = DESK_M,
) -> CellResult: ...


@overload
def locate(
    x_m: npt.ArrayLike,
    y_m: npt.ArrayLike,
    level_dbm: npt.ArrayLike,
    *,
    position_sigma_m: npt.ArrayLike = 0.0,
    rat: str | None = None,
    environment: str = "any",
    height_m: float | None = None,
    antenna: str = "any",
    reach: str = "any",
    within_walk_m: float | None = None,
    area: Path | str | None = None,
    within_m: float = DESK_M,
) -> CellResult: ...


def locate(
    x_m: Readings | npt.ArrayLike,
    y_m: npt.ArrayLike | None = None,
    level_dbm: npt.ArrayLike | None = None,
    *,
    position_sigma_m: npt.ArrayLike = 0.0,
    rat: str | None = None,
    environment: str = "any",
    height_m: float | None = None,
    antenna: str = "any",
    reach: str = "any",
    within_walk_m: float | None = None,
    area: Path | str | None = None,
    within_m: float = DESK_M,
) -> CellResult:
    """Posterior of a transmitter's position and the verdict, from the readings of one cell.

    Either `Readings`, or bare arrays in the order of the walk, evenly in time: receiver positions
    `x_m` and `y_m`, shape (n,), metres in any plane with the same scale on both axes, and
    `level_dbm`, shape (n,). `position_sigma_m`, scalar or shape (n,), is the receiver's standard
    deviation per axis. `rat` ("GSM", "LTE", ...) sets the modem's reporting range: readings there
    are censored. `environment` (any, open, suburban, urban) chooses the prior of P0 and eta. The
    levels weigh the hypotheses of `height_m`, the antenna above the receiver, of `antenna` (omni,
    sector) and of `reach` (near, far), the distance from the walk, unless one is fixed. Located
    means that `within_m` holds 95 % of the probability. The answer may suppose that the transmitter
    stands within `within_walk_m` of the hull of these positions, or inside the polygons of `area`,
    a GeoJSON file.

    The result has `verdict` ("located", "ambiguous", "cannot tell"), `warnings` with the reasons,
    and `posterior`, None for too few readings: `x_m`, `y_m`, `r50_m`, `r95_m` in metres, `p0_dbm`
    at 1 m, `eta`, `modes` and `squares`, each in the frame of the input.

    Raises `ConfigError` for arrays of different shapes or beside `Readings`, values that
    are not finite, levels outside -200 to 50 dBm, degrees in place of metres, and unknown
    names.
    Source: `logger.core.locator.pipeline`, which lists the steps.
    """
    prior = _prior(environment, height_m, antenna, reach, within_walk_m, area)
    if area is not None and not isinstance(x_m, Readings):
        raise ConfigError("bare arrays are on no map: use within_walk_m, or give Readings")
    if isinstance(x_m, Readings):
        if not (y_m is None and level_dbm is None and rat is None) or np.any(position_sigma_m):
            raise ConfigError("observations have their own y_m, level_dbm, position_sigma_m, rat")
        readings = x_m
    elif y_m is None or level_dbm is None:
        raise ConfigError("bare arrays are given as locate(x_m, y_m, level_dbm)")
    else:
        readings = _bare(x_m, y_m, level_dbm, position_sigma_m, rat)
    # the matrices are small: threads of BLAS would only wait for each other
    with threadpool_limits(1):
        return locate_cell(readings, prior, _radius_m(within_m))


def smooth(
    runs: RunOrPath | Sequence[RunOrPath],
    cells: str | Sequence[str] | None = None,
    *,
    environment: str = "any",
    height_m: float | None = None,
    antenna: str = "any",
    reach: str = "any",
    within_walk_m: float | None = None,
    area: Path | str | None = None,
    loss: Loss = "linear",
    within_m: float = DESK_M,
    processes: int = 1,
    progress: Progress | bool = False,
) -> Result:
    """Every estimator over every cell of one run or of several, or over `cells` only.

    Readings of several runs are joined, with an unknown offset between the levels of different
    modems. `within_m`, `area` and the options of the prior are as in `locate`, `within_walk_m`
    around the whole walks. `loss` is that of the least-squares fit. More than one of `processes`
    needs a main guard in the calling script. `progress` is True, or a function as tqdm.
    `Result.cells` has a `CellResult` per cell, conspicuous ones first, then most readings first;
    arrays of its estimators are shape (n,) or (n, 4) with x, y (metres, UTM), P0 (dBm at 1 m) and
    eta.

    Raises `RunFileError` for a file that is no run, `ConfigError` for a cell that was not observed,
    an unknown environment or a run that appears twice, `GeoError` for runs of several places, which
    `by_place` tells apart.
    """
    prior = _prior(environment, height_m, antenna, reach, within_walk_m, area)
    if loss not in (known := get_args(Loss)):
        raise ConfigError(f"loss {loss!r} is unknown: one of {', '.join(known)}")
    options = Options(prior, loss, _radius_m(within_m))
    result = smooth_runs(
        named_apart(_runs(runs)),
        _names(cells),
        options=options,
        progress=_progress(progress),
        processes=processes,
    )
    return conspicuous_first(result)[0]


def suspect(
    runs: RunOrPath | Sequence[RunOrPath], *, progress: Progress | bool = False
) -> Suspicions:
    """Which cells of runs are suspicious, and why.

    `cells` has the `word` and the `findings` of each, the most suspicious first; places are degrees
    (WGS84). Printed, it is what `postproc suspect` says. `progress` as in `smooth`.

    Raises `RunFileError` for a file that is no run, `GeoError` for runs of several places.
    """
    every = named_apart(_runs(runs))
    check_one_place(every)
    return assess_runs(every, progress=_progress(progress))


def by_place(runs: RunOrPath | Sequence[RunOrPath]) -> list[Group]:
    """Runs in groups that share ground or a cell; each has its `runs`, and `where` in degrees.

    Raises `RunFileError` for a file that is no run.
    """
    return groups_of(named_apart(_runs(runs)))


def verify(
    runs: RunOrPath | Sequence[RunOrPath],
    claims: Claim | Sequence[Claim] | Path | str,
    cells: str | Sequence[str] | None = None,
    *,
    p_fa: float = 0.05,
    environment: str = "any",
    height_m: float | None = None,
    antenna: str = "any",
    reach: str = "any",
    within_walk_m: float | None = None,
    area: Path | str | None = None,
    progress: Progress | bool = False,
) -> Verified:
    """Test claimed positions of cells against runs: consistent, rejected or cannot tell.

    `claims` are `Claim`s (degrees WGS84, `sigma_m` in metres per axis) or a file: CSV with cell,
    lat, lon[, sigma_m], a cell export or a cell database. Of the claims rejected at most the share
    `p_fa` is rejected wrongly, on average (Benjamini and Hochberg 1995). `within_walk_m`, `area`
    and `progress` are as in `smooth`.

    Raises `ConfigError` for a cell that was not observed or a rate outside 0 to 0.5, `RunFileError`
    for a file that cannot be read.
    """
    file = Path(claims) if isinstance(claims, (Path, str)) else None
    if isinstance(claims, Claim):
        claims = [claims]
    cells = _names(cells)
    return verify_claims(
        _runs(runs),
        () if isinstance(claims, (Path, str)) else claims,
        p_fa,
        _prior(environment, height_m, antenna, reach, within_walk_m, area),
        cells,
        file=file,
        progress=_progress(progress),
    )


def export(
    run: RunOrPath | Result | Sequence[Result],
    path: Path | str,
    *,
    form: str | None = None,
    result: Result | None = None,
    all_estimators: bool = False,
    cells: str | Sequence[str] | None = None,
) -> Exported:
    """Write levels and track of a run, or the cells of results, complete or not at all.

    The format is `form` or the suffix of `path`: csv, kml, geojson, gpx, and for a run also wigle,
    opencellid-csv, opencellid-json, parquet. Results, also as `result`, give one row or feature a
    cell (degrees, WGS84); `all_estimators` adds the other estimators.

    Raises `ConfigError` for an unknown format, cells in a format that has none and a `path`
    that cannot be written, `EstimationError` for a run without a position fix, `RunFileError`
    where nothing can be written.
    """
    target = Path(path)
    results = [result] if result is not None else [run] if isinstance(run, Result) else None
    if not isinstance(run, (Run, Path, str, Result)):
        results = list(run)
        if not all(isinstance(one, Result) for one in results):
            raise ConfigError("levels are written one run a file; several may be results alone")
        if not results:
            raise ConfigError("no result is given")
    name = format_of(form, target, with_estimates=results is not None)
    check_output(target)
    wanted = _names(cells)
    if results is not None:
        some = [_part_of(one, wanted) for one in results] if wanted else results
        if wanted and (unknown := set(wanted) - {cell.cell for one in some for cell in one.cells}):
            raise ConfigError(f"cell {min(unknown)} is in no result")
        return write_answers(some, target, name, every=all_estimators)[0]
    assert isinstance(run, (Run, Path, str))
    observed = _run(run)
    walk = walk_of_run(observed, list(observed_cells([observed], wanted)) if wanted else None)
    return write_walk(walk, target, name)


def _part_of(result: Result, cells: Sequence[str]) -> Result:
    return replace(result, cells=tuple(cell for cell in result.cells if cell.cell in cells))


def _prior(
    environment: str,
    height_m: float | None,
    antenna: str,
    reach: str,
    within_walk_m: float | None,
    area: Path | str | None,
) -> Prior:
    where = area_of(within_walk_m, area)
    return prior_for(environment, height_m=height_m, antenna=antenna, reach=reach, area=where)


def _radius_m(within_m: float) -> float:
    if not 0.0 < within_m < inf:
        raise ConfigError(f"a radius is more than 0 m and finite, not {within_m:g}")
    return within_m


def _run(run: RunOrPath) -> Run:
    return run if isinstance(run, Run) else read_run(run)


def _runs(runs: RunOrPath | Sequence[RunOrPath]) -> list[Run]:
    every = list(map(_run, [runs] if isinstance(runs, RunOrPath) else runs))
    if not every:
        raise ConfigError("no run is given")
    return every


def _names(cells: str | Sequence[str] | None) -> Sequence[str] | None:
    return [cells] if isinstance(cells, str) else cells


def _progress(progress: Progress | bool) -> Progress | None:
    return (with_progress if progress else None) if isinstance(progress, bool) else progress


def _bare(
    x_m: npt.ArrayLike,
    y_m: npt.ArrayLike,
    level_dbm: npt.ArrayLike,
    position_sigma_m: npt.ArrayLike,
    rat: str | None,
) -> Readings:
    x, y, level = (_floats(values) for values in (x_m, y_m, level_dbm))
    if x.ndim != 1 or not x.shape == y.shape == level.shape:
        raise ConfigError(
            f"x_m, y_m and level_dbm are of one shape (n,), not {x.shape}, {y.shape}, {level.shape}"
        )
    if rat is not None and rat.upper() not in map(str.upper, _TECHNOLOGIES):
        raise ConfigError(f"rat {rat!r} is unknown: one of {', '.join(_TECHNOLOGIES)}")
    sigma_m = _broadcast(position_sigma_m, len(x))
    low_dbm, high_dbm = LEVEL_RANGE_DBM
    if not all(np.all(np.isfinite(values)) for values in (x, y, level, sigma_m)):
        raise ConfigError("x_m, y_m, level_dbm and position_sigma_m must be finite: leave out NaN")
    if np.any((level < low_dbm) | (level > high_dbm)):
        raise ConfigError(f"level_dbm must be within {low_dbm:.0f} to {high_dbm:.0f} dBm")
    if np.any(sigma_m < 0.0):
        raise ConfigError("position_sigma_m must not be negative")
    if len(x) >= FEWEST_BLOCKS and _are_degrees(x, y):
        raise ConfigError(
            "x_m and y_m look like degrees: they are metres, and all lie within "
            f"{_DEGREES_WITHIN:g}; Places.of_degrees(lat_deg, lon_deg) of logger.core.places "
            "converts them"
        )
    number = np.arange(len(x))
    places = Places.of(x, y, utm=NO_MAP, sigma_m=sigma_m, t_ns=number * 10**9)
    return Readings("", rat, places, level, number)


def _are_degrees(x: FloatArray, y: FloatArray) -> bool:
    """Whether positions that differ could be longitudes and latitudes of one walk."""
    extents = np.ptp(x), np.ptp(y)
    could_be = np.all(np.abs(x) <= 180.0) and np.all(np.abs(y) <= 90.0)
    could_be_swapped = np.all(np.abs(x) <= 90.0) and np.all(np.abs(y) <= 180.0)
    return bool((could_be or could_be_swapped) and 0.0 < max(extents) < _DEGREES_WITHIN)


def _floats(values: npt.ArrayLike) -> FloatArray:
    try:
        # a copy: the caller may write to his own; what is masked is unknown
        return np.array(np.ma.filled(np.ma.asarray(values, float), np.nan))
    except (TypeError, ValueError) as error:
        raise ConfigError(
            f"x_m, y_m, level_dbm and position_sigma_m are arrays of numbers: {error}"
        ) from None


def _broadcast(values: npt.ArrayLike, n: int) -> FloatArray:
    try:
        return np.broadcast_to(_floats(values), (n,)).copy()
    except ValueError:
        raise ConfigError(f"position_sigma_m is a scalar or has shape ({n},)") from None
