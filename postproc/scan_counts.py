"""In how many scans each cell was heard, and whether that is enough to speak of it.

A damaged digit gives the name of a cell that is not there, and shows in no form; but it does not
come twice. So a cell is spoken of when two scans have named it, each in a form that rules damage
out as far as a form can.
"""

from collections.abc import Sequence

import numpy as np

from logger.core.identities import FEWEST_SCANS
from logger.core.runfile import Run


def scans_of(runs: Sequence[Run]) -> dict[str, int]:
    """Scans of all runs in which each cell was named surely; 0 for one that never was."""
    found: dict[str, int] = {}
    for run in runs:
        readings = run.tables["readings"]
        names, which = np.unique(readings["cell"], return_inverse=True)
        scans, scan = np.unique(readings["seq"], return_inverse=True)
        sure = readings["identity_unsure"] == 0
        pairs = np.unique(which[sure] * len(scans) + scan[sure])
        counts = np.bincount(pairs // max(len(scans), 1), minlength=len(names))
        for stored, count in zip(names.tolist(), counts.tolist(), strict=True):
            name = stored.decode("utf-8", "replace")
            found[name] = found.get(name, 0) + count
    found.pop("", None)
    return found


def too_rarely(n_scans: int) -> str | None:
    """Why a cell heard in so many scans is not spoken of; None where it is."""
    if n_scans >= FEWEST_SCANS:
        return None
    return "heard in one scan only" if n_scans else "its identity was never read without doubt"
