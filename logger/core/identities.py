"""Which cells exist: those that two scans have named.

A changed digit names a cell that does not exist. The first time nothing shows it; where it comes
again, the driver knows the true cell and marks the identity as unsure. So a cell named in a single
scan is never a target and never located, and an unsure identity does not make a cell known.
"""

from logger.core.latest import Latest
from logger.core.types import Scan

FEWEST_SCANS = 2

_MOST_ONCE = 1000
"""With a false name in each second, a real cell has a quarter of an hour to be named again."""
_MOST_KNOWN = 10_000


class Identities:
    """Names of late; those named once and those known are bounded apart.

    So false names displace no known one.
    """

    def __init__(self) -> None:
        self._once: Latest[None] = Latest(_MOST_ONCE)
        self._known: Latest[None] = Latest(_MOST_KNOWN)

    def __contains__(self, name: str | None) -> bool:
        return name in self._known

    def add(self, scan: Scan) -> None:
        """Take the names of a scan, each once."""
        sure = (r.cell for r in scan.readings if not r.identity_unsure)
        for name in dict.fromkeys(name for name in sure if name is not None):
            is_known = name in self._once or name in self._known
            self._once.pop(name, None)
            (self._known if is_known else self._once).put(name, None)


def identity_of(name: str) -> tuple[int, int, int, int] | None:
    """MCC, MNC, area and cell of a name, None where it is no identity."""
    parts = name.split("-")
    if len(parts) != 4 or not all(
        part.isascii() and part.isdigit() and len(part) < 12 for part in parts
    ):
        return None
    mcc, net, area, cell = map(int, parts)
    return mcc, net, area, cell
