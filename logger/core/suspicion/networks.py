"""Which networks a log is of: another one is no news where telephones or searches alternate."""

_USUAL_S = 300.0
"""A log of several telephones, or of a modem that tries networks in turn, names all of its networks
in the first minutes."""
MOST_NETWORKS = 128
"""More than all countries near a walk have."""


def may_be_same(operator: str, other: str) -> bool:
    """Whether two networks `mcc-mnc` may be one; `?` is a code that the modem did not print."""
    pairs = zip(operator.split("-"), other.split("-"), strict=False)
    return all("?" in pair or pair[0] == pair[1] for pair in pairs)


class Networks:
    """Networks that were heard in the first minutes of a log."""

    def __init__(self) -> None:
        self._first_s: float | None = None
        self._usual: set[str] = set()

    def take(self, t_s: float, operator: str) -> None:
        """Remember the network of a cell."""
        if self._first_s is None:
            self._first_s = t_s
        if t_s - self._first_s < _USUAL_S and len(self._usual) < MOST_NETWORKS:
            self._usual.add(operator)

    def are_apart(self, operator: str, before: str) -> bool:
        """Whether a cell of a network says nothing about the one `before`.

        They are other networks and the log is of both; one that comes later has to be explained.
        """
        return operator in self._usual and not may_be_same(operator, before)
