"""The built documentation in a real browser: accessible, and complete without a network."""

import subprocess
import sys

import pytest

from tests.docs.pages import ROOT
from tests.kit.browser import axe_core, browser

pytestmark = pytest.mark.slow

PHONE, DESKTOP = 390, 1280
GENERATED = {"generated/commands.html", "generated/tables.html"}
"""By the build itself, from what the programs print."""
NAMES = sorted(
    {
        page.relative_to(ROOT / "docs").with_suffix(".html").as_posix()
        for page in (ROOT / "docs").rglob("*.md")
    }
    | GENERATED
)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("furo", reason="pip install '.[docs]'")
    folder = tmp_path_factory.mktemp("site")
    subprocess.run(
        [sys.executable, "-m", "sphinx", "-W", "-q", "-b", "html", ROOT / "docs", folder],
        check=True,
        capture_output=True,
    )
    return folder


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.mark.parametrize("name", NAMES)
def test_axe_finds_no_violation(chromium, site, name):
    chromium.open(site / name, width=DESKTOP, dark=False)
    assert chromium.accessibility_violations(axe_core()) == []


def test_axe_finds_what_is_wrong(chromium, site):
    faulty = site / "faulty.html"
    faulty.write_text('<!doctype html><html lang="en"><title>x</title><main><img src="x.png">')
    chromium.open(faulty, width=DESKTOP, dark=False)
    assert "image-alt" in [found["id"] for found in chromium.accessibility_violations(axe_core())]


@pytest.mark.parametrize("width", [PHONE, DESKTOP])
def test_the_guide_shows_all_its_pictures_and_fits_the_screen(chromium, site, width):
    chromium.open(site / "guide.html", width=width, dark=False)
    broken = "return [...document.images].filter(i => !i.naturalWidth).map(i => i.src)"
    assert chromium.evaluate(broken) == []
    assert chromium.evaluate("return document.images.length") >= 5
    assert [e for e in chromium.overflowing_elements() if e == "page"] == []
    assert not [url for url in chromium.requested_urls() if not url.startswith("file:")]
