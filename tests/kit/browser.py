"""A headless Chromium, and measurements on a page in it."""

import base64
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import pytest

_OVERFLOWING = """
const width = document.documentElement.clientWidth, names = [];
if (document.documentElement.scrollWidth > width) names.push('page');
for (const e of document.body.querySelectorAll('*')) {
  if (e.closest('.scroll') && !e.matches('.scroll')) continue;
  const r = e.getBoundingClientRect();
  const outside = r.right > width + 1 || r.left < -1;
  if (r.width > 1 && outside) names.push(e.tagName + ' ' + e.className);
}
return names;
"""
_SMALLEST_TEXT = """
let least = [1e9, ''];
const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (texts.nextNode()) {
  const text = texts.currentNode, parent = text.parentElement;
  const box = parent.getBoundingClientRect();
  if (!text.data.trim() || box.width < 2 || parent.closest('title, .unseen')) continue;
  const m = parent.getScreenCTM ? parent.getScreenCTM() : null;
  const scale = m ? Math.hypot(m.a, m.b) : 1;
  const size = parseFloat(getComputedStyle(parent).fontSize) * scale;
  if (size < least[0]) least = [size, text.data.trim()];
}
return least;
"""
_AXE = """
const done = arguments[arguments.length - 1];
const summary = v => ({
  id: v.id, impact: v.impact, help: v.help, nodes: v.nodes.map(n => n.html.slice(0, 200))
});
axe.run(document, {resultTypes: ['violations']}).then(
  r => done(r.violations.map(summary)), e => done(String(e))
);
"""


class Browser:
    """One page at a time, on a screen of any width, in the light or dark colour scheme."""

    def __init__(self, driver) -> None:
        self._driver = driver

    def open(self, path: Path, *, width: int, dark: bool, height: int = 900) -> None:
        """Show a file and clear the logs of the console and the network."""
        feature = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        media = {"media": "", "features": [feature]}
        self._driver.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
        screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        self._driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
        for log in ("browser", "performance"):
            self._driver.get_log(log)
        self._driver.get(path.as_uri())

    def evaluate(self, script: str):
        """Run a script in the page and return its result."""
        return self._driver.execute_script(script)

    def overflowing_elements(self) -> list[str]:
        """Elements wider than the screen, except those inside boxes that scroll."""
        return self.evaluate(_OVERFLOWING)

    def requested_urls(self) -> list[str]:
        """Addresses requested since the page was opened, except its own file and data URLs."""
        messages = [
            json.loads(entry["message"])["message"] for entry in self._driver.get_log("performance")
        ]
        requests = [
            message["params"]["request"]["url"]
            for message in messages
            if message["method"] == "Network.requestWillBeSent"
        ]
        entries = self.evaluate("return performance.getEntriesByType('resource').map(e => e.name)")
        own = self._driver.current_url
        return [
            url
            for url in (*requests, *entries)
            if not url.startswith("data:") and url.split("#")[0] != own
        ]

    def console_messages(self) -> list[str]:
        """Warnings and errors of the console since the page was opened."""
        return [
            entry["message"]
            for entry in self._driver.get_log("browser")
            if entry["level"] in {"WARNING", "SEVERE"}
        ]

    def accessibility_violations(self, axe: Path) -> list[dict]:
        """Violations that axe-core reports, except the minor ones."""
        self._driver.execute_script(axe.read_text("utf-8"))
        violations = self._driver.execute_async_script(_AXE)
        assert isinstance(violations, list), violations
        return [v for v in violations if v["impact"] in {"moderate", "serious", "critical"}]

    def screenshot(self, *, whole: bool = True) -> bytes:
        """The complete page as PNG, or what the screen shows of it."""
        how = {"captureBeyondViewport": whole}
        return base64.b64decode(self._driver.execute_cdp_cmd("Page.captureScreenshot", how)["data"])

    def keep_screen(self, path: Path) -> None:
        """Write what the screen shows, in few colours: a third of the bytes."""
        from PIL import Image

        picture = Image.open(BytesIO(self.screenshot(whole=False))).convert("RGB")
        picture.quantize(96).save(path, optimize=True)

    def box(self, selector: str) -> dict[str, float]:
        """Where an element is on the screen."""
        rect = f"document.querySelector('{selector}').getBoundingClientRect()"
        return self.evaluate(f"return {rect}.toJSON()")

    def off_screen(self, selectors) -> list[str]:
        """Those of some elements that are not wholly on the screen, or have no size."""
        width, height = self.evaluate("return [innerWidth, innerHeight]")
        boxes = {selector: self.box(selector) for selector in selectors}
        return [
            selector
            for selector, box in boxes.items()
            if box["top"] < 0 or box["left"] < 0 or box["right"] > width + 1
            or box["bottom"] > height or not box["width"] * box["height"]
        ]  # fmt: skip

    def open_all(self) -> None:
        """Open everything that is folded."""
        self.evaluate("for (const one of document.querySelectorAll('details')) one.open = true")

    def smallest_text(self) -> tuple[float, str]:
        """Pixels of the smallest text that has a size, in HTML and in pictures, and the text."""
        return tuple(self.evaluate(_SMALLEST_TEXT))

    def show_as_printed(self) -> None:
        """Use the style sheet of print on the screen, until a page is opened."""
        self._driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})

    def pdf(self) -> bytes:
        """The page as PDF."""
        return base64.b64decode(self._driver.execute_cdp_cmd("Page.printToPDF", {})["data"])


@contextmanager
def browser() -> Iterator[Browser]:
    """Start Chromium; skips where it, its driver or selenium is missing."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    program, driver = (shutil.which(name) for name in ("chromium", "chromedriver"))
    if program is None or driver is None:
        pytest.skip(
            "chromium and chromedriver are missing "
            "(Debian: apt-get install chromium chromium-driver)"
        )
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for argument in (
        "headless=new",
        "no-sandbox",
        "disable-gpu",
        "disable-dev-shm-usage",
        "hide-scrollbars",
    ):
        options.add_argument(f"--{argument}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    chrome = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    try:
        yield Browser(chrome)
    finally:
        chrome.quit()


def axe_core() -> Path:
    """axe.min.js of the npm package axe-core; skips where CELLWALK_AXE does not name it."""
    path = os.environ.get("CELLWALK_AXE", "")
    if not Path(path).is_file():
        pytest.skip("CELLWALK_AXE does not name axe.min.js (npm install axe-core)")
    return Path(path)
