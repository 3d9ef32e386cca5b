"""What `postproc smooth` says of a `Result`: its JSON form, and lines and tables."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import NamedTuple

import shapely
from msgspec import Struct
from pyproj import Geod

from logger.core.answer import (
    Answer,
    Mode,
    Parameters,
    PathEnd,
    Paths,
    Place,
    Position,
    Region,
)
from logger.core.certainty import (
    RADII,
    Ellipse,
    decimals_within,
    metres,
    radius_m,
    share_text,
)
from logger.core.document import (
    Column,
    Degrees,
    Document,
    Line,
    Measured,
    Table,
    Value,
    Word,
    facts,
    number_of,
)
from logger.core.guidance.sentence import direction_from
from logger.core.locator.alternatives import alternatives_text
from logger.core.locator.region import HALF, LEVEL
from logger.core.model.prior import Prior
from logger.core.places import Places
from logger.core.runfile import Run
from logger.core.suspicion.words import reason_line, strongest_reasons
from logger.core.types import known_utc_text
from postproc.cell_work import Failure, attempt
from postproc.estimators.filters import AXES
from postproc.estimators.region_outline import polygons
from postproc.ground import runs_text
from postproc.info import RunFacts, describe
from postproc.result import (
    BACKWARD,
    BATCH,
    EKF,
    ESTIMATORS,
    REFERENCE,
    RTS,
    CellResult,
    ObservedRun,
    Result,
    heard_at,
    region_of,
    share_names,
)

_PLACE = ("lat", "lon", "r95_m", "r50_m", "drms_m", "may_be_distant")
_PARAMETERS = ("p0_dbm", "p0_sigma_db", "eta", "eta_sigma")
_END = ("lat", "lon", "drms_m", *_PARAMETERS, "ellipse95")
_PRIOR = tuple(one.name for one in fields(Prior) if one.name != "area")
_NOISE = ("sigma_db", "decorrelation_m", "white_share")
_STATISTICS = (
    "sigma_db",
    "skewness",
    "excess_kurtosis",
    "beyond_3_sigma",
    "lag1",
    "decorrelation_m",
    "independent",
)

REFERENCE_NOTE = (
    "* the filter of the specification, for comparison: neither its position nor its ellipse "
    "can be trusted"
)
_CELL_COLUMNS = (
    Column("cell"),
    Column("word"),
    Column("verdict"),
    Column("position"),
    Column("likely", is_right=True),  # short for `RADII`, so that a line fits into 80 columns
    Column("surely", is_right=True),
    Column("places", is_right=True),
)
_DISTANT = "*"
_MOST_ROWS = 12
"""More cells that are ordinary and not located push the answer off the screen."""
_ESTIMATOR_COLUMNS = (
    Column("estimator"),
    Column("position"),
    Column("50 %; 95 % (m)"),
    Column("P0", ".1f", "dBm"),
    Column("eta", ".2f"),
    Column("n", "d"),
)
_RUN_COLUMNS = (
    Column("run"),
    Column("n", "d"),
    Column("reads", "+.1f", "dB"),
    Column("without it"),
    Column("50 %; 95 % (m)"),
    Column("verdict"),
)
Parts = list[str | Line | Table]
_GEOD = Geod(ellps="WGS84")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSummary(RunFacts):
    """A run; `n_readings_without_position` includes those that no fix is near."""

    n_readings_without_position: int
    warnings: list[str]


class TruthCheck(Struct, kw_only=True):
    """True position of a simulated cell."""

    lat: float
    lon: float
    error_m: float | None = None
    inside_region95: bool | None = None


class SummaryRow(NamedTuple):
    """A cell with its answer, and the truth of a simulated one; `form` is its JSON."""

    result: CellResult
    answer: Answer
    truth: TruthCheck | None
    form: object

    @property
    def error(self) -> str | None:
        """That of the program which ended some of the work on the cell, None where none did."""
        return self.answer.provenance.error


class Summary(NamedTuple):
    """What is said of runs and of each cell.

    `in_order` names the cells as a text has them.
    """

    runs: list[RunSummary]
    warnings: tuple[str, ...]
    rows: list[SummaryRow]
    in_order: list[str]
    unnoticed: str
    run_names: Sequence[str]


def document_of(summary: Summary, *, details: bool) -> tuple[Document, list[Failure]]:
    """Reasons of conspicuous cells, a line for each cell, and why it is not located.

    With `details` all reasons and estimators. Also returns the cells of which a part could not be
    said. `docs/result.schema.json` describes the content: positions in degrees (WGS84), lengths in
    metres, levels in dBm, times in ns since boot. A value that is unknown or not finite is null.
    """
    runs, forms = summary.runs, [row.form for row in summary.rows]
    content: dict[str, object] = {"runs": runs, "warnings": summary.warnings, "cells": forms}
    if len(runs) == 1:
        content = {"run": runs[0], "cells": forms}
    content["unnoticed"] = summary.unnoticed
    by_cell = {row.result.cell: row for row in summary.rows}
    rows = [by_cell[cell] for cell in summary.in_order]
    conspicuous = {
        row.answer.cell: row.answer.word
        for row in rows
        if row.answer.word is not None and row.answer.is_conspicuous
    }
    # they are among the warnings, where JSON has them
    said_above = {reason_line(cell, word) for cell, word in conspicuous.items()}
    parts: Parts = [*_words(rows, has_several_runs=len(runs) > 1)]
    if any(run.simulated for run in runs):
        parts.append("This is a simulated run: the true positions are known.")
    parts += [
        Line(warning if len(runs) == 1 else f"{run.path}: {warning}", "red")
        for run in runs
        for warning in run.warnings
        if warning not in said_above
    ]
    if len(runs) > 1:
        parts += [Line(one, "yellow") for one in summary.warnings if one not in said_above]
    failures: list[Failure] = []
    if details:
        for row in rows:
            said = attempt(
                row.answer.cell, "its details", partial(_cell_parts, row, summary.run_names)
            )
            if isinstance(said, Failure):
                failures.append(said)
            else:
                parts += said
        parts += map(_failure_line, failures)
        if any(row.answer.paths and REFERENCE.key in row.answer.paths.ends for row in rows):
            parts += ["", REFERENCE_NOTE]
    elif rows:
        overview, failures = _overview(rows)
        parts += overview
    if summary.unnoticed:
        parts += ["", summary.unnoticed]
    return Document(content, body=parts), failures


def _words(rows: Sequence[SummaryRow], *, has_several_runs: bool) -> Iterator[Line]:
    conspicuous = [row for row in rows if row.answer.is_conspicuous]
    for row in conspicuous:
        answer, heard = row.answer, ""
        assert answer.word is not None
        if has_several_runs:
            heard = f" Heard in {_heard_text(answer)}."
        why = "; ".join(strongest_reasons(answer.word))
        yield Line((Word(answer.cell, "bold"), " is ", Word(answer.word.word), f": {why}.{heard}"))
        if answer.verdict != "located" and (walk := advice(answer, row.result)):
            yield Line(walk)
    yield from map(Line, dict.fromkeys(row.answer.to_do for row in rows if row.answer.to_do))
    n_checked = sum(row.answer.word is not None for row in rows)
    if n_checked and not conspicuous:
        cells = "The cell is not" if len(rows) == 1 else f"None of {n_checked} cells is"
        yield Line(f"{cells} suspicious or unusual, by the rules that could be checked.")


def _heard_text(answer: Answer) -> str:
    made_from = answer.provenance
    ends = (known_utc_text(at_ns) for at_ns in (made_from.first_utc_ns, made_from.last_utc_ns))
    return runs_text(made_from.runs, *ends)


_LONGEST_WALK_M = 5000.0
"""An hour's walk: towards a position less certain than this no walk is advised."""


