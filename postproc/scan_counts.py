"""Number of scans that observed each cell, whether it is enough to report the cell, and when.

A damaged digit gives the name of a cell that does not exist. No check of a reply detects its first
occurrence; later ones are marked as unsure. So a cell is reported when two scans have named it
without doubt.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence

import numpy as np
import numpy.typing as npt

from logger.core.arrays import IntArray
from logger.core.cell_names import FEWEST_SCANS, is_by_channel, why_no_name, with_hint
from logger.core.errors import ConfigError
from logger.core.rows import numbered_texts
from logger.core.runfile import Run
from logger.core.timebase import utc_clock


def distinct_pairs(first: IntArray, second: IntArray) -> tuple[IntArray, IntArray]:
    """Each pair of values (n,) once, in ascending order."""
    order = np.lexsort((second, first))
    first, second = first[order], second[order]
    is_new = np.ones(len(order), np.bool_)
    is_new[1:] = (np.diff(first) != 0) | (np.diff(second) != 0)
    return first[is_new], second[is_new]


def scans_of(runs: Sequence[Run]) -> dict[str, int]:
    """Scans of all runs in which each cell was identified without doubt; 0 where it never was."""
    total: Counter[str] = Counter()
    for run in runs:
        readings = run.named_readings
        names, which = numbered_texts(readings["cell"])
        sure = readings["identity_unsure"] == 0
        scan, cell = readings["seq"][sure], which[sure]
        _add(total, names, distinct_pairs(cell, scan)[0])
    del total[""]
    return total


def joined_of(runs: Sequence[Run]) -> dict[str, int]:
    """Readings of each cell that do not name it themselves: `logger.core.joined_names`."""
    joined: Counter[str] = Counter()
    for run in runs:
        is_nameless = run.tables["readings"]["cell"] == b""
        names, which = numbered_texts(run.named_readings["cell"][is_nameless])
        _add(joined, names, which)
    return {name: n for name, n in joined.items() if name and not is_by_channel(name)}


def _add(total: Counter[str], names: npt.NDArray[np.bytes_], which: IntArray) -> None:
    """Count the rows of each name; `which` are their numbers."""
    counts = np.bincount(which, minlength=len(names))
    for stored, count in zip(names.tolist(), counts.tolist(), strict=True):
        total[stored.decode()] += count


def heard_utc_ns(runs: Sequence[Run]) -> dict[str, tuple[int, int]]:
    """UTC of the first and the last reading of each cell, in the runs that know UTC."""
    times_ns: dict[str, list[int]] = {}
    for run in runs:
        clock, readings = utc_clock(run.meta.origin, run.tables["fixes"]), run.named_readings
        names, which = numbered_texts(readings["cell"])
        order = np.lexsort((readings["t_ns"], which))
        t_ns, first = readings["t_ns"][order], np.searchsorted(which[order], np.arange(len(names)))
        last = np.append(first, len(order))[1:] - 1
        for name, *ends_ns in zip(names, t_ns[first].tolist(), t_ns[last].tolist(), strict=True):
            utc_ns = [at_ns for at_ns in map(clock, ends_ns) if at_ns is not None]
            times_ns.setdefault(name.decode(), []).extend(utc_ns)
    return {name: (min(utc_ns), max(utc_ns)) for name, utc_ns in times_ns.items() if utc_ns}


def too_rarely(n_scans: int) -> str | None:
    """Why a cell observed in so many scans is not reported; None where it is."""
    if n_scans >= FEWEST_SCANS:
        return None
    return "observed in one scan only" if n_scans else "its identity was never read without doubt"


def observed_cells(runs: Sequence[Run], only: Sequence[str] | None) -> dict[str, int]:
    """Number of readings of each cell, or of those in `only`.

    Raises `ConfigError` for a name that was not observed.
    """
    names, which = numbered_texts(np.concatenate([run.named_readings["cell"] for run in runs]))
    counts = np.bincount(which, minlength=len(names)).tolist()
    every = {name.decode(): n for name, n in zip(names, counts, strict=True) if name}
    check_observed(only or (), every)
    return {name: n for name, n in every.items() if not only or name in only}


def check_observed(names: Iterable[str], observed: Collection[str]) -> None:
    """Raise `ConfigError` for names that were not observed."""
    unknown = sorted({name for name in names if name not in observed})
    for cell in unknown:
        if why := why_no_name(cell):
            raise ConfigError(why)
    if unknown:
        cells = ", ".join(with_hint(cell, observed) for cell in unknown)
        raise ConfigError(f"cell {cells} was not observed; `postproc info` lists those that were")
