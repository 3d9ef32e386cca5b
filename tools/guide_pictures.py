"""Draw the pictures of docs/guide.md that show what the programs do.

    python tools/guide_pictures.py

`docs/pictures/led.svg` has the patterns of `logger.device.leds`, `docs/pictures/answers.svg` three
answers of `postproc.locate`. `tests/docs/test_guide.py` compares the files with these functions.
"""

from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from shapely.geometry import Polygon, box

from logger.device.leds import FLASHES_S
from postproc import locate
from postproc.estimators.region_outline import outline

PICTURES = Path(__file__).resolve().parents[1] / "docs/pictures"

STYLE = (
    "text{font-family:system-ui,'DejaVu Sans',sans-serif;fill:#1f2328;font-size:14px}"
    ".h{font-weight:600}.s{font-size:12px;fill:#424a53}"
)

MEANING = {
    "recording": "recording: walk",
    "suspicious": "recording, and a cell is suspicious",
    "no fix": "no position yet: go under open sky",
    "error": "error: run fieldlogger doctor",
    "dark": "dark or steady: nothing is recorded",
}
"""What to do about each state, in the words of the guide."""

_SHOWN_S = 4.0

WALKS = {
    "located": ((-150, -20), (-30, -20), (-30, 60), (60, 60), (60, -40), (170, -40)),
    "ambiguous": ((-200, -60), (200, -60)),
    "cannot tell": ((-190, -170), (190, -170)),
}
"""Corners of three walks past one transmitter, in metres."""

WORDS = {
    "located": "past it on several sides",
    "ambiguous": "straight past it: both sides fit",
    "cannot tell": "along one street, farther away",
}

TRANSMITTER_M = (10.0, 0.0)
_NOISE_DB, _STEP_M, _SEED = 5.0, 2.0, 17
_HALF_M = 220
_PANEL, _GAP, _TOP = 300, 20, 34


def led_picture() -> str:
    """The patterns of the lamp, on as a filled bar."""
    rows = []
    for i, (sign, meaning) in enumerate(MEANING.items()):
        y = 44 + 40 * i
        rows.append(f'<rect x="10" y="{y - 15}" width="400" height="20" fill="#30363d"/>')
        rows += [
            f'<rect x="{10 + 100 * start:.0f}" y="{y - 15}" width="{100 * length:.0f}" height="20" '
            'fill="#3fb950"/>'
            for start, length in _flashes(FLASHES_S.get(sign, (0.0, _SHOWN_S)))
        ]
        rows.append(f'<text x="424" y="{y}">{escape(meaning)}</text>')
    axis = "".join(
        f'<text class="s" x="{10 + 100 * s}" y="20" text-anchor="{anchor}">{s} s</text>'
        for s, anchor in zip(range(5), ("start", *["middle"] * 3, "end"), strict=True)
    )
    return _svg(700, 224, "Patterns of the lamp over four seconds, green while it is on",
                axis + "\n".join(rows))  # fmt: skip


def _flashes(pattern_s: tuple[float, ...]) -> list[tuple[float, float]]:
    """Start and length of each time the lamp is on."""
    flashes, now_s, i = [], 0.0, 0
    while now_s < _SHOWN_S:
        length_s = pattern_s[i % len(pattern_s)]
        if i % 2 == 0 and length_s > 0:
            flashes.append((now_s, min(length_s, _SHOWN_S - now_s)))
        now_s, i = now_s + length_s, i + 1
    return flashes


def answers_picture() -> str:
    """Three walks past one transmitter with the answer of the program to each."""
    panels = [_panel(word, 10 + i * (_PANEL + _GAP)) for i, word in enumerate(WALKS)]
    legend_y = _TOP + _PANEL + 46
    legend = (
        f'<rect x="10" y="{legend_y - 11}" width="22" height="13" fill="#b6d4f2"/>'
        f'<text class="s" x="38" y="{legend_y}">region, holds 95 %</text>'
        f'<path d="M180 {legend_y - 5} h24" stroke="#57606a" stroke-width="3"/>'
        f'<text class="s" x="210" y="{legend_y}">the walk</text>'
        f'<circle cx="290" cy="{legend_y - 5}" r="5" fill="#0550ae"/>'
        f'<text class="s" x="302" y="{legend_y}">likeliest place</text>'
        f"{_cross(420, legend_y - 5)}"
        f'<text class="s" x="432" y="{legend_y}">where the simulated transmitter stands</text>'
        f'<path d="M700 {legend_y - 5} h{100 * _PANEL / (2 * _HALF_M):.0f}" stroke="#1f2328" '
        'stroke-width="2"/>'
        f'<text class="s" x="776" y="{legend_y}">100 m</text>'
    )
    width = 3 * _PANEL + 2 * _GAP + 20
    title = "Three answers: located, ambiguous and cannot tell"
    return _svg(width, legend_y + 14, title, "\n".join([*panels, legend]))


