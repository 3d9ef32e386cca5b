"""Sets a modem to GSM only if the configuration asks for it, and restores its mode.

The commands are in `logger.drivers.network_mode`.

The value before is durable before anything is changed. It is set back at the stop, or at the next
start where the stop did not come or the modem had gone; whether the setting is still on or not.
"""

from collections.abc import Callable

from logger.core.types import Level
from logger.device.link import Link
from logger.device.saved_modes import KeptMode, KeptModes
from logger.device.shutdown import AfterStop
from logger.drivers.family import Family, wake
from logger.drivers.network_mode import ModeCommand, ask_model, read_mode, same_mode, set_mode
from logger.drivers.protocols.dialogue import Command, Reply, run_dialogue

Ask = Callable[[Command], Reply]

RESTORE_S = 20.0
"""Real seconds that a stop leaves for it; systemd leaves 60 for all of the stop."""
_TRIES = 3
ADVICE = "the next start tries again, or set it by hand"


class ModeSwitch:
    """For one connection with one modem; each note is written once."""

    def __init__(self, link: Link, kept: KeptModes, *, gsm_only: bool) -> None:
        self._link = link
        self._kept = kept
        self._gsm_only = gsm_only
        self._noted: set[str] = set()
        self._tries_left = 0

    def renew(self) -> None:
        """The modem has been set up anew, and may have forgotten what it hears."""
        self._tries_left = _TRIES

    def settle(self, driver: Family, ask: Ask) -> None:
        """GSM only if it is wanted, else as before if an earlier run changed it.

        To be called between two polls: it does nothing once that is done, or was tried some times.
        """
        if not self._tries_left:
            return
        try:
            is_done = self._settle(driver, ask)
        except OSError as error:
            is_done = True
            self._note_unchanged(f"what it is cannot be kept: {error.strerror or error}")
        self._tries_left = 0 if is_done else self._tries_left - 1

    def set_back(self, driver: Family | None, modem: AfterStop) -> None:
        """At the stop: as it was before.

        The stop may have come in the middle of anything, which the modem is let finish; what does
        not succeed then is tried again.
        """
        try:
            if driver is None or not self._kept.all():
                return
            for _ in range(_TRIES):
                modem.drain()
                if self._set_back(driver, modem.ask):
                    return
        except OSError as error:
            self._note(
                "warning", "mode-left", f"the modem is not set back: {error.strerror or error}"
            )

    def _set_back(self, driver: Family, ask: Ask) -> bool:
        """Whether nothing is left to do."""
        name = run_dialogue(ask_model(), ask) if run_dialogue(wake(), ask) else None
        if name is None:
            return False
        entry = self._kept.of(driver.name, name)
        return entry is None or self._restore(driver, entry, ask)

    def _settle(self, driver: Family, ask: Ask) -> bool:
        """Whether nothing is left to do; what has failed may succeed the next time."""
        kept = self._kept.all()
        if self._gsm_only and not driver.mode_commands:
            self._note_unchanged(f"driver {driver.name} has no command for GSM only")
            return True
        if not self._gsm_only and not kept:
            return True
        name = run_dialogue(ask_model(), ask)
        if name is None:
            self._note_unchanged("the modem does not say which model it is (AT+CGMM)")
            return False
        entry = self._kept.of(driver.name, name)
        if self._gsm_only:
            return self._change(driver, name, entry, ask)
        if entry is not None:
            is_done = self._restore(driver, entry, ask)
            if not is_done and not self._link.stop.is_set():
                self._note("warning", "mode-left", f"{name} does not take {entry.value}; {ADVICE}")
            return is_done
        waiting = ", ".join(one.model for one in kept)
        text = (
            f"not for this modem: {waiting} was left on GSM only, and is set back when it is here"
        )
        self._note("info", "mode-kept", text)
        return True

    def _change(self, driver: Family, name: str, entry: KeptMode | None, ask: Ask) -> bool:
        found = run_dialogue(read_mode(driver.mode_commands), ask)
        if found is None:
            asks = " and ".join(command.query for command in driver.mode_commands)
            self._note_unchanged(f"the modem does not tell what it is ({asks})")
            return False
        command, value = found
        if command.is_gsm(value):
            text = f"the modem hears GSM only by itself ({command.query})"
            if entry is not None:
                text = (
                    f"the modem hears GSM only; it was {entry.value}, and is set back at the stop"
                )
            self._note("info", "mode-gsm", text)
            return True
        # durable first: whatever happens from here on, the next start knows what it was
        self._kept.keep(KeptMode(driver.name, name, command.query, value))
        now = run_dialogue(set_mode(command, command.gsm_only), ask)
        sent = command.set_to(command.gsm_only)
        if now is not None and command.is_gsm(now):
            text = f"{sent}: the modem hears GSM only; it was {value}, and is set back at the stop"
            self._note("info", "mode-set", text)
            return True
        if now is not None and same_mode(now, value):
            self._kept.drop(driver.name, name)
            self._note_unchanged(f"the modem refuses {sent}")
            return True
        self._note_unchanged(f"no answer to {sent}; it was {value}, and is set back at the stop")
        return False

    def _restore(self, driver: Family, entry: KeptMode, ask: Ask) -> bool:
        """Whether the modem is as it was, or as its owner has set it since."""
        command = _command(driver, entry)
        if command is None:
            setting = f"{entry.asks} {entry.value!r}"
            text = f"{self._kept.path}: {setting} is no mode of this modem; remove it"
            self._note("warning", "mode-left", text)
            return True
        found = run_dialogue(read_mode([command]), ask)
        if found is not None and not command.is_gsm(found[1]):
            text = (
                f"the modem is on {found[1]} and no longer on GSM only ({command.query}): left so"
            )
        else:
            now = run_dialogue(set_mode(command, entry.value), ask)
            if now is None or not same_mode(now, entry.value):
                return False
            text = f"{command.set_to(entry.value)}: the modem is as it was before GSM only"
        self._kept.drop(entry.driver, entry.model)
        self._note("info", "mode-restored", text)
        return True

    def _note_unchanged(self, why: str) -> None:
        if not self._link.stop.is_set():  # else it was not asked to the end
            self._note("warning", "mode-unchanged", f"what the modem hears is not changed: {why}")

    def _note(self, level: Level, code: str, text: str) -> None:
        if text not in self._noted:
            self._noted.add(text)
            self._link.note(level, code, text)


def _command(driver: Family, entry: KeptMode) -> ModeCommand | None:
    """The command of an entry; None where the file names another, or a value that is none."""
    known = (command for command in driver.mode_commands if command.query == entry.asks)
    return next((command for command in known if command.is_value(entry.value)), None)


def left_changed(kept: KeptModes, drivers: Callable[[str], Family | None]) -> str:
    """What the stop could not set back, in words; empty where there is nothing."""
    try:
        entries = kept.all()
    except OSError as error:
        return str(error)
    texts = []
    for entry in entries:
        driver = drivers(entry.driver)
        command = None if driver is None else _command(driver, entry)
        hand = f" ({command.set_to(entry.value)})" if command else ""
        texts.append(f"{entry.model} is still on GSM only; {ADVICE}{hand}")
    return "; ".join(texts)
