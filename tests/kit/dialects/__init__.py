"""Simulated modems of the families that `fieldlogger simulate` lacks, to test the drivers."""

import pkgutil
from collections.abc import Iterator, Mapping
from importlib import import_module

from logger.sim import dialects
from logger.sim.dialects import Dialect


def _more() -> Iterator[Dialect]:
    for module in pkgutil.iter_modules(__path__, f"{__name__}."):
        for value in vars(import_module(module.name)).values():
            if isinstance(value, Dialect):
                yield value


DIALECTS: Mapping[str, Dialect] = dialects.DIALECTS | {
    dialect.name: dialect for dialect in sorted(_more(), key=lambda dialect: dialect.name)
}
"""One or more for each family of drivers."""
