"""The report in a real browser: nothing leaves the screen, nothing is asked of anybody, everybody
can read it.
"""

from dataclasses import replace

import pytest

from postproc.report.rendering import report
from tests.kit import sample_results as kit
from tests.kit.browser import axe_core, browser

pytestmark = pytest.mark.slow

PHONE, DESKTOP = 390, 1280
VIEWS = [(PHONE, False), (PHONE, True), (DESKTOP, False), (DESKTOP, True)]
NAMES = ["phone in light", "phone in darkness", "desktop in light", "desktop in darkness"]

FAULTY = """<!doctype html><html><head><title>faulty</title></head><body>
<div style="width: 3000px">too wide</div><img src="http://127.0.0.1:9/x.png">
<p style="color: #ddd; background: #fff">who can read this</p>
<script>console.error("broken")</script></body></html>"""


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Every kind of cell, and a name that no line can hold."""
    folder = tmp_path_factory.mktemp("page")
    found = kit.sample_result(
        kit.write_run(folder / "walk.journal", seconds=240, cells=3), verdict="ambiguous", places=2
    )
    first, second, third = found.cells
    second = replace(second, obs=replace(second.obs, cell="x" * 200), cell="x" * 200)
    path = folder / "walk.html"
    report(replace(found, cells=(first, second, third)), kit.sample_claims(found)).write(path)
    return path


@pytest.fixture(params=VIEWS, ids=NAMES)
def shown(request, chromium, page):
    width, dark = request.param
    chromium.open(page, width=width, dark=dark)
    return chromium


def test_nothing_reaches_out_of_the_screen(shown):
    assert shown.overflowing_elements() == []


def test_nothing_is_asked_of_anybody_and_the_console_is_silent(shown):
    assert shown.requested_urls() == []
    assert shown.console_messages() == []


def test_axe_finds_no_barrier(chromium, page):
    axe = axe_core()
    for width, dark in VIEWS:
        chromium.open(page, width=width, dark=dark)
        assert chromium.accessibility_violations(axe) == [], (width, dark)


def test_darkness_reaches_the_pictures(chromium, page):
    def lightness(what):
        script = f"return getComputedStyle(document.querySelector('{what[0]}')).{what[1]}"
        return sum(map(int, chromium.evaluate(script).split("(")[1].rstrip(")").split(",")[:3]))

    chromium.open(page, width=DESKTOP, dark=False)
    day = [lightness(one) for one in (("html", "backgroundColor"), (".picture text", "fill"))]
    chromium.open(page, width=DESKTOP, dark=True)
    night = [lightness(one) for one in (("html", "backgroundColor"), (".picture text", "fill"))]
    assert (day[0] > 600, night[0] < 150) == (True, True), (day, night)
    assert (day[1] < 150, night[1] > 600) == (True, True), (day, night)


def test_words_of_pictures_are_large_enough_for_a_telephone(chromium, page):
    chromium.open(page, width=PHONE, dark=False)
    script = """return [...document.querySelectorAll('.picture text')].map(t =>
      parseFloat(getComputedStyle(t).fontSize) * Math.hypot(t.getScreenCTM().a, t.getScreenCTM().b))"""
    assert min(chromium.evaluate(script)) > 9.0


def test_an_hour_of_eight_cells_stays_below_three_megabytes(tmp_path):
    found = kit.sample_result(
        kit.write_run(tmp_path / "hour.journal", seconds=3600, cells=1),
        verdict="ambiguous",
        places=2,
    )
    cells = tuple(replace(found.cells[0], cell=f"{found.cells[0].cell}-{i}") for i in range(8))
    made = report(replace(found, cells=cells))
    assert len(made.cells) == 8
    assert 1_000_000 < len(made.html.encode()) < 3_000_000


def test_prints(chromium, page):
    chromium.open(page, width=DESKTOP, dark=True)
    assert chromium.pdf().startswith(b"%PDF")


def test_the_checks_would_notice(chromium, tmp_path):
    """A page with one fault of each kind."""
    path = tmp_path / "faulty.html"
    path.write_text(FAULTY)
    chromium.open(path, width=PHONE, dark=False)
    assert "page" in chromium.overflowing_elements()
    assert any(url.endswith("x.png") for url in chromium.requested_urls())
    assert any("broken" in text for text in chromium.console_messages())


def test_axe_would_notice(chromium, tmp_path):
    path = tmp_path / "faulty.html"
    path.write_text(FAULTY)
    axe = axe_core()
    chromium.open(path, width=PHONE, dark=False)
    assert {"image-alt", "color-contrast", "html-has-lang"} <= {
        one["id"] for one in chromium.accessibility_violations(axe)
    }
