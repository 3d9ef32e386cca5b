"""Modem drivers by the name that a configuration gives them."""

from collections.abc import Callable

from logger.core.errors import ConfigError
from logger.drivers.dialogue import ModemDriver
from logger.drivers.sim800 import Sim800

DRIVERS: dict[str, Callable[[], ModemDriver]] = {Sim800.name: Sim800}


def make_driver(name: str) -> ModemDriver:
    """The modem driver of that name; an unknown name is the user's mistake, told with the names there are."""
    if name not in DRIVERS:
        raise ConfigError(f"no modem driver is called {name!r}; known are: {', '.join(sorted(DRIVERS))}")
    return DRIVERS[name]()
