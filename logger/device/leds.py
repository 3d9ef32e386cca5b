"""A light for users without a screen, by the kernel's LED class (/sys/class/leds/<name>)."""

import logging
import re
import threading
from itertools import cycle
from pathlib import Path

from logger.core.foreign import read_regular
from logger.device.status import Sign, Status

log = logging.getLogger(__name__)

LEDS = Path("/sys/class/leds")
_MOST_BYTES = 65_536
"""Of the list of triggers, which is longer than a page of memory on some boards."""

FLASHES_S: dict[Sign, tuple[float, ...]] = {
    "recording": (0.1, 1.9),
    "suspicious": (0.1, 0.2, 0.1, 0.2, 0.1, 1.3),
    "no fix": (1.0, 1.0),
    "error": (0.1, 0.1),
}
"""Seconds on and off in turn. Every state blinks, so a crashed program or Pi shows."""


LONG_FLASH_S, PAUSE_S = (0.5, 0.4), 1.6
"""A long flash for each source up to the faulty one, and what follows the last."""


def flashes_of(status: Status) -> tuple[float, ...]:
    """Seconds on and off in turn.

    With more sources than a modem and a receiver, the long flashes count to the first faulty one in
    the configuration.
    """
    # the text names what is worst: a card that takes nothing hides the ports
    ports = enumerate(status.ports.items(), 1)
    said = (k for k, (name, one) in ports if one.fault and f"{name}: {one.fault}" in status.text)
    number = next(said, 0)
    if status.state != "error" or len(status.ports) < 3 or not number:
        return FLASHES_S[status.state]
    return (*LONG_FLASH_S * (number - 1), LONG_FLASH_S[0], PAUSE_S)


class StatusLight:
    """One LED that blinks the state until `close`, which gives it back to the kernel.

    A missing or read-only LED is logged once; the recording goes on. An empty name is no LED.
    """

    def __init__(self, name: str, leds: Path = LEDS) -> None:
        self._folder = leds / name
        self._flashes_s = FLASHES_S["no fix"]
        self._changed = threading.Event()
        self._closed = False
        self._trigger_before = ""
        self._thread = threading.Thread(target=self._blink, name="light", daemon=True)
        if name and self._take():
            self._thread.start()

    def publish(self, status: Status) -> None:
        """Blink the state from now on."""
        flashes_s = flashes_of(status)
        if flashes_s != self._flashes_s:
            self._flashes_s = flashes_s
            self._changed.set()

    def close(self) -> None:
        """Stop blinking and restore the LED's trigger."""
        if self._thread.ident is not None:
            self._closed = True
            self._changed.set()
            self._thread.join()

    def _take(self) -> bool:
        """Take the LED from the kernel, which may use it to show access to the card."""
        trigger = self._folder / "trigger"
        try:
            names = read_regular(trigger, _MOST_BYTES).decode(errors="replace")
            active = re.search(r"\[([^][]+)\]", names)
            self._trigger_before = active[1] if active else "none"
            trigger.write_text("none")
        except OSError as error:
            self._warn(error)
            return False
        return True

    def _blink(self) -> None:
        brightness = self._folder / "brightness"
        try:
            while not self._closed:
                for level, seconds in zip(cycle("10"), cycle(self._flashes_s), strict=False):
                    brightness.write_text(level)
                    if self._changed.wait(seconds):
                        break
                self._changed.clear()
            (self._folder / "trigger").write_text(self._trigger_before)
        except OSError as error:
            self._warn(error)

    def _warn(self, error: OSError) -> None:
        log.warning("[status] led: %s: %s", self._folder, error.strerror)
