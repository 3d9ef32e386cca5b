"""Sets a modem to GSM only if it is so configured, and restores its mode.

The commands are in `logger.drivers.network_mode`.

The previous value is on the card before the mode is changed, in a file beside the runs with an
entry for each source and model. It is restored at the stop, or at the next start if there was no
stop or the modem was unplugged, also if the option is then off.
"""

import threading
from collections.abc import Callable, Iterable
from pathlib import Path

import msgspec

from logger.core.foreign import decode_json, read_regular
from logger.core.runfile.journal import sync_folder, write_durably
from logger.core.types import Level
from logger.device.link import Link
from logger.device.modem_exchange import AfterStop
from logger.drivers.family import Family, wake
from logger.drivers.network_mode import ModeCommand, ask_model, read_mode, same_mode, set_mode
from logger.drivers.protocols.at import Command, Reply, run_dialogue

FILE = "modem-modes.json"
_MOST_BYTES = 1 << 20
"""An entry has 200 bytes."""
_ONE_AT_A_TIME = threading.RLock()
"""Several modems change the file."""
Ask = Callable[[Command], Reply]

RESTORE_S = 20.0
"""Real seconds that a stop allows for it; systemd allows 60 for the complete stop."""
_TRIES = 3
ADVICE = "the next start tries again, or set it by hand"


