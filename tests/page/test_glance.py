"""What the page says first, and where its arrow points: its modules in a real browser."""

import msgspec
import pytest

from logger.core.answer import NextWay
from logger.core.live_settings import FOLLOW
from logger.device.live_view import CellStatus, SuspicionStatus, TargetStatus
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


LOCATED = "{cell: 'a', verdict: 'located', lat: 52.5, lon: 13.4, r50_m: 19.6, r95_m: 46.4}"


def test_a_located_cell_is_the_first_thing_said(phone):
    for state, begin in (("recording", "Recording"), ("suspicious", "Recording; a cell is ")):
        status = f"{{state: '{state}', position: {LOCATED}}}"
        sign, sentence, todo = phone.result_of("glance.js", f"m.glance({{status: {status}}}, 0)")
        assert sign == state
        assert sentence.startswith(begin)
        assert sentence.endswith("; located")
        assert todo == "Go and look, as the arrow shows; what to do stands below it."


def _screen_of(phone, status):
    """What the first part of the page shows, None of what is hidden; before the next news."""
    ids = "['target', 'geo', 'found', 'metres', 'why', 'frame', 'offer', 'auto']"
    text = "id => [id, of(id).hidden ? null : of(id).textContent]"
    link = "['href', document.getElementById('geo').getAttribute('href')]"
    of = "const of = id => document.getElementById(id)"
    shown = f"m.showArrow({{status: {status}}}); return [...{ids}.map({text}), {link}]"
    expression = f"(() => {{{of}; {shown}}})()"
    return dict(phone.result_of("arrow.js", expression))


def test_a_found_cell_has_coordinates_a_link_for_maps_and_what_to_do(phone):
    suspicions = "[{cell: 'a', word: 'suspicious'}]"
    suppose = "supposition: 'if it is within 300 m of the walk'"
    status = (
        f"{{target: {{cell: 'a', over: 'located', {suppose}}}, position: {LOCATED}, "
        f"suspicions: {suspicions}, "
        "next: {azimuth_deg: 9, distance_m: 99, lat: 1, lon: 1, why: 'so'}, "
        "fix: {valid: true, lat_deg: 52.501, lon_deg: 13.4}}"
    )
    shown = _screen_of(phone, status)
    assert shown["target"] == (
        "Found: suspicious cell a, most likely within 20\u00a0m, surely within 46\u00a0m, "
        "if it is within 300 m of the walk."
    )
    assert (shown["geo"], shown["href"]) == ("52.50000, 13.40000", "geo:52.50000,13.40000;u=46")
    assert "what to do" in shown["found"]
    assert (shown["metres"], shown["why"]) == ("111 m", "")  # to the place, and nothing else
    assert shown["frame"].startswith("south;")


@pytest.mark.parametrize(
    ("state", "fix", "metres", "frame"),
    [
        ("no fix", "{valid: false, t_ns: 9e9}", "–", "No advice without a position."),
        ("error", "{valid: true, lat_deg: 1, lon_deg: 1, t_ns: 2e9}", "–", "No advice meanwhile."),
        ("error", "{valid: true, lat_deg: 1, lon_deg: 1, t_ns: 9e9}", "0 m", "east; you stand: up"),
        ("recording", "{valid: false, t_ns: 9e9}", "99 m", "east; you stand: up is north"),
    ],
)
def test_nothing_leads_on_from_a_place_that_the_walker_has_left(phone, state, fix, metres, frame):
    # one of two modems may be the trouble, and one epoch without a position is none
    way = "{azimuth_deg: 90, distance_m: 99, lat: 1, lon: 1, why: 'so'}"
    shown = _screen_of(phone, f"{{state: '{state}', now_ns: 10e9, next: {way}, fix: {fix}}}")
    assert shown["metres"] == metres
    assert shown["frame"].startswith(frame)


def test_a_search_that_was_given_up_says_why_and_offers_the_next_cell(phone):
    status = (
        "{target: {cell: 'a', over: 'not heard for 10 min'}, offer: 'b', followed: 'a', "
        "suspicions: [{cell: 'b', word: 'unusual'}]}"
    )
    shown = _screen_of(phone, status)
    assert shown["target"] == "Given up: a; not heard for 10 min."
    assert (shown["offer"], shown["auto"]) == ("Search for unusual b", "Let the program choose")
    assert (shown["found"], shown["metres"]) == (None, "–")


