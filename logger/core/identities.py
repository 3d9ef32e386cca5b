"""Which cells are there: those that two scans have named.

A changed digit gives the name of a cell that is not there, and no form shows it; but it does not
come twice. So a cell heard in a single scan is never a target and never located. A reading whose
identity is unsure makes no cell known.
"""

from logger.core.types import Scan

FEWEST_SCANS = 2

_MOST_ONCE = 1000
"""With a false name in each second a cell that is there has a quarter of an hour to be heard
again.
"""
_MOST_KNOWN = 10_000


class Identities:
    """Names of late; those heard once and those known are bounded apart, so that false names
    displace no known one.
    """

    def __init__(self) -> None:
        self._once: dict[str, None] = {}  # the one heard longest ago first
        self._known: dict[str, None] = {}

    def __contains__(self, name: str | None) -> bool:
        return name in self._known

    def hear(self, scan: Scan) -> None:
        """Take the names of a scan, each once."""
        named = dict.fromkeys(
            r.cell for r in scan.readings if r.cell is not None and not r.identity_unsure
        )
        for name in named:
            again = name in self._once or name in self._known
            self._once.pop(name, None)
            self._known.pop(name, None)
            of_its_kind, most = (self._known, _MOST_KNOWN) if again else (self._once, _MOST_ONCE)
            of_its_kind[name] = None
            if len(of_its_kind) > most:
                del of_its_kind[next(iter(of_its_kind))]
