"""Verdicts, advice and quantities in plain words."""

from collections import Counter
from collections.abc import Sequence

from logger.core.answer import Answer, Mode, Place
from logger.core.ellipse import metres
from logger.core.guidance.sentence import direction
from postproc.result import CellResult, Result

_LONGEST_WALK_M = 5000.0
"""An hour's walk: towards a position less certain than this no walk is advised."""


def advice(answer: Answer, cell: CellResult) -> str:
    """What to do: the locator's advice where several positions fit, else the likeliest walk.

    About a located cell what `Answer.to_do` says, which may be nothing.
    """
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
    way_m = shown.xy_m[:, 0] - last.xy_m[:, 0]
    way = f"{metres(shown.away_m(last))} {direction(way_m)}"
    return (
        f"Walk around the most likely position, {where_text(place)}, {way} of the last reading "
        "of this cell."
    )


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
        parts.append(f"{n_undecided} without a position")
    return ", ".join(parts)


def number_of(count: int, noun: str) -> str:
    """A number with its noun."""
    return f"{count} {noun}{'s' * (count != 1)}"


def where_text(place: Place | Mode) -> str:
    """Latitude and longitude as far as they are known, on one line."""
    return place.where.replace(" ", "\N{NO-BREAK SPACE}")


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


def sentence(text: str) -> str:
    """With a capital letter and a full stop."""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') else '.'}"
