"""Work shared out over processes, where that is worth it and possible; and runs read ahead."""

import ctypes
import platform
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from multiprocessing import get_context, resource_tracker
from pathlib import Path
from typing import TypeVar

from threadpoolctl import threadpool_limits

from logger.core.errors import FieldLoggerError, RunFileError, error_text
from logger.core.runfile import Run, read_unaltered_run

_ITEMS_EACH = 2
"""Items that are worth starting a process for: that takes about as long as one cell."""
_MOST_PROCESSES = 4
"""A quarter of a gigabyte each, beside the run itself."""

_IN_HAND = 2
"""Items that another process has: this one, which deals them out, is busy with one of its own."""

_KEPT_BYTES = 32 << 20
"""The largest bound that malloc accepts (mallopt(3))."""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3

_READ_AHEAD = 2
"""Runs, each read by a process of its own while the caller stores the last."""

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    processes: int,
    lost: Callable[[Item], Result] | None = None,
) -> Iterator[Result]:
    """Results of `work` for the items in their order, by several processes where that pays.

    This process is one of them. What a process that ended has left is done by others, or here. An
    item that ends each process has the result of `lost`, if given.
    """
    done, count = 0, min(processes, _MOST_PROCESSES, len(items) // _ITEMS_EACH)
    there: dict[int, Future[Result]] = {}
    if count > 1:
        try:
            with _processes(count - 1) as pool:
                for result in _shared_out(pool, count - 1, work, items, there):
                    done += 1
                    yield result
        except (
            NotImplementedError,
            OSError,
            BrokenExecutor,
        ):  # this machine gives no process, or has killed one
            pass
    for i, item in enumerate(items[done:], done):
        if i in there and _is_finished(there[i]):
            yield there[i].result()
        elif i in there and lost is not None:  # it may be what ended the process
            yield _alone(work, item, lost)
        else:
            yield _here(work, item)


def _processes(count: int) -> ProcessPoolExecutor:
    # fresh processes: a fork would copy the locks of threads that it does not copy
    return ProcessPoolExecutor(count, get_context("spawn"), _begin_process)


def _submit(
    pool: ProcessPoolExecutor, work: Callable[[Item], Result], item: Item
) -> Future[Result]:
    with without_interrupt():  # a process that this starts has none before `_begin_process`
        return pool.submit(work, item)


@contextmanager
def without_interrupt() -> Iterator[None]:
    """Ctrl-C waits. Threads and processes that are started now never have it."""
    resource_tracker.ensure_running()  # its start, with the first process, would unblock it
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _is_finished(future: Future[Result]) -> bool:
    return future.done() and not future.cancelled() and future.exception() is None


def _alone(work: Callable[[Item], Result], item: Item, lost: Callable[[Item], Result]) -> Result:
    """The result of an item by a process of its own; here where this machine gives none."""
    is_begun = False
    try:
        with _processes(1) as pool:
            is_begun = _submit(pool, abs, 1).result() > 0
            return _submit(pool, work, item).result()
    except BrokenExecutor:
        return lost(item) if is_begun else _here(work, item)
    except (NotImplementedError, OSError):
        return _here(work, item)


def _shared_out(
    pool: ProcessPoolExecutor,
    helpers: int,
    work: Callable[[Item], Result],
    items: Sequence[Item],
    there: dict[int, Future[Result]],
) -> Iterator[Result]:
    """The helpers of the pool begin with the first item, this process with the last.

    `there` gets the items of the helpers.
    """
    here: dict[int, Result] = {}
    left = deque(range(len(items)))
    for i in range(len(items)):
        while i not in here and not (i in there and there[i].done()):
            while left and sum(not one.done() for one in there.values()) < _IN_HAND * helpers:
                first = left.popleft()
                there[first] = _submit(pool, work, items[first])
            if not left:
                break
            last = left.pop()
            here[last] = _here(work, items[last])
        yield here[i] if i in here else there[i].result()


def _here(work: Callable[[Item], Result], item: Item) -> Result:
    with small_matrices():
        return work(item)


@contextmanager
def small_matrices() -> Iterator[None]:
    """Settings for an estimate: one thread of BLAS, since more would only wait for each other.

    Memory that is freed is kept from now on.
    """
    _keep_freed_memory()
    with threadpool_limits(1):
        yield


@cache
def _keep_freed_memory() -> None:
    """Make glibc keep up to 32 MB that are freed; does nothing with other C libraries.

    By itself it returns each temporary array of over 128 kB to the system and fetches it again,
    page by page: a tenth of the time of an estimate. A worker of Dask, which is told to return
    every free block, takes 2.3 times as long.
    """
    if platform.libc_ver()[0] == "glibc":
        libc = ctypes.CDLL(None)
        for option in (_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD):
            libc.mallopt(option, _KEPT_BYTES)


def _begin_process() -> None:
    _keep_freed_memory()
    threadpool_limits(1)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # ends without a traceback
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def read_ahead(
    paths: Sequence[Path], make: Callable[[Run], Item]
) -> Iterator[tuple[Path, Item | FieldLoggerError]]:
    """What `make` makes of each run, in order, or why that was impossible.

    A run that was altered since it was sealed is an error.
    """

    def outcome(path: Path) -> Item | FieldLoggerError:
        return outcome_of(path, lambda: make(read_unaltered_run(path)))

    with ThreadPoolExecutor(_READ_AHEAD) as readers:
        waiting: deque[Future[Item | FieldLoggerError]] = deque()
        rest = iter(paths)
        try:
            for path in paths:
                while len(waiting) < _READ_AHEAD and (ahead := next(rest, None)) is not None:
                    waiting.append(readers.submit(outcome, ahead))
                yield path, waiting.popleft().result()
        finally:
            readers.shutdown(cancel_futures=True)


def outcome_of(path: Path, work: Callable[[], Item]) -> Item | FieldLoggerError:
    """What work on a file returns, or why it failed: one bad file does not stop the others."""
    try:
        return work()
    except FieldLoggerError as error:
        return error
    except Exception as error:  # noqa: BLE001 (it is that of the file)
        return RunFileError(
            f"{path} cannot be used, by an error of this program: {error_text(error)}"
        )