class SavedMode(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The answer `value` of a modem to the command `asks`, before the logger changed it.

    `source` is the modem's name in the configuration; empty, in files of earlier versions, is any.
    """

    driver: str
    model: str
    asks: str
    value: str
    source: str = ""


class SavedModes:
    """The entries in a folder. Raises OSError if the file cannot be read or written."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.path = folder / FILE

    def all(self) -> tuple[SavedMode, ...]:
        try:
            text = read_regular(self.path, _MOST_BYTES)
            return decode_json(text, tuple[SavedMode, ...])
        except FileNotFoundError:
            return ()
        except msgspec.DecodeError as error:
            raise OSError(f"{self.path} is damaged ({error}); repair or remove it") from None

    def of_source(self, source: str) -> tuple[SavedMode, ...]:
        """The entries that may be of a modem with this name."""
        return tuple(mode for mode in self.all() if mode.source in {"", source})

    def save(self, entry: SavedMode) -> None:
        """Make an entry durable, replacing one for the same modem."""
        with _ONE_AT_A_TIME:
            self._write([*self._others(entry), entry])

    def drop(self, entry: SavedMode) -> None:
        """Remove the entry of a modem whose mode is restored."""
        with _ONE_AT_A_TIME:
            self._write(self._others(entry))

    def _others(self, entry: SavedMode) -> list[SavedMode]:
        key = entry.driver, entry.model, entry.source
        return [mode for mode in self.all() if (mode.driver, mode.model, mode.source) != key]

    def _write(self, entries: Iterable[SavedMode]) -> None:
        saved = list(entries)
        if saved:
            write_durably(self.path, msgspec.json.format(msgspec.json.encode(saved), indent=1))
        else:
            self.path.unlink(missing_ok=True)
            sync_folder(self._folder)


class ModeSwitch:
    """For one connection with one modem; each note is written once."""

    def __init__(self, link: Link, saved: SavedModes, *, gsm_only: bool) -> None:
        self._link = link
        self._saved = saved
        self._gsm_only = gsm_only
        self._noted: set[str] = set()
        self._tries_left = 0

    def renew(self) -> None:
        """Note that the modem was set up again: it may have lost its mode."""
        self._tries_left = _TRIES

    def settle(self, driver: Family, ask: Ask) -> None:
        """Set GSM only if configured, else restore the mode that an earlier run changed.

        Call it between two polls; it does nothing after success or several attempts.
        """
        if not self._tries_left:
            return
        try:
            is_done = self._settle(driver, ask)
        except OSError as error:
            is_done = True
            self._note_unchanged(f"the present mode cannot be saved: {error.strerror or error}")
        self._tries_left = 0 if is_done else self._tries_left - 1

    def set_back(self, driver: Family | None, modem: AfterStop) -> None:
        """Restore the mode at the stop, in several attempts.

        The stop may have interrupted a command, whose reply is awaited first.
        """
        try:
            if driver is None or not self._saved.of_source(self._link.name):
                return
            for _ in range(_TRIES):
                modem.drain()
                if self._set_back(driver, modem.ask):
                    return
        except OSError as error:
            self._note(
                "warning",
                "mode-left",
                f"the mode of the modem is not restored: {error.strerror or error}",
            )

    def _set_back(self, driver: Family, ask: Ask) -> bool:
        """Whether nothing is left to do."""
        name = run_dialogue(ask_model(), ask) if run_dialogue(wake(), ask) else None
        if name is None:
            return False
        entry = self._entry(driver, name)
        return entry is None or self._restore(driver, entry, ask)

    def _settle(self, driver: Family, ask: Ask) -> bool:
        """Whether nothing is left to do; a failed attempt may succeed the next time."""
        saved = self._saved.of_source(self._link.name)
        if self._gsm_only and not driver.mode_commands:
            self._note_unchanged(f"driver {driver.name} has no command for GSM only")
            return True
        if not self._gsm_only and not saved:
            return True
        name = run_dialogue(ask_model(), ask)
        if name is None:
            self._note_unchanged("the modem does not report its model (AT+CGMM)")
            return False
        entry = self._entry(driver, name)
        if self._gsm_only:
            return self._change(driver, name, entry, ask)
        if entry is not None:
            is_done = self._restore(driver, entry, ask)
            if not is_done and not self._link.stop.is_set():
                self._note("warning", "mode-left", f"{name} does not take {entry.value}; {ADVICE}")
            return is_done
        waiting = ", ".join(entry.model for entry in saved)
        text = f"not for this modem: {waiting} is still on GSM only and is restored when here"
        self._note("info", "mode-kept", text)
        return True

    def _change(self, driver: Family, name: str, entry: SavedMode | None, ask: Ask) -> bool:
        found = run_dialogue(read_mode(driver.mode_commands), ask)
        if found is None:
            asks = " and ".join(command.query for command in driver.mode_commands)
            self._note_unchanged(f"the modem does not report its mode ({asks})")
            return False
        command, value = found
        if command.is_gsm(value):
            text = f"the modem was already on GSM only ({command.query})"
            if entry is not None:
                text = (
                    f"the modem is on GSM only; it was {entry.value}, which is restored at the stop"
                )
            self._note("info", "mode-gsm", text)
            return True
        # saved first: the next start can restore it whatever happens from here on
        saved = SavedMode(driver.name, name, command.query, value, self._link.name)
        self._saved.save(saved)
        now = run_dialogue(set_mode(command, command.gsm_only), ask)
        sent = command.set_to(command.gsm_only)
        if now is not None and command.is_gsm(now):
            text = (
                f"{sent}: the modem is on GSM only; it was {value}, which is restored at the stop"
            )
            self._note("info", "mode-set", text)
            return True
        if now is not None and same_mode(now, value):
            self._saved.drop(saved)
            self._note_unchanged(f"the modem refuses {sent}")
            return True
        self._note_unchanged(f"no answer to {sent}; it was {value}, which is restored at the stop")
        return False

    def _restore(self, driver: Family, entry: SavedMode, ask: Ask) -> bool:
        """Whether the modem has its previous mode, or one that its owner has set since."""
        command = _command(driver, entry)
        if command is None:
            setting = f"{entry.asks} {entry.value!r}"
            text = f"{self._saved.path}: {setting} is no mode of this modem; remove it"
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
            text = f"{command.set_to(entry.value)}: the modem has its mode from before GSM only"
        self._saved.drop(entry)
        self._note("info", "mode-restored", text)
        return True

    def _entry(self, driver: Family, model: str) -> SavedMode | None:
        saved = self._saved.of_source(self._link.name)
        of_model = (one for one in saved if (one.driver, one.model) == (driver.name, model))
        return next(of_model, None)

    def _note_unchanged(self, why: str) -> None:
        if not self._link.stop.is_set():  # else the stop interrupted the commands
            self._note("warning", "mode-unchanged", f"the mode of the modem is not changed: {why}")

    def _note(self, level: Level, code: str, text: str) -> None:
        if text not in self._noted:
            self._noted.add(text)
            self._link.note(level, code, text)


def _command(driver: Family, entry: SavedMode) -> ModeCommand | None:
    known = (command for command in driver.mode_commands if command.query == entry.asks)
    return next((command for command in known if command.is_value(entry.value)), None)


def unrestored_modes(saved: SavedModes, drivers: Callable[[str], Family | None]) -> str:
    """Text on the modes that the stop could not restore; empty if none."""
    try:
        entries = saved.all()
    except OSError as error:
        return str(error)
    texts = []
    for entry in entries:
        driver = drivers(entry.driver)
        command = None if driver is None else _command(driver, entry)
        hand = f" ({command.set_to(entry.value)})" if command else ""
        texts.append(f"{entry.model} is still on GSM only; {ADVICE}{hand}")
    return "; ".join(texts)
