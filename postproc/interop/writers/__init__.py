"""Formats of `postproc export`: a module each, whose name is that of the format.

A module has `write(walk, estimates, target)`. Where the format can represent only some levels it
has `writable(sighting)`, and `HAS_ESTIMATES` where it has a place for positions of cells. A module
is imported when its format is written.
"""

import pkgutil


def names() -> list[str]:
    """Names of the formats; a file that ends in one is of that format."""
    return sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules(__path__))
