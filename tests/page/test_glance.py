"""What the page says first, and where its arrow points: its modules in a real browser."""

import pytest

from logger.core.live_settings import FOLLOW
from logger.device.live_view import SuspicionStatus
from logger.device.status import Status
from tests.kit import page as kit
from tests.kit import service
from tests.kit.browser import browser
from tests.kit.phone import Phone

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def phone(tmp_path_factory):
    """A phone with the page, of a Pi that records nothing."""
    folder, port = tmp_path_factory.mktemp("page"), kit.free_port()
    kit.folders(folder)
    table = f'[page]\nlisten = "127.0.0.1:{port}"\n'
    config = service.site_toml(folder, "/dev/a", "/dev/b", table)
    with browser() as chromium, kit.page_server(folder, config, port) as page:
        phone = Phone(chromium)
        phone.open(page)
        phone.page = page
        yield phone


def test_a_located_cell_is_the_first_thing_said(phone):
    located = "{verdict: 'located', r50_m: 19.6, r95_m: 46.4}"
    for state, begin in (("recording", "Recording"), ("suspicious", "Recording; a cell is ")):
        status = f"{{state: '{state}', position: {located}}}"
        sign, sentence, todo = phone.result_of("glance.js", f"m.glance({{status: {status}}}, 0)")
        assert sign == state
        assert sentence.startswith(begin)
        assert sentence.endswith("; located, most likely within 20\u00a0m, surely within 46\u00a0m")
        assert todo == "You may end here."


def test_without_a_live_estimate_the_walk_is_recorded(phone):
    status = "{state: 'recording', no_estimate: 'no live estimate: MemoryError'}"
    sign, sentence, _ = phone.result_of("glance.js", f"m.glance({{status: {status}}}, 0)")
    assert (sign, sentence) == ("recording", "Recording, but without a live estimate")


def test_places_that_fit_are_counted_at_the_top(phone):
    modes = "[{probability: 0.6}, {probability: 0.35}, {probability: 0.05}]"
    status = f"{{state: 'recording', position: {{verdict: 'cannot tell', modes: {modes}}}}}"
    sentence = phone.result_of("glance.js", f"m.glance({{status: {status}}}, 0)")[1]
    assert sentence == "Recording; 2 places fit"


def test_a_suspicious_cell_that_is_not_followed_is_one_tap_away(phone):
    suspicions = "[{cell: '262-01-1-7', word: 'suspicious'}]"
    for cell, is_hidden in (("262-01-1-9", False), ("262-01-1-7", True)):
        state = f"{{cell: '{cell}', minute: [], status: {{cells: [], suspicions: {suspicions}}}}}"
        phone.result_of("finder.js", f"m.showFinder({state})")
        assert phone.chromium.evaluate("return document.getElementById('suspect').hidden") == (
            is_hidden
        )
    status = Status(
        *("suspicious", "", "run-000002.journal", 1, 9, 0, 8, 3, 2, 1, 0, 10, None, {}),
        followed="262-01-1-9",
        suspicions=(SuspicionStatus("262-01-1-7", "suspicious", 5.0, ()),),
    )
    with kit.recording(phone.page.requests.parents[1], status) as notes:
        shown = "return document.getElementById('suspect').hidden"
        service.wait_for(lambda: not phone.chromium.evaluate(shown), 10)
        phone.tap("#suspect")
        service.wait_for(lambda: notes, 10)
    assert [(note.code, note.text) for note in notes] == [(FOLLOW, "262-01-1-7")]


def test_what_to_do_is_said_again_only_every_ten_metres(phone):
    said = set()
    for metres in range(87, 94):
        way = f"{{azimuth_deg: 0, distance_m: {metres}, lat: 0, lon: 0}}"
        status = f"{{state: 'recording', fix: null, next: {way}}}"
        said.add(phone.result_of("glance.js", f"m.glance({{status: {status}}}, 0)")[2])
    assert said == {"Walk 90 m as the arrow shows."}


def test_the_arrow_leads_from_where_the_walker_is_now(phone):
    fix = "fix: {valid: true, lat_deg: 52.5, lon_deg: 13.4}"
    north_m = "next: {azimuth_deg: 90, distance_m: 250, lat: 52.501, lon: 13.4}"
    way = phone.result_of("geometry.js", f"m.wayOf({{{fix}, {north_m}}})")
    assert way["metres"] == pytest.approx(111.0, abs=1.0)
    assert way["azimuthDeg"] == pytest.approx(0.0, abs=0.1)
    near = north_m.replace("52.501", "52.5001")
    assert phone.result_of("geometry.js", f"m.wayOf({{{fix}, {near}}})")["azimuthDeg"] == 90
    lost = phone.result_of("geometry.js", f"m.wayOf({{fix: null, {north_m}}})")
    assert lost == {"azimuthDeg": 90, "metres": 250}
