"""The page of a survey in a real browser: it fits the screen, requests nothing, is accessible."""

import os
from pathlib import Path

import pytest
import shapely
import shapely.affinity
from msgspec.structs import replace

from logger.core.places import Utm
from postproc.result import Options
from postproc.survey.answers.page import html
from postproc.survey.location import EVERY_RUN, Location, locate_survey
from postproc.survey.scheduling import Cluster
from tests.kit.browser import axe_core, browser
from tests.postproc.survey.cities import write_city
from tests.postproc.survey.test_places import fill, survey_of, walk

pytestmark = pytest.mark.slow

PHONE, DESKTOP = 390, 1280
TOWNS = [(51.48, 12.02), (48.1, 11.5), (-33.9, 151.2), (51.34, 12.37)]
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
    path.write_text(html(survey, _with_cells(found, cells), EVERY_RUN, None))
    few = replace(first, lat_deg=None, lon_deg=None, n_used=0, verdict="cannot tell")
    city = [
        replace(first if i % 5 else few, cell=f"262-01-801-{2000 + i}", word="nothing unusual")
        for i in range(246)
    ]
    odd = [replace(one, word="unusual", word_reasons=REASONS[:1]) for one in city[:4]]
    large = html(survey, _with_cells(found, (*city, *cells, *odd)), EVERY_RUN, None)
    (folder / "large.html").write_text(large)
    (folder / "towns.html").write_text(_page_of_towns(folder, first, found))
    return path


def _with_cells(found, cells):
    return Location(tuple(cells), found.loggers, found.n_known, found.unnoticed)


def _page_of_towns(folder, cell, found):
    """Four towns with two cells each, of which one is conspicuous."""
    walks, cells = [], []
    for number, (lat_deg, lon_deg) in enumerate(TOWNS):
        lat, lon = fill(lat_deg, lon_deg, 500.0)
        walks.append(walk(number + 1, Utm.at(lat_deg, lon_deg).zone, lat, lon))
        at = shapely.from_wkb(cell.region_wkb)
        to = {"xoff": lon_deg - cell.lon_deg, "yoff": lat_deg - cell.lat_deg}
        here = replace(
            cell, verdict="located", lat_deg=lat_deg, lon_deg=lon_deg, r50_m=20.0, r95_m=60.0,
            region_wkb=shapely.to_wkb(shapely.affinity.translate(at, **to)),
        )  # fmt: skip
        word = "suspicious" if number < 2 else "unusual"
        name = f"262-01-80{number}"
        cells.append(replace(here, cell=f"{name}-1", word=word, word_reasons=REASONS[:1]))
        cells.append(
            replace(here, cell=f"{name}-2", word="nothing unusual", lat_deg=lat_deg + 2e-3)
        )
    return html(survey_of(folder / "towns", walks), _with_cells(found, cells), EVERY_RUN, None)


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


def test_towns_have_plans_side_by_side_and_their_cells_say_which(chromium, page):
    chromium.open(page.with_name("towns.html"), width=DESKTOP, dark=False)
    left, right = (chromium.box(f"figure:has(#plan-{n})") for n in (2, 3))
    assert left["top"] == right["top"]
    assert left["right"] <= right["left"]
    assert chromium.console_messages() == []
    inset = chromium.evaluate(
        "const s = document.querySelector('svg.inset'), b = s.viewBox.baseVal;"
        "return [b.width > 0, s.getScreenCTM().a * b.width / s.clientWidth]"
    )
    assert inset == [True, pytest.approx(1.0, rel=0.05)]
    links = chromium.evaluate(
        "return [...document.querySelectorAll('.odd-cell a')].map(a => [a.closest('article')"
        ".querySelector('.cell').textContent, document.querySelector(a.getAttribute('href'))"
        ".textContent])"
    )
    assert [(cell, title[:24]) for cell, title in links] == [
        ("262-01-801-1", "Plan 2 of 4: around 48.1"),
        ("262-01-802-1", "Plan 3 of 4: around 33.9"),
        ("262-01-803-1", "Plan 4 of 4: around 51.3"),
    ]
    chromium.open(page.with_name("towns.html"), width=PHONE, dark=False, height=844)
    assert chromium.evaluate("return document.documentElement.scrollHeight") <= 6 * 844
    assert chromium.smallest_text() >= (11.0,)


@pytest.mark.skipif("CELLWALK_SCREENSHOTS" not in os.environ, reason="make screenshots")
def test_screenshots(chromium, page):
    """The first screen of a survey of four towns."""
    for device, width, height in (("phone", PHONE, 844), ("desktop", DESKTOP, 800)):
        for scheme in ("light", "dark"):
            name = f"survey-{device}-{scheme}.png"
            chromium.open(
                page.with_name("towns.html"), width=width, dark=scheme == "dark", height=height
            )
            chromium.keep_screen(Path(os.environ["CELLWALK_SCREENSHOTS"]) / name)


def test_axe_finds_no_violation(chromium, page):
    axe = axe_core()
    for width, dark in VIEWS:
        for path in (page, page.with_name("large.html"), page.with_name("towns.html")):
            chromium.open(path, width=width, dark=dark)
            assert chromium.accessibility_violations(axe) == [], (path, width, dark)
