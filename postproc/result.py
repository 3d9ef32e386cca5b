"""The result of `smooth`: every estimator over every cell of some runs, and answers as a table.

Tables, report, view, exports and JSON are made of this alone.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from math import isfinite
from typing import TYPE_CHECKING, Any, Final, NamedTuple, get_args

import numpy as np

from logger.core import ekf
from logger.core.answer import (
    Answer,
    PathEnd,
    Paths,
    Place,
    Provenance,
    Region,
    Word,
    answer_of,
    place_of,
    supposition_of,
)
from logger.core.arrays import FloatArray, IntArray
from logger.core.certainty import (
    RADII,
    Ellipse,
    ellipse95,
    metres,
    radii_text,
)
from logger.core.document import (
    LENGTH,
    Column,
    Document,
    Table,
    Value,
    html_table,
    html_text,
    number_of,
    terminal_lines,
)
from logger.core.document import Word as Mark
from logger.core.errors import ConfigError
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import HALF, LEVEL, Squares, area_m2
from logger.core.locator.timing_advance import TimingCheck
from logger.core.locator.verdict import DESK_M
from logger.core.model.prior import ENVIRONMENTS, Prior
from logger.core.places import MAX_GAP_S, NO_MAP, Places, Utm
from logger.core.readings import Observations, Readings, SpikeLevel
from logger.core.runfile import Run
from logger.core.suspicion.rule import WORDS
from logger.core.suspicion.words import strongest_reasons
from logger.core.types import Verdict, known_utc_text
from postproc.cell_work import Failure
from postproc.estimators.filters import Comparison, FilterPath
from postproc.estimators.least_squares import BatchFit, Loss
from postproc.estimators.region_outline import geojson, outline
from postproc.estimators.residuals import Residuals
from postproc.notebook_plan import OnPlan, draw, new_axes, svg

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

VERDICTS: Final[tuple[Verdict, ...]] = get_args(Verdict)
"""From the best to none."""
COLUMNS = (
    "cell",
    "word",
    "verdict",
    "latitude_deg",
    "longitude_deg",
    "r50_m",
    "r95_m",
    "supposition",
    "n_places",
    "other_places",
    "n_readings",
    "runs",
    "first_utc",
    "last_utc",
    "word_reasons",
    "verdict_reasons",
)
"""Position: that of the cell, WGS 84. `r50_m` and `r95_m` about it hold 50 % and 95 % of the
probability, also of `other_places`: latitude, longitude and share of each; `supposition` is what
the radii suppose."""
_BESIDE = ("ekf", "rts", "batch")
"""Other estimators by their key; the ellipse of the reference EKF is wrong."""
_WIDEST_M = 50_000.0
"""GSM reaches 35 km: a wider ellipse contains no information."""


def answer_table(answers: Iterable[Answer], *, every: bool = False) -> Table:
    """One row for each answer; None is what is not known.

    `every` adds the positions of the other estimators.
    """
    beside = _BESIDE if every else ()
    more = (f"{key}_{angle}" for key in beside for angle in ("latitude_deg", "longitude_deg"))
    columns = tuple(map(Column, (*COLUMNS, *more)))
    return Table(columns, [tuple(_values(answer, beside)) for answer in answers])


def frame_of(table: Table) -> "pd.DataFrame":
    """The table as a frame of pandas, times as such; raises `ConfigError` without pandas."""
    try:
        import pandas as pd  # noqa: PLC0415 (optional, and takes a second)
    except ImportError:
        raise ConfigError(
            "a frame needs pandas, which is not installed: pip install pandas"
        ) from None
    frame = pd.DataFrame(list(table.rows), columns=[column.title for column in table.columns])
    times = {name: pd.to_datetime(frame[name], utc=True) for name in ("first_utc", "last_utc")}
    return frame.assign(**times)


def _values(answer: Answer, beside: Sequence[str]) -> Iterator[Value]:
    word, made_from = answer.word, answer.provenance
    yield from (answer.cell, word.word if word else None, answer.verdict)
    yield from _place(answer)
    yield from (made_from.n, "; ".join(made_from.runs))
    for utc_ns in (made_from.first_utc_ns, made_from.last_utc_ns):
        yield known_utc_text(utc_ns)
    yield "; ".join(strongest_reasons(word)) if word else None
    yield "; ".join(answer.reasons)
    for key in beside:
        end = answer.paths.ends.get(key) if answer.paths else None
        shown = end.in_short() if end is not None and _is_bounded(end) else None
        yield from (None, None) if shown is None else (shown.lat, shown.lon)


def _place(answer: Answer) -> tuple[Value, ...]:
    if answer.place is None:
        return None, None, None, None, None, 0, None
    place = answer.place.in_short()
    others = (f"{one.share}: {one.lat} {one.lon}" for one in place.modes[1:])
    radii = place.r50_m, place.r95_m, place.supposition or None
    return place.lat, place.lon, *radii, len(place.modes), "; ".join(others) or None


def _is_bounded(end: PathEnd) -> bool:
    """Whether an estimator has a position to show."""
    major_m = end.ellipse95.semi_major_m
    return isfinite(end.lat) and end.is_bounded and major_m <= _WIDEST_M


# --- the result ---


@dataclass(frozen=True, slots=True)
class Options:
    """What the user may choose.

    The prior, the loss of the least-squares fit, and the 95 % radius of a located cell.
    """

    prior: Prior = ENVIRONMENTS["any"]
    loss: Loss = "linear"
    within_m: float = DESK_M


@dataclass(frozen=True, slots=True)
class ObservedRun:
    """A run with its readings at the walker's smoothed positions, and warnings about the run.

    `observations` is None where the run has no position fix. Those of several runs are in the UTM
    zone of the first with a position.
    """

    run: Run
    observations: Observations | None
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RunShare:
    """What a run contributes to a cell: `n` readings with a position, the offset of its modem.

    `run` is the index in `Result.runs`. `offset_db` is how much higher its modem reads than the
    one with most levels of the cell, None if unknown.
    """

    run: int
    n: int
    offset_db: float | None
    sigma_db: float | None


def share_names(shares: Sequence[RunShare], run_names: Sequence[str]) -> list[str]:
    """Their runs, each modem of one that has several by its number."""
    counts = Counter(share.run for share in shares)
    names, seen = [], Counter[int]()
    for share in shares:
        seen[share.run] += 1
        n = counts[share.run]
        modem = f" (modem {seen[share.run]} of {n})" if n > 1 else ""
        names.append(f"{run_names[share.run]}{modem}")
    return names


class Estimator(NamedTuple):
    """An estimator beside the posterior: attribute of `CellResult`, key in JSON, and name."""

    key: str
    json_key: str
    name: str


BATCH: Final = Estimator("batch", "batch", "least squares")
EKF: Final = Estimator("ekf", "ekf", "EKF")
BACKWARD: Final = Estimator("backward", "ekf_backward", "EKF backward")
RTS: Final = Estimator("rts", "rts", "RTS")
REFERENCE: Final = Estimator("reference", "reference_ekf", "reference EKF")
ESTIMATORS: Final = (BATCH, EKF, BACKWARD, RTS, REFERENCE)
"""In the order of the tables."""


class Estimate(NamedTuple):
    """Final state of one estimator after `n` readings.

    `x` (4,) is a position in metres, P0 in dBm and eta; `p` (4, 4) its covariance, which only
    readings that bound the fit give.
    """

    estimator: Estimator
    x: FloatArray
    p: FloatArray
    n: int
    is_bounded: bool = True

    @property
    def ellipse(self) -> Ellipse:
        """95 % ellipse."""
        return ellipse95(*self.p[[0, 0, 1], [0, 1, 1]].tolist())


def is_equal(one: Any, other: Any) -> bool:
    """Whether every number is the same, or unknown in both."""
    return type(one) is type(other) and bool(_comparable(one) == _comparable(other))


def _comparable(value: Any) -> Any:
    # arrays have no truth, and NaN is not equal to itself
    if is_dataclass(value) and not isinstance(value, Run):
        value = (type(value).__name__, *(getattr(value, part.name) for part in fields(value)))
    match value:
        case np.ndarray():
            return value.dtype, value.shape, value.tobytes()
        case Run():
            return value.digest
        case tuple():
            return tuple(map(_comparable, value))
        case Mapping():
            return {key: _comparable(part) for key, part in value.items()}
    return value if value == value else repr(value)  # noqa: PLR0124


@dataclass(frozen=True, slots=True, eq=False)
class CellResult:
    """What each estimator states about one cell; None where it has nothing reliable to state.

    `n` counts the readings with a position, `n_scans` the scans that surely identified the cell.
    `residuals` are those at the posterior's best position. `failed` names the estimators that did
    not converge; their values are dropped. `heard_utc_ns` are the UTC of the first and the last
    reading, None if unknown. `set_aside` are levels that the readings around contradict; only the
    reference EKF and `residuals` use them. `error` is the error of the program that ended some work
    on the cell, `needed_m` the radius that a location needs, if the region is wider. `word` is
    empty unless it is conspicuous.

    `shares` is what each run contributed, and `without` the answer without one run, by its index in
    `Result.runs`; empty unless two or more runs observed the cell.
    """

    cell: str
    n: int
    obs: Readings | None
    verdict: Verdict
    warnings: tuple[str, ...]
    posterior: Posterior | None = None
    reference: FilterPath | None = None
    ekf: FilterPath | None = None
    rts: FilterPath | None = None
    batch: BatchFit | None = None
    backward: FilterPath | None = None
    comparison: Comparison | None = None
    residuals: Residuals | None = None
    timing: TimingCheck | None = None
    failed: tuple[str, ...] = ()
    set_aside: tuple[SpikeLevel, ...] = ()
    n_scans: int | None = None
    heard_utc_ns: tuple[int, int] | None = None
    shares: tuple[RunShare, ...] = ()
    without: Mapping[int, "CellResult"] = field(default_factory=dict)
    error: str | None = None
    needed_m: float | None = None
    word: str = ""

    __eq__, __hash__ = is_equal, None  # type: ignore[assignment]

    @property
    def place(self) -> Place | None:
        """The posterior in degrees; None without one, and of bare arrays, which are on no map."""
        if self.posterior is None or self.obs is None or self.obs.utm == NO_MAP:
            return None
        return place_of(self.posterior)

    @property
    def latitude_deg(self) -> float | None:
        """Of the likeliest place, WGS 84; None where `place` is."""
        return None if self.place is None else self.place.lat

    @property
    def longitude_deg(self) -> float | None:
        """As `latitude_deg`."""
        return None if self.place is None else self.place.lon

    def __repr__(self) -> str:
        return f"{self.cell or 'cell'}, {self.n} readings: {self._sentence()}"

    def _repr_html_(self) -> str:
        head = f"<p><b>{html_text(self.cell)}</b>, {self.n} readings: "
        plan = "" if self.obs is None else svg([], self._heard_m(), _on_plan(self))
        caption = _CAPTION.format("heard here") if plan else ""
        return f"{head}{html_text(self._sentence())}</p>{plan}{caption}"

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw where the cell was heard, its places and both regions, in metres (UTM)."""
        axes = ax or new_axes()
        draw(axes, [], self._heard_m(), _on_plan(self))
        return axes

    def _sentence(self) -> str:
        word = f"{self.word}; " if self.word else ""
        posterior = self.posterior
        if posterior is not None and self.place is None:
            area = "" if posterior.prior.area is None else posterior.prior.area.text
            supposed = supposition_of(area, may_be_distant=posterior.may_be_distant)
            at = f"x {posterior.x_m:.0f} m, y {posterior.y_m:.0f} m"
            radii = radii_text(posterior.r50_m, posterior.r95_m)
            return f"{word}{self.verdict}, {', '.join(filter(None, [at, radii, supposed]))}"
        made_from = Provenance(self.n)
        answer = Answer(self.cell, self.verdict, self.warnings, made_from, self.place)
        return f"{word}{answer.sentence}"

    def _heard_m(self) -> FloatArray:
        return np.empty((0, 2)) if self.obs is None else self.obs.places.xy_m.T

    def answer(self, runs: Sequence[Run], word: Word | None = None) -> Answer:
        """The answer from the `runs` of the result, with the word of suspicion if it was asked."""
        paths = None
        if self.obs is not None:
            ends = {one.estimator.key: _end(one, self.obs.utm) for one in self.estimates}
            paths = Paths(ends, self.failed)
        names = tuple(dict.fromkeys(runs[share.run].name for share in self.shares))
        first_utc_ns, last_utc_ns = self.heard_utc_ns or (None, None)
        made_from = Provenance(self.n, first_utc_ns, last_utc_ns, self.n_scans, names, self.error)
        return answer_of(
            self.cell, self.verdict, self.warnings, made_from, self.posterior, word, paths
        )

    @property
    def estimates(self) -> Iterator[Estimate]:
        """Where each estimator beside the posterior ends; positions are UTM."""
        for estimator in ESTIMATORS:
            path: FilterPath | BatchFit | None = getattr(self, estimator.key)
            if isinstance(path, BatchFit):
                yield Estimate(estimator, path.state, path.covariance, path.n, path.bounded)
            elif path is not None and len(path):
                n = path.consistency.n if path.consistency else len(path)
                yield Estimate(estimator, path.x[-1, :4], path.p[-1, :4, :4], n)

    def after(self, why: Failure) -> "CellResult":
        """The row of the cell where work on its result failed."""
        warnings = (why.reason, *self.warnings)
        return CellResult(
            self.cell, self.n, None, "cannot tell", warnings, n_scans=self.n_scans,
            heard_utc_ns=self.heard_utc_ns, shares=self.shares, error=why.error,
        )  # fmt: skip


