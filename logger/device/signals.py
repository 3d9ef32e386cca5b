"""Signals that stop the logger."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def stop_signals() -> Iterator[tuple[threading.Event, list[str]]]:
    """Turn SIGTERM and SIGINT into an event; the handler does nothing else."""
    ended, received = threading.Event(), list[str]()

    def receive(number: int, _frame: FrameType | None) -> None:
        received.append(f"signal {signal.Signals(number).name}")
        ended.set()

    before = {number: signal.signal(number, receive) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield ended, received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
