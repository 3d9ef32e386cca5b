"""The served viewer in a real browser: the walk is on the canvas, and nothing leaves the
machine.
"""

import signal
import time

import pytest

from postproc.pictures import colours
from postproc.view.scene import write_scene
from tests.kit import sample_results as kit
from tests.kit.browser import browser
from tests.kit.sample_view import sample_view
from tests.kit.screenshots import count_pixels, missing_items
from tests.kit.web_server import WebServer

pytestmark = pytest.mark.slow

WIDTH = 1280
TIME_BAR = (255, 1051, 886)
"""West, east and height of the bar of time, in pixels of that page."""
PATIENCE_S = 180.0
PLAN = (0.0, 0.4)
"""Of the page's width; farther east is the key."""


class Address(str):
    """What a browser opens."""

    __slots__ = ()

    def as_uri(self):
        return str(self)


class Page:
    """The viewer in a browser."""

    def __init__(self, chromium, address):
        self.chromium, self.driver, self.address = chromium, chromium._driver, address
        self.driver.set_page_load_timeout(PATIENCE_S)
        self.driver.set_script_timeout(PATIENCE_S)
        chromium.open(Address(address), width=WIDTH, dark=True)
        self.wait(
            lambda: chromium.evaluate(
                "return typeof window._handle === 'object' && !window._handle.has_panicked()"
            )
        )

    def wait(self, holds):
        until = time.monotonic() + PATIENCE_S
        while not holds():
            assert time.monotonic() < until, "it never happens"
            time.sleep(0.5)

    def screenshot(self):
        return self.driver.get_screenshot_as_png()

    def settled(self):
        """The picture once it no longer changes."""
        seen = [b""]

        def rests():
            seen.append(self.screenshot())
            return seen[-1] == seen[-2]

        self.wait(rests)
        return seen[-1]

    def look_at(self, share):
        """Click into the bar of time; the viewer's page has no other handle to it."""
        west, east, south = TIME_BAR
        for kind, button, pressed in (
            ("Moved", "none", 0),
            ("Pressed", "left", 1),
            ("Released", "left", 0),
        ):
            event = {"type": f"mouse{kind}", "button": button, "buttons": pressed, "clickCount": 1}
            place = {"x": west + share * (east - west), "y": south}
            self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", event | place)
            self.screenshot()  # a frame between the events

    def errors(self):
        return [
            one["message"] for one in self.driver.get_log("browser") if one["level"] == "SEVERE"
        ]


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    folder = tmp_path_factory.mktemp("web")
    found = kit.sample_result(kit.write_run(folder / "walk.journal", seconds=240, cells=4))
    write_scene(sample_view(found), folder / "walk.rrd", online=False)
    running = WebServer(folder / "walk.rrd")
    yield running
    assert running.stop(signal.SIGINT) == 0


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


def outline(png):
    """Pixels of the posterior's regions."""
    return count_pixels(png, colours.POSTERIOR, within=PLAN, off=12)


def test_the_walk_is_on_the_canvas_and_nothing_leaves(served, chromium):
    page = Page(chromium, served.address)
    page.wait(lambda: not missing_items(page.screenshot(), within=PLAN))
    late = outline(page.settled())
    page.look_at(1 / 3)
    page.wait(lambda: outline(page.screenshot()) > 1.5 * late > 0)
    # what the page asks of others is answered on the spot
    assert (
        chromium.evaluate("return fetch('https://tel.example/').then(answer => answer.status)")
        == 204
    )
    asked = chromium.requested_urls()
    assert any(url.endswith("/run.rrd") for url in asked)
    assert {url for url in asked if not url.startswith(served.address)} == set()
    assert page.errors() == []


def test_nothing_is_not_taken_for_a_walk_and_a_request_is_noticed(served, chromium):
    """The negative control: a page without a recording, in which somebody asks another machine for
    a picture.
    """
    page = Page(chromium, served.address + "?hide_welcome_screen&persist=0")
    time.sleep(3.0)
    assert len(missing_items(page.screenshot(), within=PLAN)) > 3
    chromium.evaluate(
        "const image = new Image(); document.body.append(image); image.src = 'https://192.0.2.1/x.png'"
    )
    page.wait(page.errors)
    assert any("192.0.2.1" in url for url in chromium.requested_urls())