def advice(answer: Answer, cell: CellResult) -> str:
    """What to do: the locator's advice where several positions fit, else the likeliest walk."""
    if answer.verdict == "located":
        return answer.to_do
    if answer.verdict == "ambiguous":
        return sentence(cell.warnings[1]) if len(cell.warnings) > 1 else ""
    posterior, place, obs = cell.posterior, cell.place, cell.obs
    if posterior is None or place is None or obs is None or not len(obs):
        return "Walk where this cell is received, with a position fix, and turn a corner or two."
    if posterior.at_limit or posterior.r95_m > _LONGEST_WALK_M:
        return "The levels do not show the distance yet: walk to where they are clearly higher."
    last, shown = obs.places[-1], posterior.place
    way = f"{metres(shown.away_m(last))} {direction_from(last, shown)}"
    where = f"the most likely position, {place.where}, {way} of the last reading of this cell"
    if posterior.may_be_distant:
        return f"Walk towards {where}, as long as the levels rise: they do not show a distance yet."
    return f"Walk around {where}."


def sentence(text: str) -> str:
    """With a capital letter and a full stop."""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') else '.'}"


def _failure_line(failure: Failure) -> Line:
    return Line((f"{failure.cell}: ", Word(failure.reason, "red")))


def _overview(rows: Sequence[SummaryRow]) -> tuple[Parts, list[Failure]]:
    shown = [row for i, row in enumerate(rows) if i < _MOST_ROWS or not _is_dull(row)]
    folded = [row for row in rows[_MOST_ROWS:] if _is_dull(row)]
    tried = [(row, attempt(row.answer.cell, "its line", partial(_cell_rows, row))) for row in shown]
    failures = [lines for _, lines in tried if isinstance(lines, Failure)]
    table = Table(
        _CELL_COLUMNS,
        [
            line
            for row, lines in tried
            for line in ([_begin(row.answer)] if isinstance(lines, Failure) else lines)
        ],
    )
    parts: Parts = ["", table]
    if folded:
        n_few = sum(row.answer.place is None for row in folded)
        how_many = "all" if n_few == len(folded) else n_few
        few = f", {how_many} for want of readings" if n_few else ""
        n_checked = sum(row.answer.word is not None for row in folded)
        of_checked = "" if n_checked == len(folded) else f" of {n_checked} checked"
        ordinary = f"; none{of_checked} is unusual" if n_checked else ""
        n_more = f"{number_of(len(folded), 'more cell')}"
        more = f"{n_more} cannot be located{few}{ordinary} (-v shows them)"
        parts.append(Line(more, "dim"))
    parts += map(_failure_line, failures)
    parts += [
        _failure_line(Failure(row.answer.cell, reason, None))
        for row in rows
        for reason in (row.answer.reasons if row.error else ())
    ]
    if any(row.answer.place is not None and row.answer.place.may_be_distant for row in shown):
        parts += [
            "",
            f"{_DISTANT} if it is no distant mast: the levels fit one kilometres away as well",
        ]
    parts += _why_not([row for row in shown if not row.error])
    for line in (_area_line(shown), _truth_line(shown)):
        parts += ["", line] if line else []
    has_places = any(row.answer.verdict == "ambiguous" for row in shown)
    parts += [
        "",
        Line(
            f"likely: {RADII[0]} (50 %); surely: {RADII[1]} (95 %)"
            f"{'; of a place: if it is that one' if has_places else ''}. "
            "Details of one cell: --cell NAME; of every cell: -v; of the words: postproc suspect",
            "dim",
        ),
    ]
    return parts, failures


