"""The README stays short, links lead somewhere, and the site builds without warnings."""

import re
import subprocess
import sys

import pytest

from tests.docs.pages import PAGES, ROOT, links, name_of, text_of

README_LINES = 100
README_NUMBERS = 40
"""A newcomer reads the README; the figures are in docs/accuracy.md."""
LOADED = re.compile(r'(?:<link[^>]+rel="stylesheet"[^>]+href|<script[^>]+src|<img[^>]+src)="(.*?)"')
"""What a browser requests for a page."""
NUMBER = re.compile(r"(?<![\w.])\d[\d.,]*")


def test_the_readme_is_short():
    text = (ROOT / "README.md").read_text("utf-8")
    assert len(text.splitlines()) <= README_LINES
    assert len(NUMBER.findall(text)) <= README_NUMBERS


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_to_files_and_headings(page):
    local = [link for link in links(page) if "://" not in link]
    missing = []
    for link in local:
        target, _, anchor = link.partition("#")
        file = (page.parent / target).resolve() if target else page
        if not file.exists() or (anchor and anchor not in _anchors(file)):
            missing.append(link)
    assert missing == []


def _anchors(page) -> list[str]:
    headings = re.findall(r"^#+ (.*)$", text_of(page), re.MULTILINE)
    return [re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings]


def test_the_site_builds_without_warnings_and_without_a_network(tmp_path):
    pytest.importorskip("sphinx", reason="pip install '.[docs]'")
    pytest.importorskip("myst_parser", reason="pip install '.[docs]'")
    pytest.importorskip("furo", reason="pip install '.[docs]'")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html"]
    build = subprocess.run(
        [*command, "-d", tmp_path / "doctrees", ROOT / "docs", tmp_path / "site"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert build.returncode == 0, build.stderr
    page = (tmp_path / "site/index.html").read_text("utf-8")
    loaded = LOADED.findall(page)
    assert loaded
    assert not [address for address in loaded if "//" in address]
