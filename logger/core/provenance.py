"""Where a run comes from, as its description states it.

A run is recorded, simulated, imported, or a shared copy of such a run.
"""

IMPORT = "import of"
IMPORT_WITHOUT_TIMES = "import without times of"
DATED = ", with dates"
"""Ends an import of dated times of no known zone."""
SHARED = "shared copy"
SIMULATED = "simulated walk "
"""The name of the scenario follows."""

_IMPORTS = (IMPORT, IMPORT_WITHOUT_TIMES, f"{SHARED} of an import")
_WITHOUT_TIMES = (IMPORT_WITHOUT_TIMES, f"{SHARED} of an import without times")


def is_import(origin: str) -> bool:
    """Whether another program recorded it: its times are then those of that program."""
    return origin.startswith(_IMPORTS)


def has_times(origin: str) -> bool:
    """Whether times of a run are more than the order of its records."""
    return not origin.startswith(_WITHOUT_TIMES)


def is_dated(origin: str) -> bool:
    """Whether an import had dates, although no fix has UTC."""
    return is_import(origin) and origin.endswith(DATED)


def is_simulated(origin: str) -> bool:
    """Whether the simulator recorded it, perhaps faster than real: its receiver is never wrong."""
    return origin.startswith(SIMULATED)


def origin_of_copy(origin: str) -> str:
    """Origin of a copy to give away, which names no file of its owner."""
    if not is_import(origin):
        return SHARED
    return (
        f"{SHARED} of an import{'' if has_times(origin) else ' without times'}"
        f"{DATED if is_dated(origin) else ''}"
    )