def _on_plan(cell: CellResult, label: str = "", word: str = "") -> list[OnPlan]:
    if cell.posterior is None:
        return []
    modes = cell.posterior.likely_modes if cell.verdict == "ambiguous" else ()
    places_m = [(mode.x_m, mode.y_m) for mode in modes or cell.posterior.modes[:1]]
    levels = {95: LEVEL, 50: HALF} if cell.posterior.is_strongest_inside else {95: LEVEL}
    squares = cell.posterior.squares
    regions = {percent: rings_of(squares, level) for percent, level in levels.items()}
    return [OnPlan(label or cell.cell, word, np.array(places_m), regions)]


def rings_of(squares: Squares, level: float) -> list[FloatArray]:
    """Outline of the smallest region with this probability: closed rings (k, 2), in metres.

    Outer ones run counterclockwise, holes clockwise.
    """
    return [
        np.asarray(ring.coords, float)
        for polygon in outline(squares, level)
        for ring in (polygon.exterior, *polygon.interiors)
    ]


def region_of(cell: CellResult, level: float) -> Region:
    """The region that holds so much of the probability, where its squares are known."""
    posterior, obs = cell.posterior, cell.obs
    if posterior is None or obs is None:
        return Region()
    if level != LEVEL and not posterior.is_strongest_inside:
        return Region()
    return Region(
        area_m2=area_m2(posterior.squares, level),
        geojson=geojson(posterior.squares, obs.utm, level),
    )


