"""A small plan of cells for a notebook: the walks, and of each cell its places and both regions.

Positions are metres east and north in one plane, usually a UTM zone. The colours are legible on
light and on dark ground; ink is that of the notebook.
"""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from math import floor, log10
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from shapely import LineString

from logger.core.arrays import FloatArray
from logger.core.document import Word

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REGIONS = {95: ("surely within (95 %)", 0.15), 50: ("most likely within (50 %)", 0.35)}
"""Name of each region by its percentage, and how opaque it is; the larger one below."""
_COLOURS = {"suspicious": "#d6303c", "unusual": "#be8c1e"}
_ORDINARY, _WALK = "#3c6ee6", "#7d7d87"
_LEAST_WALK_M = 100.0
"""A walk on the spot is drawn as if it were this long, or the plan would show GPS noise alone."""
_MOST_WALKS = 20.0
"""A region wider than this many walks extends outside: the walk would shrink to a dot."""
_WIDTH, _LEAST_HEIGHT, _MOST_HEIGHT, _EDGE = 460.0, 180.0, 400.0, 22.0
"""Pixels."""
_SCALE_PARTS = 8
"""The scale bar is about one of so many of the width."""
_MOST_BYTES = 40_000


class OnPlan(NamedTuple):
    """A cell: what it is labelled, its word, its places (n, 2), the likeliest first, and its rings.

    `regions` has by percentage the rings (k, 2) of the region, holes among them.
    """

    label: str
    word: str
    places_m: FloatArray
    regions: Mapping[int, Sequence[FloatArray]]

    @property
    def colour(self) -> str:
        """By its word."""
        return _COLOURS.get(self.word, _ORDINARY)

    @property
    def text(self) -> str:
        """Sign and label."""
        return " ".join(filter(None, (Word(self.word).symbol, self.label)))


def svg(walks: Sequence[FloatArray], heard_m: FloatArray, cells: Sequence[OnPlan]) -> str:
    """The plan as SVG: `walks` (k, 2) as lines, `heard_m` (n, 2) as dots; empty without either."""
    if not len(heard_m) and not any(map(len, walks)):
        return ""
    low_m, high_m = _shown_m(walks, heard_m, cells)
    inside = _WIDTH - 2.0 * _EDGE, _MOST_HEIGHT - 2.0 * _EDGE
    scale = float(np.min(inside / (high_m - low_m)))
    height = max(float(high_m[1] - low_m[1]) * scale + 2.0 * _EDGE, _LEAST_HEIGHT)
    half_m = 0.5 * np.array([_WIDTH, height]) / scale
    corner_m = 0.5 * (low_m + high_m) + half_m * (-1.0, 1.0)  # north-west

    def pixels(points_m: FloatArray) -> FloatArray:
        return np.asarray((points_m - corner_m) * (scale, -scale), float)

    text, tolerance = "", 0.7
    while not text or len(text.encode()) > _MOST_BYTES:
        shapes = "".join(_shapes(walks, heard_m, cells, pixels, tolerance))
        text = _whole(shapes, height, scale, cells)
        tolerance *= 2.0
    return text


def draw(
    axes: "Axes", walks: Sequence[FloatArray], heard_m: FloatArray, cells: Sequence[OnPlan]
) -> None:
    """The same on axes of matplotlib, to scale in metres."""
    for i, walk in enumerate(walks):
        axes.plot(*walk.T, color=_WALK, linewidth=1, label="_" if i else "walk")
    if len(heard_m):
        axes.plot(*heard_m.T, ".", color=_WALK, markersize=3, label="heard here")
    from matplotlib.patches import PathPatch  # noqa: PLC0415 (only for those who draw)
    from matplotlib.path import Path  # noqa: PLC0415

    for cell in cells:
        for percent, (_, alpha) in REGIONS.items():
            if rings := cell.regions.get(percent):
                path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
                axes.add_patch(PathPatch(path, facecolor=cell.colour, alpha=alpha, linewidth=0))
                axes.add_patch(PathPatch(path, fill=False, edgecolor=cell.colour, linewidth=0.8))
        label = ": ".join(filter(None, (cell.label, cell.word)))
        marker = "X" if cell.word == "suspicious" else "o"
        axes.plot(*cell.places_m.T, marker, color=cell.colour, label=label, markeredgecolor="white")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="east (m)", ylabel="north (m)")
    axes.ticklabel_format(useOffset=False, style="plain")
    style: Any = {"bbox_to_anchor": (0.0, 1.0), "ncols": 2, "frameon": False, "fontsize": "small"}
    if axes.get_legend_handles_labels()[0]:  # a run without a fix has none
        axes.legend(loc="lower left", **style)  # above the axes, where it hides nothing


