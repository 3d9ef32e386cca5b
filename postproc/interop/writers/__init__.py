"""Formats of `postproc export`: a module each, whose name is that of the format.

A module has `write(walk, target)`. Where the format can represent only some levels it has
`writable(sighting)`, and where it has a place for cells `write_answers(table, regions, target)`:
one row or feature for each row of `postproc.answer_table`; with `HAS_REGIONS` also the regions of
each, which are empty for other formats. A module is imported when its format is written.
"""

import pkgutil


def names() -> list[str]:
    """Names of the formats; a file that ends in one is of that format."""
    return sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules(__path__))
