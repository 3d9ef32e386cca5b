import os
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import active_children
from pathlib import Path
from typing import NamedTuple

import pytest

from postproc import processes
from postproc.processes import each
from tests.kit.interrupted import stderr_of_interrupted


def process_of(_):
    return os.getpid()


def divide_by(item):
    return 1 / item


class Meeting(NamedTuple):
    """Work that this process does only after another one has begun."""

    begun: Path
    parent: int

    def __call__(self, item):
        if os.getpid() != self.parent:
            self.begun.touch()
        until_s = time.monotonic() + 60.0
        while not self.begun.exists() and time.monotonic() < until_s:
            time.sleep(0.01)
        return item, os.getpid()


def fails_elsewhere(parent):
    if os.getpid() != parent:
        os._exit(1)
    return parent


@pytest.fixture
def no_pool(monkeypatch):
    class Refused(ProcessPoolExecutor):
        def __init__(self, *_):
            raise OSError("no semaphores here")

    monkeypatch.setattr(processes, "ProcessPoolExecutor", Refused)


def test_results_come_in_order_from_this_process_and_another(tmp_path):
    met = Meeting(tmp_path / "another process", os.getpid())
    found = list(each(met, [3, 1, 2, 0], 2))
    assert [item for item, _ in found] == [3, 1, 2, 0]
    there = [process for _, process in found]
    assert there[-1] == os.getpid() != there[0]
    assert len(set(there)) == 2


def test_an_error_is_the_callers():
    with pytest.raises(ZeroDivisionError):
        list(each(divide_by, [1, 1, 1, 0], 2))


def test_a_caller_that_wants_no_more_leaves_no_process(tmp_path):
    results = each(Meeting(tmp_path / "another process", os.getpid()), range(9), 2)
    next(results)
    assert active_children()
    results.close()
    assert not active_children()


@pytest.mark.parametrize(("count", "most"), [(4, 1), (3, 8), (1, 2), (0, 2)])
def test_little_work_stays_here(count, most):
    assert set(each(process_of, range(count), most)) <= {os.getpid()}


def test_without_processes_the_work_is_done_here(no_pool):
    assert list(each(process_of, range(4), 2)) == [os.getpid()] * 4


def test_a_process_that_is_killed_leaves_its_work_here():
    assert list(each(fails_elsewhere, [os.getpid()] * 4, 2)) == [os.getpid()] * 4


class EndsFor(NamedTuple):
    """Work that ends any process but this one with some of the items."""

    items: tuple[int, ...]
    parent: int

    def __call__(self, item):
        if item in self.items and os.getpid() != self.parent:
            os._exit(9)
        return item


@pytest.mark.parametrize("ends", [(0,), (1,), (0, 2)])
def test_an_item_that_ends_its_process_is_lost_alone(ends):
    work = EndsFor(ends, os.getpid())
    results = list(each(work, range(8), 2, lambda item: f"lost {item}"))
    assert [str(result).removeprefix("lost ") for result in results] == list("01234567")
    lost = [result for result in results if isinstance(result, str)]
    assert 0 < len(lost) <= len(ends)
    assert set(lost) <= {f"lost {item}" for item in ends}


_STARTS_SLOWLY = """
import sys, time
from pathlib import Path
from postproc.processes import each
if __name__ == "__main__":
    list(each(time.sleep, [60.0] * 4, 2))
else:
    Path(sys.argv[1]).touch()
    time.sleep(1.0)
"""


def test_an_interrupt_while_a_process_starts_leaves_no_traceback_of_it(tmp_path):
    said, _ = stderr_of_interrupted(_STARTS_SLOWLY, tmp_path)
    assert said.count("Traceback") == 1, said  # that of this program, which leaves it to Python
