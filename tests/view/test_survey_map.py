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
        replace(third, word="suspicious", word_rules=("P1", "S3"), word_runs=2),
    )
    path = folder / "survey.html"
    path.write_text(html(survey, cells, found.loggers, EVERY_RUN, None))
    return path


@pytest.mark.parametrize(("width", "dark"), VIEWS)
def test_it_fits_the_screen_and_requests_nothing(chromium, page, width, dark):
    chromium.open(page, width=width, dark=dark)
    # the picture cuts off regions that reach beyond it
    wide = [name for name in chromium.overflowing_elements() if not name.startswith("path")]
    assert wide == []
    clip = "return getComputedStyle(document.querySelector('svg')).overflowX"
    assert chromium.evaluate(clip) in {"hidden", "clip"}
    assert chromium.requested_urls() == []
    assert chromium.console_messages() == []


def test_unusual_cells_and_the_plan_are_shown(chromium, page):
    chromium.open(page, width=DESKTOP, dark=False)
    unusual = chromium.evaluate("return document.querySelector('ul').innerText")
    assert "suspicious in 2 runs (P1, S3)" in unusual
    assert chromium.evaluate("return document.querySelectorAll('circle.odd').length") == 1
    plan = "return document.querySelector('svg').getBoundingClientRect().width"
    assert chromium.evaluate(plan) > 600


def test_axe_finds_no_violation(chromium, page):
    axe = axe_core()
    for width, dark in VIEWS:
        chromium.open(page, width=width, dark=dark)
        assert chromium.accessibility_violations(axe) == [], (width, dark)