def _is_dull(row: SummaryRow) -> bool:
    """Whether a cell is ordinary and cannot be located."""
    answer = row.answer
    return answer.verdict == "cannot tell" and not answer.is_conspicuous and row.error is None


def _why_not(rows: Sequence[SummaryRow]) -> Parts:
    """Why cells are not located; of several places, which are in the table, where to walk."""
    wide: list[float] = []
    others: list[tuple[str, str]] = []
    for row in rows:
        answer, needed_m = row.answer, row.result.needed_m
        if answer.verdict == "located" or not answer.reasons:
            continue
        if needed_m is not None:
            wide.append(needed_m)
        else:
            is_ambiguous = answer.verdict == "ambiguous" and len(answer.reasons) > 1
            others.append((answer.cell, answer.reasons[is_ambiguous]))
    parts: Parts = []
    if wide:
        cells = "1 cell is" if len(wide) == 1 else f"{len(wide)} cells are"
        narrow = "Levels from other sides, and nearer to the position, would tell more."
        text = f"{cells} not located because 95 % do not lie within {metres(wide[0])}. {narrow}"
        parts += ["", text]
    return [*parts, *([""] if others else []), *facts(others)]


def _begin(answer: Answer) -> tuple[Value, ...]:
    word = answer.word.word if answer.word is not None and answer.is_conspicuous else ""
    return answer.cell, Word(word), Word(answer.verdict)


