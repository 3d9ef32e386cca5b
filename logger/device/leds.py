"""A light for somebody without a screen, through the kernel's LED class
(/sys/class/leds/<name>).
"""

import logging
import re
import threading
from itertools import cycle
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

log = logging.getLogger(__name__)

LEDS = Path("/sys/class/leds")

Sign = Literal["recording", "no fix", "error"]

FLASHES_S: dict[Sign, tuple[float, float]] = {
    "recording": (0.1, 1.9),
    "no fix": (1.0, 1.0),
    "error": (0.1, 0.1),
}
"""Seconds on and off.

No sign is a steady light or none, so that a dead program or Pi is never taken for one.
"""


class Lamp:
    """One LED, blinking while the context lasts, and then what it was before.

    An LED that is not there or may not be written is told once in the log, and the walk goes on
    without.
    """

    def __init__(self, name: str, leds: Path = LEDS) -> None:
        self._folder = leds / name if name else None
        self._sign: Sign = "no fix"
        self._changed = threading.Event()
        self._ended = False
        self._before = ""
        self._thread = threading.Thread(target=self._blink, name="lamp", daemon=True)

    def __enter__(self) -> Self:
        if self._folder is not None and self._take(self._folder):
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._thread.ident is not None:
            self._ended = True
            self._changed.set()
            self._thread.join()

    def show(self, sign: Sign) -> None:
        """Blink so from now on."""
        if sign != self._sign:
            self._sign = sign
            self._changed.set()

    def _take(self, folder: Path) -> bool:
        """Take the LED from the kernel, which uses it for the card, say."""
        try:
            chosen = re.search(r"\[(.+?)\]", (folder / "trigger").read_text())
            self._before = chosen[1] if chosen else "none"
            (folder / "trigger").write_text("none")
        except OSError as error:
            log.warning("[status] led: %s: %s", folder, error.strerror)
            return False
        return True

    def _blink(self) -> None:
        assert self._folder is not None
        brightness, trigger = self._folder / "brightness", self._folder / "trigger"
        try:
            while not self._ended:
                for level, seconds in cycle(zip(("1", "0"), FLASHES_S[self._sign], strict=True)):
                    brightness.write_text(level)
                    if self._changed.wait(seconds):
                        break
                self._changed.clear()
            trigger.write_text(self._before)
        except OSError as error:
            log.warning("[status] led: %s: %s", self._folder, error.strerror)
