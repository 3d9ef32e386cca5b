"""The page from its parts, by the template in `templates`."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import inf

from jinja2 import Template
from markupsafe import Markup

from logger.core.answer import CONSPICUOUS, Answer
from logger.core.certainty import OnMap, decimals_within, metres
from logger.core.document import Column, Degrees, Table, Value, Word, number_of
from logger.core.locator.alternatives import alternatives_text
from logger.core.suspicion.words import strongest_reasons, word_rate_text
from postproc.html_page import page_environment
from postproc.info import (
    CellCount,
    Event,
    Gap,
    Info,
    describe,
    gravest_events,
    longest_gaps,
)
from postproc.report.coordinates import Coordinates, coordinates
from postproc.report.figures import ReportFigure
from postproc.report.svg import inline_svg
from postproc.result import RADIUS_COLUMNS, CellResult, Result, heard_at, surely
from postproc.summary import advice, estimator_table, run_table, sentence
from postproc.suspicion.signalling import signals_of, signals_table
from postproc.verification.claims import CellVerdict, Verified

_NO_CLAIMS = Verified(0.0, (), (), ())
_NO_TABLE = Table((), ())
_MOST_PLACES = 4
_MOST_ROWS = 12
"""Of a table that does not scroll by itself."""
_MOST_EVENTS = 100
_MOST_GAPS = 60
"""Of a run: a recorder that fails for hours writes more than anybody reads."""


Streets = Callable[[OnMap], str | None]
"""Name of the street at a latitude and longitude."""


def no_street(_at: OnMap) -> str | None:
    """No file has names of streets."""
    return None


@dataclass(frozen=True, slots=True)
class CellSection:
    """A cell in detail: its number, answer, advice, warnings beside the answer, and figures.

    `word` is empty where suspicion was not asked. `reasons` and `harmless` causes, the weightiest
    first, and the `rate` stand beside "unusual" and "suspicious"; beside any other word the reasons
    are what rules only warn of.
    """

    number: int
    result: CellResult
    sentence: str
    advice: str
    findings: tuple[str, ...]
    places: tuple[Coordinates, ...]
    figures: tuple[ReportFigure, ...]
    estimators: Table
    runs: Table
    word: str = ""
    reasons: tuple[str, ...] = ()
    harmless: tuple[str, ...] = ()
    rate: str = ""

    @property
    def key(self) -> str:
        """Its identifier on the page."""
        return f"cell-{self.number}"

    @property
    def is_odd(self) -> bool:
        """Whether the page speaks of it first."""
        return self.word in CONSPICUOUS


def gap_table(gaps: Sequence[Gap], run_name: str) -> Table:
    """Times without a record."""
    columns = (Column("missing"), Column("start", is_right=True), Column("duration"))
    rows = [(gap.of, time_text(gap.start_s), duration_text(gap.length_s)) for gap in gaps]
    return Table(columns, rows, f"Gaps of {run_name}", scrolls=True)


def event_table(events: Sequence[Event], run_name: str) -> Table:
    """Notes of the recorder."""
    columns = (
        Column("time", is_right=True),
        Column("level"),
        Column("source"),
        Column("event", is_long=True),
    )
    rows = [
        (time_text(event.t_s), Word(event.level), event.source, event.in_short) for event in events
    ]
    return Table(columns, rows, f"Events of {run_name}", scrolls=True)


def cell_section(
    number: int,
    answer: Answer,
    result: CellResult,
    run_names: Sequence[str],
    figures: Sequence[ReportFigure],
    streets: Streets = no_street,
) -> CellSection:
    """A cell of runs with its answer and figures; the number identifies it on the page."""
    word = answer.word.word if answer.word else ""
    said, to_do = sentence(answer.verdict_sentence), advice(answer, result)
    answered = f"{said} {to_do}".lower()
    section = CellSection(
        number=number,
        result=result,
        sentence=said,
        advice=to_do,
        findings=tuple(text for text in result.warnings if text.lower() not in answered),
        places=tuple(_places(result, streets)),
        figures=tuple(figures),
        estimators=estimator_table(answer),
        runs=run_table(result, run_names),
        word=word,
    )
    if answer.word is None:
        return section
    findings = sorted(answer.word.findings, key=lambda finding: -finding.nats)
    if not section.is_odd:
        warns = (one.text for one in findings if one.rule.strength == "warns")
        return replace(section, reasons=tuple(dict.fromkeys(warns)))
    harmless = ", ".join(finding.rule.harmless for finding in findings).split(", ")
    return replace(
        section,
        reasons=tuple(strongest_reasons(answer.word)),
        harmless=tuple(dict.fromkeys(harmless)),
        rate=word_rate_text(answer.word.word),
    )


def section_without_details(number: int, result: CellResult) -> CellSection:
    """A cell whose details could not be made: the reason."""
    why = sentence(f"no details: {result.warnings[0]}")
    return CellSection(number, result, why, "", (), (), (), _NO_TABLE, _NO_TABLE)


def _places(result: CellResult, streets: Streets) -> Iterator[Coordinates]:
    place = result.place
    if place is None or result.verdict == "cannot tell":
        return
    modes = place.likely_modes[:_MOST_PLACES]
    for mode in modes:
        is_only = len(modes) == 1
        radius_m = place.r95_m if is_only else None
        share = "" if is_only else mode.share
        street = streets(mode) or ""
        radii_m = (place.r95_m, place.r50_m) if is_only else (mode.ellipse95.semi_major_m,)
        decimals = decimals_within(*radii_m)
        yield coordinates(mode, radius_m, share, street, decimals)


def html(
    result: Result,
    cells: Sequence[CellSection],
    verified: Verified | None,
    overview: ReportFigure | None = None,
    cell_map: ReportFigure | None = None,
) -> str:
    """The page; the same input gives the same text."""
    infos = [describe(observed.run) for observed in result.runs]
    return _template("report.html").render(
        heading=heading(result),
        located=located_text(result.cells),
        top=cells[0] if cells and cells[0].is_odd else None,
        unnoticed=result.unnoticed,
        has_suspicious=any(word.word == "suspicious" for word in result.words.values()),
        details=cells,
        cells=result.cells,
        warnings=[text for one in result.runs for text in one.warnings] + list(result.warnings),
        prior=next((cell.posterior.prior for cell in result.cells if cell.posterior), None),
        cell_table=_cell_table(result, _strongest_counts(infos)),
        claim_table=_claim_table(verified or _NO_CLAIMS),
        overview=overview,
        cell_map=cell_map,
        runs=[(one.run, info) for one, info in zip(result.runs, infos, strict=True)],
        claims=verified or _NO_CLAIMS,
        signalling=_signalling(result),
        program=f"cellwalk {result.version}",
    )


def _signalling(result: Result) -> Table | None:
    listed = signals_of([observed.run for observed in result.runs])
    return signals_table(listed) if listed else None


def _strongest_counts(infos: Sequence[Info]) -> dict[str, CellCount]:
    counts = [count for info in infos for count in info.cells]
    counts.sort(key=lambda count: count.strongest_dbm or -inf)
    return {count.cell: count for count in counts}


def _svg(figure: ReportFigure, key: str) -> Markup:
    """The figure under a title and above a text that are named by its key, unique on the page."""
    return inline_svg(figure.figure, key, f"{key}-title", f"{key}-text")


@cache
def _template(name: str) -> Template:
    environment = page_environment("postproc.report")
    environment.filters |= {
        "alternatives": alternatives_text,
        "metres": metres,
        "sentence": sentence,
        "minute": lambda utc: f"{utc[:16].replace('T', ' ')} UTC",
        "of": number_of,
        "time": time_text,
        "duration": duration_text,
        "svg": _svg,
        "longest": partial(longest_gaps, most=_MOST_GAPS),
        "gravest": partial(gravest_events, most=_MOST_EVENTS),
        "gap_table": gap_table,
        "event_table": event_table,
    }
    environment.globals["MOST_RUNS"] = 2
    return environment.get_template(name)


_POSITION = Column("latitude and longitude")


def _cell_table(result: Result, counts: Mapping[str, CellCount]) -> Table:
    columns = (
        Column("no.", "d"),
        Column("cell"),
        Column("word"),
        Column("verdict"),
        Column("type"),
        Column("readings", "d"),
        Column("highest level", ".0f", "dBm"),
        _POSITION,
        *RADIUS_COLUMNS,
    )
    rows = []
    for number, cell in enumerate(result.cells, 1):
        word = result.words.get(cell.cell)
        count, place = counts.get(cell.cell), cell.place
        heard = None if place else heard_at(cell.obs)
        shown: tuple[Value, ...] = (heard and f"heard {heard}", None, None)
        if place is not None:
            shown = (place.where, place.r50_m, surely(place.r95_m, place.supposition))
        rows.append(
            (
                number,
                cell.cell,
                Word(word.word) if word else None,
                Word(cell.verdict),
                count.rat if count else None,
                cell.n,
                count.strongest_dbm if count else None,
                *shown,
            )
        )
    scrolls = len(rows) > _MOST_ROWS
    return Table(columns, rows, "Table of all cells", name_column=1, scrolls=scrolls)


def _claim_table(verified: Verified) -> Table:
    columns = (
        Column("cell"),
        Column("verdict"),
        Column("claimed position"),
        Column("accuracy", is_right=True),
        Column("source"),
        Column("distance from the walk", is_right=True),
        Column("p direct", ".3g"),
        Column("p indirect", ".3g"),
        Column("q", ".3g"),
        Column("detectable displacement", is_right=True),
    )
    rows = [
        (
            cell.cell,
            Word(cell.verdict),
            Degrees(cell.claim.lat_deg, cell.claim.lon_deg),
            metres(cell.claim.sigma_m) if cell.claim.sigma_m else None,
            cell.claim.source,
            None if cell.distance_m is None else metres(cell.distance_m),
            cell.p_direct,
            cell.p_indirect,
            cell.q,
            _detectable(cell) if cell.power else None,
        )
        for cell in verified.cells
    ]
    return Table(columns, rows, "Table of claims")


def _detectable(tested: CellVerdict) -> str:
    displacements_m = [m for m in tested.detectable_m if m is not None]
    if not displacements_m:
        return "none"
    return f"{metres(min(displacements_m))} to {metres(max(displacements_m))}"


def heading(result: Result) -> str:
    """Which cell is suspicious, or that none is."""
    if not result.cells:
        return "No cell was observed"
    if not result.words:
        return located_text(result.cells)
    counts = Counter(word.word for word in result.words.values())
    if counts["suspicious"] > 1:
        return f"{counts['suspicious']} cells are suspicious"
    if counts["suspicious"]:
        return "One cell is suspicious"
    if n_unusual := counts["unusual"]:
        return f"No cell is suspicious, {n_unusual} {'is' if n_unusual == 1 else 'are'} unusual"
    return "No cell is suspicious"


def located_text(cells: Sequence[CellResult]) -> str:
    """The verdicts of all cells in one line."""
    counts = Counter(cell.verdict for cell in cells)
    parts = [f"{counts['located']} of {number_of(len(cells), 'cell')} located"]
    if n_ambiguous := counts["ambiguous"]:
        parts.append(f"{n_ambiguous} ambiguous")
    if n_undecided := counts["cannot tell"]:
        parts.append(f"{n_undecided} not located")
    return ", ".join(parts)


def time_text(seconds: float) -> str:
    """Time since the start, h:mm:ss."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"


def duration_text(seconds: float) -> str:
    """Length of an interval."""
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60:02} min"