def _end(of: Estimate, utm: Utm) -> PathEnd:
    x, p = of.x, of.p
    at = Places.of(x[0], x[1], utm=utm).on_map
    return PathEnd(
        lat=at.lat,
        lon=at.lon,
        drms_m=ekf.drms_m(ekf.upper_triangle(p)),
        p0_dbm=float(x[2]),
        p0_sigma_db=float(np.sqrt(max(p[2, 2], 0.0))),
        eta=float(x[3]),
        eta_sigma=float(np.sqrt(max(p[3, 3], 0.0))),
        ellipse95=ellipse95(p[0, 0], p[0, 1], p[1, 1]),
        n=of.n,
        is_bounded=of.is_bounded,
    )


def split_at_gaps(t_ns: IntArray, points_m: FloatArray) -> list[FloatArray]:
    """Points (n, 2) cut into strips (k, 2) where nothing came for more than `MAX_GAP_S`."""
    return np.split(points_m, np.flatnonzero(np.diff(t_ns) > MAX_GAP_S * 1e9) + 1)


def program_version() -> str:
    """Version of this program."""
    from importlib.metadata import version  # noqa: PLC0415 (50 ms)

    return version("cellwalk")


def in_report_order(cells: Sequence[CellResult], first: Sequence[str]) -> list[CellResult]:
    """Those named `first`, then by verdict and readings."""
    named = {cell: number for number, cell in enumerate(first)}

    def rank(cell: CellResult) -> tuple[int, ...]:
        is_nowhere = cell.obs is None and not cell.error
        verdict = VERDICTS.index(cell.verdict)
        return named.get(cell.cell, len(named)), is_nowhere, verdict, -cell.n

    return sorted(cells, key=rank)


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """All cells of one or several runs, the cell with most readings first.

    `warnings` are about the runs together; those about one run are in `runs`. `version` is that of
    the program that estimated. `words` are those of the cells if suspicion was asked, `not_asked`
    the rules that no run could serve, each with what was missing; `unnoticed` says what none could
    see.
    """

    runs: tuple[ObservedRun, ...]
    cells: tuple[CellResult, ...]
    warnings: tuple[str, ...] = ()
    options: Options = Options()
    version: str = field(default_factory=program_version)
    words: Mapping[str, Word] = field(default_factory=dict)
    not_asked: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    unnoticed: str = ""

    __eq__, __hash__ = is_equal, None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        conspicuous = {name: word.word for name, word in self.words.items() if word.is_conspicuous}
        cells = (replace(cell, word=conspicuous.get(cell.cell, "")) for cell in self.cells)
        object.__setattr__(self, "cells", tuple(cells))

    @property
    def answers(self) -> tuple[Answer, ...]:
        """The answers about all cells."""
        return tuple(map(self.answer, self.cells))

    def to_frame(self) -> "pd.DataFrame":
        """The answers as a frame of pandas, a row each; `docs/api.md` lists the columns.

        Raises `ConfigError` where pandas is not installed.
        """
        return frame_of(answer_table(self.answers))

    def plot(self, cell: str | None = None, ax: "Axes | None" = None) -> "Axes":
        """Draw the walks, and places and regions of `cell`, or of what is known best.

        Axes are east and north in metres (UTM). Raises `ConfigError` for a cell that is not there.
        """
        drawn = self._to_draw() if cell is None else [one for one in self.cells if one.cell == cell]
        if cell is not None and not drawn:
            raise ConfigError(f"cell {cell} is not in this result")
        axes = ax or new_axes()
        on_plan = [part for one in drawn for part in _on_plan(one, "", one.word)]
        draw(axes, self._strips_m(), np.empty((0, 2)), on_plan)
        return axes

    def __repr__(self) -> str:
        more = len(self.cells) - _MOST_LINES
        after = [f"and {more} more: .to_frame() has all"] * (more > 0)
        said = Document(
            None, body=[self._title(), self._table(self.cells_in_order[:_MOST_LINES]), *after]
        )
        return "\n".join(terminal_lines(said))

    def _repr_html_(self) -> str:
        drawn, shown = self._to_draw(), self.cells_in_order[:_MOST_ROWS]
        shown += [cell for cell in drawn if all(cell is not one for one in shown)]
        on_plan = [
            part
            for i, cell in enumerate(shown, 1)
            if any(cell is one for one in drawn)
            for part in _on_plan(cell, f"{i}", cell.word)
        ]
        plan = svg(self._strips_m(), np.empty((0, 2)), on_plan)
        more = len(self.cells) - len(shown)
        after = f"<p>and {more} more: <code>.to_frame()</code> has all</p>" if more else ""
        title = f"<p><b>{html_text(self._title())}</b></p>"
        caption = _CAPTION.format("the walk") if plan else ""
        return f"{title}{plan}{caption}{html_table(self._table(shown))}{after}"

    def _table(self, cells: Sequence[CellResult]) -> Table:
        rows = [_row(i, self.answer(cell)) for i, cell in enumerate(cells, 1)]
        return Table(_NOTEBOOK_COLUMNS, rows, "Cells", name_column=1)

    def _title(self) -> str:
        names = [observed.run.name for observed in self.runs]
        more = f" and {len(names) - 3} more" if len(names) > 3 else ""
        words = Counter(cell.word for cell in self.cells)
        n_located = sum(cell.verdict == "located" for cell in self.cells)
        counts = [f"{words[word]} {word}" for word in WORDS[:0:-1] if words[word]]
        n_cells = number_of(len(self.cells), "cell")
        said = ", ".join([n_cells, *counts, f"{n_located} located"])
        return f"{', '.join(names[:3])}{more}: {said}"

    @property
    def cells_in_order(self) -> list[CellResult]:
        """As every text has them."""
        conspicuous = [cell for cell, word in self.words.items() if word.is_conspicuous]
        return in_report_order(self.cells, conspicuous)

    def _to_draw(self) -> list[CellResult]:
        """The conspicuous, located and ambiguous cells; without any the first that has a place."""
        placed = [cell for cell in self.cells_in_order if cell.posterior is not None]
        known = [cell for cell in placed if cell.word or cell.verdict != "cannot tell"]
        return known[:_MOST_DRAWN] or placed[:1]

    def _strips_m(self) -> list[FloatArray]:
        strips = []
        for observed in self.runs:
            if observed.observations is not None:
                track = observed.observations.track
                strips += split_at_gaps(track.t_ns, track.xy_m.T)
        return strips

    def answer(self, cell: CellResult) -> Answer:
        """The answer about one of the cells, with its word where suspicion was asked."""
        return cell.answer([observed.run for observed in self.runs], self.words.get(cell.cell))


