import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from logger.core.runfile import read_run
from logger.core.types import CellReading, Fix, Note, Record, Scan
from postproc.report.rendering import most_told, report
from postproc.result import ObservedRun, Result, RunShare
from postproc.results import summary
from postproc.smoothing import smooth_runs
from postproc.verification.claims import Claim
from postproc.verification.run_claims import CellVerdict, Verified
from tests.kit import sample_results as kit
from tests.kit.html_page import Page
from tests.kit.runs import write_journal

HOSTILE = """<script>alert(1)</script>"' onload=x & {{ 7*7 }} </pre></style> $a_{b}$ """
LEVELS = ("h1", "h2", "h3", "h4")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("report") / "walk.journal", seconds=120, cells=3)
    return kit.sample_result(run)


@pytest.fixture(scope="module")
def made(result):
    return report(result, kit.sample_claims(result))


@pytest.fixture(scope="module")
def page(made):
    return Page(made.html)


def references(page):
    """Everything on a page that points anywhere."""
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


def test_nothing_is_asked_of_anybody(page, made):
    found = list(references(page))
    assert found
    assert [one for one in found if not one.startswith(("#", "data:image/png;base64,"))] == []
    assert page.all("script", "link", "iframe", "object", "embed", "base", "form") == []
    assert "@import" not in made.html
    assert "://" not in re.sub(r"base64,[^\"]*", "", made.html)
    policy = next(one.get("content") for one in page.all("meta") if one.get("http-equiv"))
    assert "default-src 'none'" in policy


def test_identifiers_are_unique_and_what_refers_to_them_finds_them(page):
    names = [one.get("id") for one in page.elements if one.get("id")]
    assert len(names) == len(set(names)) > 20
    wanted = [one[1:] for one in references(page) if one.startswith("#")]
    for element in page.elements:
        wanted += element.get("aria-labelledby").split() + element.get("aria-describedby").split()
    assert set(wanted) <= set(names)


def test_every_picture_says_what_is_seen(page):
    pictures = page.all("svg", "img")
    assert (
        len(pictures) == 5 + 2 + 2 + 1
    )  # all of the first cell, plan and levels of the others, the overview
    told = []
    for picture in pictures:
        assert picture.get("role") == "img"
        assert page.by_id(picture.get("aria-labelledby")).text
        told.append(page.by_id(picture.get("aria-describedby")).text)
    assert len(set(told)) == len(told)
    assert all(re.search(r"\d", text) for text in told)


def test_words_of_the_pictures_are_those_of_the_data(page, result):
    first = result.cells[0]
    seen = {
        one: page.by_id(f"cell-1-{one}-seen").text
        for one in ("plan", "levels", "distance", "path-loss")
    }
    low, high = np.min(first.obs.level_dbm), np.max(first.obs.level_dbm)
    assert f"from {low:.0f} to {high:.0f} dBm" in seen["plan"]
    assert "The likeliest place lies 79 m east of the start" in seen["plan"]
    assert "A claimed place (consistent) lies 56 m north of the start" in seen["plan"]
    assert f"{len(first.obs)} levels of this cell" in seen["levels"]
    assert "P0 -35.0 ± 2.0 dBm and eta 3.00 ± 0.20" in seen["path-loss"]
    assert "60 readings between" in seen["distance"]
    assert "3 cells over 2 minutes; 3 of them" in page.by_id("overview-seen").text
    assert "The strongest is cell 1 " in page.by_id("overview-seen").text


def test_structure_can_be_walked_by_ear(page):
    assert page.all("html")[0].get("lang") == "en"
    assert all(
        len(page.all(tag)) == 1 for tag in ("header", "nav", "main", "footer", "h1", "title")
    )
    levels = [LEVELS.index(one.tag) for one in page.all(*LEVELS)]
    assert levels[0] == 0
    assert all(b - a <= 1 for a, b in pairwise(levels))
    assert all(one.text for one in page.all(*LEVELS))
    assert all(one.get("scope") in {"col", "row"} for one in page.all("th"))
    boxes = [one for one in page.all("div") if "scroll" in one.get("class")]
    assert len(boxes) >= len(page.all("table"))
    assert all(one.get("tabindex") == "0" and one.get("role") == "region" for one in boxes)
    assert all("div" in one.within for one in page.all("table"))


def test_the_verdict_comes_first_and_in_words(page, result):
    assert page.all("h1")[0].text == "1 of 3 cells located, 2 cannot be told"
    first = page.all("article")[0]
    assert "located" in first.text
    assert "Located within 29 m" in first.text
    assert "With 95 % probability" in first.text
    assert result.cells[0].cell in first.text
    assert "simulated run" in page.all("header")[0].text


