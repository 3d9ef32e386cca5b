"""The report in a real browser: it fits the screen, requests nothing and is accessible."""

import os
import re
from dataclasses import replace
from pathlib import Path

import pytest

from logger.core.runfile import read_run
from logger.simulate import simulate
from postproc.report.rendering import make_report
from postproc.smoothing import smooth_runs
from postproc.suspicion.run_assessment import conspicuous_first
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


@pytest.fixture(scope="module")
def six_cells(tmp_path_factory):
    """A page of six cells for each word that one of them has."""
    folder = tmp_path_factory.mktemp("six")
    result = kit.sample_result(kit.write_run(folder / "six.journal", seconds=600, cells=6))
    pages = {}
    for word in ("suspicious", "unusual", "nothing unusual"):
        pages[word] = folder / f"{word}.html"
        report = make_report(kit.with_word(result, word=word), first=(kit.cell_name(0),))
        report.write(pages[word])
    return pages


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
        chromium.open_all()
        assert chromium.accessibility_violations(axe) == [], (width, dark)


def test_axe_finds_no_violation_on_a_suspicious_page(chromium, six_cells):
    axe = axe_core()
    for path in six_cells.values():
        for width, dark in VIEWS:
            chromium.open(path, width=width, dark=dark)
            assert chromium.accessibility_violations(axe) == [], (path, width, dark)


def test_pictures_follow_the_colour_scheme(chromium, page):
    def brightness(selector, colour):
        """Sum of red, green and blue, from 0 to 765."""
        script = f"return getComputedStyle(document.querySelector('{selector}')).{colour}"
        return sum(map(int, chromium.evaluate(script).split("(")[1].rstrip(")").split(",")[:3]))

    def ground_and_text(*, dark):
        chromium.open(page, width=DESKTOP, dark=dark)
        return brightness("html", "backgroundColor"), brightness(".detail .picture text", "fill")

    light_ground, dark_text = ground_and_text(dark=False)
    dark_ground, light_text = ground_and_text(dark=True)
    assert min(light_ground, light_text) > 600
    assert max(dark_ground, dark_text) < 150


def test_no_text_is_small_on_a_phone(chromium, page, six_cells):
    for path in (page, six_cells["suspicious"]):
        chromium.open(path, width=PHONE, dark=False)
        chromium.open_all()
        assert chromium.smallest_text() >= (11.0,)


@pytest.mark.parametrize(("width", "height"), [(PHONE, 844), (DESKTOP, 800)])
@pytest.mark.parametrize("word", ["suspicious", "unusual", "nothing unusual"])
def test_the_first_screen_is_the_answer(chromium, six_cells, word, width, height):
    """Which cell, its word, why, where, what to do; else that none is suspicious, and the blind."""
    chromium.open(six_cells[word], width=width, dark=False, height=height)
    ids = ["#answer"]
    if word != "nothing unusual":
        ids += ["#top-cell", "#top-cell .badge", "#top-reason", "#top-place", "#top-do"]
        ids += ["#map-place-1"]
    if word != "suspicious":
        ids += ["#unnoticed"]
    assert chromium.off_screen(ids) == []


@pytest.mark.parametrize(("width", "height", "most"), [(PHONE, 844, 8), (DESKTOP, 800, 4)])
def test_six_cells_are_a_short_page_before_anything_is_opened(
    chromium, six_cells, width, height, most
):
    chromium.open(six_cells["suspicious"], width=width, dark=False, height=height)
    assert chromium.evaluate("return document.querySelectorAll('details[open]').length") == 0
    assert chromium.evaluate("return document.documentElement.scrollHeight") <= most * height


def test_printing_opens_all(chromium, six_cells):
    script = """return [...document.querySelectorAll('details > :not(summary)')].map(
      part => part.checkVisibility())"""
    chromium.open(six_cells["suspicious"], width=DESKTOP, dark=False)
    assert not any(chromium.evaluate(script))
    chromium.show_as_printed()
    shown = chromium.evaluate(script)
    assert len(shown) > 20
    assert all(shown)


def test_a_word_is_never_said_by_a_colour_alone(chromium, six_cells):
    chromium.open(six_cells["suspicious"], width=DESKTOP, dark=False)
    chromium.open_all()
    script = """return [...document.querySelectorAll('.badge.suspicious')].map(e => e.innerText)"""
    badges = chromium.evaluate(script)
    assert len(badges) == 3  # card, table, details
    assert set(badges) == {"✕ suspicious"}
    script = "return [...document.querySelectorAll('svg text')].map(e => e.textContent)"
    said = [text for text in chromium.evaluate(script) if "suspicious" in text]
    # on the plan of all cells, in its legend, and in that of the cell's own plan
    assert len(said) == 3


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


@pytest.mark.skipif("CELLWALK_SCREENSHOTS" not in os.environ, reason="make screenshots")
def test_screenshots(chromium, tmp_path):
    """What the guide shows: the first screen of the demo's page."""
    run = read_run(simulate(tmp_path, "block", 3, None, 40.0))
    result, first = conspicuous_first(smooth_runs([run]))
    path = tmp_path / "run.html"
    make_report(result, first=first).write(path)
    folder = Path(os.environ["CELLWALK_SCREENSHOTS"])
    for device, width, height in (("phone", PHONE, 844), ("desktop", DESKTOP, 800)):
        for scheme in ("light", "dark"):
            chromium.open(path, width=width, dark=scheme == "dark", height=height)
            chromium.keep_screen(folder / f"report-{device}-{scheme}.png")
