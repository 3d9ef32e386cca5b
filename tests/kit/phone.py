"""The page of `fieldlogger page` on a screen of a phone, in a headless Chromium."""

import json

from tests.kit import service

PHONE_PX = 390


class Address(str):
    """A URL in place of a path."""

    __slots__ = ()

    def as_uri(self):
        return str(self)


class Phone:
    """The page on a screen of a phone."""

    def __init__(self, chromium) -> None:
        self.chromium, self.driver = chromium, chromium._driver

    def open(self, page, *, dark=False, width=PHONE_PX):
        self.chromium.open(Address(page.address), width=width, dark=dark)

    def text(self, name):
        return self.chromium.evaluate(f"return document.getElementById('{name}').textContent")

    @property
    def sign(self):
        return self.chromium.evaluate("return document.getElementById('glance').dataset.sign")

    def tap(self, selector):
        self.chromium.evaluate(f"document.querySelector({json.dumps(selector)}).click()")

    def choose(self, theme):
        service.wait_for(lambda: self._theme_is(theme), 20)

    def _theme_is(self, theme):
        if theme in self.text("theme"):
            return True
        self.tap("#theme")
        return False

    def slow_down(self, times):
        """Let the browser's processor be so many times slower."""
        self.driver.execute_cdp_cmd("Emulation.setCPUThrottlingRate", {"rate": times})

    def network(self, **conditions):
        self.driver.execute_cdp_cmd("Network.enable", {})
        known = {"offline": False, "latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
        self.driver.execute_cdp_cmd("Network.emulateNetworkConditions", known | conditions)

    def result_of(self, module, expression):
        """What an expression yields in which `m` is a module of the page."""
        done = "arguments[arguments.length - 1]"
        script = f"const done = {done}; import('./{module}').then(m => done({expression}))"
        script += ".catch(error => done(String(error)))"
        return self.driver.execute_async_script(script)
