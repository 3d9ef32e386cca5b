"""The page in a real browser at the width of a phone, while the real service records a walk."""

import json
import os
import time
from functools import partial
from pathlib import Path

import pytest

from logger.core.runfile import read_run
from logger.page.assets import assets
from logger.sim.scenario import ORIGIN_LAT_DEG, ORIGIN_LON_DEG
from postproc.replay import replay
from tests.kit import page as kit
from tests.kit import service, vector_tiles
from tests.kit.browser import axe_core, browser
from tests.kit.phone import Phone
from tests.kit.screenshots import count_pixels

pytestmark = pytest.mark.slow

SLOWER = 4
"""What Chromium's tools take for the processor of a mid-range phone."""
FIRST_PAINT_MS, FIRST_PAINT_BYTES = 1500, 300_000
PAINT_MS = """
return performance.getEntriesByName('first-contentful-paint').map(e => e.startTime)[0];
"""
REDDISH = """
const canvas = document.getElementById('minute'), {width, height} = canvas;
const {data} = canvas.getContext('2d').getImageData(0, 0, width, height);
let n = 0;
for (let i = 0; i < data.length; i += 4) {
  n += data[i] > 200 && data[i + 1] < 100 && data[i + 3] > 200;
}
return n;
"""
"""Points of the level in the ink of the night."""
SENT_BYTES = """
return performance.getEntriesByType('resource').filter(e => !e.name.endsWith('live'))
  .reduce((n, e) => n + e.transferSize, 0);
"""
SLOW = {"latency": 150, "downloadThroughput": 200_000, "uploadThroughput": 90_000}
"""Bytes/s of a phone at the edge of a Wi-Fi; twice what Chromium's tools call "Slow 4G"."""


@pytest.fixture(scope="module")
def phone():
    with browser() as chromium:
        yield Phone(chromium)


@pytest.fixture
def recorded_walk(tmp_path, monkeypatch):
    with kit.recorded_page(tmp_path, monkeypatch) as (page, start):
        yield page, start


def _hears(phone):
    return lambda: phone.text("level").removeprefix("-").isdecimal()


def test_the_page_shows_the_walk_and_calls_nobody_else(recorded_walk, phone, tmp_path):
    page, start = recorded_walk
    with start() as logger:
        phone.slow_down(SLOWER)
        phone.network(**SLOW)
        phone.open(page)
        service.wait_for(_hears(phone), 60)
        paint_ms, sent_bytes = (
            phone.chromium.evaluate(PAINT_MS),
            phone.chromium.evaluate(SENT_BYTES),
        )
        print(f"first paint after {paint_ms:.0f} ms, {sent_bytes / 1000:.0f} kB")
        assert paint_ms < FIRST_PAINT_MS
        assert sent_bytes < FIRST_PAINT_BYTES
        phone.slow_down(1)
        phone.network()
        assert phone.sign in {"recording", "suspicious"}
        assert phone.chromium.overflowing_elements() == []
        assert phone.chromium.box("#within")["height"] < 60  # one line of text
        urls = phone.chromium.requested_urls()
        assert urls
        assert all(url.startswith(page.address) for url in urls)
        _marks_and_follows(phone)
        assert phone.chromium.console_messages() == []
        time.sleep(2.0)
        service.stop_service(logger)
    service.wait_for(lambda: "run-000001.h5" in phone.text("runs"), 40)
    service.wait_for(lambda: phone.sign == "stopped", 20)
    (run,) = (read_run(path) for path in (tmp_path / "runs").glob("*.h5"))
    notes = [(row["code"], row["text"].decode()) for row in run.tables["notes"]]
    assert (b"mark", "a door") in notes
    assert (b"within", "300") in notes
    assert b"follow" in [code for code, _ in notes]
    assert replay(run).equal
    kept = f"{len(run.tables['readings']):_}".replace("_", "\u00a0")
    assert phone.text("state") == f"Stopped in order, {kept} readings kept"


