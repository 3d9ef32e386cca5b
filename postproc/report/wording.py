"""Verdicts, advice and quantities in plain words."""

from collections import Counter
from collections.abc import Sequence
from math import atan2, degrees, hypot, isfinite
from typing import NamedTuple

from logger.core.locator.posterior import Posterior
from postproc.json_text import Json
from postproc.result import CellResult

_COMPASS = (
    "north",
    "north-east",
    "east",
    "south-east",
    "south",
    "south-west",
    "west",
    "north-west",
)
_MOST_PLACES = 4
_WORTH_A_WALK_M = 5000.0


class Answer(NamedTuple):
    """A verdict for somebody who has a minute; `advice` says what to walk next, None where nothing
    is missing.
    """

    verdict: str
    title: str
    text: str
    advice: str | None


def answer(cell: CellResult, found: Json) -> Answer:
    """What the walk says of a cell; `found` is its part of `results.summary`."""
    posterior = cell.posterior
    if posterior is None or cell.verdict == "cannot tell":
        why = cell.warnings[0] if cell.warnings else "the readings do not hold the answer"
        return Answer(cell.verdict, "Cannot be told yet", _sentence(why), _advice(cell))
    if cell.verdict == "located":
        area = area_text(found["region95"]["area_m2"])
        text = f"With 95 % probability it stands in a region of {area} about {place_text(found['best'])}."
        return Answer(cell.verdict, f"Located within {metres(posterior.r95_m)}", text, None)
    places = [mode for mode in found["modes"] if mode["percent"] is not None]
    shares = [f"{mode['percent']}% at {place_text(mode)}" for mode in places[:_MOST_PLACES]]
    more = len(places) - len(shares)
    text = (
        f"The levels fit several places: {', '.join(shares)}{f' and {more} more' if more else ''}."
    )
    return Answer(cell.verdict, f"{len(places)} places fit", text, _advice(cell))


def counted(cells: Sequence[CellResult], answers: Sequence[Answer]) -> str:
    """The verdicts of all cells in one line; of a single one the answer itself."""
    if not cells:
        return "No cell was heard"
    if len(cells) == len(answers) == 1:
        return f"Cell {cells[0].cell}: {answers[0].title[:1].lower()}{answers[0].title[1:]}"
    of = Counter(cell.verdict for cell in cells)
    parts = [f"{of['located']} of {number_of(len(cells), 'cell')} located"]
    parts += [f"{of['ambiguous']} ambiguous"] * bool(of["ambiguous"])
    parts += [f"{of['cannot tell']} cannot be told"] * bool(of["cannot tell"])
    return ", ".join(parts)


def number_of(count: int, what: str) -> str:
    """A number of things."""
    return f"{count} {what}{'s' * (count != 1)}"


def metres(value_m: float | None) -> str:
    """A length with the digits that matter."""
    if value_m is None or not isfinite(value_m):
        return "unknown"
    if value_m < 1000.0:
        return f"{value_m:.0f} m"
    return f"{value_m / 1000.0:.{1 if value_m < 10_000.0 else 0}f} km"


def area_text(area_m2: float) -> str:
    """An area with the digits that matter."""
    if area_m2 >= 100_000.0:
        return f"{area_m2 / 1e6:.2g} km²"
    return f"{float(f'{area_m2:.2g}'):,.0f} m²".replace(",", "\N{NARROW NO-BREAK SPACE}")


def place_text(place: Json) -> str:
    """Latitude and longitude to a metre."""
    return f"{place['lat']:.5f} {place['lon']:.5f}"


def direction(east_m: float, north_m: float) -> str:
    """A direction in words, to one of eight."""
    return _COMPASS[round(degrees(atan2(east_m, north_m)) / 45.0) % 8]


def time_text(seconds: float) -> str:
    """Time since the start, h:mm:ss."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"


def duration_text(seconds: float) -> str:
    """How long something lasted."""
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60:02} min"


def _advice(cell: CellResult) -> str | None:
    """The locator's own advice where several places fit, else where a next walk would tell most."""
    if cell.verdict == "ambiguous":
        return _sentence(cell.warnings[1]) if len(cell.warnings) > 1 else None
    if cell.posterior is None or cell.obs is None or not len(cell.obs):
        return "Walk where this cell is heard, with a position fix, and turn a corner or two on the way."
    return _nearer(cell, cell.posterior)


def _nearer(cell: CellResult, posterior: Posterior) -> str:
    """Towards the likeliest place, or along where the cell was heard loudest where that is too far
    to be one.
    """
    obs = cell.obs
    if obs is None or posterior.at_limit or posterior.r95_m > _WORTH_A_WALK_M:
        return "The level says little of the distance yet: walk on to where it is heard clearly stronger."
    east_m, north_m = posterior.x_m - float(obs.x_m[-1]), posterior.y_m - float(obs.y_m[-1])
    lat, lon = obs.utm.to_latlon(posterior.x_m, posterior.y_m)
    return (
        f"Walk past the likeliest place, {lat:.5f} {lon:.5f}, {metres(hypot(east_m, north_m))} to the "
        f"{direction(east_m, north_m)} of where this walk last heard it, and around it: levels from more than one side "
        "tell most."
    )


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') else '.'}"