def _cell_rows(row: SummaryRow) -> list[tuple[Value, ...]]:
    begin, place = _begin(row.answer), row.answer.place
    if place is None:
        where = heard_at(row.result.obs)
        return [(*begin, where and f"heard {where}")]
    # before the radius: the digits of a column stay below each other
    mark = _DISTANT if place.may_be_distant else ""
    modes, radii = place.likely_modes, (metres(place.r50_m), f"{mark}{metres(place.r95_m)}")
    rows: list[tuple[Value, ...]] = [
        (*begin, place.where, *radii, str(len(modes)) if modes else "")
    ]
    for i, mode in enumerate(modes if row.answer.verdict == "ambiguous" else (), 1):
        within_m = (radius_m(mode.ellipse95, level) for level in (HALF, LEVEL))
        rows.append((f"  place {i}: {mode.share}", "", "", mode.where, *map(metres, within_m)))
    return rows


def _area_line(rows: Sequence[SummaryRow]) -> str:
    """What the positions suppose."""
    places = [row.answer.place for row in rows if row.answer.place is not None]
    areas = sorted({place.area for place in places if place.area})
    shares = sorted(one.outside_share for one in places if one.outside_share is not None)
    if not areas:
        return ""
    outside = share_text(shares[0]) if shares else "an unknown part"
    if shares and share_text(shares[-1]) != outside:
        outside = f"{outside} to {share_text(shares[-1])}"
    return (
        f"Positions are those of a cell {' or '.join(areas)}. Without the area, {outside} of the "
        "probability is elsewhere."
    )


def _truth_line(rows: Sequence[SummaryRow]) -> str:
    checks = [row.truth for row in rows if row.truth is not None and row.truth.error_m is not None]
    if not checks:
        return ""
    errors_m = sorted(check.error_m for check in checks if check.error_m is not None)
    held = sum(bool(check.inside_region95) for check in checks)
    if len(checks) == 1:
        side = "holds" if held else "does not hold"
        return f"In truth the position is {metres(errors_m[0])} off; the 95 % region {side} it."
    return (
        f"In truth the positions are {metres(errors_m[0])} to {metres(errors_m[-1])} off; the "
        f"95 % region holds that of {held} of {len(checks)} cells."
    )


def _cell_parts(row: SummaryRow, run_names: Sequence[str]) -> Parts:
    answer, result = row.answer, row.result
    made_from, scans = answer.provenance, ""
    if made_from.n_scans is not None:
        scans = f", observed in {number_of(made_from.n_scans, 'scan')}"
    heard = f", heard in {_heard_text(answer)}" if len(run_names) > 1 else ""
    counts = f"  {made_from.n} readings{scans}{heard}"
    parts: Parts = ["", Line((Word(answer.cell, "bold"), counts))]
    parts.append(Line(answer.sentence, bullet="  "))
    others = answer.reasons[answer.verdict != "located" :]
    parts += [Line(warning, bullet="  - ") for warning in others]
    parts.append(estimator_table(answer))
    if answer.parameters is not None and answer.parameters.alternatives:
        parts.append(Line(alternatives_text(answer.parameters.alternatives), bullet="  "))
    if result.timing is not None:
        points = f"read at {result.timing.places} points, {result.timing.disagree} disagree"
        parts.append(Line(f"timing advance: {points}", bullet="  "))
    if result.without:
        parts.append(run_table(result, run_names))
    if row.truth is not None and row.truth.error_m is not None:
        side = "inside" if row.truth.inside_region95 else "OUTSIDE"
        error = f"best position is {row.truth.error_m:.0f} m off"
        parts.append(Line(f"truth: {error}, truth is {side} the 95 % region", bullet="  "))
    return parts


def estimator_table(answer: Answer) -> Table:
    """The posterior, its modes where there are several, and every estimator."""
    return Table(
        _ESTIMATOR_COLUMNS, list(_estimator_rows(answer)), f"All estimators of cell {answer.cell}"
    )


