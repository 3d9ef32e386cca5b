"""Rows without a pending command: a modem's own reports, or the rest of a late reply."""

from logger.drivers.protocols.at import INTERRUPTION

BLOCK_GAP_S = 0.5
"""Silence that ends a block of unsolicited rows; such blocks have no final line."""


class UnsolicitedBlock:
    """One block of such rows, whose cells were received from `begin_ns` to `end_ns`."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        self.begin_ns = 0
        self.end_ns = 0

    def add(self, line: str, t_ns: int, since_ns: int) -> None:
        """Add a row received at `t_ns` whose content is not older than `since_ns`."""
        self.begin_ns = min(since_ns, self.begin_ns) if self._lines else since_ns
        self.end_ns = t_ns
        self._lines.append(line)

    def interrupt(self) -> None:
        """Mark that other data came, which may have cut the last row."""
        if self._lines:
            self._lines.append(INTERRUPTION)

    def is_over(self, now_ns: int) -> bool:
        """Whether there is a block that has been silent for long enough."""
        return bool(self._lines) and now_ns - self.end_ns > BLOCK_GAP_S * 1e9

    def take(self) -> list[str]:
        """Return the lines of the block and empty it."""
        lines, self._lines = self._lines, []
        return lines
