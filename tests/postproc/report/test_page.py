"""The page: structure, verdicts, values, claims and alternative texts."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from postproc.report.rendering import make_report
from postproc.verification.claims import CellVerdict, Claim, Verified
from tests.kit import sample_results as kit
from tests.kit.html_page import Page

LEVELS = ("h1", "h2", "h3", "h4")


def test_every_picture_has_an_alternative_text(page):
    pictures = page.all("svg", "img")
    # all of the first cell, plan and levels of the two others, the map and the overview
    assert len(pictures) == 5 + 2 + 2 + 1 + 1
    texts = []
    for picture in pictures:
        assert picture.get("role") == "img"
        assert page.by_id(picture.get("aria-labelledby")).text
        texts.append(page.by_id(picture.get("aria-describedby")).text)
    assert len(set(texts)) == len(texts)
    assert all(re.search(r"\d", text) for text in texts)


def test_alternative_texts_state_the_data(page, result):
    first = result.cells[0]
    names = ("plan", "levels", "distance", "path-loss")
    texts = {name: page.by_id(f"cell-1-{name}-text").text for name in names}
    low, high = np.min(first.obs.level_dbm), np.max(first.obs.level_dbm)
    assert f"range from {low:.0f} to {high:.0f} dBm" in texts["plan"]
    assert "The most likely position is 79 m east of the start" in texts["plan"]
    assert "A claimed position (consistent) is 56 m north of the start" in texts["plan"]
    assert f"{len(first.obs)} levels of this cell" in texts["levels"]
    assert "P0 -35.0 ± 2.0 dBm and eta 3.00 ± 0.20" in texts["path-loss"]
    assert "60 readings at distances of" in texts["distance"]
    assert "3 cells over 2 minutes; 3 of them" in page.by_id("overview-text").text
    assert "The strongest is cell 1 " in page.by_id("overview-text").text


def test_a_screen_reader_finds_the_structure(page):
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


def test_the_verdict_comes_first(page, result):
    assert page.all("h1")[0].text == "1 of 3 cells located, 2 not located"
    first = page.all("article")[0]
    said = result.answers[0].sentence
    assert said.endswith("most likely within 14 m, surely within 29 m")
    assert f"L{said[1:]}." in first.text
    assert result.cells[0].cell in first.text
    assert "simulated run" in page.all("header")[0].text


def test_a_suspicious_cell_comes_before_all(result):
    """Its word, why, where, what to do, what else explains it, and how often the word is wrong."""
    odd = kit.with_word(result, 1)
    page = Page(make_report(odd, first=(odd.cells[1].cell,)).html)
    assert page.all("h1")[0].text == "One cell is suspicious"
    top = page.all("article")[0]
    assert top.get("class") == "top"
    assert f"1 {odd.cells[1].cell} ✕ suspicious" in top.text
    assert page.by_id("top-reason").text == "Why: Area 9 is that of none of the others."
    assert page.by_id("top-do").text.startswith("What to do: ")
    (more,) = (one for one in page.all("div") if one.get("class") == "more")
    harmless = "Harmless causes: The border of two areas, a small cell in a house or shop, a legit"
    assert harmless in more.text
    assert "0.03 times an hour (0.00 to 0.14, 95 %) in 38.5 h of 62 runs" in more.text
    assert (
        "one that only timing advances would betray. Earlier walks of this ground: 0" in more.text
    )
    row = next(one for one in page.all("tr") if odd.cells[1].cell in one.text)
    assert "✕ suspicious" in row.text


def test_a_cell_has_one_number_everywhere(result):
    odd = kit.with_word(result, 2)
    report = make_report(odd, first=(odd.cells[2].cell,))
    page = Page(report.html)
    cards = [one.text.split()[:2] for one in page.all("article")]
    assert cards == [[str(n), cell] for n, cell in enumerate(report.cells, 1)]
    marks = [one.get("id") for one in page.all("g") if "place-" in one.get("id")]
    on_plan = {f"{mark.rpartition('-')[2]}" for mark in marks}
    assert on_plan == {"1", "2"}
    assert "1 is " + report.cells[0] in page.by_id("map-text").text
    rows = re.findall(r"(\d+)\s*(262-01-4711-\d+)", " ".join(one.text for one in page.all("tr")))
    assert [list(row) for row in rows] == cards


def test_a_place_has_one_coordinate(result):
    """In every notation the page has of it: within a metre."""
    odd = kit.with_word(result)
    page = Page(make_report(odd, most=1).html)
    place = result.cells[0].place
    at = f"{place.lat:.5f}", f"{place.lon:.5f}"
    known = re.findall(r"(52\.50\d{3}),?\s(13\.40\d{3})", page.all("main")[0].text)
    cell = kit.json_of(result)["cells"][0]
    others = [cell[name] for name in ("ekf", "rts", "batch", "reference_ekf")]
    assert known.count(at) >= 4
    assert set(known) - {at} <= {(f"{one['lat']:.5f}", f"{one['lon']:.5f}") for one in others}
    (dms,) = set(re.findall(r"(\d+)°(\d\d)'([\d.]+)\"N", page.text))
    lat_deg = int(dms[0]) + int(dms[1]) / 60 + float(dms[2]) / 3600
    assert abs(lat_deg - place.lat) < 1e-5


def test_the_table_says_what_a_radius_supposes(result):
    first, *others = result.cells
    distant = replace(result, cells=[kit.as_if_distant(first), *others])
    page = Page(make_report(distant, most=1).html)
    assert re.search(r"\d\sm if it is no distant mast", page.text)  # with a comma in the sentence


def test_without_a_suspicious_cell_the_page_says_what_it_cannot_see(result):
    page = Page(make_report(kit.with_word(result, word="nothing unusual"), most=1).html)
    assert page.all("h1")[0].text == "No cell is suspicious"
    said = page.by_id("unnoticed").text
    assert said.startswith(
        "Here a strong new station would most likely have been noticed, but not a weak"
    )


def test_no_line_ends_within_a_value_and_nothing_is_said_twice(page, result, tmp_path):
    make_report(result).write(tmp_path / "page.html")
    html = (tmp_path / "page.html").read_text()
    first = result.cells[0]
    where = first.place.where.replace(" ", "\N{NO-BREAK SPACE}")
    assert html.count(where) >= 2  # card and table
    assert f"within {first.place.r50_m:.0f}\N{NO-BREAK SPACE}m" in html
    assert html.count("1 of 3 cells located") == 2  # title and heading


def test_values_are_those_of_the_summary(page, result):
    values = [one for one in page.elements if one.tag == "data"]
    shown = {float(one.get("value")) for one in values}
    for cell in kit.json_of(result)["cells"]:
        wanted = [
            cell["best"][name]
            for name in (
                "lat",
                "lon",
                "r50_m",
                "r95_m",
                "p0_dbm",
                "p0_sigma_db",
                "eta",
                "eta_sigma",
            )
        ]
        others = [
            cell[one]
            for one in ("ekf", "rts", "batch", "reference_ekf")
            if cell[one]["lat"] is not None
        ]
        wanted += [one[name] for one in others for name in ("lat", "lon", "n")]
        assert {value for value in wanted if value is not None} <= shown
    units_m = {"": 1.0, "m": 1.0, "km": 1000.0}
    for one in values:
        number, _, unit = one.text.partition(" ")
        assert float(number) * units_m[unit] == pytest.approx(float(one.get("value")), abs=1.0)


def test_a_cell_names_reach_antenna_and_height(page):
    said = [one.text for one in page.all("p") if "reach:" in one.text]
    assert len(said) == 1
    assert "reach: near 90 %, far 10 % (alone: 3" in said[0].replace("\N{NO-BREAK SPACE}", " ")
    assert "elsewhere); height: 5 m (fixed)." in said[0]


def test_claims_are_listed_with_their_verdicts(page):
    assert page.by_id("claims").text == "Claimed positions"
    assert "Claimed at 52.50050 13.40000: ● consistent" in page.all("article")[0].text
    assert "✕ rejected" in page.text
    assert "There is no claim about 1 other cell observed" in page.text
    assert "claimed position: consistent" in "".join(one.text for one in page.all("text"))


@pytest.mark.parametrize("degrees", [(0.0, 103.4), (-52.5, -166.6), (83.9, 13.4)])
def test_a_claim_on_another_continent(result, degrees):
    cell = result.cells[0]
    claim = CellVerdict(
        cell.cell, cell.n, Claim(cell.cell, *degrees, 5000.0, "x"), "rejected", ("because",)
    )
    page = Page(make_report(result, Verified(0.05, (claim,), (), ()), most=1).html)
    assert "outside the plan" in " ".join(one.text for one in page.all("text"))


def test_without_claims_there_is_no_such_section(result):
    assert "Claimed positions" not in make_report(result, most=1).html


def test_the_same_run_gives_the_same_page(result, report):
    assert make_report(result, kit.sample_claims(result)).html == report.html


def test_a_cell_without_a_position_has_advice(page):
    advice = [one.text for one in page.all("p") if one.get("class") == "advice"]
    assert len(advice) == 2
    assert all(one.startswith("Next walk: ") for one in advice)


def test_all_cells_are_in_the_table_and_few_in_detail(tmp_path):
    result = kit.sample_result(kit.write_run(tmp_path / "x.journal", seconds=20, cells=40))
    report = make_report(result, most=2)
    page = Page(report.html)
    assert len(report.cells) == len(page.all("article")) == 2
    rows = [
        one
        for one in page.all("th")
        if one.get("scope") == "row" and one.text.startswith("262-01-4711-")
    ]
    assert len(rows) == 40
    assert "2 cells of 40 in detail" in page.text


def test_the_page_of_an_hour_is_small(tmp_path):
    run = kit.write_run(tmp_path / "x.journal", seconds=3600, cells=2)
    html = make_report(kit.sample_result(run), most=1).html
    assert len(html) < 3_000_000 / 8
    svgs = re.findall(r"<svg.*?</svg>", html, re.DOTALL)
    assert max(len(re.findall(r"<(?:path|use)\b", svg)) for svg in svgs) < 1000
