"""Formats of `postproc export`: a module each, whose name is that of the format.

A module has `write(walk, target)`, `writable(sighting)` if the format can represent only some
levels, and `write_answers(answered, table, target)` if it has a place for cells: one row or feature
for each row of `postproc.result`. Without `HAS_REGIONS` the regions of each are empty. One of
a track alone has `HAS_LEVELS = False`. A module is imported when its format is written.
"""

import pkgutil


def names() -> list[str]:
    """Names of the formats; a file that ends in one is of that format."""
    return sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules(__path__))