def test_values_are_those_of_the_summary(page, result):
    values = [one for one in page.elements if one.tag == "data"]
    shown = {float(one.get("value")) for one in values}
    for cell in summary(result)["cells"]:
        wanted = [
            cell["best"][name]
            for name in ("lat", "lon", "r95_m", "p0_dbm", "p0_sigma_db", "eta", "eta_sigma")
        ]
        others = [
            cell[one]
            for one in ("ekf", "rts", "batch", "reference_ekf")
            if cell[one]["lat"] is not None
        ]
        wanted += [one[name] for one in others for name in ("lat", "lon", "n")]
        assert {value for value in wanted if value is not None} <= shown
    assert all(abs(float(one.get("value")) - float(one.text)) < 1.0 for one in values)


def test_claims_stand_with_their_verdicts(page):
    table = page.by_id("claims")
    assert table.text == "Is it where it claims to be?"
    assert "Claimed at 52.50050 13.40000: ● consistent" in page.all("article")[0].text
    assert "✕ rejected" in page.text
    assert "Nothing is claimed of 1 other cell heard" in page.text
    assert "claimed place: consistent" in "".join(one.text for one in page.all("text"))


@pytest.mark.parametrize("place", [(0.0, 103.4), (-52.5, -166.6), (83.9, 13.4)])
def test_a_claim_at_the_other_end_of_the_world(result, place):
    cell = result.cells[0]
    claim = CellVerdict(
        cell.cell, cell.n, Claim(cell.cell, *place, 5000.0, "x"), "rejected", ("because",)
    )
    page = Page(report(result, Verified(0.05, (claim,), (), ()), most=1).html)
    assert "beyond)" in "".join(one.text for one in page.all("text"))


def test_without_claims_there_is_no_such_section(result):
    assert "claims to be" not in report(result, most=1).html


def test_the_same_run_gives_the_same_page(result, made):
    assert report(result, kit.sample_claims(result)).html == made.html


def test_pictures_take_their_ink_from_the_page(made):
    drawn = "".join(re.findall(r"<svg.*?</svg>", made.html, re.DOTALL))
    assert "var(--ink)" in drawn
    assert "var(--grid)" in drawn
    assert re.findall(r"#(?:000000|ffffff|1f242b|5c6470|dde1e6)", drawn) == []


def palettes(css):
    """Custom properties in light, in darkness and on paper."""
    blocks = re.findall(r":root \{(.*?)\}", css, re.DOTALL)
    every = [dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6})\b", block)) for block in blocks]
    return every[0], *every[1:]


