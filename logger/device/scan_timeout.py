"""How long to wait for a silent modem, and when to query it.

A full scan takes up to minutes, and any character sent meanwhile may end it (ITU-T V.250 5.6.1), so
nothing is sent. But a modem that has hung would block the session until the manual's limit of the
command. So a scan may be silent for as long as it has been before, and a little longer; then the
modem is queried with AT. If the rows of a scan come one by one, the longest silence lies between
two of them, otherwise it is the complete scan: one rule serves both.
"""

import math

from logger.drivers.protocols.at import Command

MARGIN_S = 5.0
"""How much longer than its longest silence so far a scan may be silent."""
QUERY_INTERVAL_S = 3.0
"""A modem that is not busy answers AT well within this time."""
LATE_S = 6.0
"""Extra time for a reply while its bytes keep coming."""
PAUSE_S = 1.0
"""Silence after which the bytes have stopped coming."""


class SilenceLimits:
    """Longest silences to accept in one modem's full scans, by command.

    A scan that a query may have ended is allowed twice the silence the next time, until one is
    completed: a slow but healthy scan succeeds.
    """

    def __init__(self) -> None:
        self._longest_s: dict[str, float] = {}
        self._allowed_s: dict[str, float] = {}

    def silence_s(self, command: Command) -> float:
        """Silence before a query: the documented one until a scan was completed."""
        return self._allowed_s.get(command.text, command.silence_s)

    def learn_completed(self, command: Command, silence_s: float) -> None:
        """Learn from a scan whose longest silence was `silence_s`."""
        longest_s = self._longest_s[command.text] = max(
            silence_s, self._longest_s.get(command.text, 0.0)
        )
        self._allowed_s[command.text] = longest_s + MARGIN_S

    def learn_interrupted(self, command: Command) -> None:
        """Learn from a scan that was over after a query: it had hung, or the query ended it."""
        self._allowed_s[command.text] = 2.0 * self.silence_s(command)


class Wait:
    """The wait for the reply to a command written at `now_s`; all times are real seconds.

    After a silence of `silence_s` queries are due, at an interval of a few seconds.
    """

    def __init__(self, command: Command, now_s: float, silence_s: float = math.inf) -> None:
        self.command = command
        self.longest_silence_s = 0.0
        self.n_queries = 0
        self._silence_s = silence_s
        self._start_s = self._byte_s = self._line_s = now_s
        self._query_s = -math.inf
        self._n_lines = 0

    def observe(
        self, now_s: float, *, has_bytes: bool, n_lines: int, is_over: bool = False
    ) -> None:
        """Update with the latest chunk: any bytes, lines of the reply so far, end of the reply.

        Unsolicited lines end no silence: a modem that has lost the command sends them too.
        """
        self._byte_s = now_s if has_bytes else self._byte_s
        if is_over or n_lines != self._n_lines:
            self.longest_silence_s = max(self.longest_silence_s, now_s - self._line_s)
            self._line_s, self._n_lines = now_s, n_lines

    def is_query_due(self, now_s: float) -> bool:
        """Whether it is time for a query, which is then counted."""
        is_silent = now_s - self._line_s >= self._silence_s
        is_due = is_silent and now_s - self._query_s >= QUERY_INTERVAL_S
        if is_due:
            self._query_s = now_s
            self.n_queries += 1
        return is_due

    def is_over(self, now_s: float) -> bool:
        """Whether the time for the reply is over."""
        is_coming = self._n_lines > 0 and now_s - self._byte_s < PAUSE_S
        return now_s - self._start_s >= self.command.timeout_s + (LATE_S if is_coming else 0.0)

    def is_slow(self, now_s: float) -> bool:
        """Whether more than half of that time is over."""
        return 2.0 * (now_s - self._start_s) > self.command.timeout_s
