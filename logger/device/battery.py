"""Batteries and UPS boards, as the kernel shows them: read only, nothing is switched.

Sources: Documentation/ABI/testing/sysfs-class-power of Linux (capacity in percent, voltage_now in
microvolts, current_now in microamperes, scope `Device` for a battery of a mouse), and
Documentation/hwmon/ina2xx.rst (in1_input is the bus voltage in millivolts, curr1_input the current
in milliamperes). A board that only a program of its own can read, such as a PiSugar, is not seen.
"""

import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event

import msgspec

from logger.config import PowerSettings
from logger.core.types import Note
from logger.device.machine import SYS, kernel_number, kernel_text
from logger.device.notify import ServiceManager

log = logging.getLogger(__name__)

SENSORS = frozenset({"ina219", "ina220", "ina226", "ina230", "ina231"})
"""Names of hwmon devices on UPS boards, which know no percentage."""

LOOK_EVERY_S = 10.0
_LOW_LOOKS = 3
"""A modem that transmits pulls the voltage down for a moment."""
_NOTE_PERCENT, _NOTE_VOLTS = 10.0, 0.25
"""A change since the last note that makes another one."""
_RISE_PERCENT, _RISE_VOLTS = 5.0, 0.2
"""So far above the limit a battery may be used again: a relieved one rises by itself."""


class Battery(msgspec.Struct, frozen=True):
    """One battery or sensor now; `state` is in the kernel's words, such as "discharging".

    What is unknown is None. The sign of the current is that of the wiring.
    """

    name: str
    percent: float | None = None
    volts: float | None = None
    amperes: float | None = None
    state: str | None = None

    def __str__(self) -> str:
        percent = None if self.percent is None else f"{self.percent:.0f} %"
        volts = None if self.volts is None else f"{self.volts:.2f} V"
        amperes = None if self.amperes is None else f"{self.amperes:.2f} A"
        values = [text for text in (percent, volts, amperes, self.state) if text]
        return f"{self.name}: {', '.join(values) or 'says nothing'}"

    @property
    def has_supply(self) -> bool:
        """Whether a charger is known to be connected."""
        return self.state in {"charging", "full", "not charging"}


def batteries(sys: Path = SYS) -> list[Battery]:
    """All batteries of the machine, those with a percentage first."""
    supplies = [_supply(folder) for folder in sorted(sys.glob("class/power_supply/*"))]
    sensors = [_sensor(folder) for folder in sorted(sys.glob("class/hwmon/hwmon*"))]
    seen = [battery for battery in (*supplies, *sensors) if battery is not None]
    return sorted(seen, key=lambda battery: battery.percent is None)


def _supply(folder: Path) -> Battery | None:
    if (
        kernel_text(folder / "type") not in {"Battery", "UPS"}
        or kernel_text(folder / "scope") == "Device"
    ):
        return None
    if kernel_text(folder / "present") == "0":
        return None
    percent = kernel_number(folder / "capacity")
    volts, amperes = kernel_number(folder / "voltage_now"), kernel_number(folder / "current_now")
    state = (kernel_text(folder / "status") or "unknown").lower()
    return Battery(
        folder.name,
        percent if percent is not None and 0.0 <= percent <= 100.0 else None,
        None if volts is None else volts / 1e6,
        None if amperes is None else amperes / 1e6,
        None if state == "unknown" else state,
    )


def _sensor(folder: Path) -> Battery | None:
    name = kernel_text(folder / "name")
    millivolts = kernel_number(folder / "in1_input")
    if name not in SENSORS or millivolts is None:
        return None
    milliamperes = kernel_number(folder / "curr1_input")
    return Battery(
        name,
        volts=millivolts / 1e3,
        amperes=None if milliamperes is None else milliamperes / 1e3,
    )


def is_low(battery: Battery, settings: PowerSettings, rise: bool = False) -> bool:
    """Whether a battery is below a limit of the settings, and nothing is known to charge it.

    With `rise` the limits are those above which a stopped recording begins again.
    """
    if battery.has_supply:
        return False
    percent, volts = settings.stop_percent, settings.stop_volts
    if battery.percent is not None and percent:
        return battery.percent <= percent + (_RISE_PERCENT if rise else 0.0)
    if battery.volts is not None and volts:
        return battery.volts <= volts + (_RISE_VOLTS if rise else 0.0)
    return False


class BatteryWatch:
    """Looks at the batteries from time to time; `now_s` is any steady clock in real seconds."""

    def __init__(
        self, settings: PowerSettings, now_s: Callable[[], float], sys: Path = SYS
    ) -> None:
        self._settings = settings
        self._now_s = now_s
        self._sys = sys
        self._next_s = now_s()
        self._noted: dict[str, Battery] = {}
        self._low_looks = 0
        self.latest: Battery | None = None
        self.low = ""

    def look(self) -> Iterator[Note]:
        """Read the batteries when it is time; yield what is worth a note.

        `low` is the reason to stop, once a battery was low several times.
        """
        if self._now_s() < self._next_s:
            return
        self._next_s = self._now_s() + LOOK_EVERY_S
        seen = batteries(self._sys)
        self.latest = seen[0] if seen else None
        yield from (self._note(battery) for battery in seen if self._is_news(battery))
        low = next((battery for battery in seen if is_low(battery, self._settings)), None)
        self._low_looks = 0 if low is None else self._low_looks + 1
        if low is not None and self._low_looks == _LOW_LOOKS:
            self.low = f"battery low: {low}"
            yield Note("warning", "battery-low", f"{low}: the run is closed")

    def _is_news(self, battery: Battery) -> bool:
        before = self._noted.get(battery.name)
        return (
            before is None
            or before.state != battery.state
            or _differ(before.percent, battery.percent, _NOTE_PERCENT)
            or (battery.percent is None and _differ(before.volts, battery.volts, _NOTE_VOLTS))
        )

    def _note(self, battery: Battery) -> Note:
        self._noted[battery.name] = battery
        return Note("info", "battery", str(battery))


def _differ(before: float | None, now: float | None, least: float) -> bool:
    if before is None or now is None:
        return before is not now
    return abs(now - before) >= least


def too_low_to_begin(settings: PowerSettings, sys: Path = SYS) -> str:
    """Why recording has to wait for a charger; empty if it may begin."""
    if not (settings.stop_percent or settings.stop_volts):
        return ""
    low = next((b for b in batteries(sys) if is_low(b, settings, rise=True)), None)
    return "" if low is None else f"waiting for a charger: {low}"


def wait_for_charger(
    settings: PowerSettings, manager: ServiceManager, ended: Event, sys: Path = SYS
) -> None:
    """Wait until the battery allows to record, or `ended`; feeds systemd's watchdog."""
    reason = ""
    while not ended.is_set() and (now := too_low_to_begin(settings, sys)):
        if not reason:
            log.warning("%s", now)
        reason = now
        manager.alive()
        manager.status(reason)
        ended.wait(LOOK_EVERY_S)
