"""Tasks on Dask: a cluster of this machine, or any scheduler of dask.distributed by its address.

Dask replaces a worker that dies and repeats its task. When the scheduler is lost, results that have
arrived are kept, and the rest goes to the next scheduler at the same address. A task is a function
of the survey, so it can be repeated.
"""

import logging
import os
import time
from asyncio import CancelledError
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, Self, TypeVar
from uuid import uuid4

import dask
from distributed import Client, KilledWorker, LocalCluster, as_completed
from distributed.comm import CommClosedError

from logger.core.errors import ConfigError
from postproc.processes import without_interrupt

CONNECT_S = 60.0
"""For a scheduler to answer, at the start and after it was lost."""
_MOST_LOSSES = 20
"""A scheduler that is lost more often does not work."""
_MOST_DEATHS = 100
"""Workers that may die before the tasks are taken for the cause."""
_MOST_OF_ONE = 3
"""Times that Dask may give up a task, each after four workers have died with it."""
_NO_PAGES: Mapping[str, list[str]] = {
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}
"""Dask tells every user of this machine over HTTP, usually at port 8787, what it is doing."""
_LOST = (CommClosedError, CancelledError, TimeoutError, OSError)

Item = TypeVar("Item")
Result = TypeVar("Result")


class Cluster:
    """Workers, started or connected to when there is work.

    `scheduler` is the address of a Dask scheduler; without one, `workers` processes of this
    machine.
    """

    def __init__(self, scheduler: str | None = None, workers: int | None = None) -> None:
        self._scheduler, self._workers = scheduler, workers
        self._client: Client | None = None
        self._resources = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._disconnect()

    def results(
        self,
        work: Callable[[Item], Result],
        items: Sequence[Item],
        lost: Callable[[Item], Result] | None = None,
    ) -> Iterator[tuple[Item, Result]]:
        """Each item with its result, exactly once, in any order.

        An item with which workers die has the result of `lost`. Raises `ConfigError` where no
        scheduler answers or workers die again and again, and what a task raises.
        """
        waiting = dict(enumerate(items))
        n_losses = 0
        while waiting:
            try:
                for number, result in _results(self._connect_once(), work, waiting, lost):
                    yield waiting.pop(number), result
            except _SchedulerLost:
                self._disconnect()
                n_losses += 1
                if n_losses > _MOST_LOSSES:
                    raise ConfigError(f"the scheduler was lost {n_losses} times") from None

    def _connect_once(self) -> Client:
        if self._client is None:
            client = _client(self._scheduler, self._workers)
            self._client = self._resources.enter_context(client)
        return self._client

    def _disconnect(self) -> None:
        self._client = None
        self._resources.close()


class _SchedulerLost(Exception):  # noqa: N818 (no error: the work goes on)
    pass


def _results(
    client: Client,
    work: Callable[[Any], Any],
    waiting: Mapping[int, Any],
    lost: Callable[[Any], Any] | None,
) -> Iterator[tuple[int, Any]]:
    """Results by the number of the item; raises `_SchedulerLost`."""
    number_of: dict[str, int] = {}

    def submit(numbers: Sequence[int]) -> list[Any]:
        # at once: the scheduler then keeps a queue, of which the first free worker takes the next
        keys = [f"cellwalk-{uuid4().hex}" for _ in numbers]
        number_of.update(zip(keys, numbers, strict=True))
        items = [waiting[number] for number in numbers]
        return list(client.map(work, items, key=keys, pure=False))

    deaths: Counter[int] = Counter()
    try:
        arriving = as_completed(submit(list(waiting)), loop=client.loop)
        for future in arriving:
            if future.status in {"cancelled", "lost"}:
                raise _SchedulerLost
            try:
                result = future.result(timeout=CONNECT_S)
            except KilledWorker as error:
                number = number_of[future.key]
                deaths[number] += 1
                if lost is not None and deaths[number] == _MOST_OF_ONE:
                    yield number, lost(waiting[number])
                    continue
                if deaths.total() > _MOST_DEATHS:
                    raise ConfigError(f"workers die again and again: {error}") from error
                arriving.update(submit([number]))
                continue
            yield number_of[future.key], result
            future.release()
    except _LOST as error:
        raise _SchedulerLost from error


@contextmanager
def _client(scheduler: str | None, workers: int | None) -> Iterator[Client]:
    # what a lost worker or scheduler means is said here, in one line
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    if scheduler is None:
        with dask.config.set(_NO_PAGES), ExitStack() as opened:
            with without_interrupt():  # a worker would answer Ctrl-C by a traceback
                # TLS with keys that exist in memory only: other users cannot connect
                local = LocalCluster(
                    n_workers=workers or os.cpu_count() or 1,
                    threads_per_worker=1,
                    dashboard_address=None,
                    scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                    security=True,
                    silence_logs=logging.CRITICAL,
                    env={"OMP_NUM_THREADS": "1"},
                )
                cluster = opened.enter_context(local)
                client = opened.enter_context(Client(cluster, set_as_default=False))
            yield client
        return
    client = _connect(scheduler)
    try:
        yield client
    finally:
        with suppress(*_LOST):
            client.close(timeout=CONNECT_S)


def _connect(address: str) -> Client:
    deadline = time.monotonic() + CONNECT_S
    while True:
        try:
            return Client(address, timeout=5.0, set_as_default=False)
        except _LOST as error:
            if time.monotonic() > deadline:
                raise ConfigError(
                    f"no Dask scheduler answers at {address}: {str(error).splitlines()[0]}"
                ) from error
            time.sleep(0.5)
        except ValueError as error:
            raise ConfigError(f"{address!r} is no address of a scheduler: {error}") from error