def _marks_and_follows(phone):
    phone.chromium.evaluate("document.getElementById('note').value = 'a door'")
    phone.chromium.evaluate("document.getElementById('mark').requestSubmit()")
    service.wait_for(lambda: phone.text("answer") == "Mark 1 is on the card.", 30)
    weaker = phone.chromium.evaluate(
        "return document.querySelectorAll('#cells .name')[2].textContent"
    )
    phone.chromium.evaluate("document.querySelectorAll('#cells .follow')[2].click()")
    service.wait_for(lambda: phone.text("cell").startswith(weaker), 30)
    phone.chromium.evaluate("document.getElementById('within').click()")
    within = "return document.getElementById('within').ariaPressed"
    service.wait_for(lambda: phone.chromium.evaluate(within) == "true", 30)
    # browsers want a real tap for sound
    phone.chromium.evaluate("document.getElementById('sound').scrollIntoView({block: 'center'})")
    phone.driver.find_element("id", "sound").click()
    assert phone.chromium.evaluate("return document.getElementById('sound').ariaPressed") == "true"


def test_news_are_at_most_a_second_old(recorded_walk, phone, tmp_path):
    page, start = recorded_walk
    with start() as logger:
        phone.open(page)
        service.wait_for(_hears(phone), 60)
        ages_s = []
        for _ in range(40):
            shown_ns = phone.chromium.evaluate("return document.documentElement.dataset.now")
            ages_s.append((time.clock_gettime_ns(time.CLOCK_BOOTTIME) - int(shown_ns)) / 1e9)
            time.sleep(0.13)
        print(f"age of what the phone shows: {sorted(ages_s)[20]:.2f} s, at most {max(ages_s):.2f}")
        assert max(ages_s) < 1.0
        service.stop_service(logger)


def test_a_restart_of_the_service_is_trouble_and_then_another_run(recorded_walk, phone):
    page, start = recorded_walk
    with start() as logger:
        phone.open(page)
        service.wait_for(_hears(phone), 60)
        logger.kill()
        logger.wait()
        service.wait_for(lambda: phone.sign == "trouble", 20)
        assert "silent" in phone.text("state")
        _shows_nothing_old(phone)
    with start() as logger:
        service.wait_for(lambda: phone.sign in {"recording", "suspicious"}, 60)
        service.wait_for(lambda: "000002" in phone.text("counters"), 20)
        service.stop_service(logger)


def _shows_nothing_old(phone):
    """Neither arrow nor level look as if they were of now."""
    assert (phone.text("metres"), phone.text("level"), phone.text("trend")) == ("–", "–", "")
    assert phone.chromium.evaluate(
        "return document.getElementById('needle').hasAttribute('hidden')"
    )


def _streams_opened(phone):
    """Connections for news since the last call."""
    return sum(url.endswith("/live") for url in phone.chromium.requested_urls())


def test_a_phone_out_of_reach_says_so_and_comes_back(recorded_walk, phone):
    page, start = recorded_walk
    with start() as logger:
        phone.open(page)
        service.wait_for(_hears(phone), 60)
        page.process.send_signal(19)  # SIGSTOP: as if the Wi-Fi were gone
        service.wait_for(lambda: "No contact" in phone.text("state"), 20)
        _shows_nothing_old(phone)
        opened = partial(_streams_opened, phone)
        service.wait_for(lambda: opened() > 0, 20)  # the old connection may be silent for minutes
        phone.choose("night")
        assert phone.chromium.evaluate(REDDISH) > 100
        phone.choose("light")
        assert phone.chromium.evaluate(REDDISH) == 0
        page.process.send_signal(18)
        service.wait_for(lambda: phone.sign != "trouble", 20)
        service.stop_service(logger)


def test_axe_finds_nothing_in_any_colours(recorded_walk, phone):
    page, start = recorded_walk
    with start() as logger:
        phone.open(page)
        service.wait_for(_hears(phone), 60)
        for theme in ("light", "dark", "night"):
            phone.choose(theme)
            assert phone.chromium.accessibility_violations(axe_core()) == []
        service.stop_service(logger)
    service.wait_for(lambda: phone.sign == "stopped", 20)
    assert phone.chromium.accessibility_violations(axe_core()) == []


def test_axe_and_the_policy_find_what_is_wrong(recorded_walk, phone):
    """The negative control."""
    page, _ = recorded_walk
    phone.open(page)
    phone.chromium.evaluate("document.getElementById('near').textContent = ''")
    found = phone.chromium.accessibility_violations(axe_core())
    assert "button-name" in {violation["id"] for violation in found}
    for tag, change in (
        ("script", "textContent = 'window.bad = 1'"),
        ("img", "src = 'http://192.0.2.1/x.png'"),
        ("style", "textContent = 'p {}'"),
    ):
        made = f"const e = document.createElement('{tag}'); e.{change}"
        phone.chromium.evaluate(f"{made}; document.body.append(e)")
    service.wait_for(lambda: phone.chromium.evaluate("return document.images.length") == 1, 20)
    assert phone.chromium.evaluate("return window.bad ?? null") is None
    messages = " ".join(phone.chromium.console_messages())
    for directive in ("script-src", "img-src", "style-src"):
        assert directive in messages