def contrast(one, other):
    """WCAG 2.2, contrast ratio of two colours."""

    def luminance(colour):
        digits = colour[1:] if len(colour) == 7 else "".join(2 * c for c in colour[1:])
        parts = [int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_words_can_be_read_in_light_in_darkness_and_on_paper(page):
    found = palettes(page.all("style")[0].text)
    assert len(found) == 3
    for colours in found:
        assert colours.keys() == found[0].keys()
        for ink in ("ink", "muted", "link"):
            assert (
                min(contrast(colours[ink], colours[ground]) for ground in ("paper", "ground"))
                >= 4.5
            ), ink
        for badge in ("good", "doubt", "none", "bad"):
            assert contrast(colours[badge], colours[f"{badge}-bg"]) >= 4.5, badge


def write(path, records, **changes):
    write_journal(path, records, **changes)
    return read_run(path)


def heard(t_ns, name):
    return Record(
        t_ns, "modem", Scan(t_ns, (CellReading("scan", label=name, rssi_dbm=-60.0),), None)
    )


def test_foreign_text_stays_text(tmp_path):
    """Names of cells, files and sources, notes and the configuration come from outside."""
    records = [Record(0, "gnss", Fix(True, None, 52.0, 13.0))]
    records += [heard(i * 10**9, HOSTILE) for i in range(3)]
    records += [
        Record(
            3 * 10**9, "logger", Note("error", HOSTILE, f"{HOSTILE}\a\N{RIGHT-TO-LEFT OVERRIDE}")
        )
    ]
    path = tmp_path / "a<b onclick=x>&.journal"
    run = write(
        path,
        records,
        config_text=HOSTILE,
        program=HOSTILE,
        origin=HOSTILE,
        versions={HOSTILE: HOSTILE},
    )
    html = report(smooth_runs([run])).html
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


@pytest.mark.parametrize(
    "records",
    [
        [],
        [Record(0, "logger", Note("info", "start", "only a note"))],
        [heard(0, "a"), heard(10**9, "b")],
        [Record(0, "gnss", Fix(True, None, 52.0, 13.0))],
        [Record(0, "gnss", Fix(True, None, 52.0, 13.0)), heard(10, "a")],
        [
            Record(0, "gnss", Fix(True, None, 52.0, 13.0)),
            *(heard(i * 10**8, "a") for i in range(9)),
        ],
        [Record(0, "gnss", Fix(False)), heard(10, "漢")],
    ],
    ids=[
        "nothing",
        "a note",
        "no fix",
        "only a fix",
        "one reading",
        "standing still",
        "invalid fix",
    ],
)
def test_runs_with_next_to_nothing(records, tmp_path):
    page = Page(report(smooth_runs([write(tmp_path / "x.journal", records)])).html)
    assert page.all("h1")[0].text
    assert "date unknown" in page.text


def test_what_to_walk_next_if_ambiguous(tmp_path):
    """A straight walk past a transmitter on one side: both sides fit, and the page says where to
    go.
    """
    rng = np.random.default_rng(1)
    x0, y0 = kit.UTM.to_xy(kit.LAT, kit.LON)
    records = []
    for i in range(160):
        lat, lon = kit.UTM.to_latlon(x0 + 3.0 * i, y0)
        level = -35.0 - 30.0 * np.log10(np.hypot(3.0 * i - 240.0, 80.0)) + rng.normal(0.0, 1.0)
        readings = (CellReading("scan", "GSM", "262", "01", 1, 7, rssi_dbm=float(level)),)
        records += [
            Record(i * 10**9, "gnss", Fix(True, None, lat, lon, hdop=0.9)),
            Record(i * 10**9 + 1, "modem", Scan(i * 10**9, readings, None)),
        ]
    smoothed = smooth_runs([write(tmp_path / "straight.journal", records)])
    (cell,) = smoothed.cells
    assert cell.verdict == "ambiguous"
    page = Page(report(smoothed).html)
    assert page.all("h1")[0].text == "Cell 262-01-1-7: 2 places fit"
    article = page.all("article")[0].text
    assert "2 places fit" in article
    (advice,) = [one.text for one in page.all("p") if one.get("class") == "advice"]
    best = summary(smoothed)["cells"][0]["modes"]
    assert any(f"walk past {mode['lat']:.5f} {mode['lon']:.5f}" in advice for mode in best)
    assert "place 2:" in page.text


def test_a_cell_that_cannot_be_told_says_where_to_go(page):
    advice = [one.text for one in page.all("p") if one.get("class") == "advice"]
    assert len(advice) == 2
    assert all(one.startswith("Walk next: ") for one in advice)


def test_most_told_are_located_first_then_heard_most(result):
    a, b, c = result.cells
    cells = [
        replace(a, verdict="cannot tell", n=9),
        replace(b, verdict="ambiguous", n=1),
        replace(c, verdict="located"),
    ]
    assert [cell.cell for cell in most_told(cells, 2)] == [c.cell, b.cell]
    assert most_told([replace(a, obs=None)], 2) == []


def test_many_cells_stand_in_the_table_and_few_are_told(tmp_path):
    made = report(
        kit.sample_result(kit.write_run(tmp_path / "x.journal", seconds=20, cells=40)), most=2
    )
    page = Page(made.html)
    assert len(made.cells) == len(page.all("article")) == 2
    rows = [
        one
        for one in page.all("th")
        if one.get("scope") == "row" and one.text.startswith("262-01-4711-")
    ]
    assert len(rows) == 40
    assert "Pictures are of the 2 cells with most to tell" in page.text


def test_an_hour_stays_small(tmp_path):
    run = kit.write_run(tmp_path / "x.journal", seconds=3600, cells=2)
    found = kit.sample_result(run)
    one = report(found, most=1)
    assert len(one.html) < 3_000_000 / 8
    drawn = re.findall(r"<svg.*?</svg>", one.html, re.DOTALL)
    assert max(len(re.findall(r"<(?:path|use)\b", picture)) for picture in drawn) < 1000


def test_the_overview_is_a_picture_of_its_own(made, result, tmp_path):
    alone = replace(made, pictures=())
    assert [path.name for path in alone.write_pictures(tmp_path)] == [
        "overview.png",
        "overview.svg",
    ]
    assert (tmp_path / "overview.png").read_bytes().startswith(b"\x89PNG")
    assert report(replace(result, cells=result.cells[:1]), most=0).overview is None


def test_several_runs_on_one_page(result, tmp_path):
    other = kit.write_run(tmp_path / "second.journal", seconds=120, cells=3)
    cell = result.cells[0]
    short = replace(cell, posterior=None)
    shares = (RunShare(0, 60, 0.0, 0.0), RunShare(1, 60, 2.5, 1.0))
    merged = replace(cell, shares=shares, without={0: short, 1: cell})
    walks = (replace(result.runs[0], warnings=()), ObservedRun(other, None, ("of two",)))
    together = Result(walks, (merged,), ("told of both",))
    page = Page(report(together).html)
    assert len(page.all("svg")) == 2  # plan and distance: clocks differ
    assert "second.journal" in page.text
    assert {"2.5", "1.0"} <= {one.get("value") for one in page.all("data")}
    assert "told of both" in page.text
    assert "of two" in page.text
