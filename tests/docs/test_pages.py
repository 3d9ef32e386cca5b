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


SOURCES = ("logger", "postproc", "systemd", "benchmarks", "tools", "tests", "Makefile", ".ci")
MENTION = re.compile(
    r"\b((?:docs|firmware_notes|systemd)/[\w/.-]+\.md)(?:, ([A-Z][a-z]+(?:[ -][a-z]+)+))?"
)


def mentions() -> list[tuple[str, str, str]]:
    """Files of the source that name a page, the page, and the heading named with it."""
    tracked = subprocess.run(
        ["git", "ls-files", *SOURCES], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    texts = {name: (ROOT / name).read_bytes().decode("utf-8", "ignore") for name in tracked}
    return [
        (name, page, " ".join(heading.split()))
        for name, text in texts.items()
        for page, heading in MENTION.findall(text)
    ]


def test_pages_and_headings_that_the_source_names_exist():
    if not (ROOT / ".git").exists():
        pytest.skip("the list of files is that of git")
    found = mentions()
    assert ("logger/doctor/single_tests.py", "systemd/README.md", "Read-only root") in found
    missing = [
        (name, page, heading)
        for name, page, heading in found
        if not name.startswith("tests/test_contributing")  # it makes a page
        and not ((ROOT / page).is_file() and (not heading or _has_heading(ROOT / page, heading)))
    ]
    assert missing == []


def _has_heading(page, start: str) -> bool:
    headings = re.findall(r"^#+ (.*)$", text_of(page), re.MULTILINE)
    return any(heading.startswith(start) for heading in headings)


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
