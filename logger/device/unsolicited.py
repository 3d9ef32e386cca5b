"""Rows that come while nothing is pending: a modem's own reports, or the rest of a reply that took
too long.
"""

from logger.drivers.protocols.dialogue import INTERRUPTION

BLOCK_GAP_S = 0.5
"""Silence that ends a block of rows nobody asked for; such blocks have no final line."""


class Unasked:
    """One block of such rows, and when the cells in it were heard: from `begin_ns` to `end_ns`."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        self.begin_ns = 0
        self.end_ns = 0

    def add(self, line: str, t_ns: int, since_ns: int) -> None:
        """Take a row that has come at `t_ns` and tells of no time before `since_ns`."""
        self.begin_ns = min(since_ns, self.begin_ns) if self._lines else since_ns
        self.end_ns = t_ns
        self._lines.append(line)

    def interrupt(self) -> None:
        """Take note that something else came, which may have cut the last row."""
        if self._lines:
            self._lines.append(INTERRUPTION)

    def is_over(self, now_ns: int) -> bool:
        """True when there is a block, and it has been silent for long enough."""
        return bool(self._lines) and now_ns - self.end_ns > BLOCK_GAP_S * 1e9

    def take(self) -> list[str]:
        """The lines of the block, which is empty afterwards."""
        lines, self._lines = self._lines, []
        return lines
