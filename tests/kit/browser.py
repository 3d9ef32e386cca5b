"""A headless Chromium, and what can be asked of a page in it."""

import base64
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

_OVERFLOWING = """
const wide = document.documentElement.clientWidth, found = [];
if (document.documentElement.scrollWidth > wide) found.push('page');
for (const e of document.body.querySelectorAll('*')) {
  if (e.closest('.scroll') && !e.matches('.scroll')) continue;
  const r = e.getBoundingClientRect();
  if (r.width > 1 && (r.right > wide + 1 || r.left < -1)) found.push(e.tagName + ' ' + e.className);
}
return found;
"""
_AXE = """
const done = arguments[arguments.length - 1];
const told = v => ({id: v.id, impact: v.impact, help: v.help, nodes: v.nodes.map(n => n.html.slice(0, 200))});
axe.run(document, {resultTypes: ['violations']}).then(r => done(r.violations.map(told)), e => done(String(e)));
"""


class Browser:
    """One page at a time, seen on a screen of any size, in light or in darkness."""

    def __init__(self, driver) -> None:
        self._driver = driver

    def open(self, path: Path, *, width: int, dark: bool) -> None:
        """Show a file; what the console and the network said before is forgotten."""
        feature = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
        screen = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
        self._driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
        for log in ("browser", "performance"):
            self._driver.get_log(log)
        self._driver.get(path.as_uri())

    def ask(self, script: str):
        """What a script returns."""
        return self._driver.execute_script(script)

    def overflowing(self) -> list[str]:
        """Elements that reach out of the screen, those in boxes that scroll excepted."""
        return self.ask(_OVERFLOWING)

    def requested(self) -> list[str]:
        """Addresses asked for since the page was opened, its own file and data within it
        excepted.
        """
        told = [
            json.loads(entry["message"])["message"] for entry in self._driver.get_log("performance")
        ]
        asked = [
            one["params"]["request"]["url"]
            for one in told
            if one["method"] == "Network.requestWillBeSent"
        ]
        entries = self.ask("return performance.getEntriesByType('resource').map(e => e.name)")
        own = self._driver.current_url
        return [
            url
            for url in (*asked, *entries)
            if not url.startswith("data:") and url.split("#")[0] != own
        ]

    def complaints(self) -> list[str]:
        """Warnings and errors of the console since the page was opened."""
        return [
            one["message"]
            for one in self._driver.get_log("browser")
            if one["level"] in {"WARNING", "SEVERE"}
        ]

    def barriers(self, axe: Path) -> list[dict]:
        """Findings of axe-core but for the minor ones."""
        self._driver.execute_script(axe.read_text("utf-8"))
        found = self._driver.execute_async_script(_AXE)
        assert isinstance(found, list), found
        return [one for one in found if one["impact"] in {"moderate", "serious", "critical"}]

    def picture(self) -> bytes:
        """The whole page as PNG."""
        return base64.b64decode(
            self._driver.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True})[
                "data"
            ]
        )

    def printed(self) -> bytes:
        """The page as PDF."""
        return base64.b64decode(self._driver.execute_cdp_cmd("Page.printToPDF", {})["data"])


@contextmanager
def browser() -> Iterator[Browser]:
    """Start Chromium; skips where it, its driver or selenium is missing."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    program, driver = (shutil.which(name) for name in ("chromium", "chromedriver"))
    if program is None or driver is None:
        pytest.skip(
            "chromium and chromedriver are missing (Debian: apt-get install chromium chromium-driver)"
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
    started = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    try:
        yield Browser(started)
    finally:
        started.quit()


def axe_core() -> Path:
    """axe.min.js of the npm package axe-core; skips where CELLWALK_AXE does not name it."""
    named = os.environ.get("CELLWALK_AXE", "")
    if not Path(named).is_file():
        pytest.skip("CELLWALK_AXE does not name axe.min.js (npm install axe-core)")
    return Path(named)
