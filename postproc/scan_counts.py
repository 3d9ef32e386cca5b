"""Number of scans that observed each cell, and whether it is enough to report the cell.

A damaged digit gives the name of a cell that does not exist, and no check of the reply's format
detects it; but the same damage does not occur twice. So a cell is reported when two scans have
named it, each in a reply that passed all checks of its format.
"""

from collections.abc import Sequence

import numpy as np

from logger.core.errors import ConfigError
from logger.core.identities import FEWEST_SCANS
from logger.core.runfile import Run


def scans_of(runs: Sequence[Run]) -> dict[str, int]:
    """Scans of all runs in which each cell was identified without doubt; 0 where it never was."""
    counts_by_name: dict[str, int] = {}
    for run in runs:
        readings = run.tables["readings"]
        names, which = np.unique(readings["cell"], return_inverse=True)
        scans, scan = np.unique(readings["seq"], return_inverse=True)
        sure = readings["identity_unsure"] == 0
        pairs = np.unique(which[sure] * len(scans) + scan[sure])
        counts = np.bincount(pairs // max(len(scans), 1), minlength=len(names))
        for stored, count in zip(names.tolist(), counts.tolist(), strict=True):
            name = stored.decode("utf-8", "replace")
            counts_by_name[name] = counts_by_name.get(name, 0) + count
    counts_by_name.pop("", None)
    return counts_by_name


def too_rarely(n_scans: int) -> str | None:
    """Why a cell observed in so many scans is not reported; None where it is."""
    if n_scans >= FEWEST_SCANS:
        return None
    return "observed in one scan only" if n_scans else "its identity was never read without doubt"


def observed_cells(runs: Sequence[Run], only: Sequence[str] | None) -> dict[str, int]:
    """Number of readings of each cell, or of those in `only`.

    Raises `ConfigError` for a name that was not observed.
    """
    names, counts = np.unique(
        np.concatenate([run.tables["readings"]["cell"] for run in runs]), return_counts=True
    )
    every = {name.decode(): int(n) for name, n in zip(names, counts, strict=True) if name}
    if unknown := set(only or ()) - set(every):
        raise ConfigError(
            f"cell {', '.join(sorted(unknown))} was not observed; `postproc info` lists those that "
            "were"
        )
    return {name: n for name, n in every.items() if not only or name in only}