def _estimator_rows(answer: Answer) -> Iterator[tuple[Value, ...]]:
    place, parameters = answer.place, answer.parameters
    if place is not None and parameters is not None:
        n = answer.provenance.n
        yield ("posterior", _position(place), _radii(place), *_parameters(parameters), n)
        for i, mode in enumerate(place.likely_modes if len(place.likely_modes) > 1 else (), 1):
            yield f"  position {i}: {mode.share}", _position(mode), _axes(mode.ellipse95)
    paths = answer.paths or Paths({}, ())
    for estimator in ESTIMATORS:
        title = f"{estimator.name}*" if estimator == REFERENCE else estimator.name
        end = paths.ends.get(estimator.key)
        if estimator.key in paths.failed:
            yield title, "did not converge"
        elif end is not None:
            extent = (_axes(end.ellipse95), *_parameters(end))
            if not end.is_bounded:
                # a fit that the readings do not bound has no uncertainty
                extent = ("no bounds", end.p0_dbm, end.eta)
            yield (title, _position(end), *extent, end.n)


def _parameters(of: Parameters | PathEnd) -> tuple[Value, Value]:
    return Measured(of.p0_dbm, of.p0_sigma_db), Measured(of.eta, of.eta_sigma)


def run_table(cell: CellResult, run_names: Sequence[str]) -> Table:
    """What each run contributes: its level against the one with most, and the answer without it."""
    rows: list[tuple[Value, ...]] = []
    shares = cell.shares if cell.without else ()
    for share, name in zip(shares, share_names(shares, run_names), strict=True):
        rest = cell.without[share.run]
        is_first = share.offset_db is not None and not share.sigma_db
        level: Value = "0" if is_first else Measured(share.offset_db, share.sigma_db)
        place = rest.place
        position = (_position(place), _radii(place)) if place else (None, None)
        rows.append((name, share.n, level, *position, Word(rest.verdict)))
    return Table(_RUN_COLUMNS, rows, f"Run by run: cell {cell.cell}")


def _position(at: Position | Mode | PathEnd) -> Degrees:
    if isinstance(at, Position):
        return Degrees(at.lat, at.lon, decimals_within(at.r95_m, at.r50_m))
    return Degrees(at.lat, at.lon, decimals_within(at.ellipse95.semi_major_m))


def _radii(place: Place) -> str:
    return f"r {place.r50_m:.0f}; {place.r95_m:.0f}"


def _axes(ellipse: Ellipse) -> str:
    return f"{ellipse.semi_major_m:.0f} x {ellipse.semi_minor_m:.0f}"


def summarise(result: Result) -> Summary:
    """What is said of one run or of several."""
    more = result.warnings if len(result.runs) == 1 else ()
    return Summary(
        [_run(observed, more) for observed in result.runs],
        result.warnings,
        [_row_or_why_not(cell, result) for cell in result.cells],
        [cell.cell for cell in result.cells_in_order],
        result.unnoticed,
        [observed.run.name for observed in result.runs],
    )


def _run(observed: ObservedRun, more: Sequence[str]) -> RunSummary:
    info = describe(observed.run)
    facts = {field.name: getattr(info, field.name) for field in fields(RunFacts)}
    observations = observed.observations
    return RunSummary(
        **facts,
        n_readings_without_position=(
            observations.n_without_position if observations else info.n_readings
        ),
        warnings=[*observed.warnings, *more],
    )


def _row_or_why_not(cell: CellResult, result: Result) -> SummaryRow:
    runs = [observed.run for observed in result.runs]

    def row_of(cell: CellResult, truth: TruthCheck | None) -> SummaryRow:
        answer = result.answer(cell)
        return SummaryRow(cell, answer, truth, json_form(cell, answer, truth, runs))

    row = attempt(cell.cell, "its summary", lambda: row_of(cell, truth_of(cell, runs)))
    return row_of(cell.after(row), None) if isinstance(row, Failure) else row


