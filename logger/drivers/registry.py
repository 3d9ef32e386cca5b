"""Modem drivers by the name that a configuration gives them, and by what a modem says of itself."""

from collections.abc import Sequence

from logger.core.errors import ConfigError
from logger.core.types import CellReading
from logger.drivers.cinterion.cinterion import Cinterion
from logger.drivers.family import Family, wake
from logger.drivers.fibocom.fibocom import Fibocom
from logger.drivers.generic.generic import Generic
from logger.drivers.huawei.huawei import Huawei
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.quectel.quectel import Quectel
from logger.drivers.quectel.quectel_gsm import QuectelGsm
from logger.drivers.sierra.sierra import Sierra
from logger.drivers.simcom.sim800 import Sim800
from logger.drivers.simcom.sim7000 import Sim7000
from logger.drivers.simcom.sim7600 import Sim7600
from logger.drivers.telit.telit import Telit
from logger.drivers.ublox.ublox import Ublox

AUTO = "auto"
FAMILIES: dict[str, Family] = {
    driver.name: driver
    for driver in (
        Sim800(),
        Sim7000(),
        Sim7600(),
        Quectel(),
        QuectelGsm(),
        Telit(),
        Ublox(),
        Cinterion(),
        Sierra(),
        Huawei(),
        Fibocom(),
        Generic(),
    )
}
"""In the order in which they are asked whether a modem is theirs; the last one takes any."""

_WHO = tuple(Command(text) for text in ("ATE0", "ATI", "AT+CGMI", "AT+CGMM", "AT+CGMR"))


def driver_of(name: str) -> Family | None:
    """The driver of that name, None for `auto`; an unknown name is the user's mistake."""
    if name != AUTO and name not in FAMILIES:
        raise ConfigError(
            f"no modem driver is called {name!r}; known are: {', '.join((AUTO, *FAMILIES))}"
        )
    return FAMILIES.get(name)


def check_mode(driver: str, set_mode: str) -> None:
    """Raise `ConfigError` where a setting asks for what a driver cannot do; `auto` may find one
    that can.
    """
    family = driver_of(driver)
    if set_mode and family is not None and not family.mode_commands:
        able = ", ".join(name for name, one in FAMILIES.items() if one.mode_commands)
        text = (
            f"driver {driver!r} has no command for it; leave it out. Drivers that have one: {able}"
        )
        raise ConfigError(f'[modem] set_mode = "{set_mode}": {text}')


def identify() -> Dialogue[tuple[Family, str] | None]:
    """Ask a modem who it is: its driver and its own words; None when it does not answer."""
    if not (yield from wake()):
        return None
    said: list[str] = []
    for command in _WHO:
        reply = yield command
        said += [line.strip() for line in reply.lines if line.strip() not in said]
    text = " ".join(said)
    return family_of(text), text


def family_of(identity: str) -> Family:
    """The driver for a modem that says this of itself."""
    return next(driver for driver in FAMILIES.values() if driver.identifies.search(identity))


def reader_of(lines: Sequence[str]) -> Family:
    """The driver that finds most of its own in a transcript: most cells with an identity, most
    cells, most rows.
    """

    def found(driver: Family) -> tuple[int, int, int]:
        rows = driver.rows_in(lines)
        cells = [row for row in rows if isinstance(row, CellReading)]
        return sum(cell.cid is not None for cell in cells), len(cells), len(rows)

    return max(FAMILIES.values(), key=found)