def test_a_run_that_was_closed_in_order_is_no_trouble(phone):
    # its HDF5 file is being made
    said = phone.result_of("glance.js", "m.glance({status: {}, silent_s: 0, kept: 5232}, 0)")
    assert said[:2] == ["stopped", "Stopped in order, 5\u00a0232 readings kept"]
    silent = phone.result_of("glance.js", "m.glance({status: {}, silent_s: 4, kept: null}, 0)")
    assert silent[:2] == ["trouble", "The recorder is silent for 4 s"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("b: no such port", "Trouble with b; the others are being recorded"),
        ("waiting for the card: full", "Trouble: this walk is not being recorded"),
    ],
)
def test_a_failing_card_is_worse_than_a_faulty_port(phone, text, said):
    ports = "{a: {fault: ''}, b: {fault: 'no such port'}, c: {fault: ''}}"
    status = f"{{state: 'error', text: '{text}', ports: {ports}}}"
    assert phone.result_of("glance.js", f"m.glance({{status: {status}}}, 0)")[1] == said


def test_without_a_live_estimate_the_walk_is_recorded(phone):
    status = "{state: 'recording', no_estimate: 'no live estimate: MemoryError'}"
    sign, sentence, _ = phone.result_of("glance.js", f"m.glance({{status: {status}}}, 0)")
    assert (sign, sentence) == ("recording", "Recording, but without a live estimate")


def test_places_that_fit_are_counted_at_the_top(phone):
    modes = "[{probability: 0.6}, {probability: 0.35}, {probability: 0.05}]"
    status = f"{{state: 'recording', position: {{verdict: 'cannot tell', modes: {modes}}}}}"
    sentence = phone.result_of("glance.js", f"m.glance({{status: {status}}}, 0)")[1]
    assert sentence == "Recording; 3 places fit"


def test_the_cell_that_is_offered_is_one_tap_away(phone):
    status = Status(
        *("suspicious", "", "run-000002.journal", 1, 9, 0, 8, 3, 2, 1, 0, 10, None, {}),
        followed="262-01-1-9",
        suspicions=(SuspicionStatus("262-01-1-7", "suspicious", 5.0, ()),),
        target=TargetStatus("262-01-1-9", "cannot tell"),
        offer="262-01-1-7",
    )
    with kit.recording(phone.page.requests.parents[1], status) as notes:
        shown = "To cell 262-01-1-9, as you chose."
        service.wait_for(lambda: phone.text("target") == shown, 10)
        assert not phone.chromium.evaluate("return document.getElementById('offer').hidden")
        phone.tap("#offer")
        service.wait_for(lambda: notes, 10)
        phone.tap("#auto")
        service.wait_for(lambda: len(notes) > 1, 10)
    assert [(note.code, note.text) for note in notes] == [
        (FOLLOW, "262-01-1-7"),
        (FOLLOW, "suspicious"),
    ]


@pytest.mark.parametrize(("width", "letters"), [(320, "100%"), (320, "200%"), (390, "200%")])
def test_small_screens_and_large_letters_hold_everything(phone, width, letters):
    # the letters are those that a person has set in the browser
    long, why = "310-410-65535-268435455", f"area 65535 {'x' * 60}"
    row = CellStatus(long, "LTE", 68_935, True, -101.0, -102.0, -99.0, -12.0, 9, 3, 1107.0)
    status = Status(
        *("suspicious", "", "run-000002.journal", 1, 9, 0, 8, 123_456, 65_432, 1_234_567),
        *(0, 10, None, {}),
        suspicions=(SuspicionStatus(long, "suspicious", 5.0, (why,)),),
        cells=(msgspec.structs.replace(row, word="suspicious", reasons=(why,)), row),
        target=TargetStatus(long, "cannot tell"),
        next=NextWay(9.0, 1234.0, 52.5, 13.4, 1.0, "go", "passing it says most"),
        offer=long,
        followed=long,
    )
    with kit.recording(phone.page.requests.parents[1], status):
        phone.open(phone.page, width=width)
        service.wait_for(lambda: phone.text("metres") == "1234 m", 10)
        phone.chromium.evaluate(f"document.documentElement.style.fontSize = '{letters}'")
        service.wait_for(lambda: phone.text("average") == "-102", 10)
        assert phone.chromium.overflowing_elements() == []
        size = "return parseFloat(getComputedStyle(document.getElementById('why')).fontSize)"
        assert phone.chromium.evaluate(size) == pytest.approx(17.0 * int(letters[:-1]) / 100.0)
    phone.open(phone.page)


