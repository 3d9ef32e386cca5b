"""The report in a real browser: it fits the screen, requests nothing and is accessible."""

import re
from dataclasses import replace

import pytest

from postproc.report.rendering import make_report
from tests.kit import sample_results as kit
from tests.kit.browser import axe_core, browser

pytestmark = pytest.mark.slow

PHONE, DESKTOP = 390, 1280
VIEWS = [(PHONE, False), (PHONE, True), (DESKTOP, False), (DESKTOP, True)]
NAMES = ["light phone", "dark phone", "light desktop", "dark desktop"]

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
    """Every kind of cell, and a name longer than any line."""
    folder = tmp_path_factory.mktemp("page")
    run = kit.write_run(folder / "walk.journal", seconds=240, cells=3)
    result = kit.sample_result(run, verdict="ambiguous", places=2)
    first, second, third = result.cells
    second = replace(second, obs=replace(second.obs, cell="x" * 200), cell="x" * 200)
    path = folder / "walk.html"
    claims = kit.sample_claims(result)
    make_report(replace(result, cells=(first, second, third)), claims).write(path)
    return path


@pytest.fixture(params=VIEWS, ids=NAMES)
def open_page(request, chromium, page):
    width, dark = request.param
    chromium.open(page, width=width, dark=dark)
    return chromium


def test_everything_fits_the_screen(open_page):
    assert open_page.overflowing_elements() == []


def test_it_requests_nothing_and_the_console_is_empty(open_page):
    assert open_page.requested_urls() == []
    assert open_page.console_messages() == []


def test_axe_finds_no_violation(chromium, page):
    axe = axe_core()
    for width, dark in VIEWS:
        chromium.open(page, width=width, dark=dark)
        assert chromium.accessibility_violations(axe) == [], (width, dark)


def test_pictures_follow_the_colour_scheme(chromium, page):
    def brightness(selector, colour):
        """Sum of red, green and blue, from 0 to 765."""
        script = f"return getComputedStyle(document.querySelector('{selector}')).{colour}"
        return sum(map(int, chromium.evaluate(script).split("(")[1].rstrip(")").split(",")[:3]))

    def ground_and_text(*, dark):
        chromium.open(page, width=DESKTOP, dark=dark)
        return brightness("html", "backgroundColor"), brightness(".picture text", "fill")

    light_ground, dark_text = ground_and_text(dark=False)
    dark_ground, light_text = ground_and_text(dark=True)
    assert min(light_ground, light_text) > 600
    assert max(dark_ground, dark_text) < 150


def test_text_in_pictures_is_legible_on_a_phone(chromium, page):
    chromium.open(page, width=PHONE, dark=False)
    script = """return [...document.querySelectorAll('.picture text')].map(text => {
      const {a, b} = text.getScreenCTM();
      return parseFloat(getComputedStyle(text).fontSize) * Math.hypot(a, b);
    })"""
    assert min(chromium.evaluate(script)) > 9.0


def test_an_hour_of_eight_cells_stays_below_three_megabytes(tmp_path):
    run = kit.write_run(tmp_path / "hour.journal", seconds=3600, cells=1)
    result = kit.sample_result(run, verdict="ambiguous", places=2)
    (cell,) = result.cells
    cells = tuple(replace(cell, cell=f"{cell.cell}-{i}") for i in range(8))
    report = make_report(replace(result, cells=cells))
    assert len(report.cells) == 8
    assert 1_000_000 < len(report.html.encode()) < 3_000_000


def test_prints(chromium, page):
    chromium.open(page, width=DESKTOP, dark=True)
    pdf = chromium.pdf()
    assert pdf.startswith(b"%PDF")
    assert sheets(pdf) <= 4


def test_six_cells_with_all_figures_print_on_eight_sheets(chromium, tmp_path):
    """Two of them share a sheet with all else; none begins a sheet of its own."""
    run = kit.write_run(tmp_path / "walk.journal", seconds=600, cells=6)
    result = kit.sample_result(run)
    cells = tuple(
        replace(result.cells[0], cell=kit.cell_name(i), verdict="located") for i in range(6)
    )
    path = tmp_path / "six.html"
    make_report(replace(result, cells=cells)).write(path)
    chromium.open(path, width=DESKTOP, dark=False)
    assert sheets(chromium.pdf()) <= 8


def sheets(pdf):
    return len(re.findall(rb"/Type\s*/Page[^s]", pdf))


def test_the_checks_find_faults(chromium, tmp_path):
    """A page with one fault of each kind."""
    path = tmp_path / "faulty.html"
    path.write_text(FAULTY)
    chromium.open(path, width=PHONE, dark=False)
    assert "page" in chromium.overflowing_elements()
    assert any(url.endswith("x.png") for url in chromium.requested_urls())
    assert any("broken" in text for text in chromium.console_messages())


def test_axe_finds_faults(chromium, tmp_path):
    path = tmp_path / "faulty.html"
    path.write_text(FAULTY)
    axe = axe_core()
    chromium.open(path, width=PHONE, dark=False)
    assert {"image-alt", "color-contrast", "html-has-lang"} <= {
        violation["id"] for violation in chromium.accessibility_violations(axe)
    }
