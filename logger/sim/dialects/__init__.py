"""Simulated modems by name, one or more for each family of drivers."""

import pkgutil
from collections.abc import Iterator, Mapping
from importlib import import_module

from logger.sim.dialects.dialect import Dialect


def _dialects() -> Iterator[Dialect]:
    """All dialects that are defined in the modules of this folder."""
    for module in pkgutil.iter_modules(__path__, f"{__name__}."):
        for value in vars(import_module(module.name)).values():
            if isinstance(value, Dialect):
                yield value


DIALECTS: Mapping[str, Dialect] = {
    dialect.name: dialect for dialect in sorted(_dialects(), key=lambda dialect: dialect.name)
}
