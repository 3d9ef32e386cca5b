"""The page requests nothing, and text from outside stays text."""

import re

from logger.core.runfile import read_run
from logger.core.types import CellReading, Fix, Note, Record, Scan
from postproc.report.rendering import make_report
from postproc.smoothing import smooth_runs
from tests.kit.html_page import Page
from tests.kit.runs import write_journal

OSM = "https://www.openstreetmap.org/?mlat="
HOSTILE = """<script>alert(1)</script>"' onload=x & {{ 7*7 }} </pre></style> $a_{b}$ """


def references(page):
    """Every reference on a page."""
    for element in page.elements:
        for name, value in element.attributes.items():
            if name in {
                "href",
                "xlink:href",
                "src",
                "srcset",
                "data",
                "action",
                "poster",
                "background",
                "cite",
            }:
                yield value
            yield from re.findall(r"url\(([^)]*)\)", value)
    for style in page.all("style"):
        yield from re.findall(r"url\(([^)]*)\)", style.text)


def test_the_page_requests_nothing(page, report):
    targets = list(references(page))
    assert targets
    own = ("#", "data:image/png;base64,", "data:image/jpeg;base64,")
    links = [one.get("href") for one in page.all("a")]
    followed = [link for link in links if not link.startswith("#")]
    assert all(target.startswith(own) for target in targets if target not in followed)
    assert {link.partition(":")[0] for link in followed} == {"geo", "https"}
    assert all(link.startswith(("geo:", OSM)) for link in followed)
    assert page.all("script", "link", "iframe", "object", "embed", "base", "form") == []
    assert "@import" not in report.html
    assert "://" not in re.sub(r"base64,[^\"]*", "", report.html).replace(OSM, "")
    policy = next(one.get("content") for one in page.all("meta") if one.get("http-equiv"))
    assert "default-src 'none'" in policy


def test_identifiers_are_unique_and_references_resolve(page):
    names = [one.get("id") for one in page.elements if one.get("id")]
    assert len(names) == len(set(names)) > 20
    wanted = [one[1:] for one in references(page) if one.startswith("#")]
    for element in page.elements:
        wanted += element.get("aria-labelledby").split() + element.get("aria-describedby").split()
    assert set(wanted) <= set(names)


def scan(t_ns, name):
    cells = (CellReading("scan", label=name, rssi_dbm=-60.0),)
    return Record(t_ns, "modem", Scan(t_ns, cells, None))


def test_third_party_text_stays_text(tmp_path):
    """Names of cells, files and sources, notes and the configuration come from outside."""
    records = [Record(0, "gnss", Fix(True, None, 52.0, 13.0))]
    records += [scan(i * 10**9, HOSTILE) for i in range(3)]
    records += [
        Record(
            3 * 10**9, "logger", Note("error", HOSTILE, f"{HOSTILE}\a\N{RIGHT-TO-LEFT OVERRIDE}")
        )
    ]
    path = tmp_path / "a<b onclick=x>&.journal"
    write_journal(
        path,
        records,
        config_text=HOSTILE,
        program=HOSTILE,
        origin=HOSTILE,
        versions={HOSTILE: HOSTILE},
    )
    html = make_report(smooth_runs([read_run(path)])).html
    page = Page(html)
    assert page.all("script", "b") == []
    assert html.count("</style>") == 1
    assert not [
        one for one in page.elements if any(name.startswith("on") for name in one.attributes)
    ]
    assert page.all("pre")[0].text == " ".join(HOSTILE.split())
    assert " ".join(HOSTILE.split()) in page.text
    assert "a<b onclick=x>&.journal" in page.text
    assert "\a" not in html
    assert "\N{RIGHT-TO-LEFT OVERRIDE}" not in html