_MOST_LINES, _MOST_ROWS, _MOST_DRAWN = 7, 12, 6
_CAPTION = "<p>Grey: {}. Strong colour: most likely there (50 %). Faint: surely there (95 %).</p>"
RADIUS_COLUMNS = tuple(Column(name, LENGTH) for name in RADII)
_NOTEBOOK_COLUMNS = (
    Column("no.", "d"),
    Column("cell"),
    Column("word"),
    Column("verdict"),
    Column("likeliest place"),
    *RADIUS_COLUMNS,
    Column("readings", "d"),
)


def _row(number: int, answer: Answer) -> tuple[Value, ...]:
    word = Mark(answer.word.word) if answer.word and answer.is_conspicuous else ""
    begin, place = (number, answer.cell, word, Mark(answer.verdict)), answer.place
    at = (
        (place.where, place.r50_m, surely(place.r95_m, place.supposition))
        if place
        else (None, None, None)
    )
    return (*begin, *at, answer.provenance.n)


def surely(r95_m: float | None, supposition: str | None) -> Value:
    """The radius of 95 % and its supposition."""
    return f"{metres(r95_m)} {supposition}" if supposition else r95_m


def joint_warnings(n_runs: int, cells: Sequence[CellResult]) -> tuple[str, ...]:
    """Warnings about the runs of these cells together."""
    if not cells:
        return ("no cell with an identity was observed",)
    if n_runs > 1 and all(len({one.run for one in cell.shares if one.n}) < 2 for cell in cells):
        return ("no cell was observed in two of the runs: each answer is that of one run",)
    return ()


def heard_at(obs: Readings | None) -> str | None:
    """Where a cell without a position was heard best; None if nowhere."""
    heard = None if obs is None or obs.utm == NO_MAP else obs.everywhere()
    if not heard:
        return None
    at = heard.strongest.places.on_map
    return f"{at.lat:.4f} {at.lon:.4f}"
