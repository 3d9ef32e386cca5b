"""The page from its parts."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from math import inf
from pathlib import Path
from typing import Any
from unicodedata import category

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from logger.core.runfile import Run
from postproc.info import CellCount, Event, Gap, Info, describe
from postproc.json_text import Json
from postproc.report import wording
from postproc.report.figures import Drawn
from postproc.report.svg import inline
from postproc.report.wording import Answer
from postproc.result import CellResult, Result
from postproc.tables import TITLES
from postproc.verification.run_claims import CellVerdict, Verified

_NO_CLAIMS = Verified(0.0, (), (), ())
_MOST_EVENTS = 150
_MOST_GAPS = 60


@dataclass(frozen=True, slots=True)
class Shown:
    """A picture as it stands on the page."""

    key: str
    title: str
    svg: Markup
    seen: str


@dataclass(frozen=True, slots=True)
class Told:
    """A cell told in full: its answer, its part of `results.summary`, findings beside the answer,
    and pictures.
    """

    key: str
    answer: Answer
    found: Json
    findings: tuple[str, ...]
    pictures: tuple[Shown, ...]

    @property
    def estimators(self) -> list[tuple[str, Json, str]]:
        """Name, values and extent in words of each estimator that has a place."""
        best, rows = self.found["best"], []
        if best["lat"] is not None:
            rows.append(("posterior", best | {"n": self.found["n"]}, f"radius {best['r95_m']:.0f}"))
        for name, title in TITLES.items():
            if self.found[name]["lat"] is not None:
                rows.append((title, self.found[name], _axes(self.found[name]["ellipse95"])))
        return rows


@dataclass(frozen=True, slots=True)
class Walk:
    """One run as the page tells it; `events` and `gaps` are bounded, the worst and the longest
    kept.
    """

    run: Run
    info: Info
    warnings: tuple[str, ...]
    events: tuple[Event, ...]
    gaps: tuple[Gap, ...]


def told_cell(number: int, cell: CellResult, found: Json, drawn: Sequence[Drawn]) -> Told:
    """A cell with its pictures, its number naming it on the page."""
    key = f"cell-{number}"
    answer = wording.answer(cell, found)
    told = f"{answer.text} {answer.advice}".lower()
    findings = tuple(text for text in cell.warnings if text.lower() not in told)
    pictures = tuple(_shown(f"{key}-{one.name}", one) for one in drawn)
    return Told(key, answer, found, findings, pictures)


def walk_of(run: Run, warnings: Sequence[str]) -> Walk:
    """A run with what happened on the way."""
    info = describe(run)
    told = sorted(info.events, key=lambda event: event.level not in {"warning", "error"})[
        :_MOST_EVENTS
    ]
    longest = sorted(info.gaps, key=lambda gap: -gap.length_s)[:_MOST_GAPS]
    events, gaps = (
        sorted(told, key=lambda event: event.t_s),
        sorted(longest, key=lambda gap: gap.start_s),
    )
    return Walk(run, info, tuple(warnings), tuple(events), tuple(gaps))


def html(
    result: Result,
    told: Sequence[Told],
    found: Sequence[Json],
    walks: Sequence[Walk],
    verified: Verified | None,
    overview: Drawn | None = None,
) -> str:
    """The page; the same input gives the same text."""
    page = _templates().get_template("report.html")
    return page.render(
        heading=wording.counted(result.cells, [one.answer for one in told]),
        told=told,
        cells=found,
        warnings=[text for walk in walks for text in walk.warnings] + list(result.warnings),
        prior=next((cell["prior"] for cell in found if cell["prior"]), None),
        heard=_heard(walks),
        overview=_shown(overview.name, overview) if overview else None,
        walks=walks,
        claims=verified or _NO_CLAIMS,
        detectable=_detectable,
        program=f"cellwalk {version('cellwalk')}",
    )


def _heard(walks: Sequence[Walk]) -> dict[str, CellCount]:
    """Cells of all walks, each as it was where it was heard strongest."""
    every = sorted(
        (cell for walk in walks for cell in walk.info.cells),
        key=lambda cell: cell.strongest_dbm or -inf,
    )
    return {cell.cell: cell for cell in every}


def _shown(key: str, drawn: Drawn) -> Shown:
    return Shown(
        key, drawn.title, inline(drawn.figure, key, f"{key}-title", f"{key}-seen"), drawn.seen
    )


@cache
def _templates() -> Environment:
    """Everything put into the page is escaped, the pictures of `svg` excepted."""
    environment = Environment(
        loader=PackageLoader("postproc.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_plain,
    )
    environment.filters |= {
        "axes": _axes,
        "metres": wording.metres,
        "of": wording.number_of,
        "place": wording.place_text,
        "time": wording.time_text,
        "duration": wording.duration_text,
        "filename": lambda path: Path(path).name,
    }
    return environment


def _plain(value: Any) -> Any:
    """Nothing known is a dash; what cannot be printed, a lone surrogate or a bell, shows as
    such.
    """
    if value is None:
        return "–"
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    return "".join(
        "\N{REPLACEMENT CHARACTER}" if category(c).startswith("C") and c not in "\n\t" else c
        for c in value
    )


def _axes(ellipse: Json) -> str:
    return f"{ellipse['semi_major_m']:.0f} × {ellipse['semi_minor_m']:.0f}"


def _detectable(cell: CellVerdict) -> str:
    """Displacements that the test followed would have noticed."""
    noticed = [m for m in cell.detectable_m if m is not None]
    return (
        f"{wording.metres(min(noticed))} to {wording.metres(max(noticed))}" if noticed else "none"
    )