def _panel(word: str, left: float) -> str:
    x_m, y_m = _track(WALKS[word])
    distance_m = np.hypot(np.hypot(x_m - TRANSMITTER_M[0], y_m - TRANSMITTER_M[1]), 5.0)
    noise_db = np.random.default_rng(_SEED).normal(0.0, _NOISE_DB, len(x_m))
    answer = locate(x_m, y_m, -30.0 - 30.0 * np.log10(distance_m) + noise_db)
    if answer.verdict != word or answer.posterior is None:
        raise ValueError(f"{word}: the program says {answer.verdict}")
    frame = box(-_HALF_M, -_HALF_M, _HALF_M, _HALF_M)
    shapes = [part.intersection(frame) for part in outline(answer.posterior.squares)]
    region = "".join(
        _path(part, left)
        for shape in shapes
        for part in getattr(shape, "geoms", [shape])
        if isinstance(part, Polygon) and not part.is_empty
    )
    points = " ".join(_point(x, y, left) for x, y in WALKS[word])
    places = [mode.state[:2] for mode in answer.posterior.modes] if word == "ambiguous" else [
        (answer.posterior.x_m, answer.posterior.y_m)]  # fmt: skip
    dots = "".join(
        f'<circle cx="{_x(x, left):.0f}" cy="{_y(y):.0f}" r="5" fill="#0550ae"/>'
        for x, y in ([] if word == "cannot tell" else places)
    )
    return (
        f'<text class="h" x="{left}" y="24">{word}</text>'
        f'<rect x="{left}" y="{_TOP}" width="{_PANEL}" height="{_PANEL}" fill="#f6f8fa"/>'
        f'<path d="{region}" fill="#b6d4f2" fill-rule="evenodd" stroke="#0969da"/>'
        f'<polyline points="{points}" fill="none" stroke="#57606a" stroke-width="3"/>'
        f"{_cross(_x(TRANSMITTER_M[0], left), _y(TRANSMITTER_M[1]))}{dots}"
        f'<text class="s" x="{left}" y="{_TOP + _PANEL + 18}">{WORDS[word]}</text>'
    )


def _track(corners: tuple[tuple[float, float], ...]) -> tuple[np.ndarray, np.ndarray]:
    """A reading every `_STEP_M` along the way."""
    xy = np.array(corners, float)
    along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    at_m = np.arange(0.0, along_m[-1], _STEP_M)
    return np.interp(at_m, along_m, xy[:, 0]), np.interp(at_m, along_m, xy[:, 1])


def _x(x_m: float, left: float) -> float:
    return left + (x_m + _HALF_M) / (2 * _HALF_M) * _PANEL


def _y(y_m: float) -> float:
    return _TOP + (_HALF_M - y_m) / (2 * _HALF_M) * _PANEL


def _point(x_m: float, y_m: float, left: float) -> str:
    return f"{_x(x_m, left):.0f},{_y(y_m):.0f}"


def _path(part: Polygon, left: float) -> str:
    rings = (part.exterior, *part.interiors)
    return "".join(f"M{'L'.join(_point(x, y, left) for x, y in r.coords)}Z" for r in rings)


def _cross(x: float, y: float) -> str:
    return (
        f'<path d="M{x - 7:.0f} {y - 7:.0f} l14 14 m0 -14 l-14 14" stroke="#cf222e" '
        'stroke-width="3"/>'
    )


def _svg(width: int, height: int, title: str, body: str) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" role="img" aria-labelledby="title">\n'
        f'<title id="title">{title}</title>\n'
        f"<style>{STYLE}</style>\n"
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>\n{body}\n</svg>\n'
    )


if __name__ == "__main__":
    (PICTURES / "led.svg").write_text(led_picture(), "utf-8")
    (PICTURES / "answers.svg").write_text(answers_picture(), "utf-8")
