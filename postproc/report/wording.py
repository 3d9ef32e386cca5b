"""Verdicts, advice and quantities in plain words."""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from logger.core.answer import Mode, Place
from logger.core.ellipse import metres, radii_text
from logger.core.guidance.sentence import direction
from logger.core.locator.rivals import area_text
from postproc.result import CellResult

_MOST_POSITIONS = 4
"""Positions of an ambiguous cell that its answer lists; the plan shows all."""
_LONGEST_WALK_M = 5000.0
"""An hour's walk: towards a position less certain than this no walk is advised."""


class Headline(NamedTuple):
    """The answer about a cell in a few words.

    `advice` is where to walk next, None where no walk is needed.
    """

    verdict: str
    title: str
    text: str
    advice: str | None


def headline(cell: CellResult) -> Headline:
    """What the walk shows about a cell."""
    place = cell.place
    if place is None or cell.verdict == "cannot tell":
        reason = cell.warnings[0] if cell.warnings else "the readings do not determine a position"
        return Headline(cell.verdict, "No position yet", _sentence(reason), _advice(cell))
    if cell.verdict == "located":
        area, radii = area_text(place.area_m2), radii_text(place.r50_m, place.r95_m)
        position = degrees_text(place)
        text = f"With a probability of 95 %, it is in a region of {area} around {position}."
        return Headline(cell.verdict, f"Located: {radii}", text, None)
    modes = place.likely_modes
    shares = [f"{mode.percent}% at {degrees_text(mode)}" for mode in modes]
    more = len(modes) - _MOST_POSITIONS
    listed = ", ".join(shares[:_MOST_POSITIONS]) + (f" and {more} more" if more > 0 else "")
    text = f"The levels fit several positions: {listed}."
    return Headline(cell.verdict, f"{len(modes)} positions fit", text, _advice(cell))


def heading(cells: Sequence[CellResult], answers: Sequence[Headline]) -> str:
    """The verdicts of all cells in one line, or the answer of a single one."""
    if not cells:
        return "No cell was observed"
    if len(cells) == len(answers) == 1:
        title = answers[0].title
        return f"Cell {cells[0].cell}: {title[:1].lower()}{title[1:]}"
    counts = Counter(cell.verdict for cell in cells)
    parts = [f"{counts['located']} of {number_of(len(cells), 'cell')} located"]
    if n_ambiguous := counts["ambiguous"]:
        parts.append(f"{n_ambiguous} ambiguous")
    if n_undecided := counts["cannot tell"]:
        parts.append(f"{n_undecided} without a position")
    return ", ".join(parts)


def number_of(count: int, noun: str) -> str:
    """A number with its noun."""
    return f"{count} {noun}{'s' * (count != 1)}"


def degrees_text(place: Place | Mode) -> str:
    """Latitude and longitude to a metre."""
    return f"{place.lat:.5f} {place.lon:.5f}"


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


def _advice(cell: CellResult) -> str | None:
    """The locator's advice where several positions fit, else the most informative walk."""
    if cell.verdict == "ambiguous":
        return _sentence(cell.warnings[1]) if len(cell.warnings) > 1 else None
    posterior, place, obs = cell.posterior, cell.place, cell.obs
    if posterior is None or place is None or obs is None or not len(obs):
        return "Walk where this cell is received, with a position fix, and turn a corner or two."
    if posterior.at_limit or posterior.r95_m > _LONGEST_WALK_M:
        return "The levels do not show the distance yet: walk to where they are clearly higher."
    last, shown = obs.places[-1], posterior.place
    way_m = shown.xy_m[:, 0] - last.xy_m[:, 0]
    way = f"{metres(shown.away_m(last))} {direction(way_m)}"
    return (
        f"Walk around the most likely position, {degrees_text(place)}. It is {way} of the last "
        "reading of this cell. Levels from more than one side are the most informative."
    )


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') else '.'}"
