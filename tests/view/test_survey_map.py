"""The page of a survey in a real browser: it fits the screen, requests nothing, is accessible."""

import pytest
from msgspec.structs import replace

from postproc.result import Options
from postproc.survey.answers.page import html
from postproc.survey.location import EVERY_RUN, locate_survey
from postproc.survey.scheduling import Cluster
from tests.kit.browser import axe_core, browser
from tests.postproc.survey.cities import write_city

pytestmark = pytest.mark.slow

PHONE, DESKTOP = 390, 1280
REASONS = ("area 7 is that of none of the others", "appears with -60 dBm")
VIEWS = [(PHONE, False), (PHONE, True), (DESKTOP, False), (DESKTOP, True)]


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A located, an ambiguous and an unusual cell, and one with a name longer than any line."""
    folder = tmp_path_factory.mktemp("city")
    _, survey = write_city(folder / "s", n_stations=3, n_runs=6)
    with Cluster(workers=1) as cluster:
        found = locate_survey(survey, Options(), cluster=cluster)
    first, second, third = found.cells
    cells = (
        replace(first, verdict="located"),
        replace(second, verdict="ambiguous", cell="x" * 200),
        replace(
            third, word="suspicious", word_rules=("P1", "S3"), word_reasons=REASONS, word_runs=2
        ),
    )
    path = folder / "survey.html"
    path.write_text(html(survey, cells, found.loggers, EVERY_RUN, None))
    few = replace(first, lat_deg=None, lon_deg=None, n_used=0, verdict="cannot tell")
    city = [
        replace(first if i % 5 else few, cell=f"262-01-801-{2000 + i}", word="nothing unusual")
        for i in range(246)
    ]
    odd = [replace(one, word="unusual", word_reasons=REASONS[:1]) for one in city[:4]]
    large = html(survey, (*city, *cells, *odd), found.loggers, EVERY_RUN, None)
    (folder / "large.html").write_text(large)
    return path


@pytest.mark.parametrize(("width", "dark"), VIEWS)
def test_it_fits_the_screen_and_requests_nothing(chromium, page, width, dark):
    chromium.open(page, width=width, dark=dark)
    # the picture cuts off what reaches beyond it
    wide = [name for name in chromium.overflowing_elements() if "SVG" not in name]
    assert wide == []
    clip = "return getComputedStyle(document.querySelector('svg.plan')).overflowX"
    assert chromium.evaluate(clip) in {"hidden", "clip"}
    assert chromium.requested_urls() == []
    assert chromium.console_messages() == []


@pytest.mark.parametrize(("width", "height"), [(PHONE, 844), (DESKTOP, 800)])
def test_the_first_screen_is_the_answer(chromium, page, width, height):
    chromium.open(page, width=width, dark=False, height=height)
    ids = ["#answer", "#top-cell", "#top-reason", "#top-place", "#top-do", "#place-1"]
    assert chromium.off_screen(ids) == []
    said = chromium.evaluate("return document.querySelector('.lead').innerText")
    assert "Why: Area 7 is that of none of the others. 2 runs say so." in said
    assert "✕ suspicious" in said


def test_a_city_is_a_short_page_on_a_phone(chromium, page):
    chromium.open(page.with_name("large.html"), width=PHONE, dark=False, height=844)
    assert chromium.evaluate("return document.documentElement.scrollHeight") <= 15 * 844
    rows = "return document.querySelectorAll('tbody tr').length"
    assert chromium.evaluate(rows) == 253
    chromium.open_all()
    assert chromium.smallest_text() >= (11.0,)


def test_axe_finds_no_violation(chromium, page):
    axe = axe_core()
    for width, dark in VIEWS:
        for path in (page, page.with_name("large.html")):
            chromium.open(path, width=width, dark=dark)
            assert chromium.accessibility_violations(axe) == [], (path, width, dark)