def test_a_screen_reader_says_once_that_contact_is_lost(phone):
    show = "m.showGlance({status: {state: 'recording'}}, ms)"
    live = f"(ms => {{{show}; return document.getElementById('glance').ariaLive}})"
    lived = phone.result_of("glance.js", f"[6000, 7000, 12000, 0].map({live})")
    assert lived == ["polite", "off", "off", "polite"]


def test_a_screen_reader_says_what_the_trouble_is_now(phone):
    show = "m.showGlance({status: {state: 'error', text, ports: {}}}, 0)"
    live = f"(text => {{{show}; return document.getElementById('glance').ariaLive}})"
    texts = "['modem: no scan for 61 s', 'modem: no scan for 62 s', 'no such port']"
    assert phone.result_of("glance.js", f"{texts}.map({live})") == ["polite", "off", "polite"]


@pytest.mark.parametrize(
    ("state", "said"),
    [
        ("recording", "Mark 1 is on the card."),
        ("no fix", "Mark 1 is on the card, without a position: there is none now."),
    ],
)
def test_a_mark_without_a_position_is_said_to_have_none(phone, state, said):
    phone.chromium.evaluate("window.fetch = async () => new Response('')")  # a Pi that takes it
    phone.chromium.evaluate("document.getElementById('mark').requestSubmit()")
    take = f"m.takeAnswer({{n_marks: 1, status: {{state: '{state}'}}}})"

    def is_answered():
        phone.result_of("marks.js", take)
        return phone.text("answer") != "Sent; not on the card yet."

    service.wait_for(is_answered, 10)
    assert phone.text("answer") == said
    phone.open(phone.page)


def test_who_should_stand_still_is_not_told_to_walk(phone):
    status = "{state: 'no fix', fix: null, ports: {}}"
    todo = phone.result_of("glance.js", f"m.glance({{status: {status}}}, 0)")[2]
    assert todo == "Stand under the open sky for a minute."
    assert _screen_of(phone, f"{status}")["frame"] == "No advice without a position."
    broken = "{state: 'error', text: 'no modem', ports: {}}"
    assert _screen_of(phone, broken)["frame"] == "No advice meanwhile."


def test_one_distance_is_said_beside_the_arrow_alone(phone):
    way = "{azimuth_deg: 0, distance_m: 87, lat: 0, lon: 0}"
    status = f"{{state: 'recording', fix: null, next: {way}}}"
    todo = phone.result_of("glance.js", f"m.glance({{status: {status}}}, 0)")[2]
    assert todo == "Walk as the arrow shows."


def test_the_arrow_and_the_plan_cross_180_degrees(phone):
    """Taveuni is on both sides of it."""
    fix = "fix: {valid: true, lat_deg: -16.8, lon_deg: 179.999}"
    way = phone.result_of("geometry.js", f"m.wayOf({{{fix}, next: {{lat: -16.8, lon: -179.999}}}})")
    assert way == {"azimuthDeg": 90, "metres": pytest.approx(213.0, abs=1.0)}
    region = "m.metres({lat: -16.8, lon: 179.999}, -16.8, -179.999)"
    assert phone.result_of("geometry.js", region)[0] == pytest.approx(213.0, abs=1.0)


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


@pytest.mark.parametrize("missing", ["*/geometry.js", "*.js"])
def test_a_page_that_came_in_part_loads_itself_again(phone, missing):
    # over a poor Wi-Fi some of its files may be missing: it would connect for ever
    command = phone.driver.execute_cdp_cmd
    command("Network.enable", {})
    command("Network.setBlockedURLs", {"urls": [missing]})
    phone.open(phone.page)
    assert not _is_alive(phone)
    command("Network.setBlockedURLs", {"urls": []})
    service.wait_for(lambda: _is_alive(phone), 20)


def _is_alive(phone):
    state = phone.chromium.evaluate("return document.getElementById('state')?.textContent")
    return state not in {None, "Connecting to the Pi"}


def test_an_impatient_person_is_not_refused_for_long(phone):
    for _ in range(12):  # more requests than one phone may make at once
        phone.open(phone.page)
    service.wait_for(lambda: _is_alive(phone), 20)
