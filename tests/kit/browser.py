"""A headless Chromium, and measurements on a page in it."""

import base64
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
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

    def open(self, path: Path, *, width: int, dark: bool) -> None:
        """Show a file and clear the logs of the console and the network."""
        feature = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
        screen = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
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

    def screenshot(self) -> bytes:
        """The complete page as PNG."""
        return base64.b64decode(
            self._driver.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True})[
                "data"
            ]
        )

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
