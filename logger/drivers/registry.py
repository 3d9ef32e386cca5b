"""Modem drivers by the name that a configuration gives them, and by the identity of a modem."""

import pkgutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple
from importlib import import_module
from types import ModuleType

from logger import drivers
from logger.core.errors import ConfigError
from logger.core.types import CellReading
from logger.drivers.family import Family, wake
from logger.drivers.generic import Generic
from logger.drivers.protocols.at import Command, Dialogue

AUTO = "auto"
IDENTITY = ("ATI", "AT+CGMI", "AT+CGMM", "AT+CGMR")
"""Commands that ask for maker, model and firmware, which modems answer in words of their own."""


def families_in(package: ModuleType) -> dict[str, Family]:
    """One driver of each `Family` that a module of the package defines, by name."""
    found: list[Family] = []
    for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
        if module.name != __name__:
            content = import_module(module.name)
            found += [
                value()
                for value in vars(content).values()
                if isinstance(value, type)
                and issubclass(value, Family)
                and value.__module__ == module.name
                and value is not Family
            ]
    return {driver.name: driver for driver in sorted(found, key=lambda driver: driver.name)}


FAMILIES: Mapping[str, Family] = families_in(drivers)
"""All drivers by name; which of them serves a modem does not depend on the order."""


def driver_of(name: str) -> Family | None:
    """The driver of that name, None for `auto`; an unknown name is the user's mistake."""
    if name != AUTO and name not in FAMILIES:
        # a family in capitals, or a model instead of its family
        claims = claimants(name, FAMILIES.values())
        meant = [one for one in FAMILIES if one == name.lower()] or [one.name for one in claims]
        hint = f"did you mean {meant[0]!r}? " if meant else ""
        raise ConfigError(
            f"no modem driver is called {name!r}; {hint}known are: {', '.join((AUTO, *FAMILIES))}"
        )
    return FAMILIES.get(name)


def check_mode(driver: str, set_mode: str) -> None:
    """Raise `ConfigError` where `[modem] set_mode` asks for what the driver has no command for."""
    family = driver_of(driver)
    if set_mode and family is not None and not family.mode_commands:
        able = ", ".join(name for name, other in FAMILIES.items() if other.mode_commands)
        text = (
            f"driver {driver!r} has no command for it; leave it out. Drivers that have one: {able}"
        )
        raise ConfigError(f'[modem] set_mode = "{set_mode}": {text}')


def identify() -> Dialogue[tuple[Family, str] | None]:
    """Ask a modem for its identity: its driver and the text; None when it does not answer."""
    if not (yield from wake()):
        return None
    lines: list[str] = []
    for text in ("ATE0", *IDENTITY):
        reply = yield Command(text)
        lines += [line.strip() for line in reply.lines if line.strip() not in lines]
    found = " ".join(lines)
    return family_of(found), found


def family_of(identity: str) -> Family:
    """The driver of the modem with this identity: the one with the most specific claim."""
    return next(iter(claimants(identity, FAMILIES.values())), FAMILIES[Generic.name])


def claimants(identity: str, families: Iterable[Family]) -> list[Family]:
    """Drivers with the most specific claim on an identity; none where no driver claims it."""
    ranks = {family: family.claim.rank(identity) for family in families}
    highest = max(ranks.values())
    return [family for family, rank in ranks.items() if rank == highest > 0]


def reader_of(lines: Sequence[str]) -> Family:
    """The driver that reads most in a transcript: cells with an identity, cells, rows, values.

    Of equals the first by name; `generic` where no driver reads a row.
    """

    def count(driver: Family) -> tuple[int, ...]:
        rows = driver.rows_in(lines)
        cells = [row for row in rows if isinstance(row, CellReading)]
        n_values = sum(value is not None for cell in cells for value in astuple(cell))
        return sum(cell.cid is not None for cell in cells), len(cells), len(rows), n_values

    return max((FAMILIES[Generic.name], *FAMILIES.values()), key=count)
