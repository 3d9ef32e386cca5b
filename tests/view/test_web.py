"""The served viewer in a real browser: it shows the walk and calls no other machine."""

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
"""West end, east end and height of the time bar, in pixels of that page."""
TIMEOUT_S = 180.0
PLAN = (0.0, 0.4)
"""Of the page's width; farther east is the key."""


class Address(str):
    """A URL in place of a path."""

    __slots__ = ()

    def as_uri(self):
        return str(self)


class Page:
    """The viewer in a browser."""

    def __init__(self, chromium, address):
        self.chromium, self.driver, self.address = chromium, chromium._driver, address
        self.driver.set_page_load_timeout(TIMEOUT_S)
        self.driver.set_script_timeout(TIMEOUT_S)
        chromium.open(Address(address), width=WIDTH, dark=True)
        self.wait(
            lambda: chromium.evaluate(
                "return typeof window._handle === 'object' && !window._handle.has_panicked()"
            )
        )

    def wait(self, holds):
        until = time.monotonic() + TIMEOUT_S
        while not holds():
            assert time.monotonic() < until, "it never happens"
            time.sleep(0.5)

    def screenshot(self):
        return self.driver.get_screenshot_as_png()

    def stable_screenshot(self):
        """A screenshot that no longer changes."""
        seen = [b""]

        def is_stable():
            seen.append(self.screenshot())
            return seen[-1] == seen[-2]

        self.wait(is_stable)
        return seen[-1]

    def look_at(self, share):
        """Click into the time bar: the page offers no other access to the cursor."""
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
def web_viewer(tmp_path_factory):
    folder = tmp_path_factory.mktemp("web")
    result = kit.sample_result(kit.write_run(folder / "walk.journal", seconds=240, cells=4))
    write_scene(sample_view(result), folder / "walk.rrd", online=False)
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


def test_it_shows_the_walk_and_calls_no_other_machine(web_viewer, chromium):
    page = Page(chromium, web_viewer.address)
    page.wait(lambda: not missing_items(page.screenshot(), within=PLAN))
    # on a busy machine the key is there before the regions, and a click may find no frame
    page.wait(lambda: outline(page.stable_screenshot()) > 0)
    late = outline(page.stable_screenshot())
    page.wait(lambda: page.look_at(1 / 3) or outline(page.screenshot()) > 1.5 * late)
    # a request to another machine is answered within the page
    fetch = "return fetch('https://tel.example/').then(answer => answer.status)"
    assert chromium.evaluate(fetch) == 204
    urls = chromium.requested_urls()
    assert any(url.endswith("/run.rrd") for url in urls)
    assert all(url.startswith(web_viewer.address) for url in urls)
    assert page.errors() == []


def test_an_empty_page_and_an_external_request_are_detected(web_viewer, chromium):
    """The negative control: no recording, and an image from another machine."""
    page = Page(chromium, web_viewer.address + "?hide_welcome_screen&persist=0")
    time.sleep(3.0)
    assert len(missing_items(page.screenshot(), within=PLAN)) > 3
    script = "const image = new Image(); document.body.append(image);"
    chromium.evaluate(f"{script} image.src = 'https://192.0.2.1/x.png'")
    page.wait(page.errors)
    assert any("192.0.2.1" in url for url in chromium.requested_urls())
