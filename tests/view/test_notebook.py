"""What a notebook shows of a result, in a real browser: legible on light and on dark ground."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from tests.kit import sample_results as kit
from tests.kit.browser import browser

pytestmark = pytest.mark.slow

GROUNDS = {False: ("#ffffff", "#000000"), True: ("#111111", "#dddddd")}
"""Ground and ink of Jupyter's light and dark themes."""
RED, GREY = (214, 48, 60), (125, 125, 135)
"""Of a suspicious cell, and of the walk."""
LEAST_CONTRAST = 3.0
"""Of what is no text (WCAG 2.2, 1.4.11)."""


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("notebook") / "w.journal", seconds=400, cells=3)
    return kit.with_word(kit.sample_result(run))


def _picture(chromium, folder, shown, *, dark):
    """The output of a cell as a notebook shows it, and where its plan is."""
    ground, ink = GROUNDS[dark]
    style = f"<body style='background: {ground}; color: {ink}; font: 14px sans-serif'>"
    path = folder / "notebook.html"
    path.write_text(f"<!doctype html><meta charset='utf-8'>{style}{shown._repr_html_()}")
    chromium.open(path, width=800, dark=dark)
    assert chromium.console_messages() == []
    assert chromium.requested_urls() == []
    box = chromium.box("svg")
    assert box["right"] <= 800
    edges = tuple(round(box[side]) for side in ("left", "top", "right", "bottom"))
    picture = Image.open(BytesIO(chromium.screenshot())).convert("RGB").crop(edges)
    return np.asarray(picture, float), np.array(Image.new("RGB", (1, 1), ground), float)[0, 0]


def _luminance(colour):
    share = np.asarray(colour, float) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return linear @ (0.2126, 0.7152, 0.0722)


def _contrast(one, other):
    dark, light = sorted((_luminance(one), _luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def _near(pixels, colour):
    return np.count_nonzero(np.max(np.abs(pixels - colour), axis=2) < 40.0)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_walk_place_and_regions_are_seen_on_the_ground_of_the_notebook(
    chromium, result, tmp_path, dark
):
    """No more than the ground, where the walk or the cell is not drawn."""
    for shown in (result, result.cells[0]):
        pixels, ground = _picture(chromium, tmp_path, shown, dark=dark)
        assert np.all(pixels[2, 2] == ground)  # the plan brings no ground of its own
        colour = RED if shown is result else (60, 110, 230)
        assert _near(pixels, colour) > 30
        assert _near(pixels, GREY) > 100
        assert min(_contrast(colour, ground), _contrast(GREY, ground)) >= LEAST_CONTRAST
        regions = pixels[np.max(np.abs(pixels - ground), axis=2) > 15.0]
        assert len(regions) > 0.01 * pixels[..., 0].size
        ink = 0.0 if not dark else 221.0
        assert np.count_nonzero(np.all(np.abs(pixels - ink) < 30.0, axis=2)) > 20  # scale and north
