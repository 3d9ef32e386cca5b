"""The plan of all cells, with and without a picture of the ground."""

import base64
import re
from dataclasses import replace
from io import BytesIO
from itertools import combinations

import numpy as np
from msgspec import structs
from PIL import Image
from pmtiles.tile import TileType

from logger.core.certainty import OnMap
from logger.core.places import Places
from logger.sim.scenario import scenario
from postproc.pictures.survey import survey_of
from postproc.report.cell_map import cell_map
from postproc.report.rendering import make_report
from tests.kit.sample_results import UTM, sample_result, with_word
from tests.kit.vector_tiles import feature, layer, tile_at, write_pmtiles

ORIGIN = "simulated walk block"


def _photograph(path, result):
    """Tiles of noise around the walk, as a photograph from the air is for a picture format."""
    fixes = result.runs[0].run.tables["fixes"]
    column, row = tile_at(float(fixes["lat_deg"][0]), float(fixes["lon_deg"][0]), 17)
    noise = np.random.default_rng(1).integers(0, 255, (256, 256, 3), np.uint8)
    file = BytesIO()
    Image.fromarray(noise).save(file, "PNG")
    places = [(17, column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    return write_pmtiles(path, dict.fromkeys(places, file.getvalue()), TileType.PNG)


def test_positions_have_the_numbers_of_the_table(result):
    figure = cell_map(survey_of(result), result.cells, None)
    texts = [text.get_text() for text in figure.figure.axes[0].texts]
    assert "N" in texts
    assert any(re.fullmatch(r"\d+ m", text) for text in texts)
    numbers = [i for i, cell in enumerate(result.cells, 1) if cell.verdict != "cannot tell"]
    assert {text for text in texts if text.isdecimal()} == set(map(str, numbers))
    assert f"{numbers[0]} is {result.cells[numbers[0] - 1].cell}" in figure.alt_text


def test_labels_of_near_places_hide_neither_each_other_nor_a_mark(result):
    posterior = result.cells[0].posterior
    at_m = np.array([posterior.place.xy_m[:, 0] + (k, -0.6 * k) for k in (0.0, 25.0, 50.0)])
    modes = tuple(
        replace(posterior.modes[0], probability=share, place=Places.of(*xy_m, utm=UTM))
        for xy_m, share in zip(at_m, (0.6, 0.3, 0.1), strict=True)
    )
    cells = (replace(result.cells[0], posterior=replace(posterior, modes=modes)),)
    odd = with_word(replace(result, cells=cells))
    axes = cell_map(survey_of(odd), odd.cells, None).figure.axes[0]
    axes.figure.draw_without_rendering()
    labels = [text for text in axes.texts if text.get_text().startswith("1 ")]
    assert [text.get_text() for text in labels] == ["1 suspicious (60 %)", "1 (30 %)", "1 (10 %)"]
    boxes = [text.get_window_extent() for text in labels]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    marks = axes.transData.transform([text.xy for text in labels])
    assert not any(box.count_contains(marks) for box in boxes)


def test_places_outside_the_plan_are_counted(result):
    far = sample_result(result.runs[0].run, verdict="ambiguous", places=4)
    (legend,) = cell_map(survey_of(far), far.cells, None).figure.legends
    said = legend.get_texts()[0].get_text()
    assert " ".join(said.split()).endswith(", 3 of 4 places outside the plan")


def test_a_long_name_is_whole_in_the_legend(result):
    long = replace(result.cells[0], cell="x" * 120)
    figure = cell_map(survey_of(result), [long], None).figure
    figure.draw_without_rendering()
    extent = figure.legends[0].get_window_extent()
    assert extent.x1 <= figure.bbox.x1
    assert extent.y0 >= figure.bbox.y0


def test_a_cell_with_a_word_is_marked_in_shape_and_word(result):
    plain, odd = (cell_map(survey_of(one), one.cells, None) for one in (result, with_word(result)))
    texts = [text.get_text() for text in odd.figure.axes[0].texts]
    assert "1 suspicious" in texts
    assert f"1 is {result.cells[0].cell}, suspicious" in odd.alt_text
    marks, odd_marks = (
        {line.get_marker() for line in one.figure.axes[0].lines} for one in (plain, odd)
    )
    assert odd_marks - marks == {"x"}


def test_an_unusual_cell_without_a_position_is_where_it_was_strongest(result):
    unusual = with_word(result, 1, "unusual")
    texts = cell_map(survey_of(unusual), unusual.cells, None).alt_text
    assert f"2 is {result.cells[1].cell}, unusual, where it was strongest" in texts


def test_streets_of_the_simulation_are_on_the_plan_and_named(result):
    observed = result.runs[0]
    simulated = replace(observed.run, meta=structs.replace(observed.run.meta, origin=ORIGIN))
    result = replace(result, runs=(replace(observed, run=simulated),))
    survey = survey_of(result)
    assert len(survey.streets_m) == len(scenario("block").walk.streets) == 11
    texts = [text.get_text() for text in cell_map(survey, result.cells, None).figure.axes[0].texts]
    assert "simulated streets" in texts


def test_streets_are_those_of_the_city_that_was_walked(result):
    observed = result.runs[0]  # near Berlin
    city = structs.replace(observed.run.meta, origin="simulated walk city-clean")
    survey = survey_of(
        replace(result, runs=(replace(observed, run=replace(observed.run, meta=city)),))
    )
    walked = scenario("city-clean", city_name="leipzig").streets_deg()
    ends_m = np.array(
        [[survey.position_m(OnMap(lat=lat, lon=lon)) for lat, lon in street] for street in walked]
    )
    assert np.allclose(survey.streets_m, ends_m)


def test_a_region_that_no_verdict_stands_for_is_faint_and_dashed(result):
    (cell,) = (one for one in result.cells if one.verdict == "located")
    unsure = replace(result, cells=(replace(cell, verdict="cannot tell"),))
    unsure = with_word(unsure, 0, "unusual")
    for one, is_solid in ((replace(unsure, cells=(cell,)), True), (unsure, False)):
        axes = cell_map(survey_of(one), one.cells, None).figure.axes[0]
        region = axes.patches[0]
        assert (region.get_linestyle() in {"-", "solid"}) == is_solid
        assert (region.get_facecolor()[3] > 0.1) == is_solid
        assert len(axes.patches) - bool(axes.child_axes) == 2  # of 95 and of 50 %


def test_without_a_position_there_is_none(result):
    unknown = [replace(cell, verdict="cannot tell") for cell in result.cells]
    assert cell_map(survey_of(result), unknown, None) is None


def test_the_ground_is_in_the_page_as_jpeg(result, tmp_path):
    air = _photograph(tmp_path / "air.pmtiles", result)
    html = make_report(result, basemap=air).html
    (jpeg,) = re.findall(r"data:image/jpeg;base64,([^\"]+)", html)
    (tmp_path / "ground.jpg").write_bytes(base64.b64decode(jpeg))
    pixels = np.asarray(Image.open(tmp_path / "ground.jpg").convert("L"))
    assert pixels.std() > 20.0
    assert len(html) < 2_000_000


def test_a_position_has_the_street_beside_it(result, tmp_path):
    fixes = result.runs[0].run.tables["fixes"]
    column, row = tile_at(float(fixes["lat_deg"][0]), float(fixes["lon_deg"][0]), 15)
    lines = [feature("line", [[(x, 0), (x, 4096)]], [0, 0]) for x in range(0, 4097, 256)]
    streets = layer("roads", lines, ["name"], ["Main <Street>"])
    places = [(15, column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    html = make_report(
        result, basemap=write_pmtiles(tmp_path / "x.pmtiles", dict.fromkeys(places, streets))
    ).html
    assert "near <strong>Main &lt;Street&gt;</strong>" in html


def test_a_map_that_does_not_cover_the_walk_does_not_cost_the_page(result, tmp_path, capsys):
    far = write_pmtiles(tmp_path / "far.pmtiles", {(14, 3, 3): layer("roads", [])})
    assert "data:image/jpeg" not in make_report(result, basemap=far).html
    why = f"{far} does not cover the area of this walk"
    assert capsys.readouterr().err == f"{far} is not drawn: {why}\n"


def test_cells_that_the_plan_leaves_out_may_have_a_position_elsewhere_on_the_page(result):
    cells = [replace(cell, verdict="cannot tell") for cell in result.cells]
    cells[0] = replace(cells[0], verdict="located")
    text = cell_map(survey_of(result), cells, None).alt_text
    assert text.endswith(f" The plan does not show the other {len(cells) - 1}.")
