"""Verdicts, advice and quantities in plain words."""

from collections import Counter
from collections.abc import Sequence

from logger.core.answer import Answer, Mode, Place
from postproc import summary
from postproc.result import CellResult, Result


def advice(answer: Answer, cell: CellResult) -> str:
    """What to do."""
    text, place = summary.advice(answer, cell), answer.place
    return text if place is None else text.replace(place.where, where_text(place))


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