def json_form(
    cell: CellResult, answer: Answer, truth: TruthCheck | None, runs: Sequence[Run]
) -> dict[str, object]:
    """A cell in JSON; what is not known is null or empty."""
    place, parameters, made_from = answer.place, answer.parameters, answer.provenance
    form: dict[str, object] = {
        "cell": answer.cell,
        "n": made_from.n,
        "n_scans": made_from.n_scans,
        "first_utc": known_utc_text(made_from.first_utc_ns),
        "last_utc": known_utc_text(made_from.last_utc_ns),
        "verdict": answer.verdict,
        "best": _fields(place, _PLACE)
        | _fields(parameters, _PARAMETERS)
        | _fields(place, ("strongest",)),
        "modes": place.modes if place else (),
        "region95": region_of(cell, LEVEL) if place else Region(),
        "region50": region_of(cell, HALF) if place else Region(),
        "prior": parameters and _fields(parameters.prior, _PRIOR),
        "alternatives": parameters.alternatives if parameters else (),
    }
    if place is not None and place.area:
        form["area"] = {"text": place.area, "outside_share": place.outside_share}
    if parameters is not None:
        form["noise"] = _fields(parameters, _NOISE)
    paths, ends = answer.paths or Paths({}, ()), {}
    for estimator in ESTIMATORS:
        end = paths.ends.get(estimator.key)
        is_converged = False if estimator.key in paths.failed else None
        ends[estimator] = _fields(end, _END) | (
            {"n": end.n, "converged": True} if end else {"n": 0, "converged": is_converged}
        )
    form |= {one.json_key: ends[one] for one in (REFERENCE, EKF, BACKWARD)}
    compared = cell.comparison
    form["agreement"] = compared and {
        "sigmas": dict(zip(AXES, compared.sigmas, strict=True)),
        "agrees": compared.agrees,
    }
    form |= {one.json_key: ends[one] for one in (RTS, BATCH)}
    if cell.batch is not None and cell.obs is not None:
        places = [Places.of(*rival[:2], utm=cell.obs.utm) for rival in cell.batch.rivals]
        rivals = [place.lat_lon_deg[:, 0].tolist() for place in places]
        form[BATCH.json_key] = _fields(paths.ends[BATCH.key], (*_END, "n")) | {
            "sigma_db": cell.batch.sigma_db,
            "converged": cell.batch.converged,
            "bounded": cell.batch.bounded,
            "correlation_inflation": cell.batch.inflation,
            "rivals": [{"lat": lat, "lon": lon} for lat, lon in rivals],
        }
    found = cell.residuals
    form["residuals"] = found and _fields(found, _STATISTICS) | {
        "by_distance": found.by_distance and found.by_distance._asdict(),
        "by_azimuth": found.by_azimuth and found.by_azimuth._asdict(),
        "innovations": found.innovations and found.innovations._asdict(),
        "outliers": [outlier._asdict() for outlier in found.outliers],
    }
    form["set_aside"] = [spike._asdict() for spike in cell.set_aside]
    form |= {"truth": truth, "warnings": answer.reasons}
    if cell.timing is not None:
        form["timing"] = cell.timing._asdict()
    if len(runs) > 1:
        form["runs"] = made_from.runs
        shares = [(runs[share.run].path, share) for share in cell.shares if share.n]
        form["offsets"] = [
            {"run": path} | _fields(share, ("n", "offset_db", "sigma_db")) for path, share in shares
        ]
        form["without"] = [
            {
                "n": rest.n,
                "verdict": rest.verdict,
                "best": rest.place and rest.place.position,
                "region95": _fields(rest.place, ("area_m2",)),
                "run": runs[i].path,
            }
            for i, rest in cell.without.items()
        ]
    if answer.word is not None:
        form |= {"word": answer.word.word, "word_reasons": strongest_reasons(answer.word)}
    if made_from.error is not None:
        form["error"] = made_from.error
    return form


def _fields(part: object, names: Sequence[str]) -> dict[str, object]:
    return {name: getattr(part, name, None) for name in names}


def truth_of(result: CellResult, runs: Sequence[Run]) -> TruthCheck | None:
    """True position of a simulated cell and the error of the best one; None for an unknown cell."""
    truth = next((t for run in runs for t in run.meta.truth if t.cell == result.cell), None)
    if truth is None:
        return None
    check = TruthCheck(lat=truth.lat_deg, lon=truth.lon_deg)
    if (place := result.place) and result.posterior is not None and result.obs is not None:
        check.error_m = _GEOD.inv(place.lon, place.lat, truth.lon_deg, truth.lat_deg)[2]
        point = shapely.Point(result.obs.utm.to_xy(truth.lat_deg, truth.lon_deg))
        check.inside_region95 = bool(polygons(result.posterior.squares).intersects(point))
    return check