def round_step(span: float, most: int) -> float:
    """A step of 1, 2 or 5 times a power of ten that divides `span` into at most `most` parts."""
    if span <= 0.0:
        return 1.0
    power = 10.0 ** floor(log10(span / most))
    steps = (power, 2 * power, 5 * power, 10 * power)
    return next(step for step in steps if span / step <= most + 1e-9)


def length_text(length_m: float) -> str:
    """Of a scale bar."""
    return f"{length_m:g} m" if length_m < 1000.0 else f"{length_m / 1000.0:g} km"


def new_axes() -> "Axes":
    """Axes of a new figure of pyplot."""
    from matplotlib import pyplot as plt  # noqa: PLC0415 (a second; only for those who draw)

    return plt.subplots(layout="constrained")[1]


def _shown_m(
    walks: Sequence[FloatArray], heard_m: FloatArray, cells: Sequence[OnPlan]
) -> FloatArray:
    """South-west and north-east corner of what is drawn, shape (2, 2)."""
    walked_m = np.vstack([*walks, heard_m])
    low_m, high_m = walked_m.min(axis=0), walked_m.max(axis=0)
    walk_m = max(float(np.max(high_m - low_m)), _LEAST_WALK_M)
    for cell in cells:
        for points_m in (cell.places_m[:1], *cell.regions.get(95, ())):
            low, high = np.minimum(low_m, points_m.min(0)), np.maximum(high_m, points_m.max(0))
            if np.max(high - low) <= _MOST_WALKS * walk_m:
                low_m, high_m = low, high
    middle_m, half_m = 0.5 * (low_m + high_m), 0.5 * np.maximum(high_m - low_m, 0.4 * walk_m)
    return np.stack([middle_m - half_m, middle_m + half_m])


def _shapes(
    walks: Sequence[FloatArray], heard_m: FloatArray, cells: Sequence[OnPlan],
    pixels: Any, tolerance: float,
) -> Iterator[str]:  # fmt: skip
    for percent, (name, opacity) in REGIONS.items():
        for cell in cells:
            if rings := cell.regions.get(percent):
                path = "".join(_line(pixels(ring), tolerance) + "z" for ring in rings)
                fill = f'fill="{cell.colour}" fill-opacity="{opacity}" fill-rule="evenodd"'
                title = f"<title>{escape(f'{cell.label}: {name}')}</title>"
                yield f'<path d="{path}" {fill} stroke="{cell.colour}">{title}</path>'
    lines = "".join(_line(pixels(walk), tolerance) for walk in walks)
    dots = np.unique(np.rint(pixels(heard_m) / tolerance) * tolerance, axis=0)
    lines += "".join(f"M{x:g} {y:g}h0" for x, y in dots)
    style = f'fill="none" stroke="{_WALK}" stroke-linecap="round" stroke-linejoin="round"'
    yield f'<path d="{lines}" {style} stroke-width="{3 if len(dots) else 1.5}"/>'
    for cell in reversed(cells):  # the first on top
        for i, (x, y) in enumerate(pixels(cell.places_m)):
            yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{3 if i else 5}" fill="{cell.colour}"/>'
        x, y = pixels(cell.places_m)[0]
        side = f'x="{x + 8:.1f}"' if x < 0.6 * _WIDTH else f'x="{x - 8:.1f}" text-anchor="end"'
        yield f'<text {side} y="{y + 4:.1f}" font-weight="bold">{escape(cell.text)}</text>'


def _line(points: FloatArray, tolerance: float) -> str:
    if len(points) < 2:
        return "".join(f"M{x:.1f} {y:.1f}h0" for x, y in points)
    corners = np.asarray(LineString(points).simplify(tolerance).coords)
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in corners)


def _whole(shapes: str, height: float, scale: float, cells: Sequence[OnPlan]) -> str:
    bar_m = round_step(_WIDTH / scale, _SCALE_PARTS)
    right, below = _WIDTH - 10.0, height - 8.0
    bar = f"M{right - bar_m * scale:.1f} {below}H{right}"
    named = ", ".join(": ".join(filter(None, (cell.label, cell.word))) for cell in cells)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH:g} {height:.0f}" '
        f'width="{_WIDTH:g}" style="max-width:100%;height:auto;color:inherit" role="img" '
        f'aria-label="Plan of the walk, north above: {escape(named)}" '
        f'font-family="sans-serif" font-size="12" fill="currentColor">{shapes}'
        f'<path d="{bar}" stroke="currentColor" stroke-width="2"/>'
        f'<text x="{right:g}" y="{below - 5:g}" text-anchor="end">{length_text(bar_m)}</text>'
        '<path d="M12 24V8M8 13l4-5l4 5" fill="none" stroke="currentColor"/>'
        '<text x="12" y="36" text-anchor="middle">N</text></svg>'
    )
