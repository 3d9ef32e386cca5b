"""How long a silent modem is waited for, and when it is asked whether it is still there.

A full scan takes up to minutes, and any character sent meanwhile may end it (ITU-T V.250 5.6.1), so
nothing is sent. But a modem that has hung would be waited for until the manual's limit of the
command. So a scan may be silent for as long as it has been before, and a little longer; then the
modem is asked. Where the rows of a scan come as they are found the longest silence lies between two
of them, elsewhere it is the whole scan: one rule serves both.
"""

import math

from logger.drivers.protocols.dialogue import Command

MARGIN_S = 5.0
"""How much longer than ever before a scan may be silent."""
ASK_EVERY_S = 3.0
LATE_S = 6.0
"""How much longer than its time a reply may take while its bytes keep coming."""
PAUSE_S = 1.0
"""Silence after which they have stopped coming."""


class Patience:
    """What one modem's full scans have taught, by command.

    A scan that a question may have ended is given twice the silence the next time, until one is
    completed: a healthy slow one gets through.
    """

    def __init__(self) -> None:
        self._longest_s: dict[str, float] = {}
        self._allowed_s: dict[str, float] = {}

    def silence_s(self, command: Command) -> float:
        """Silence after which the modem is asked: until a scan is completed the documented one."""
        return self._allowed_s.get(command.text, command.silence_s)

    def completed(self, command: Command, silence_s: float) -> None:
        """Learn from a scan that was silent for so long at most."""
        longest_s = self._longest_s[command.text] = max(
            silence_s, self._longest_s.get(command.text, 0.0)
        )
        self._allowed_s[command.text] = longest_s + MARGIN_S

    def interrupted(self, command: Command) -> None:
        """Learn from a scan that was over when the modem answered: it may have hung, or the
        question has ended it.
        """
        self._allowed_s[command.text] = 2.0 * self.silence_s(command)


class Wait:
    """The wait for the reply to a command written at `now_s`; all times are real seconds.

    With `silence_s` the modem is asked after so long a silence, and again every few seconds.
    """

    def __init__(self, command: Command, now_s: float, silence_s: float = math.inf) -> None:
        self.command = command
        self.longest_silence_s = 0.0
        self.questions = 0
        self._silence_s = silence_s
        self._start_s = self._byte_s = self._line_s = now_s
        self._asked_s = -math.inf
        self._n_lines = 0

    def hear(self, now_s: float, *, spoke: bool, n_lines: int, over: bool = False) -> None:
        """Take note of what came: whether any byte did, the lines of the reply by now, whether it
        is over.

        Lines that nobody asked for end no silence: a modem that has lost the command says them too.
        """
        self._byte_s = now_s if spoke else self._byte_s
        if over or n_lines != self._n_lines:
            self.longest_silence_s = max(self.longest_silence_s, now_s - self._line_s)
            self._line_s, self._n_lines = now_s, n_lines

    def asks(self, now_s: float) -> bool:
        """True when it is time for a question, which is then counted."""
        due = now_s - self._line_s >= self._silence_s and now_s - self._asked_s >= ASK_EVERY_S
        if due:
            self._asked_s = now_s
            self.questions += 1
        return due

    def is_over(self, now_s: float) -> bool:
        """True when the reply's time is over."""
        coming = self._n_lines > 0 and now_s - self._byte_s < PAUSE_S
        return now_s - self._start_s >= self.command.timeout_s + (LATE_S if coming else 0.0)

    def is_slow(self, now_s: float) -> bool:
        """True when more than half of that time is over."""
        return 2.0 * (now_s - self._start_s) > self.command.timeout_s