def _ground(path):
    """A map of the simulated walk's surroundings: each tile has two streets and a lake."""
    streets = (
        vector_tiles.feature("line", [[(0, 1000), (4096, 1200)]]),
        vector_tiles.feature("line", [[(1500, 0), (1400, 4096)]]),
    )
    lake = vector_tiles.feature("polygon", [[(2000, 2000), (3600, 2000), (3600, 3600)]])
    tile = vector_tiles.layer("roads", streets) + vector_tiles.layer("water", [lake])
    tiles = {}
    for zoom in (13, 14, 15, 16):
        x, y = vector_tiles.tile_at(ORIGIN_LAT_DEG, ORIGIN_LON_DEG, zoom)
        tiles |= {(zoom, x + i, y + j): tile for i in range(-4, 5) for j in range(-4, 5)}
    return vector_tiles.write_pmtiles(path, tiles)


def test_the_plan_lies_on_a_map_that_is_on_the_pi(tmp_path, monkeypatch, phone):
    if "maplibre-gl.mjs" not in assets(with_map=True):
        pytest.skip("the programs of the map are missing (make page-map)")
    ground = _ground(tmp_path / "ground.pmtiles")
    with kit.recorded_page(tmp_path, monkeypatch, ground=ground) as (page, start):
        with start() as logger:
            phone.open(page)
            lake = "return document.querySelector('#ground canvas') !== null"
            service.wait_for(lambda: phone.chromium.evaluate(lake), 60)
            phone.tap("#near")
            phone.chromium.evaluate("document.getElementById('near').scrollIntoView(false)")
            service.wait_for(lambda: _is_lake_visible(phone), 60)
            if folder := os.environ.get("CELLWALK_SCREENSHOTS"):
                picture = phone.driver.get_screenshot_as_png()
                (Path(folder) / "page-map-light.png").write_bytes(picture)
            urls = phone.chromium.requested_urls()
            assert all(url.startswith((page.address, "blob:")) for url in urls)
            # a machine without a graphics card draws in software, and says so
            messages = [m for m in phone.chromium.console_messages() if "WebGL" not in m]
            assert messages == []
            assert phone.chromium.accessibility_violations(axe_core()) == []
            service.stop_service(logger)


def _is_lake_visible(phone):
    """A quarter of --cell on white, without what is drawn over it."""
    plan = "document.getElementById('plan').style.visibility"
    phone.chromium.evaluate(f"{plan} = 'hidden'")
    picture = phone.driver.get_screenshot_as_png()
    phone.chromium.evaluate(f"{plan} = 'visible'")
    return count_pixels(picture, (191, 217, 232), off=4) > 300


@pytest.mark.skipif("CELLWALK_SCREENSHOTS" not in os.environ, reason="make screenshots")
def test_screenshots(recorded_walk, phone, tmp_path):
    """What docs/guide/page.md shows: a walk that is ambiguous, then located, then in trouble."""
    page, start = recorded_walk
    folder = Path(os.environ["CELLWALK_SCREENSHOTS"])
    folder.mkdir(parents=True, exist_ok=True)
    status = tmp_path / "cellwalk/status.json"

    def position():
        return json.loads(status.read_text())["position"] or {"verdict": "", "modes": []}

    def save(name, theme):
        phone.choose(theme)
        time.sleep(0.6)
        (folder / f"page-{name}-{theme}.png").write_bytes(phone.driver.get_screenshot_as_png())

    with start() as logger:
        service.wait_for(status.exists, 60)
        phone.open(page)
        service.wait_for(lambda: len(position()["modes"]) > 1, 120)
        save("ambiguous", "light")
        save("ambiguous", "night")
        service.wait_for(lambda: position()["verdict"] == "located", 120)
        save("located", "light")
        save("located", "dark")
        logger.kill()
        logger.wait()
    service.wait_for(lambda: phone.sign == "trouble", 20)
    save("trouble", "light")
    save("trouble", "night")
